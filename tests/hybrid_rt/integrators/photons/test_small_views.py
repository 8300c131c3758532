"""Photons where the camera sees a small part of what they light."""

import math

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    GradientSky,
    Lambertian,
    Object,
    PPMOptions,
    Rectangle,
    Scene,
    render,
)


def floor_below_a_pane(width):
    """Return a matt floor and a pane above it, so many units wide, of which half a unit is seen."""
    objects = [
        Object(
            Rectangle((-width / 2, -width / 2, 0), (width, 0, 0), (0, width, 0)), Lambertian(0.8)
        ),
        Object(Box((-width / 2, -width / 2, 0.3), (width / 2, width / 2, 0.4)), Dielectric(1.5)),
    ]
    camera = Camera((0, 0, 0.2), (0.05, 0.02, 0), (0, 1, 0), vertical_fov=60, width=24, height=18)
    return Scene(camera, objects, (), GradientSky(1, 1))


OPTIONS = PPMOptions(photons_per_pass=5000)


def test_discs_are_wide_where_photons_are_sparse():
    """A disc of 0.03 of the view would hold 0.001 photons a pass, one of a quarter 0.05."""
    report = render(floor_below_a_pane(60), "ppm", passes=16, options=OPTIONS).report
    (radius,) = report["photons"]["first_radii"]
    size = math.hypot(0.3, 0.2, 0.2)  # of what is seen, about, with the camera
    assert 0.15 * size < radius < 0.35 * size
    assert report["points_missed_by_photons"] == 0 or report["relative_error"]["noise"] > 1.0


def test_no_target_is_reached_where_no_point_has_met_a_photon():
    scene = floor_below_a_pane(20_000)
    result = render(scene, "ppm", passes=8, target_error=0.5, options=OPTIONS)
    assert result.report["points_missed_by_photons"] > 0
    assert result.report["stopped_by"] == "passes"
    assert result.error == math.inf
