"""Roots at t_min and t_max: what their bounds leave open says TANGENT, by every way to ask."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Asphere,
    Box,
    Cylinder,
    Intersector,
    Plane,
    Rectangle,
    Sphere,
    Status,
    Torus,
    TriangleMesh,
)
from hybrid_rt.demo import teapot
from meshing import TrimmedSurface, polygon

TILT = np.array([[0.8, -0.48, 0.36, 0], [0.6, 0.64, -0.48, 0], [0, 0.6, 0.8, 0], [0, 0, 0, 1]])
HOLE = [polygon([(0, 0.1), (1, 0.1), (1, 0.9), (0, 0.9)])]
SURFACES = {
    "sphere": lambda: Sphere((0, 0, 0), 1),
    "trimmed sphere": lambda: TrimmedSurface(Sphere((0, 0, 0), 1), HOLE),
    "rectangle": lambda: Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)),
    "plane": lambda: Plane((0, 0, 0), (0.1, 0.2, 1)),
    "box": lambda: Box((-1, -1, -1), (1, 1, 1)),
    "flattened box": lambda: Box((-1, -1, -1e-6), (1, 1, 1e-6)).transformed(TILT),
    "torus": lambda: Torus((0, 0, 0), (0, 0, 1), 1, 0.4),
    "asphere": lambda: Asphere(2, -0.5, [0, 0.01], 2, (0, 0, 0), (0, 0, 1)),
    "cylinder": lambda: Cylinder((0, 0, -1), (0, 0, 1), 1, 2),
    "teapot": teapot,
    "mesh": lambda: TriangleMesh(trimesh.creation.icosphere(2)),
}


@pytest.mark.parametrize("name", SURFACES)
def test_what_the_bound_leaves_open_says_so(name):
    """Limits at half a bound from the root, and at three; directions of any length."""
    surface, rng = SURFACES[name](), np.random.default_rng(8)
    tracer = Intersector(surface, threads=1)
    targets = rng.uniform(-0.6, 0.6, (60, 3))
    if name == "teapot":
        low, high = surface.bounds
        targets = 0.5 * (low + high) + 0.3 * targets * (high - low)
    d = rng.normal(size=(60, 3)) * rng.uniform(0.3, 3, (60, 1))
    o = targets - 4 * d
    hits = tracer.intersect(o, d)
    rows = hits.status == Status.HIT
    assert rows.sum() > 15
    o, d, t, bound = o[rows], d[rows], hits.t[rows], hits.t_bound[rows]
    for share in (-3.0, -0.5, 0.5, 3.0):
        is_open = abs(share) < 1
        before = tracer.intersect(o, d, t_max=t + share * bound)
        assert (before.hit == (share > 0)).all()
        assert (before.status == (Status.TANGENT if is_open else before.hit)).all()
        assert np.array_equal(tracer.occluded(o, d, t_max=t + share * bound), before.hit)
        all_of = tracer.intersect_all(o, d, t_max=t + share * bound)
        assert np.array_equal(all_of.count > 0, before.hit)
        behind = tracer.intersect(o, d, t_min=t + share * bound)
        assert ((behind.hit & (np.abs(behind.t - t) <= bound)) == (share < 0)).all()
        assert ((behind.status == Status.TANGENT) == is_open).all()
        assert np.array_equal(tracer.occluded(o, d, t_min=t + share * bound), behind.hit)


def test_a_tangent_hit_beyond_the_limit_keeps_its_mark():
    """A ray that grazes a sphere: its t is open by 1e-8, and so is on which side of t_max it lies."""
    tracer = Intersector(Sphere((0, 0, 0), 1))
    ray = (-3.0, 1.0 - 2.0**-52, 0.0), (1.0, 0.0, 0.0)
    hit = tracer.intersect(*ray)
    assert hit.status[0] == Status.TANGENT
    assert hit.t_bound[0] > 1e-9
    for share, status in ((-0.9, Status.TANGENT), (-1.1, Status.MISS)):
        row = tracer.intersect(*ray, t_max=hit.t + share * hit.t_bound)
        assert not row.hit[0]
        assert row.status[0] == status
        assert np.isnan(row.position).all()


def test_a_named_point_is_not_in_doubt():
    """A ray that leaves a torus from its own point begins at no root; unless it is named, at one or none."""
    tracer = Intersector([Torus((0, 0, 0), (0, 0, 1), 1, 0.4), Plane((0, 0, 5), (0, 0, 1))])
    rng = np.random.default_rng(2)
    d = rng.normal(size=(200, 3))
    first = tracer.intersect(-5 * d, d)
    first = first[(first.object_id == 0) & (first.normal[:, 2] > 0.1)]
    assert len(first) > 20
    ways = first.normal
    assert (tracer.intersect(first.position, ways, source=first).status == Status.HIT).all()
    begun = tracer.intersect(first.position, ways)
    # Where it is found at the origin itself it is none, without a mark.
    at_origin = tracer.intersect(first.position, ways, t_min=-1e-6).t == 0.0
    assert 5 < at_origin.sum() < len(first) - 5
    assert ((begun.status == Status.TANGENT) == ~at_origin).all()


def test_limits_of_any_size_are_taken():
    """From minus infinity to the largest double, without a warning."""
    tracer = Intersector(Sphere((0, 0, 0), 1))
    for t_max, is_hit in (
        (-np.inf, 0),
        (-1.0, 0),
        (0.0, 0),
        (1e-300, 0),
        (2.0**1023, 1),
        (1.7e308, 1),
    ):
        assert tracer.intersect((0, 0, 3), (0, 0, -1), t_max=t_max).hit[0] == is_hit
    mixed = tracer.intersect([(0, 0, 3)] * 2 + [(0, 5, 3)], (0, 0, -1), t_max=[1.0, np.inf, np.inf])
    assert mixed.status.tolist() == [0, 1, 0]
