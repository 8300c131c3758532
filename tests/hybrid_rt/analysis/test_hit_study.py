"""Studies of first hits: certified ones are right, those of meshes are not."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from studied import SCENE, TUBE

from hybrid_rt import Intersector, Torus
from hybrid_rt.analysis import answers, hit_study, tables
from hybrid_rt.analysis.hit_study import camera_rays, study_hits
from hybrid_rt.intersection.hit_errors import certified_hits
from meshing import SurfaceOfRevolution, TrimmedSurface, polygon


@pytest.fixture(scope="module")
def tube():
    return study_hits([TUBE], camera_rays(SCENE, 4000), tolerances=(1e-2, 1e-4), runs=2, threads=1)


def test_hits_on_trimmed_surfaces_are_studied():
    window = polygon([(-0.1, 0.3), (0.15, 0.25), (0.12, 0.7), (-0.08, 0.6)])
    loops = [polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), window]
    surfaces = [TrimmedSurface(TUBE, loops)]
    study = study_hits(surfaces, camera_rays(SCENE, 1000), tolerances=(1e-2,), runs=1, threads=1)
    wrong = {curve.name: curve.points[0].error.median for curve in study.curves}
    assert wrong["certified"] == wrong["certified, no Embree"] == 0.0
    # Triangles that an edge crosses stay whole.
    assert wrong["mesh"] > 0.0
    assert 0 < study.judged < 1000


@pytest.mark.parametrize("more", [{"u_range": (0, 0.5)}, {"weights": [1, 0.5]}])
def test_hits_on_parts_of_turns_and_rational_surfaces_are_studied(more):
    tube = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.2]], (0, 0, 0), (0, 0, 1), **more)
    study = study_hits([tube], camera_rays(SCENE, 1000), tolerances=(0.1,), runs=1, threads=1)
    wrong = {curve.name: curve.points[0].error.median for curve in study.curves}
    assert wrong["certified"] == wrong["certified, no Embree"] == 0.0
    mean_dt = {curve.name: curve.points[0].more["mean_dt"] for curve in study.curves}
    assert mean_dt["certified"] < 1e-14
    assert mean_dt["mesh"] > 1e-4
    assert study.judged > 200
    # Steps are counted on whole turns of plain profiles only.
    assert study.newton == []


def test_hits_on_closed_forms_are_timed():
    """No accuracy but "certified" is another method where nothing is tessellated."""
    rays = camera_rays(SCENE, 1000)
    study = study_hits([Torus((0, 0, 0), (0, 0, 1), 1.0, 0.3)], rays, runs=1, threads=1)
    assert [curve.name for curve in study.curves] == ["certified, no Embree"]
    assert study.curves[0].points[0].error.median == 0.0
    assert study.judged > 100
    assert 0.0 < study.truth_bound < 1e-12
    cost, bound = answers.hit_answers(study)
    assert "nothing to tessellate" in cost
    assert "of the size" in bound
    assert len(tables.hit_table(study.curves).rows) == 1


class Shown:
    """A tracer that finds given hits."""

    n_triangles = 0
    build_seconds = 0.0


def test_errors_of_hits_by_hand():
    """A tube of radius 1 about z, seen along y, of which everything is known."""
    tube = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
    x = np.array([-1.2, -0.9, -0.5, 0.0, 0.5, 0.9, 1.2])
    origins = np.stack([x, np.full(7, -3.0), np.full(7, 0.1)], axis=1)
    directions = np.tile((0.0, 2.0, 0.0), (7, 1))
    bare = Intersector([tube], coarse="none")
    truth, hits = certified_hits(bare, origins, directions), bare.intersect(origins, directions)
    depth = np.sqrt(1 - 0.5**2)
    hits.t[2] += 2 * depth / 2  # the far side; t counts lengths of 2
    hits.t[3] = np.inf
    hits.object_id[3] = -1
    hits.t[0], hits.object_id[0] = 1.0, 0
    hits.t[4] += 0.01
    hits.normal[4] = (1.0, 0.0, 0.0)  # the true one is (1/2, -depth, 0): 60 degrees off
    hits.residual[5] = 0.25
    point, judged = hit_study._hit_point(
        0.0, Shown(), [tube], truth, hits, SimpleNamespace(median=1.0, least=1.0, most=1.0)
    )
    assert judged == 6
    assert point.error.median == 0.5
    assert [point.more[kind] for kind in ("missed", "phantom", "farther")] == [1, 1, 1]
    assert point.more["worst_dt"] == pytest.approx(0.02)
    assert point.more["mean_dt"] == pytest.approx(0.02 / 3)
    assert point.more["worst_residual"] == 0.25
    assert point.more["mean_angle"] == pytest.approx(20.0)


class TestHits:
    def test_certified_hits_are_right_and_meshes_are_not(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        assert tube.rays == pytest.approx(4000, rel=0.02)
        assert all(
            p.error.median == 0.0
            for name, points in curves.items()
            if name.startswith("certified")
            for p in points
        )
        coarse, fine = curves["mesh"]
        assert coarse.error.median > fine.error.median
        assert coarse.more["triangles"] < fine.more["triangles"]
        # A chord of tolerance e lies within e of the arc, on average two thirds of it; slant adds.
        assert 0.3 * coarse.setting < coarse.more["mean_dt"] < 3.0 * coarse.setting
        assert curves["refined"][0].more["mean_dt"] < 1e-14
        assert math.isinf(curves["certified, no Embree"][0].setting)

    def test_newton_mends_distances_and_no_decisions(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        # Rounding may decide one ray otherwise; triangles are met in float32 here, there in float64.
        one_ray = 1.5 / tube.judged
        for stepped, mesh, refined in zip(
            tube.newton, curves["mesh"], curves["refined"], strict=True
        ):
            points = stepped.points
            assert [p.setting for p in points] == [0, 1, 2, 3, 4, 6]
            assert points[0].more["mean_dt"] == pytest.approx(mesh.more["mean_dt"], rel=1e-4)
            assert points[0].error.median == pytest.approx(mesh.error.median, abs=one_ray)
            assert points[-1].error.median == pytest.approx(refined.error.median, abs=one_ray)
            assert points[-1].more["mean_dt"] < 1e-13
            assert points[-1].more["worst_residual"] < 1e-12
