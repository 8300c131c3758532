"""Two certificates that share no proof of a single root give the same first hits."""

import numpy as np
import pytest

from benchmarks.uniform_grids import best_uniform_grid
from hybrid_rt import Sphere
from meshing import SurfaceOfRevolution
from proof.cases.campaign import SCENES
from proof.judges.second_certificate import Bisection, duel


@pytest.mark.parametrize("scene", ["teapot", "patches"])
def test_fans_and_bisection_agree_on_hard_rays(scene):
    (found,) = duel(SCENES[scene](), 4000, seed=5)
    assert found.rays == 4000
    assert found.hits > 2000
    # Rows within rounding of another decision may differ; the oracle accepts both.
    assert found.wrong == found.wrong_second == found.given_up == 0
    assert found.apart < 0.03 * found.rays
    assert 0.0 < found.worst <= 1.0


def test_the_second_settles_nothing_by_fans():
    surfaces = SCENES["teapot"]()
    tracer = Bisection(surfaces)
    origins = np.tile([0.0, -20.0, 1.0], (100, 1))
    directions = np.random.default_rng(1).normal((0.0, 20.0, 0.0), 1.0, (100, 3))
    hits = tracer.intersect(origins, directions)
    assert hits.hit.sum() > 50
    assert tracer.counters["slow_solves"] >= hits.hit.sum()
    with pytest.raises(TypeError, match=r"surfaces\[0\] is a Sphere: pass BezierPatches"):
        Bisection([Sphere((0, 0, 0), 1)])


def test_the_best_grid_of_a_cylinder_follows_its_bend():
    cylinder = SurfaceOfRevolution([(0, 1), (3, 1)], (0, 0, 0), (0, 0, 1))
    grid = best_uniform_grid(cylinder, 1e-2)
    # n columns deviate by 1 - cos(pi / n): about 23 of them; along the axis it is straight.
    assert grid.rows == 1
    assert 20 <= grid.columns <= 32
    assert grid.deviation <= 1e-2
