"""Newton by numbers of steps, on surfaces of which the hits are known."""

from itertools import pairwise

import numpy as np
import pytest

from hybrid_rt.analysis.methods import size_of
from hybrid_rt.analysis.newton_steps import SteppedHits
from hybrid_rt.analysis.ray_sets import camera
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Sphere
from meshing import BezierPatches, SurfaceOfRevolution

# Two cubic arcs: a barrel of radius near 1, open at both ends.
BARREL = SurfaceOfRevolution(
    [[-1.0, 0.8], [-0.4, 1.1], [0.4, 1.1], [1.0, 0.8]], (0, 0, 0), (1, 2, 3)
)
X, Y = np.meshgrid(np.linspace(-1, 1, 3), np.linspace(-1, 1, 3), indexing="ij")
# z = (1 - x^2) (1 - y^2) / 4 over [-1, 1]^2 has one Bezier height that is not zero.
HILL = BezierPatches([np.stack([X, Y, np.where((X == 0) & (Y == 0), 1.0, 0.0)], axis=-1)])


def test_errors_are_squared_by_each_step_on_a_hill():
    """Vertical rays: the exact t is a height in closed form."""
    rng = np.random.default_rng(4)
    x, y = rng.uniform(-0.9, 0.9, (2, 500))
    slope = np.tile([0.3, 0.2, -1.0], (500, 1))
    height = (1 - x * x) * (1 - y * y) / 4
    origins = np.column_stack([x, y, height]) - 2.0 * slope
    found = SteppedHits([HILL], 0.03, threads=1)
    errors = []
    for steps in range(6):
        hits = found.intersect(origins, slope, steps)
        assert hits.hit.all()
        errors.append(np.abs(hits.t - 2.0).max())
    assert 1e-3 < errors[0] < 0.1
    for before, after in pairwise(errors):
        assert after < max(2.0 * before**2, 1e-14)
    assert errors[-1] < 1e-14


@pytest.mark.parametrize("surfaces", [[BARREL], [teapot()]], ids=["barrel", "teapot"])
def test_none_is_the_mesh_and_many_are_the_refined_hits(surfaces):
    rays = camera(surfaces, 2000, 3)
    tolerance = 1e-3 * size_of(surfaces)
    stepped = SteppedHits(surfaces, tolerance, threads=1)
    for accuracy, steps, near in (("mesh", 0, 1e-5), ("refined", 8, 1e-12)):
        tracer = Intersector(surfaces, accuracy, tolerance=tolerance, threads=1)
        expected = tracer.intersect(rays.origins, rays.directions)
        hits = stepped.intersect(rays.origins, rays.directions, steps)
        same = hits.hit == expected.hit
        # Triangles' edges and silhouettes may be decided otherwise.
        assert same.mean() > 0.995
        both = hits.hit & expected.hit
        gap = np.abs(hits.t[both] - expected.t[both])
        assert np.quantile(gap, 0.99) < near * size_of(surfaces)
        along = np.einsum("ij,ij->i", hits.normal[both], expected.normal[both])
        assert np.quantile(along, 0.01) > (0.9 if steps == 0 else 1 - 1e-12)
        assert hits.residual[both].max() < (2 * tolerance if steps == 0 else 1e-6)


def test_surfaces_without_steps_are_refused():
    with pytest.raises(TypeError, match=r"surfaces\[0\] is a Sphere: pass patches and surfaces of"):
        SteppedHits([Sphere((0, 0, 0), 1)], 0.1)


def test_triangles_wider_than_segments_lead_to_the_right_one():
    """A spindle cut into 24 segments: Newton walks to the one that holds the root."""
    x = np.linspace(-1.0, 1.0, 25)
    # Each parabola r = 1 - x^2 / 2 from x to x + h in Bezier form.
    middle = 1.0 - 0.5 * x[:-1] * x[1:]
    ends = 1.0 - 0.5 * x * x
    spindle = SurfaceOfRevolution(
        [
            [[x[k], ends[k]], [0.5 * (x[k] + x[k + 1]), middle[k]], [x[k + 1], ends[k + 1]]]
            for k in range(24)
        ],
        (0, 0, 0),
        (1, 2, 3),
    )
    whole = SurfaceOfRevolution([[-1.0, 0.5], [0.0, 1.5], [1.0, 0.5]], (0, 0, 0), (1, 2, 3))
    rays = camera([spindle], 4000, 3)
    exact = Intersector([whole], coarse="none", threads=1).intersect(rays.origins, rays.directions)
    tolerance = 0.05 * size_of([spindle])
    refined = Intersector([spindle], "refined", tolerance=tolerance, threads=1)
    stepped = SteppedHits([spindle], tolerance, threads=1)
    for hits in (
        refined.intersect(rays.origins, rays.directions),
        stepped.intersect(rays.origins, rays.directions, 8),
    ):
        both = hits.hit & exact.hit
        gap = np.abs(hits.t[both] - exact.t[both])
        # The mesh's silhouette lies inside the true one: 44 of 774 hits are lost with the mesh. Of the
        # others 716 are right; on the triangle's own segment alone it were 574.
        assert both.sum() > 0.9 * exact.hit.sum()
        assert (gap < 1e-12 * size_of([spindle])).mean() > 0.95
