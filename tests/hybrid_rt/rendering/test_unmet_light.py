"""The interval of a picture's mean allows for lamps that no camera ray has met."""

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    GradientSky,
    ImageEnvironment,
    Lambertian,
    Mirror,
    Object,
    PointLight,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    render,
)
from hybrid_rt.rendering.unmet_light import unmet_light
from hybrid_rt.scene.compiled import compile_scene

SIDE, RADIANCE = 8, 50.0
CAMERA = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 40.0, SIDE, SIDE)
MIRROR = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Mirror(1.0), "mirror")
FLOOR = Object(MIRROR.surface, Lambertian(0.5), "floor")
# Shines down; in the mirror it lies at a depth of 3 below the camera, within one pixel.
SPECK = RectangleLight((0.1, 0.1, 2), (0, 0.02, 0), (0.02, 0, 0), RADIANCE)


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", ["whitted", "path", "ppm"])
def test_interval_holds_though_most_pictures_have_not_met_the_lamp(integrator):
    """The truth is the part of the film that the lamp's image covers."""
    covered = (0.02 / (2.0 * 3.0 * np.tan(np.radians(20.0)))) ** 2
    met = 0
    for seed in range(20):
        scene = Scene(CAMERA, [MIRROR], [SPECK])
        report = render(scene, integrator, 16, seed=seed, threads=1).report
        noise = report["noise"]
        met += noise["image_mean"] > 0.0
        assert (
            abs(noise["image_mean"] - RADIANCE * covered)
            <= (noise["half_interval_95_of_image_mean"])
        )
    # One ray in 12 000 meets it, and a picture has 1024.
    assert met < 10


def test_it_is_three_rays_of_the_brightest_lamp():
    brighter = RectangleLight((1, 1, 3), (0, 1, 0), (1, 0, 0), (10.0, 60.0, 110.0))
    scene = compile_scene(Scene(CAMERA, [MIRROR], [SPECK, brighter, PointLight((0, 0, 3), 1e6)]))
    assert unmet_light(scene, 16) == pytest.approx(3.0 * 60.0 / (16 * SIDE * SIDE), rel=1e-15)


def test_the_brightest_place_of_the_sky_counts_as_a_lamp():
    texels = np.full((8, 16, 3), 0.5)
    texels[2, 3] = (10.0, 60.0, 110.0)
    sky = ImageEnvironment(texels)
    in_mirror = compile_scene(Scene(CAMERA, [MIRROR], [SPECK], sky))
    assert unmet_light(in_mirror, 16) == pytest.approx(3.0 * 60.0 / (16 * SIDE * SIDE), rel=1e-6)
    assert unmet_light(compile_scene(Scene(CAMERA, [FLOOR], [], sky)), 16) == 0.0
    even = compile_scene(Scene(CAMERA, [MIRROR], [], GradientSky(0.2, 0.7)))
    assert unmet_light(even, 16) == pytest.approx(3.0 * 0.7 / (16 * SIDE * SIDE), rel=1e-12)


@pytest.mark.statistical
def test_interval_holds_though_a_sun_is_met_by_chance_alone():
    """A floor behind two panes, which no way is computed through; what panes reflect is left out.

    The truth is an integral over the texel and its neighbours of the sky, bilinear between the middles
    of texels, times what two panes let through, at least.
    """
    height, row, column = 128, 20, 51
    texels = np.zeros((height, 2 * height, 3))
    texels[row, column] = 2e5
    panes = [
        Object(Box((-20, -20, 1 + 0.1 * k), (20, 20, 1.02 + 0.1 * k)), Dielectric(1.5))
        for k in range(2)
    ]
    floor = Object(Rectangle((-20, -20, 0), (40, 0, 0), (0, 40, 0)), Lambertian(0.5))
    camera = Camera((0, 0, 0.9), (0, 0, 0), (0, 1, 0), 40.0, 12, 12)
    scene = Scene(camera, [floor, *panes], [], ImageEnvironment(texels, up=(0, 0, 1)))
    step = np.pi / height
    offset = (np.arange(200) + 0.5) / 100.0 - 1.0  # in texels
    polar = (row + 0.5 + offset) * step
    hat = 1.0 - np.abs(offset)
    # Fresnel's reflectance of a surface, then a pane, then two of them.
    inside = np.arcsin(np.sin(polar) / 1.5)
    s = (np.sin(polar - inside) / np.sin(polar + inside)) ** 2
    p = (np.tan(polar - inside) / np.tan(polar + inside)) ** 2
    through = sum(0.5 * (1 - r) / (1 + 3 * r) for r in (s, p))
    per_polar = hat * np.cos(polar) * np.sin(polar) * through
    least = 0.5 / np.pi * 2e5 * (per_polar.sum() * step / 100.0) * step
    half_known = 0
    for seed in range(12):
        noise = render(scene, "path", 16, seed=seed, threads=1).report["noise"]
        half = noise["half_interval_95_of_image_mean"]
        assert noise["image_mean"] + half >= least
        half_known += noise["image_mean"] < 0.5 * least
    # Else the test would say nothing.
    assert half_known >= 3


def test_mirrors_out_of_sight_count_only_where_camera_paths_go_on():
    """A detector is seen from in front; what throws light onto it stands behind the camera."""
    behind = Object(Sphere((0, 0, 3), 0.5), Mirror(0.9))
    beside = Object(Sphere((1.2, 0, 0), 0.5), Dielectric(1.5))  # the view is 0.36 wide there
    in_sight = Object(Sphere((0.5, 0, 0.1), 0.2), Mirror(0.9))
    for other, is_seen in ((behind, False), (beside, False), (in_sight, True)):
        scene = compile_scene(Scene(CAMERA, [FLOOR, other], [SPECK]))
        assert unmet_light(scene, 16) > 0.0
        assert (unmet_light(scene, 16, ends_at_matt=True) > 0.0) is is_seen
    half = {}
    for integrator in ("ppm", "path"):
        noise = render(
            Scene(CAMERA, [FLOOR, behind], [SPECK]), integrator, 16, seed=1, threads=1
        ).report["noise"]
        half[integrator] = noise["half_interval_95_of_image_mean"]
        assert (noise["unmet_lamps_95"] > 0.0) is (integrator == "path")
    assert half["ppm"] < 0.1 * half["path"]


def test_nothing_is_added_where_no_ray_meets_a_lamp_by_chance():
    """Without mirrors a lamp is found by next-event estimation, unless it is a speck in sight."""
    behind = RectangleLight((0.1, 0.1, 2), (0, 0.02, 0), (0.02, 0, 0), RADIANCE)
    assert unmet_light(compile_scene(Scene(CAMERA, [FLOOR], [behind])), 16) == 0.0
    ball = Object(Sphere((0, 0, -0.5), 0.2), Lambertian(0.5))
    in_sight = RectangleLight((0.1, 0.1, 0), (0.01, 0, 0), (0, 0.01, 0), RADIANCE)
    large = RectangleLight((-0.3, -0.3, -1), (0.6, 0, 0), (0, 0.6, 0), RADIANCE)
    assert unmet_light(compile_scene(Scene(CAMERA, [ball], [in_sight])), 16) > 0.0
    assert unmet_light(compile_scene(Scene(CAMERA, [ball], [large])), 16) == 0.0


def square_lamp(middle, edge_u, edge_v):
    corner = np.array(middle) - 0.5 * np.array(edge_u) - 0.5 * np.array(edge_v)
    return RectangleLight(corner, edge_u, edge_v, RADIANCE)


@pytest.mark.parametrize(
    ("lamp", "is_speck"),
    [
        # The view is 0.73 wide at a distance of 1; each of 8 x 8 pixels has 16 rays.
        (square_lamp((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), False),
        (square_lamp((0, 0, 0), (0.5, 0, 0), (0, 1e-5, 0)), True),  # a thread
        (square_lamp((0, 0, 0), (0.5, 0, 1e-3), (0, 0.5, 0)), False),
        (square_lamp((0.1, 0, 0), (1e-5, 0, 0.4), (0, 0.4, 0)), False),  # its back is black
        (square_lamp((-0.2, 0, 0.1), (1e-5, 0, -0.2), (0, 0.4, 0)), False),  # seen askew
        (square_lamp((-1e-5, 0, 0), (1e-7, 0, -0.2), (0, 0.4, 0)), True),  # seen along its face
        (square_lamp((0.6, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), True),  # a thin edge reaches in
        (square_lamp((0.5, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), False),  # half of it does
        (square_lamp((5.0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)), False),  # out of the picture
    ],
)
def test_specks_are_what_few_rays_meet(lamp, is_speck):
    ball = Object(Sphere((0, 0, -3), 0.2), Lambertian(0.5))
    lens = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 40.0, SIDE, SIDE, aperture=0.01)
    for camera in (CAMERA, lens):
        unmet = unmet_light(compile_scene(Scene(camera, [ball], [lamp])), 16)
        assert (unmet > 0.0) is is_speck


@pytest.mark.parametrize("albedo", [0.001, 0.5, (0.1, 0.2, 0.05)])
def test_behind_a_matt_detector_a_lamp_adds_its_albedo_at_most(albedo):
    """All that the camera sees: what is met behind it, by way of a mirror, carries no more."""
    detector = Object(FLOOR.surface, Lambertian(albedo))
    behind = Object(Sphere((0, 0, 3), 0.5), Mirror(0.9))
    lamp = RectangleLight((1, 1, 3), (0, 1, 0), (1, 0, 0), (10.0, 60.0, 110.0))
    scene = compile_scene(Scene(CAMERA, [detector, behind], [lamp]))
    expected = 3.0 * 60.0 * np.max(albedo) / (16 * SIDE * SIDE)
    assert unmet_light(scene, 16) == pytest.approx(expected, rel=1e-15)
    # A mirror in sight, or a lamp that is a speck there, adds all of it.
    in_sight = Object(Sphere((0.5, 0, 0.1), 0.2), Mirror(0.9))
    scene = compile_scene(Scene(CAMERA, [detector, in_sight], [lamp]))
    assert unmet_light(scene, 16) == pytest.approx(3.0 * 60.0 / (16 * SIDE * SIDE), rel=1e-15)
    speck = RectangleLight((0.1, 0.1, 0), (0.01, 0, 0), (0, 0.01, 0), 60.0)
    scene = compile_scene(Scene(CAMERA, [detector, behind], [speck]))
    assert unmet_light(scene, 16) == pytest.approx(3.0 * 60.0 / (16 * SIDE * SIDE), rel=1e-15)
