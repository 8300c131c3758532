"""The interval of a picture's mean allows for lamps that no camera ray has met."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
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
from hybrid_rt.rendering.unmet_lamps import unmet_light
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


def test_nothing_is_added_where_no_ray_meets_a_lamp_by_chance():
    """Without mirrors a lamp is found by next-event estimation, unless it is a speck in sight."""
    behind = RectangleLight((0.1, 0.1, 2), (0, 0.02, 0), (0.02, 0, 0), RADIANCE)
    assert unmet_light(compile_scene(Scene(CAMERA, [FLOOR], [behind])), 16) == 0.0
    ball = Object(Sphere((0, 0, -0.5), 0.2), Lambertian(0.5))
    in_sight = RectangleLight((0.1, 0.1, 0), (0.01, 0, 0), (0, 0.01, 0), RADIANCE)
    large = RectangleLight((-0.3, -0.3, -1), (0.6, 0, 0), (0, 0.6, 0), RADIANCE)
    assert unmet_light(compile_scene(Scene(CAMERA, [ball], [in_sight])), 16) > 0.0
    assert unmet_light(compile_scene(Scene(CAMERA, [ball], [large])), 16) == 0.0
