"""Photons where the camera sees a small part of what they light."""

import math

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    GradientSky,
    Lambertian,
    Object,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    render,
)
from hybrid_rt.integrators.kernels.photon_steps import IS_SHOWN, MET_SPECULAR, Photons
from hybrid_rt.integrators.photons import photon_workers
from hybrid_rt.integrators.photons.density_estimation import (
    Discs,
    Points,
    Radii,
    widest_discs,
)
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.lobes.register import WIDE


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


def detector_in_front_of_a_lamp_in_glass(albedo):
    """Return a lamp within a glass ball and a detector, of which a ninth is seen, 20 away."""
    lamp = RectangleLight((-0.5, -0.5, -1), (1, 0, 0), (0, 1, 0), radiance=1 / math.pi)
    detector = Rectangle((-30, -30, 20), (0, 60, 0), (60, 0, 0))
    objects = [
        Object(Sphere((0, 0, 0), 3), Dielectric(1.5), "dome"),
        Object(detector, Lambertian(albedo), "detector"),
    ]
    fov = 2 * math.degrees(math.atan(10 / 8))
    camera = Camera((0, 0, 12), (0, 0, 20), (0, 1, 0), vertical_fov=fov, width=32, height=32)
    return Scene(camera, objects, [lamp])


LAMP_IN_GLASS = {"passes": 4, "max_depth": 60, "options": PPMOptions(photons_per_pass=50_000)}


@pytest.mark.parametrize("albedo", [0.02, 0.1])
def test_points_beside_photons_that_were_shown_are_not_missed(albedo):
    """They wait for light that the detector sends to the glass and back: below a hundredth."""
    scene = detector_in_front_of_a_lamp_in_glass(albedo)
    result = render(scene, "ppm", **LAMP_IN_GLASS)
    report, photons = result.report, result.report["photons"]
    # Fewer are shown than were stored: most lie where the camera does not see them.
    assert 0 < 2 * photons["shown_to_camera"] < photons["stored"]
    without = photons["points_without_photons"]
    assert without >= photon_workers.NEARLY_ALL * photons["gather_points"]
    # Each of 4096 points is asked: 1024 of a pass.
    assert photons["points_with_shown_photons_alone"] == without
    assert report["points_missed_by_photons"] == 0
    assert math.isfinite(result.error)
    assert "met no photon" not in in_words(report)
    finder = render(scene, "path", 64, max_depth=60).report["noise"]
    half = finder["interval_factor"] * finder["standard_error_of_image_mean"]
    assert report["noise"]["image_mean"] == pytest.approx(
        finder["image_mean"], abs=2.0 * half + 0.01 * finder["image_mean"]
    )


def test_shown_photons_excuse_nothing_if_few_others_would_add_much(monkeypatch):
    monkeypatch.setattr(
        photon_workers, "UNMET_SHARE", 1e-6
    )  # as if the others were 10^4 times as bright
    report = render(detector_in_front_of_a_lamp_in_glass(0.02), "ppm", **LAMP_IN_GLASS).report
    assert report["points_missed_by_photons"] == report["photons"]["gather_points"]
    assert "of the points that gather light have met no photon" in in_words(report)


def test_only_shown_photons_in_the_disc_and_on_its_side_count():
    """Photons at x = 0 (shown, on top), 1 (not shown), 2 (shown, from below); discs of 0.1."""
    up = np.array([0.0, 0.0, 1.0])
    photons = Photons(
        np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]),
        np.tile(-up, (3, 1)).astype(np.float32),
        np.array([up, up, -up], dtype=np.float32),
        np.ones((3, 3), dtype=np.float32),
        np.array([MET_SPECULAR | IS_SHOWN, MET_SPECULAR, MET_SPECULAR | IS_SHOWN], dtype=np.uint8),
    )
    lobes = LobeTable(
        np.zeros(1, np.int32), np.full(1, WIDE, np.int32), np.zeros(1, np.int32),
        np.zeros((1, 6)), np.ones(1), np.array([0, 1], np.int32),
    )  # fmt: skip
    x = np.array([0.05, 0.05, 0.2, 1.05, 2.05, 2.05])
    n = x.size
    from_below = np.array([0, 0, 0, 0, 0, 1], dtype=bool)
    points = Points(
        np.stack([x, 0 * x, 0 * x], axis=1),
        np.tile(up, (n, 1)),
        np.where(from_below[:, None], up, -up),
        np.empty((0, 3)),
        np.zeros(n, dtype=np.int32),
        np.ones((n, 1, 3)),
        np.array([1, 0, 1, 1, 1, 1], dtype=bool),
        np.full(n, 0.5),
        np.full(n, np.inf),
    )
    discs = Discs(photons, lobes, Radii.fixed(0.1), 1.0)
    # Not: seen in a mirror; too far; not shown; on the other side.
    assert discs.shown_photons(points, np.arange(n)).tolist() == [0, -1, -1, -1, -1, 2]
    assert discs.shown_photons(points, np.array([5, 2])).tolist() == [2, -1]


def test_discs_are_no_wider_than_a_quarter_of_their_surface():
    """A table before a far wider glass front: its light is noisy, but not lost beyond its edges.

    Discs that are as wide as photons are sparse lose a quarter of the light. Half of the interval
    more is allowed: then one of 300 seeds fails by chance.
    """
    table = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.6), "table")
    front = Object(Box((-40, 3, -1), (40, 3.1, 40)), Dielectric(1.5), "front")
    camera = Camera((0, -4, 2.5), (0, 0, 0), (0, 0, 1), vertical_fov=12, width=24, height=24)
    scene = Scene(camera, [table, front], environment=GradientSky(0.3, 1.0))
    photons = render(scene, "ppm", 24, seed=1, options=PPMOptions(100_000))
    truth = render(scene, "path", 64, seed=1).report["noise"]
    noise = photons.report["noise"]
    gap = noise["image_mean"] - truth["image_mean"]
    half = noise["half_interval_95_of_image_mean"] + truth["half_interval_95_of_image_mean"]
    assert abs(gap) < 1.5 * half < 0.2 * truth["image_mean"]
    assert widest_discs(compile_scene(scene)).tolist() == [0.5, 0.25 * 41.0]
