"""How many camera rays a pass of ppm sends through a pixel, how many shadow rays its points cast."""

from unittest import mock

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    Lambertian,
    Mirror,
    Object,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)
from hybrid_rt.integrators.photons.pilot import CAMERA_RAYS, SHADOW_RAYS, Work

FLOOR = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5), "floor")
BLIND = Object(Rectangle((-0.5, -0.5, 0.5), (1, 0, 0), (0, 1, 0)), Lambertian(0.5), "blind")
WIDE_LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 10.0)


def scene(*lights):
    camera = Camera((0.0, -3.0, 2.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), width=24, height=24)
    return Scene(camera=camera, objects=[FLOOR, BLIND], lights=list(lights))


def number(scene, photons, **settings):
    result = render(scene, "ppm", 1, options=PPMOptions(photons), **settings)
    return result.report["photons"]["shadow_rays_per_point"]


def test_the_cheapest_of_the_good_ones_is_taken():
    """Whatever the work is: nothing cheaper is within a tenth of the least product."""
    rng = np.random.default_rng(0)
    for _ in range(200):
        work = Work(*10.0 ** rng.uniform(-2.0, 2.0, 6))
        product = {
            (c, s): work.variance(c, s) * work.cost(c, s) for c in CAMERA_RAYS for s in SHADOW_RAYS
        }
        least = min(product.values())
        assert product[work.best_numbers] <= 1.1 * least
        for numbers, value in product.items():
            assert value > 1.1 * least or work.cost(*numbers) >= work.cost(*work.best_numbers)


def test_a_wide_lamp_that_lights_little_floor_at_many_photons_is_asked_often():
    assert number(scene(WIDE_LAMP), 50_000) in SHADOW_RAYS[2:]


def test_a_point_light_has_no_noise_that_more_shadow_rays_would_lessen():
    """Direct light of a point light is exact; only another lamp's would be noisy."""
    assert number(scene(PointLight((0.0, 0.0, 3.0), 10.0)), 50_000) == 1


def test_few_photons_leave_little_to_spread_more_shadow_rays_over():
    assert number(scene(WIDE_LAMP), 10) < number(scene(WIDE_LAMP), 50_000)


@pytest.mark.statistical
@pytest.mark.nightly
def test_stated_blur_is_that_of_one_camera_ray():
    """The root mean square of the blur of light from a mirror, by 1 and by 4 camera rays.

    Where a ray passes through its pixel in one pass depends on the other passes (one net), which
    makes products of passes with single rays a little smaller: 2 % here, 5 % are allowed.
    """
    glass = Rectangle((-0.7, 0.8, 0.0), (1.4, 0.0, 0.0), (0.0, 0.0, 0.8))
    lit = scene(PointLight((0.0, -1.0, 1.5), 10.0))
    lit = Scene(lit.camera, [FLOOR, Object(glass, Mirror(), "mirror")], lit.lights)
    options = PPMOptions(20_000, initial_radius=0.5)
    blur = []
    for n in (1, 4):
        with mock.patch.object(Work, "best_numbers", (n, 1)):
            found = [render(lit, "ppm", 8, seed=k, options=options) for k in range(3)]
        assert {r.report["photons"]["camera_rays_per_pixel"] for r in found} == {n}
        blur.append([r.report["photons"]["blur_root_mean_square"] for r in found])
    assert np.mean(blur[0]) == pytest.approx(np.mean(blur[1]), rel=0.05)


def test_the_numbers_hang_on_no_thread():
    found = [
        render(scene(WIDE_LAMP), "ppm", 2, options=PPMOptions(20_000), threads=threads, seed=5)
        for threads in (1, 3)
    ]
    for name in ("camera_rays_per_pixel", "shadow_rays_per_point"):
        assert len({result.report["photons"][name] for result in found}) == 1
    assert np.array_equal(found[0].image, found[1].image)


def test_pilot_rays_are_counted_with_no_pass():
    """As many camera rays a pixel and pass as are stated, and as many shadow rays as points cast."""
    report = render(scene(WIDE_LAMP), "ppm", 2, options=PPMOptions(50_000)).report
    n_camera = 2 * 24 * 24 * report["photons"]["camera_rays_per_pixel"]
    n = report["photons"]["shadow_rays_per_point"]
    assert report["rays"]["camera"] == n_camera > 2 * 24 * 24
    assert n < report["rays"]["shadow"] <= n_camera * n


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
