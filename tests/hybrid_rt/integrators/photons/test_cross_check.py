"""The independent estimate of the mean, and what is made of it where light is rare."""

import math

import pytest

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
    Scene,
    Sphere,
    render,
)
from proof.stability.row import Effort
from proof.stability.rows_light_rare import DOWN, FLOOR, polished, rare_light


@pytest.mark.statistical
def test_interval_holds_rare_light_or_a_warning_says_so():
    """Highlights, a port, a bright spot: eight seeds of each."""
    outcome = rare_light(Effort(0.4, seed=100))
    assert not outcome.faults


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
    assert high - low < 0.5 * check["mean"]
    assert not check["contradicts"]
    assert report["seconds"]["cross-check"] > 0.0


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
