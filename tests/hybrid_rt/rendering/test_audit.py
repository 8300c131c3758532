"""What a render says of its own geometric error, against closed forms."""

import numpy as np
import pytest
from scipy.stats import binomtest

from hybrid_rt.intersection import Intersector
from hybrid_rt.lights import GradientSky
from hybrid_rt.materials import Lambertian
from hybrid_rt.primitives import Sphere
from hybrid_rt.rendering import summary as numbers
from hybrid_rt.rendering.audit import share_interval
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import SurfaceOfRevolution

TOLERANCE = 0.05
# A cylinder of radius 1 from z = -1 to z = 1, seen so that its ends are out of sight.
TUBE = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
CAMERA = Camera((0, -6, 0), (0, 0, 0), (0, 0, 1), vertical_fov=10, width=400, height=100)
SCENE = Scene(CAMERA, [Object(TUBE, Lambertian(0.5))], environment=GradientSky(0.5, 1.0))


def tube_is_hit(directions):
    """Tell whether rays from (0, -6, 0) come within 1 of the z axis."""
    across = np.hypot(directions[:, 0], directions[:, 1])
    return 6.0 * np.abs(directions[:, 0]) / across < 1.0


def true_share():
    """Share of wrong first hits of the mesh among rays through places all over the picture."""
    column, row = np.meshgrid((np.arange(3200) + 0.5) / 8, np.arange(50) * 2.0 + 1.0)
    origins, directions = CAMERA.rays(column.ravel(), row.ravel())
    meshed = Intersector([TUBE], "mesh", tolerance=TOLERANCE).intersect(origins, directions)
    hit = tube_is_hit(directions)
    # Beyond the middle of its chord a hit is nearer to where the ray leaves the tube.
    middle = 6.0 * directions[:, 1] / (directions[:, :2] ** 2).sum(axis=1)
    farther = hit & meshed.hit & (meshed.t > middle)
    return ((hit != meshed.hit) | farther).sum() / (hit | meshed.hit).sum()


def test_share_of_wrong_hits_of_a_mesh_is_in_the_reported_interval():
    report = render(SCENE, "whitted", passes=1, accuracy="mesh", tolerance=TOLERANCE).report
    wrong = report["geometry"]["wrong_first_hits"]
    share = true_share()
    assert share > 0.01
    low, high = wrong["interval_95"]
    assert low <= share <= high
    assert wrong["wrong"] == wrong["missed"] + wrong["phantom"] + wrong["farther"]
    assert wrong["share"] == pytest.approx(wrong["wrong"] / wrong["rays"])
    assert 0 < wrong["mean_error"] < wrong["worst_error"]
    assert report["geometry"]["camera_hits_without_bound"] == report["geometry"]["camera_hits"]
    assert report["rays"]["camera"] == report["intersection"]["rays"]  # the audit's are apart
    assert report["geometry"]["certified_rays"] == 0
    assert "no camera hit has a proven error" in numbers.in_words(report)
    assert f"wrong first hits: {wrong['wrong']:,} of" in numbers.in_words(report)


def test_certified_hits_need_no_audit():
    report = render(SCENE, "whitted", passes=1, tolerance=TOLERANCE).report
    geometry = report["geometry"]
    assert geometry["wrong_first_hits"] is None
    assert geometry["camera_hits_without_bound"] == 0
    assert 0 < geometry["largest_t_bound_of_camera_hits"] < 1e-9
    work = report["intersection"]
    assert geometry["certified_rays"] == work["rays"] + work["shadow_rays"] > 40_000
    assert geometry["given_up"] == 0
    assert f"{geometry['certified_rays']:,} rays certified" in numbers.in_words(report)
    assert "unknown after a single pass" in numbers.in_words(report)


def test_closed_forms_are_certified_in_every_accuracy():
    ball = Scene(CAMERA, [Object(Sphere((0, 0, 0), 0.4), Lambertian(0.5))])
    assert render(ball, passes=1, accuracy="mesh").report["geometry"]["wrong_first_hits"] is None


def test_interval_of_a_share_is_wilsons():
    for k, n in ((50, 100), (0, 10), (10, 10), (1, 100_000)):
        truth = binomtest(k, n).proportion_ci(0.95, method="wilson")
        assert share_interval(k, n) == pytest.approx((truth.low, truth.high), rel=1e-6, abs=1e-12)
    assert share_interval(0, 0) == (0.0, 1.0)
