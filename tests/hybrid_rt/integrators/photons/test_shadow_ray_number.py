"""How many shadow rays the hit points of ppm cast."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    Lambertian,
    Object,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)
from hybrid_rt.integrators.photons.shadow_ray_number import NUMBERS, Work

FLOOR = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5), "floor")
BLIND = Object(Rectangle((-0.5, -0.5, 0.5), (1, 0, 0), (0, 1, 0)), Lambertian(0.5), "blind")
WIDE_LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 10.0)


def scene(*lights):
    camera = Camera((0.0, -3.0, 2.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), width=24, height=24)
    return Scene(camera=camera, objects=[FLOOR, BLIND], lights=list(lights))


def number(scene, photons, **settings):
    result = render(scene, "ppm", 1, options=PPMOptions(photons), **settings)
    return result.report["photons"]["shadow_rays_per_point"]


@pytest.mark.parametrize(
    ("work", "best"),
    [
        (Work(of_shadow_rays=0.0, of_rest=1.0, shadow_rays=1.0, rest=10.0), 1),
        # (1 + 15 / n) (60 + 4 n): 1024, 578, 361, 264.5, 240; eight is just beyond a tenth more.
        (Work(of_shadow_rays=15.0, of_rest=1.0, shadow_rays=4.0, rest=60.0), 16),
        # (1 + 3 / n) (12 + n): 52, 35, 28, 27.5, 33; four is within a tenth.
        (Work(of_shadow_rays=3.0, of_rest=1.0, shadow_rays=1.0, rest=12.0), 4),
        # Of a pass without anything else, all rays are alike.
        (Work(of_shadow_rays=1.0, of_rest=0.0, shadow_rays=1.0, rest=0.0), 1),
    ],
)
def test_the_best_number_has_about_the_least_variance_times_cost(work, best):
    assert work.best_number == best


def test_a_wide_lamp_that_lights_little_floor_at_many_photons_is_asked_often():
    assert number(scene(WIDE_LAMP), 50_000) in NUMBERS[2:]


def test_a_point_light_has_no_noise_that_more_shadow_rays_would_lessen():
    """Direct light of a point light is exact; only another lamp's would be noisy."""
    assert number(scene(PointLight((0.0, 0.0, 3.0), 10.0)), 50_000) == 1


def test_few_photons_leave_little_to_spread_more_shadow_rays_over():
    assert number(scene(WIDE_LAMP), 10) < number(scene(WIDE_LAMP), 50_000)


def test_the_number_hangs_on_no_thread():
    found = [
        render(scene(WIDE_LAMP), "ppm", 2, options=PPMOptions(20_000), threads=threads, seed=5)
        for threads in (1, 3)
    ]
    numbers = {result.report["photons"]["shadow_rays_per_point"] for result in found}
    assert len(numbers) == 1
    assert np.array_equal(found[0].image, found[1].image)


def test_pilot_rays_are_counted_with_no_pass():
    """One camera ray a pixel and pass, and as many shadow rays as its points cast."""
    report = render(scene(WIDE_LAMP), "ppm", 2, options=PPMOptions(50_000)).report
    n = report["photons"]["shadow_rays_per_point"]
    assert report["rays"]["camera"] == 2 * 24 * 24
    assert n < report["rays"]["shadow"] <= 2 * 24 * 24 * n


@pytest.mark.statistical
def test_direct_light_stays_that_of_one_shadow_ray():
    """Eight seeds of the mean radiance: path tracing and ppm agree within 4 standard errors."""
    lit = scene(WIDE_LAMP)
    means = {
        name: [
            render(lit, name, 4, seed=k, options=options, max_depth=1).image.mean()
            for k in range(8)
        ]
        for name, options in (("ppm", PPMOptions(50_000)), ("path", None))
    }
    gap = np.mean(means["ppm"]) - np.mean(means["path"])
    error = np.hypot(*(np.std(values, ddof=1) / np.sqrt(8) for values in means.values()))
    assert abs(gap) < 4.0 * error
    assert number(lit, 50_000) > 1
