"""The independent estimate of the mean, and what is made of it where light is rare."""

import math

import numpy as np
import pytest
from marks import nightly_but
from rare_light import DOWN, FLOOR, RARE, mean_by_port, polished, port
from scipy.stats import chi2, norm

from hybrid_rt import (
    Camera,
    GradientSky,
    Lambertian,
    Metal,
    Mirror,
    Object,
    Plane,
    PointLight,
    Rectangle,
    RectangleLight,
    RoughConductor,
    Scene,
    Sphere,
    SpotLight,
    render,
)
from hybrid_rt.integrators.probes import cross_check
from hybrid_rt.integrators.probes.cross_check import _least
from hybrid_rt.integrators.probes.probe import Probe
from hybrid_rt.sensor.film import REGIONS, Film, regions_of


# Of 20 renders at a rate of 3 % more than two miss in 2 % of all series.
@pytest.mark.statistical
@pytest.mark.parametrize("n", nightly_but([8, 20], 8))
@pytest.mark.parametrize("name", RARE)
def test_interval_holds_rare_light_or_a_warning_says_so(name, n):
    """Highlights, a port, a bright spot: all but two of n seeds."""
    (scene, truth), missed = RARE[name], 0
    for seed in range(100, 100 + n):
        # Paths in the sphere end when they are absorbed, not at a limit.
        result = render(scene, passes=16, seed=seed, threads=1, max_depth=100)
        half = result.mean_half_interval
        holds = half is not None and abs(result.mean - truth()) <= half
        missed += not (holds or result.report.warnings)
    assert missed <= 2


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_estimate_is_the_mean_of_ordinary_pictures(integrator):
    """Diffuse, glossy, mirrored and sky light: within three standard errors of both, and not contradicted."""
    objects = [
        FLOOR,
        Object(Sphere((-0.5, 0, 0.4), 0.4), Metal(0.8, 0.2), "metal"),
        Object(Sphere((0.5, 0, 0.3), 0.3), Mirror(0.9), "mirror"),
        Object(Rectangle((-2, 1, 0), (4, 0, 0), (0, 0, 2)), Lambertian((0.7, 0.3, 0.2)), "wall"),
    ]
    camera = Camera((0, -3, 1.5), (0, 0, 0.4), (0, 0, 1), vertical_fov=50, width=32, height=24)
    lamp = RectangleLight((-0.5, -1, 3), (0, 1, 0), (1, 0, 0), 8.0)
    report = render(
        Scene(camera, objects, [lamp], GradientSky(0.1, 0.3)), integrator, 64, threads=1
    ).report
    check, noise = report["cross_check"], report["noise"]
    low, high = check["interval_95"]
    error = math.hypot((high - low) / 4.0, noise["standard_error_of_image_mean"])
    assert check["mean"] == pytest.approx(noise["image_mean"], abs=3.0 * error)
    assert high - low < check["mean"]
    assert not check["contradicts"]
    assert report["seconds"]["cross-check"] > 0.0


def test_light_behind_an_opening_is_estimated_by_connections():
    """Of 20 000 photons one or two come out of the sphere by themselves; hundreds are seen from outside."""
    truth = mean_by_port(0.02)
    check = render(port(0.02), passes=2, seed=2, threads=1, max_depth=60).report.cross_check
    low, high = check.interval_95
    assert low < truth < high
    assert high - low < 0.7 * truth


@pytest.mark.parametrize("reach", [0.5, 1e9])
def test_connected_or_not_the_estimate_is_the_same(reach, monkeypatch):
    """A corner of matt walls lit by what a hidden lamp sends to them; the mean is that of many passes."""
    monkeypatch.setattr(cross_check, "REACH", reach)
    walls = [
        FLOOR,
        Object(Rectangle((-1, 1, 0), (2, 0, 0), (0, 0, 2)), Lambertian(0.7), "back"),
        Object(Rectangle((-1, -1, 0), (0, 2, 0), (0, 0, 2)), Lambertian(0.7), "side"),
        Object(Rectangle((-1, -1, 0.8), (0, 2, 0), (0.7, 0, 0)), Lambertian(0.5), "shelf"),
    ]
    camera = Camera((2, -2, 1.5), (-0.5, 0.5, 0.4), (0, 0, 1), 40, width=24, height=24)
    result = render(Scene(camera, walls, [PointLight((-0.7, 0, 0.4), 4.0)]), passes=64, threads=1)
    check = result.report.cross_check
    low, high = check.interval_95
    assert abs(check.mean - result.mean) < 0.75 * (high - low)
    assert high - low < 0.3 * result.mean


def test_a_dark_region_that_photons_light_is_named_where_the_mean_agrees():
    """A slightly rough mirror lights what a screen shades, with 0.2 % of the picture's light."""
    mirror = Object(
        Rectangle((2, -0.5, 0.5), (0, 1, 0), (0, 0, 1)), RoughConductor(0.2, 3.9, 0.04), "mirror"
    )
    screen = Object(Rectangle((0, -4, 0), (0, 8, 0), (0, 0, 1.4)), Lambertian(0.0), "screen")
    camera = Camera((0, 0, 1.5), (0, 0, 0), (0, 1, 0), vertical_fov=60, width=20, height=20)
    lamps = [SpotLight((0.9, 0, 1.8), (1.1, 0, -0.8), 0.3, 6.0), PointLight((-1, 0, 1.6), 5.0)]
    result = render(
        Scene(camera, [FLOOR, mirror, screen], lamps),
        passes=16,
        threads=1,
        outputs=["half_interval"],
    )
    check = result.report["cross_check"]
    low, high = check["interval_95"]
    assert low < result.mean < high
    # The light falls on the middle rows of the right edge.
    assert check["contradicts"]
    assert check["region"] in (7, 11)
    (words,) = result.report["warnings"]
    assert "column 4 of 4 x 4" in words
    lacks = check["regions_lack_at_most"]
    assert check["image_mean_lacks_at_most"] == pytest.approx(sum(lacks) / 16)
    assert (result.channels["half_interval"][5:10, 15:] >= np.float32(lacks[7])).all()
    assert lacks[0] == 0.0


def test_means_of_regions_and_their_errors():
    """Noise of standard deviation 0.2 in 64 passes of 12 x 10 pixels, region by region."""
    region, rng = regions_of(12, 10), np.random.default_rng(3)
    assert np.unique(region).size == REGIONS
    film, level = Film(12, 10), 1.0 + np.arange(REGIONS)
    for _ in range(64):
        noise = rng.normal(0.0, 0.2, (12, 10, 1))
        film.add(np.repeat(level[region][:, :, None] + noise, 3, axis=2))
    mean, variance, _ = film.regions()
    count = np.bincount(region.ravel())
    # Four standard errors; variances from three degrees of freedom for each of 4 to 9 pixels: 30 % of
    # their mean over regions is four standard errors too.
    assert (np.abs(mean - level) < 4.0 * 0.2 / np.sqrt(64 * count)).all()
    assert np.mean(variance * 64 * count) == pytest.approx(0.2**2, rel=0.5)


@pytest.mark.parametrize("quantile", [1.96, 3.09, 3.836])
@pytest.mark.parametrize("n", [1, 3, 10, 100, 10_000])
def test_lower_limits_of_counts_are_those_of_chi_square(n, quantile):
    """Wilson and Hilferty are within 1 % of the exact limit, or within 0.1 of a count."""
    exact = chi2.ppf(norm.sf(quantile), 2 * n) / 2.0
    (found,) = _least(np.full((3, 1), float(n)), quantile)
    assert found == pytest.approx(exact, rel=0.01, abs=0.1)
    # The same for events of another size.
    (twice,) = _least(np.array([[2.0 * n], [4.0 * n], [8.0 * n]]), quantile)
    assert twice == pytest.approx(2.0 * found, rel=1e-9, abs=1e-12)


def test_a_quarter_of_the_photons_is_spread_evenly_over_lights():
    shares = Probe._shares(None, np.array([0.99, 0.0, 0.01]))
    np.testing.assert_allclose(shares, [0.8675, 0.0, 0.1325], rtol=1e-12)


def test_a_target_is_not_reached_while_photons_find_more():
    """Few samples meet the highlight: all agree to a few per cent, of a mean that lacks nearly everything."""
    report = render(polished(0.01), target_error=0.5, threads=1, seed=1).report
    assert report["stopped_by"] == "contradicted"
    (words,) = report["warnings"]
    assert "highlights of lamps without area" in words
    # With a limit beside it passes go on to that.
    report = render(polished(0.01), passes=24, target_error=0.5, threads=1, seed=1).report
    assert (report["passes"], report["stopped_by"]) == (24, "passes")


@pytest.mark.parametrize(
    "scene",
    [
        Scene(DOWN, [FLOOR], [PointLight((0, 0, 1), 1)]),
        Scene(DOWN, [Object(Plane((0, 0, 0), (0, 0, 1)), Lambertian(0.5))], [], GradientSky(1, 1)),
    ],
    ids=["one pass", "endless"],
)
def test_nothing_is_estimated_where_there_is_nothing_to_compare(scene):
    passes = 1 if scene.lights else 4
    assert render(scene, passes=passes, threads=1).report["cross_check"] is None
