"""Pictures of one pixel, or few, whose radiance is known in closed form."""

import math
from functools import partial

import numpy as np
import pytest
import trimesh

from hybrid_rt.integrators import workers
from hybrid_rt.integrators.whitted import all_lights, whitted
from hybrid_rt.integrators.whitted.all_lights import MOST_LIGHTS, AllLights
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Metal, Mirror, Phong
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.rendering import renderer as rendering
from hybrid_rt.rendering.report_warnings import warnings_in_words
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture

render = partial(rendering.render, integrator="whitted")

# Pictures are float32: a few roundings of that.
FLOAT32 = 1e-6
# Branches below 1e-3 are not followed: what they would have added in these scenes.
CUT = 2e-3


def pixel(look_from, look_at, up=(0, 1, 0)):
    """A camera with one pixel so small that it is a single ray."""
    return Camera(look_from, look_at, up, vertical_fov=1e-6, width=1, height=1)


def radiance(scene, **settings):
    return render(scene, **{"passes": 1, **settings}).image[0, 0]


def floor(material, height=0.0, size=20.0):
    surface = Rectangle((-size, -size, height), (2 * size, 0, 0), (0, 2 * size, 0))
    return Object(surface, material, "floor")


def test_matt_floor_under_a_point_light():
    scene = Scene(
        pixel((1, 0, 2), (1, 0, 0)),
        [floor(Lambertian((0.2, 0.4, 0.8)))],
        [PointLight((0, 0, 3), (10, 20, 30))],
    )
    irradiance = np.array([10, 20, 30]) * (3 / math.sqrt(10)) / 10
    expected = np.array([0.2, 0.4, 0.8]) / math.pi * irradiance
    np.testing.assert_allclose(radiance(scene), expected, rtol=FLOAT32)


def test_of_many_lights_some_are_sampled_in_proportion_to_their_power():
    """100 point lights at one place: each sample is worth the same, so 32 of them give the exact sum."""
    power = np.linspace(1.0, 3.0, 100)
    lamps = [PointLight((0, 0, 3), p) for p in power]
    scene = Scene(pixel((1, 0, 2), (1, 0, 0)), [floor(Lambertian(0.5))], lamps)
    result = render(scene, passes=1)
    expected = 0.5 / math.pi * power.sum() * (3 / math.sqrt(10)) / 10
    # A hundredth of the samples goes to lamps by turns.
    np.testing.assert_allclose(result.image[0, 0], expected, rtol=0.02)
    assert result.report["rays"]["shadow"] == MOST_LIGHTS


def test_many_lights_at_many_places_are_sampled_without_bias():
    rng = np.random.default_rng(5)
    places = np.column_stack([rng.uniform(-3, 3, (80, 2)), rng.uniform(0.5, 3, 80)])
    lamps = [PointLight(place, 1.0) for place in places]
    scene = Scene(pixel((1, 0, 0.1), (1, 0, 0)), [floor(Lambertian(0.5))], lamps)
    to_lamp = places - (1, 0, 0)
    square = (to_lamp**2).sum(axis=1)
    expected = 0.5 / math.pi * (to_lamp[:, 2] / square**1.5).sum()
    result = render(scene, passes=400)
    # Samples in order of the lamps' numbers leave a few per cent of one pass's noise.
    error = 4.0 * result.report["noise"]["standard_error_of_image_mean"]
    assert 0.0 < error < 0.02 * expected
    np.testing.assert_allclose(result.image[0, 0], expected, atol=error)


def test_shadow_rays_of_many_lights_are_bounded_by_the_block(monkeypatch):
    """Traced a few lights at a time, the picture has the same bits."""
    lamps = [PointLight((0.1 * k, 0, 3), 1.0) for k in range(7)]
    camera = Camera((1, 0, 2), (1, 0, 0), (0, 1, 0), 40, 8, 8)
    scene = Scene(camera, [floor(Lambertian(0.5))], lamps)
    whole = render(scene, passes=2).image
    most = []
    monkeypatch.setattr(all_lights, "BLOCK", 150)
    before = all_lights.shadow_rays
    monkeypatch.setattr(all_lights, "shadow_rays", lambda n: (most.append(n), before(n))[1])
    np.testing.assert_array_equal(render(scene, passes=2, threads=1).image, whole)
    assert max(most) <= 150


def test_phong_highlight_in_the_mirror_direction():
    scene = Scene(
        pixel((-2, 0, 2), (0, 0, 0)), [floor(Phong(0.3, 0.5, 40.0))], [PointLight((2, 0, 2), 8)]
    )
    f = 0.3 / math.pi + 0.5 * 42 / (2 * math.pi)
    np.testing.assert_allclose(radiance(scene), f * math.sqrt(0.5) * 8 / 8, rtol=FLOAT32)


def test_matt_floor_under_an_open_sky():
    sky = GradientSky((9, 9, 9), (1, 2, 3), up=(0, 0, 1))
    scene = Scene(pixel((0, 0, 2), (0, 0, 0)), [floor(Lambertian(0.5))], environment=sky)
    # Cosine-weighted mean height of the upper hemisphere is 2/3: sky = bottom / 6 + top 5 / 6.
    expected = 0.5 * (np.array([9, 9, 9]) / 6 + np.array([1, 2, 3]) * 5 / 6)
    np.testing.assert_allclose(radiance(scene, passes=256), expected, rtol=1e-3)


def test_area_light_is_seen_on_its_shining_side_only():
    light = RectangleLight((-1, -1, 0), (2, 0, 0), (0, 2, 0), (1, 2, 3))
    above, below = pixel((0, 0, 5), (0, 0, 0)), pixel((0, 0, -5), (0, 0, 0))
    assert radiance(Scene(above, [], [light])).tolist() == [1, 2, 3]
    assert not radiance(Scene(below, [], [light])).any()


def test_planes_that_shine_are_seen_and_not_asked(monkeypatch):
    """They have no end, so no point to choose."""

    def asked(*_):
        raise AssertionError("a plane was asked for a point")

    monkeypatch.setattr(AllLights, "_sample_lights", asked)
    plane = Object(Plane((2.0, 1.0, 0.5), (-1.0, 0.0, 1.0)), Emissive(1.0, Phong(0.1, 0.5, 500.0)))
    camera = Camera((0.5, 0.5, 1.0), (0.1, 0.1, 0.1), (1.0, 1.0, 0.0), 20, 6, 6)
    np.testing.assert_array_equal(render(Scene(camera, [plane]), passes=4).image, 1.0)


def test_area_light_blocks_other_lights():
    blocker = RectangleLight((-1, -1, 1), (2, 0, 0), (0, 2, 0), 1)  # shines upward
    scene = Scene(
        pixel((3, 0, 0.5), (0, 0, 0)), [floor(Lambertian(1))], [blocker, PointLight((0, 0, 3), 9)]
    )
    assert not radiance(scene).any()


def test_glass_casts_a_full_shadow():
    glass = Object(Sphere((0, 0, 2), 0.5), Dielectric(1.5))
    scene = Scene(
        pixel((3, 0, 0.5), (0, 0, 0)),
        [floor(Lambertian(1)), glass],
        [PointLight((0, 0, 5), 9)],
    )
    assert not radiance(scene).any()


def sky_at(direction, up=(0, 0, 1)):
    """Sky from (0, 0, 0) below to (1, 1, 1) above."""
    return 0.5 + 0.5 * np.dot(direction, up) / np.linalg.norm(direction)


def test_mirror_shows_what_lies_in_the_mirrored_direction():
    sky = GradientSky(0, 1, up=(0, 0, 1))
    scene = Scene(pixel((-2, 0, 1), (0, 0, 0)), [floor(Mirror((0.9, 0.5, 0.1)))], environment=sky)
    expected = np.array([0.9, 0.5, 0.1]) * sky_at((2, 0, 1))
    np.testing.assert_allclose(radiance(scene), expected, rtol=FLOAT32)


@pytest.mark.parametrize("ior", [1.0, 1.33, 1.5, 2.4])
@pytest.mark.parametrize("offset", [0.0, 0.3, 0.8, 0.99])
def test_glass_sphere_sends_light_along_the_closed_form_ways(ior, offset):
    """A ray at distance b from the axis leaves after k inner reflections turned by known angles."""
    sky = GradientSky(0, 1, up=(0, 0, 1))
    scene = Scene(
        pixel((-5, 0, offset), (0, 0, offset)),
        [Object(Sphere((0, 0, 0), 1.0), Dielectric(ior), "glass")],
        environment=sky,
    )
    outer, inner = math.asin(offset), math.asin(offset / ior)
    cos_i, cos_t = math.cos(outer), math.cos(inner)
    across = (cos_i - ior * cos_t) / (cos_i + ior * cos_t)
    along = (ior * cos_i - cos_t) / (ior * cos_i + cos_t)
    reflectance = (across**2 + along**2) / 2

    def turned(angle):  # the ray runs along +x and is bent toward the axis, that is downward
        return sky_at((math.cos(angle), 0, -math.sin(angle)))

    expected = reflectance * turned(-(math.pi - 2 * outer))
    for k in range(60):
        angle = 2 * (outer - inner) + k * (math.pi - 2 * inner)
        expected += (1 - reflectance) ** 2 * reflectance**k * turned(angle)
    np.testing.assert_allclose(radiance(scene, max_depth=64), expected, atol=CUT)


def slab(material, thickness=2.0):
    """Two faces of a plate, normals outward."""
    top = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    bottom = Rectangle((-9, -9, -thickness), (0, 18, 0), (18, 0, 0))
    return [Object(top, material, "top"), Object(bottom, material, "bottom")]


LAMP = RectangleLight((-9, -9, -5), (18, 0, 0), (0, 18, 0), 1.0)  # shines upward


def test_absorbing_slab_of_index_one_follows_beer_and_lambert_exactly():
    scene = Scene(pixel((0, 0, 3), (0, 0, -1)), slab(Dielectric(1.0, (0.1, 0.5, 1.5))), [LAMP])
    np.testing.assert_allclose(radiance(scene), np.exp([-0.2, -1.0, -3.0]), rtol=FLOAT32)


def test_absorbing_slab_of_glass_with_all_its_reflections():
    density = np.array([0.0, 0.1, 0.5])
    scene = Scene(pixel((0, 0, 3), (0, 0, -1)), slab(Dielectric(1.5, density)), [LAMP])
    r, a = 0.04, np.exp(-2 * density)
    np.testing.assert_allclose(radiance(scene), (1 - r) ** 2 * a / (1 - (r * a) ** 2), atol=CUT)


def test_tint_counts_once_a_surface():
    scene = Scene(pixel((0, 0, 3), (0, 0, -1)), slab(Dielectric(1.0, tint=(1, 0.5, 0.1))), [LAMP])
    np.testing.assert_allclose(radiance(scene), [1, 0.25, 0.01], rtol=FLOAT32)


def test_camera_within_glass_sees_through_what_absorbs():
    scene = Scene(pixel((0, 0, -0.5), (0, 0, -3)), slab(Dielectric(1.0, (0.1, 0.5, 1.5))), [LAMP])
    np.testing.assert_allclose(radiance(scene), np.exp([-0.15, -0.75, -2.25]), rtol=FLOAT32)


@pytest.mark.parametrize("ior", [1e-3, 1000.0])
def test_extreme_indices_stay_finite_and_within_the_light_there_is(ior):
    scene = Scene(
        Camera((0, -4, 0), (0, 0, 0), (0, 0, 1), width=16, height=12),
        [Object(Sphere((0, 0, 0), 1.0), Dielectric(ior))],
        environment=GradientSky(1, 1),
    )
    image = render(scene, passes=1, max_depth=200).image
    # Under a constant sky a lossless body vanishes; near grazing incidence light that entered
    # a body of index 1000 hardly ever leaves it, and some is left inside at max_depth.
    assert image.max() <= 1 + 1e-6
    assert image.min() > 0.9
    assert image.mean() == pytest.approx(1.0, abs=3e-3)


def test_total_reflection_sends_everything_back():
    """From within glass at 60 degrees: the plane acts as a perfect mirror."""
    surface = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    scene = Scene(
        pixel((-math.sqrt(3), 0, -1), (0, 0, 0)),
        [Object(surface, Dielectric(1.5))],
        environment=GradientSky(0, 1, up=(0, 0, 1)),
    )
    np.testing.assert_allclose(radiance(scene), sky_at((math.sqrt(3), 0, -1)), rtol=FLOAT32)


def test_two_facing_mirrors_end_at_max_depth_and_say_so():
    upper = Object(Rectangle((-9, -9, 1), (0, 18, 0), (18, 0, 0)), Mirror())
    scene = Scene(pixel((0, 0, 0.5), (0, 0, 0)), [floor(Mirror()), upper])
    result = render(scene, passes=1, max_depth=10)
    assert not result.image.any()
    assert result.report["rays"]["reflected"] == 10
    assert result.report["ended_branches"]["at max_depth"] == 1
    assert result.report["ended_branches"]["lost_weight_per_camera_ray"] == 1.0


def test_faint_branches_end_and_are_counted():
    upper = Object(Rectangle((-9, -9, 1), (0, 18, 0), (18, 0, 0)), Mirror(0.1))
    scene = Scene(pixel((0, 0, 0.5), (0, 0, 0)), [floor(Mirror(0.1)), upper])
    ended = render(scene, passes=1).report["ended_branches"]
    assert ended["below least contribution"] == 1
    assert ended["lost_weight_per_camera_ray"] <= whitted.LEAST_CONTRIBUTION


def test_what_faint_branches_lose_is_not_laid_to_max_depth():
    """Three panes seen at 75 degrees, under an even sky: 12 % is lost at any depth."""
    panes = [Object(Box((-99, -99, z), (99, 99, z + 0.3)), Dielectric(1.5)) for z in (0, 1, 2)]
    a = math.radians(75)
    eye = (-9 * math.sin(a), 0, 1 + 9 * math.cos(a))
    camera = Camera(eye, (0, 0, 1), (0, 0, 1), 5, 8, 6)
    result = render(Scene(camera, panes, environment=GradientSky(1, 1)), passes=1, max_depth=64)
    assert result.image.mean() == pytest.approx(0.88, abs=0.02)
    assert result.report["picture_holds"].endswith("but for faint branches")
    said = warnings_in_words(result.report)
    assert any("faint branches" in line and "take path" in line for line in said)
    assert not any("max_depth" in line for line in said)


def busy_scene(width=40, height=30, **camera):
    """A little of everything."""
    return Scene(
        Camera((0, -6, 3), (0, 0, 0.7), (0, 0, 1), width=width, height=height, **camera),
        [
            floor(Lambertian(CheckerTexture(0.8, 0.2, 40, "uv"))),
            Object(Sphere((-1.2, 0, 1), 1.0), Mirror(0.9), "mirror"),
            Object(Sphere((1.2, 0, 1), 1.0), Dielectric(1.5, (0.3, 0.1, 0.6)), "glass"),
            Object(Sphere((0, -1.6, 0.4), 0.4), Phong((0.6, 0.2, 0.1), 0.3, 60), "ball"),
        ],
        [RectangleLight((-1, -2, 5), (0, 2, 0), (2, 0, 0), 12.0), PointLight((4, -4, 4), 10)],
        GradientSky(0.1, (0.2, 0.3, 0.5), up=(0, 0, 1)),
    )


@pytest.fixture(scope="module")
def picture():
    return render(busy_scene(), passes=3, seed=4).image


@pytest.mark.parametrize("block", [37, 100, 1000])
def test_size_of_blocks_changes_no_bit(picture, block, monkeypatch):
    monkeypatch.setattr(workers, "BLOCK", block)
    monkeypatch.setattr(whitted, "BLOCK", block)
    np.testing.assert_array_equal(render(busy_scene(), passes=3, seed=4).image, picture)


def test_lens_blurs_and_the_closed_lens_is_the_pinhole(picture):
    assert (render(busy_scene(aperture=0.5), passes=3, seed=4).image != picture).any()
    same = render(busy_scene(aperture=0.0, focus_distance=1.0), passes=3, seed=4).image
    np.testing.assert_array_equal(same, picture)


def test_what_is_hidden_in_glass_of_higher_priority_reflects_nothing():
    """Not at grazing angles either, where Schlick's formula does."""
    body = Object(Sphere((0, 0, 0), 1), Dielectric(1.5, 0.2, priority=1), "body")
    inner = Object(
        Box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)), Dielectric(1.33, schlick=True), "inner"
    )
    camera = Camera((0, 0.7, 4), (0, 0, 0), (0, 1, 0), 35, 24, 24)
    sky = GradientSky((0.2, 0.4, 1.0), (1.0, 0.5, 0.1))
    alone, both = (
        render(Scene(camera, [body, *more], [], sky), passes=1, max_depth=64).image
        for more in ([], [inner])
    )
    np.testing.assert_allclose(both, alone, rtol=20 * FLOAT32)


def test_glass_of_index_one_is_not_seen():
    camera = Camera((0, -4, 1), (0, 0, 0.5), (0, 0, 1), width=20, height=15)
    sky = GradientSky(0.2, 1, up=(0, 0, 1))
    lamp = RectangleLight((-1, 1, 0), (2, 0, 0), (0, 0, 2), 3.0)  # shines toward the camera
    glass = Object(Sphere((0, 0, 0.5), 0.8), Dielectric(1.0))
    with_glass = render(Scene(camera, [glass], [lamp], sky), passes=2).image
    without = render(Scene(camera, [], [lamp], sky), passes=2).image
    np.testing.assert_allclose(with_glass, without, rtol=FLOAT32)


@pytest.mark.statistical
@pytest.mark.parametrize("material", [Dielectric(1.5), Mirror(0.9), Metal(0.9, 0.2)], ids=repr)
def test_shading_normals_send_nothing_through_a_face_that_stays_outside(material):
    """A coarse ball with smooth normals, whose outlines mirror rays into it: as paths see it.

    Under a sky without other objects both find all light; each interval holds the mean.
    """
    ball = TriangleMesh(trimesh.creation.icosphere(1, 1.0))
    scene = Scene(
        Camera((0, -4, 1.2), (0, 0, 0), (0, 0, 1), vertical_fov=35, width=48, height=36),
        [Object(ball, material, "ball", smooth=True)],
        environment=GradientSky((0.1, 0.2, 0.3), (1.0, 0.8, 0.2), up=(0, 0, 1)),
    )
    branches, paths = (
        rendering.render(scene, name, n, threads=1).report
        for name, n in (("whitted", 32), ("path", 64))
    )
    assert branches["clear_bodies_not_closed"] == {}
    gap = branches["noise"]["image_mean"] - paths["noise"]["image_mean"]
    noise = [report["noise"]["half_interval_95_of_image_mean"] for report in (branches, paths)]
    assert abs(gap) < sum(noise) < 0.0012
