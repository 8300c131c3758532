"""Both crossings of a ray that grazes a surface, by exact distances; what counts as one crossing."""

from fractions import Fraction
from math import isqrt

import numpy as np
import pytest
import trimesh

from hybrid_rt import Box, Cylinder, Intersector, Sphere, Status, TriangleMesh
from meshing import BezierPatches

# The band of a ray that starts two sizes away: 64 eps x scale.
BAND = 64 * 2.0**-52 * 3.0
# Coordinates that hold those of the nets below without rounding.
PLACES = {"at 0": np.zeros(3), "1e5 away": np.array([2.0**17, -(2.0**16), 2.0**15])}
K = 2**-0.5
QUARTERS = np.array([[(1, 0), (1, 1), (0, 1)], [(0, 1), (-1, 1), (-1, 0)]], float)
WEIGHTS = np.array([[1, 1], [K, K], [1, 1]])


def quarters(at):
    nets = [np.stack([np.insert(q, 2, z, axis=1) for z in (-1.0, 1.0)], 1) + at for q in QUARTERS]
    return BezierPatches(nets, weights=[WEIGHTS, WEIGHTS])


def box_mesh(at):
    return TriangleMesh(
        trimesh.Trimesh(trimesh.creation.box((2, 2, 2)).vertices + at, BOX_FACES, process=False)
    )


BOX_FACES = trimesh.creation.box((2, 2, 2)).faces


def depth_in_round(o, d, at, axes):
    """How far within a sphere or cylinder of radius 1 a line passes, exact but for the last root."""
    f = [Fraction(o[k]) - Fraction(at[k]) for k in range(axes)]
    way = [Fraction(d[k]) for k in range(axes)]
    dd, fd = sum(x * x for x in way), sum(x * y for x, y in zip(f, way, strict=True))
    return float((1 - sum(x * x for x in f) + fd * fd / dd) / 2)


def depth_in_box(o, d, at, _axes):
    """As far as the way within a box of half width 1, times the slopes on its edges."""
    low, high, steep = None, None, None
    for k in range(3):
        a, b = sorted((Fraction(at[k]) + s - Fraction(o[k])) / Fraction(d[k]) for s in (-1, 1))
        low, high = (a if low is None else max(low, a)), (b if high is None else min(high, b))
        steep = abs(d[k]) if steep is None else min(steep, abs(d[k]))
    return float(high - low) * steep * steep


ROUND = {
    "sphere": (lambda at: Sphere(at, 1.0), 3),
    "cylinder": (lambda at: Cylinder(at - (0, 0, 1), (0, 0, 1), 1.0, 2.0), 2),
    "patches": (quarters, 2),
}
SHARP = {"box": (lambda at: Box(at - 1, at + 1), 3), "mesh": (box_mesh, 3)}


def grazing_rays(rng, n, bands, at, is_sharp):
    """Rays that pass beside the silhouette, or the edge x = z = 1, so many bands within."""
    a = rng.uniform(0.1, 0.9, n) * np.pi * (0.5 if is_sharp else 1.0)
    cosine, sine, zero = np.cos(a), np.sin(a), np.zeros(n)
    aside = rng.uniform(0.1, 0.2, n)
    if is_sharp:
        out, way = np.stack([cosine, zero, sine], 1), np.stack([-sine, aside, cosine], 1)
        on = np.stack([zero + 1, rng.uniform(-0.4, 0.4, n), zero + 1], 1)
    else:
        out, way = np.stack([cosine, sine, zero], 1), np.stack([-sine, cosine, zero], 1)
        on = out
    way /= np.linalg.norm(way, axis=1)[:, None]
    return on - bands * BAND * out - 2.0 * way + at, way


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("name", [*ROUND, *SHARP])
def test_no_crossing_of_a_grazing_pair_is_left_out(name, place):
    """Twice a band within, by the exact ray: whatever coordinates round."""
    is_sharp, at = name in SHARP, PLACES[place]
    make, axes = {**ROUND, **SHARP}[name]
    tracer, rng = Intersector(make(at), threads=1), np.random.default_rng(59)
    depth_of, sure = (depth_in_box if is_sharp else depth_in_round), 0
    for bands in (3, 16, 256, 4096):
        o, d = grazing_rays(rng, 30, bands, at, is_sharp)
        found = tracer.intersect_all(o, d)
        for i in range(30):
            rows = found.of(i)
            depth = depth_of(o[i].tolist(), d[i].tolist(), at.tolist(), axes)
            if (rows.status == Status.TANGENT).any() or abs(depth) < 2 * BAND:
                continue
            assert len(rows) == (2 if depth > 0 else 0)
            sure += 1
            if len(rows):
                assert rows.front_face.tolist() == [True, False] or name == "patches"
    assert sure > 50


def test_pairs_of_a_sphere_are_where_they_are():
    """Exact roots: b^2 - dd c in fractions, its root to 60 digits."""
    at = PLACES["1e5 away"]
    o, d = grazing_rays(np.random.default_rng(5), 40, 1024, at, False)
    found = Intersector(Sphere(at, 1.0)).intersect_all(o, d)
    assert (found.count == 2).all()
    for i in range(40):
        f = [Fraction(x) - Fraction(y) for x, y in zip(o[i].tolist(), at.tolist(), strict=True)]
        way = [Fraction(x) for x in d[i].tolist()]
        dd, b = sum(x * x for x in way), sum(x * y for x, y in zip(f, way, strict=True))
        square = b * b - dd * (sum(x * x for x in f) - 1)
        root = Fraction(isqrt(int(square * 10**80)), 10**40)
        for t, bound, exact in zip(
            found.of(i).t, found.of(i).t_bound, ((-b - root) / dd, (-b + root) / dd), strict=True
        ):
            assert abs(Fraction(float(t)) - exact) <= Fraction(float(bound))


def test_objects_near_one_another_are_not_one():
    """Spheres in each other, 1e-11 apart and 1e5 from 0: all four crossings; of equal ones two."""
    at, way = PLACES["1e5 away"], np.array([0.36, 0.48, 0.8])
    inner, outer = Sphere(at, 1.0), Sphere(at, 1.0 + 2.0**-36)
    found = Intersector([inner, outer]).intersect_all(at - 3 * way, way)
    assert found.hits.object_id.tolist() == [1, 0, 0, 1]
    assert (found.hits.status == Status.HIT).all()
    twice = Intersector([inner, inner]).intersect_all(at - 3 * way, way)
    assert twice.hits.object_id.tolist() == [0, 0]


def sheet(x0, x1, z):
    return np.array([[(x0, -1, z), (x0, 1, z)], [(x1, -1, z), (x1, 1, z)]], float)


@pytest.mark.parametrize(
    ("gap", "rows", "status"), [(0.0, 1, 1), (2.0**-35, 1, 2), (2.0**-30, 2, 1)]
)
def test_borders_that_rounding_moved_apart_are_crossed_once(gap, rows, status):
    """Two patches that overlap by a hair, an ulp of their coordinates apart; the third are two layers."""
    at = np.array([2.0**17, 0.0, 2.0**17])
    surface = BezierPatches([sheet(0, 0.5 + 2.0**-20, 0) + at, sheet(0.5, 1, gap) + at])
    start = at + np.array([0.5 + 2.0**-21, 0.25, 2.0])
    found = Intersector(surface).intersect_all(start, (0, 0, -1))
    assert found.count.tolist() == [rows]
    assert (found.hits.status == status).all()


def test_a_seam_between_opposite_orientations_counts_once():
    """Of normals that turn over at a border the same crossing is told; it may say TANGENT."""
    left, right = sheet(0, 0.5, 0), sheet(0.5, 1, 0)[:, ::-1]
    found = Intersector(BezierPatches([left, right])).intersect_all((0.5, 0.25, 2), (0, 0, -1))
    assert found.count.tolist() == [1]
