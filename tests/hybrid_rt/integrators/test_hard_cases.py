"""Light transport where formulas divide by nothing or never end, by the ids of the catalogue."""

import math

import numpy as np
import pytest

from hybrid_rt.integrators import PathOptions
from hybrid_rt.integrators.path import light_paths
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight, SphereLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture, ImageTexture
from meshing import BezierPatches

WHITE_SKY = GradientSky(1.0, 1.0)
FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
CAMERA = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
DOWN = Camera((0, 0, 1), (0, 0, -9), (0, 1, 0), 1e-6, 16, 16)

both = pytest.mark.parametrize("integrator", ["path", "whitted"])


@pytest.mark.parametrize("ior", [1.5, 0.7])
def test_d06_camera_on_the_face_of_a_slab(ior):
    """Looking into the slab from its face is standing in it: radiance one, times n^2."""
    slab = Object(Box((-50, -50, 0), (50, 50, 1)), Dielectric(ior), "slab")
    image = render(
        Scene(DOWN, [slab], environment=WHITE_SKY), passes=4, max_depth=100,
        options=PathOptions(survival=1.0),
    ).image  # fmt: skip
    np.testing.assert_allclose(image, ior**2, rtol=1e-5)


@both
def test_d08_pictures_of_one_pixel_and_of_one_row(integrator):
    shining, sky = Object(FLOOR.surface, Emissive(0.5)), GradientSky(0.5, 0.5)
    for width, height in ((1, 1), (40, 1), (1, 7)):
        scene = Scene(CAMERA.resized(width, height), [shining], environment=sky)
        image = render(scene, integrator, passes=2).image
        np.testing.assert_array_equal(image, np.full((height, width, 3), 0.5, np.float32))


@both
def test_d12_light_at_the_critical_angle(integrator):
    """From glass into air: beyond the angle all light returns, and nothing is not a number."""
    sine = 1 / 1.5
    slab = Object(Box((-50, -50, -1), (50, 50, 1)), Dielectric(1.5), "slab")
    for offset in (-1e-9, 0.0, 1e-15, 1e-9):
        angle = math.asin(sine) + offset
        camera = Camera((0, 0, 0), (math.sin(angle), 0, math.cos(angle)), (0, 1, 0), 1e-9, 2, 2)
        image = render(Scene(camera, [slab], environment=WHITE_SKY), integrator, passes=1).image
        assert np.isfinite(image).all()
        assert (image <= 1.5**2 * (1 + 1e-6)).all()


@pytest.mark.parametrize(("max_depth", "color"), [(5, 0.9), (12, 0.7)])
@both
def test_d18_two_parallel_mirrors(integrator, max_depth, color):
    """Nothing ends such a path but its length, and the report says what it still carried."""
    mirrors = [
        Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Mirror(color), "below"),
        Object(Rectangle((-9, -9, 2), (18, 0, 0), (0, 18, 0)), Mirror(color), "above"),
    ]
    result = render(
        Scene(DOWN, mirrors, [PointLight((5, 5, 1), 1.0)]), integrator, passes=1,
        max_depth=max_depth, options=PathOptions(roulette_depth=99) if integrator == "path" else None,
    )  # fmt: skip
    assert not result.image.any()
    ended = result.report["ended_branches"]
    assert ended["at max_depth"] == 16 * 16
    # As many factors as directions asked for: the last is not taken any more.
    expected = color ** (max_depth + 1)
    assert ended["lost_weight_per_camera_ray"] == pytest.approx(expected, rel=1e-12)


@both
@pytest.mark.parametrize(
    "lights",
    [
        [RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 0.0)],
        [SphereLight((0, 0, 3), 0.5, 0.0), PointLight((0, 0, 5), 0.0)],
        [],
    ],
    ids=["rectangle", "sphere and point", "none"],
)
def test_d19_lights_without_power_are_black(integrator, lights):
    glass = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))
    assert not render(Scene(CAMERA, [FLOOR, glass], lights), integrator, passes=2).image.any()


def test_d19_a_dark_lamp_beside_a_bright_one_changes_nothing():
    lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 2.0)
    dark = SphereLight((8, 8, 3), 0.5, 0.0)
    pictures = [
        render(Scene(CAMERA, [FLOOR], lights), passes=2, max_depth=0).image
        for lights in ([lamp], [lamp, dark])
    ]
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize("ior", [1.0, 1.5])
def test_d20_lamp_enclosed_by_glass(ior):
    """Around both one centre: the floor gets what the shell does not send back into the lamp.

    What leaves the lamp at sine s from its normal meets the shell at sine s r / R; reflected, it
    passes the centre at the same distance and so ends in the lamp. Any source of that symmetry
    sends flux / (4 pi d^2) to a point.
    """
    radius, lamp = 0.4, SphereLight((0, 0, 2), 0.4, 5.0)
    shell = Object(Sphere((0, 0, 2), 1.0), Dielectric(ior), "shell")
    camera = Camera((0, -4, 1.5), (0, -2, 0), (0, 0, 1), 30, 12, 12)
    # Two directions: at the floor, and through the shell.
    settings = {"passes": 60, "max_depth": 2, "options": PathOptions(light_paths=64.0)}
    bare, found = (
        render(Scene(camera, objects, [lamp]), **settings).report["noise"]
        for objects in ([FLOOR], [FLOOR, shell])
    )
    sine = (np.arange(10_000) + 0.5) / 10_000
    cos_in = np.sqrt(1 - (radius * sine) ** 2)
    cos_out = np.sqrt(1 - (ior * radius * sine) ** 2)
    across = (ior * cos_in - cos_out) / (ior * cos_in + cos_out)
    along = (cos_in - ior * cos_out) / (cos_in + ior * cos_out)
    returned = (0.5 * (across**2 + along**2) * 2 * sine).mean()
    name = "standard_error_of_image_mean"
    # 4.5 standard errors: one false alarm in 1e5 seeds.
    limit = 4.5 * math.hypot(found[name], bare[name])
    assert abs(found["image_mean"] - (1 - returned) * bare["image_mean"]) < limit
    assert limit < 0.04 * bare["image_mean"]


@pytest.mark.parametrize("value", [1.0, -1e-300, -3.25, 1e9, -1e9])
def test_d28_coordinates_far_outside_the_picture(value):
    """Whole periods change nothing: plane coordinates are fractions of the world's."""
    picture = ImageTexture(np.random.default_rng(1).random((4, 4, 3)))
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Emissive(picture))
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 20, 8, 8)
    image = render(Scene(camera, [floor]), passes=1).image
    assert np.isfinite(image).all()
    checker = CheckerTexture(1.0, 0.25, (value if value > 0 else 2.0, 2.0), "uv")
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Emissive(checker))
    image = render(Scene(camera, [floor]), passes=1).image
    assert set(np.unique(image)) <= {0.25, 1.0}


@both
@pytest.mark.parametrize("factor", [2.0**99, 2.0**-99])
def test_d33_very_bright_and_very_dark(integrator, factor):
    """Light is linear, and powers of two are exact: the same picture, scaled."""

    def picture(strength):
        objects = [FLOOR, Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))]
        lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), strength)
        scene = Scene(CAMERA, objects, [lamp], GradientSky(strength, 0.5 * strength))
        result = render(scene, integrator, passes=3)
        assert math.isfinite(result.report["noise"]["image_mean"])
        return result.image

    np.testing.assert_allclose(picture(factor), picture(1.0) * np.float32(factor), rtol=1e-6)


@both
def test_d34_scene_with_nothing(integrator):
    assert not render(Scene(CAMERA), integrator, passes=1).image.any()
    sky = GradientSky(0.25, 0.25)
    np.testing.assert_array_equal(
        render(Scene(CAMERA, environment=sky), integrator, passes=1).image, np.float32(0.25)
    )


def test_a_body_of_bezier_patches_is_the_box_that_it_describes():
    """Six bilinear patches: the same surfaces, so the same paths but where rounding decides."""
    lo, hi = np.array([-0.7, -0.5, 0.2]), np.array([0.6, 0.7, 1.3])
    nets = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for level, swap in ((lo[axis], True), (hi[axis], False)):
            net = np.empty((2, 2, 3))
            net[..., axis] = level
            net[0, :, a], net[1, :, a] = lo[a], hi[a]
            net[:, 0, b], net[:, 1, b] = lo[b], hi[b]
            nets.append(net.transpose(1, 0, 2) if swap else net)
    lamp = SphereLight((1, -1, 4), 0.5, 10.0)
    pictures = [
        render(
            Scene(CAMERA.resized(32, 32), [Object(body, Dielectric(1.5, 0.2)), FLOOR], [lamp]),
            passes=8, seed=2,
        ).image
        for body in (BezierPatches(nets), Box(lo, hi))
    ]  # fmt: skip
    gap = np.abs(pictures[0] - pictures[1]).max(axis=2)
    assert np.mean(gap < 1e-4) > 0.99
    assert abs(pictures[0].mean() / pictures[1].mean() - 1) < 1e-2


def test_light_paths_of_many_passes_are_traced_a_few_at_a_time(monkeypatch):
    """A picture of few pixels has many passes at once: memory must not follow their number."""
    glass = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))
    scene = Scene(CAMERA, [FLOOR, glass], [SphereLight((0, 0, 3), 0.3, 5.0)])
    before = render(scene, passes=9, threads=1)
    most = []
    trace = light_paths.LightPathTracer._trace

    def recorded(self, passes, n):
        most.append(len(passes) * n)
        return trace(self, passes, n)

    monkeypatch.setattr(light_paths, "AT_ONCE", 200)
    monkeypatch.setattr(light_paths.LightPathTracer, "_trace", recorded)
    after = render(scene, passes=9, threads=1)
    assert max(most[1:]) <= 200  # the first are those that are counted beforehand
    np.testing.assert_array_equal(after.image, before.image)
    assert after.report["rays"] == before.report["rays"]
