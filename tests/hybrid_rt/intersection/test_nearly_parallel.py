"""Rays whose n.d rounds to 0 although they are not parallel to the surface."""

import numpy as np
import trimesh
from exact_vectors import cross, dot, exact, minus

from hybrid_rt import Box, Intersector, Plane, Status, TriangleMesh


def rays_with_lost_products(normal, n, seed):
    """Directions nearly across a normal for which the three products sum to 0, in float64 only."""
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < n:
        d = rng.normal(size=(100_000, 3))
        d[:, 2] = -(normal[0] * d[:, 0] + normal[1] * d[:, 1]) / normal[2]
        is_zero = normal[0] * d[:, 0] + normal[1] * d[:, 1] + normal[2] * d[:, 2] == 0.0
        found += [row for row in d[is_zero][: 4 * n] if dot(exact(normal), exact(row)) != 0]
    return np.array(found[:n])


def test_a_plane_is_met_far_away_or_tangent():
    plane = Plane((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    d = rays_with_lost_products(plane.exact_normal, 200, 1)
    o = plane.origin + np.random.default_rng(2).normal(size=d.shape)
    hits = Intersector(plane).intersect(o, d)
    normal, at = exact(plane.exact_normal), exact(plane.origin)
    gap = [dot(normal, minus(exact(p), at)) for p in o]
    is_met = np.array([-g / dot(normal, exact(w)) > 0 for g, w in zip(gap, d, strict=True)])
    assert is_met.any()
    assert not is_met.all()
    assert (hits.status[is_met] != Status.MISS).all()
    np.testing.assert_array_equal(hits.hit, is_met)


NEEDLE = np.array([(3.0, 0.0, 0.1), (0.5, 2e-4, 0.2), (0.5, 0.0, 0.2)])


def turned_needles(n, seed):
    """Needles, each with a direction along it whose product with the normal rounds to 0."""
    rng = np.random.default_rng(seed)
    while n:
        needles = NEEDLE @ np.linalg.qr(rng.normal(size=(20_000, 3, 3)))[0]
        a, b, c = needles.swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        aside = 3e-13 * rng.normal(size=(len(a), 1)) / np.linalg.norm(normal, axis=1)[:, None]
        d = (a - c) / np.linalg.norm(a - c, axis=1)[:, None] + aside * normal
        slope = normal[:, 0] * d[:, 0] + normal[:, 1] * d[:, 1] + normal[:, 2] * d[:, 2]
        for k in np.flatnonzero(slope == 0.0)[:n]:
            p, q, r = exact(a[k]), exact(b[k]), exact(c[k])
            if dot(cross(minus(q, p), minus(r, p)), exact(d[k])) != 0:
                n -= 1
                yield needles[k], d[k]


def crosses(p, o, d):
    """Tell whether a ray meets a triangle, and at which t, in exact arithmetic."""
    corners, way = [minus(exact(q), exact(o)) for q in p], exact(d)

    def volume(k):
        return dot(cross(corners[k - 2], corners[k - 1]), way)

    weights = [volume(k) for k in range(3)]
    total = sum(weights)
    if total == 0 or min(weights) < 0 < max(weights):
        return False, 0.0
    point = [sum(w * q[k] for w, q in zip(weights, corners, strict=True)) / total for k in range(3)]
    t = dot(point, way) / dot(way, way)
    return t > 0, float(t)


def test_needles_are_met_though_their_normals_have_no_digits():
    """Most hits are `TANGENT`; two in three needles have none else, and which do depends on the processor's rounding."""
    rng = np.random.default_rng(4)
    met = sure = 0
    for p, d in turned_needles(48, 3):
        weights = rng.dirichlet((1, 1, 1), 20)
        origins = weights @ p - rng.uniform(0.1, 2.0, (20, 1)) * d
        mesh = TriangleMesh(trimesh.Trimesh(p, [(0, 1, 2)], process=False))
        # Without a beginning: their bounds reach behind the origins.
        tracer, directions = Intersector(mesh), np.tile(d, (20, 1))
        hits = tracer.intersect(origins, directions, t_min=-np.inf)
        begun = tracer.intersect(origins, directions)
        assert (begun.status[hits.hit & (hits.t_bound > hits.t)] == Status.TANGENT).all()
        for k, o in enumerate(origins):
            is_met, t = crosses(p, o, d)
            met += is_met
            if hits.status[k] != Status.TANGENT:
                sure += 1
                assert hits.hit[k] == is_met
                assert not is_met or abs(hits.t[k] - t) <= hits.t_bound[k]
    assert met > 600
    assert sure > 10


def test_rays_along_an_edge_of_a_turned_box_enter_it():
    """Beside one of its faces, by less than the slope's rounding tells; far from 0 this takes a ray far."""
    matrix = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3))
    matrix[:3, 3] = 1e6, -8e5, 1.1e6
    box = Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7)).transformed(matrix)
    rng = np.random.default_rng(4)
    n = 4000
    weight = np.column_stack(
        [
            rng.choice([0.0, 1.0], n) + rng.normal(0, 1e-11, n),
            rng.uniform(0, 1, n),
            np.full(n, -0.3),
        ]
    )
    o = box.lo + weight @ box.edges
    d = box.edges[2] / np.linalg.norm(box.edges[2]) + 1e-7 * rng.normal(size=(n, 1)) * box.across[1]
    hits = Intersector(box, threads=1).intersect(o, d)
    edges, corner = [exact(edge) for edge in box.edges], exact(box.lo)
    sides = [cross(edges[k - 2], edges[k - 1]) for k in range(3)]
    volume = dot(edges[0], sides[0])
    is_met = []
    for p, way in zip(o, d, strict=True):
        start, step = minus(exact(p), corner), exact(way)
        first, last = 0, 10
        for side in sides:
            at, rate = dot(side, start) / volume, dot(side, step) / volume
            ends = sorted((-at / rate, (1 - at) / rate))
            first, last = max(first, ends[0]), min(last, ends[1])
        is_met.append(first < last)
    assert 0.1 < np.mean(is_met) < 0.9
    differs = hits.hit != np.array(is_met)
    assert (hits.status[differs] == Status.TANGENT).all()
