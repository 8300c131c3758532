"""Rays and normals beside collapsed edges of patches."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from hybrid_rt.core.records import Flag, Status
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.rational_surfaces import nurbs_sphere, octants

EPS = 2.0**-52
DISTANCES = (0.0, 1e-16, 1e-14, 1e-13, 1e-11, 1e-9, 1e-6, 1e-3)


def about_the_axis(distance, n=12):
    """Points at a distance from the z axis, at angles that are no seam's."""
    angle = np.arange(n) * (2.0 * np.pi / n) + 0.1
    return distance * np.cos(angle), distance * np.sin(angle)


def collapsed(side, degree, rational, seed):
    """A random net with a side that is a point, and weights."""
    rng = np.random.default_rng(seed)
    net = rng.normal(size=(degree[0] + 1, degree[1] + 1, 3))
    edge = (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1])[side]
    net[edge] = rng.normal(size=3)
    weights = np.exp(0.5 * rng.normal(size=net.shape[:2])) if rational else np.ones(net.shape[:2])
    return net, weights


def exact_partials(net, weights, u, v):
    """S_u and S_v in fractions, at parameters as float64 has them."""
    u, v = Fraction(float(u)), Fraction(float(v))

    def basis(n, x):
        value = [comb(n, k) * x**k * (1 - x) ** (n - k) for k in range(n + 1)]
        less = [comb(n - 1, k) * x**k * (1 - x) ** (n - 1 - k) for k in range(n)]
        slope = [
            n * ((less[k - 1] if k > 0 else 0) - (less[k] if k < n else 0)) for k in range(n + 1)
        ]
        return value, slope

    (bu, du), (bv, dv) = basis(net.shape[0] - 1, u), basis(net.shape[1] - 1, v)
    w = [[Fraction(float(x)) for x in row] for row in weights]
    p = [[[Fraction(float(x)) for x in q] for q in row] for row in net]

    def total(a, b, c):
        return sum(
            a[i] * b[j] * w[i][j] * (1 if c is None else p[i][j][c])
            for i in range(len(a))
            for j in range(len(b))
        )

    weight, along_u, along_v = total(bu, bv, None), total(du, bv, None), total(bu, dv, None)
    point = [total(bu, bv, c) / weight for c in range(3)]
    s_u = [(total(du, bv, c) - along_u * point[c]) / weight for c in range(3)]
    s_v = [(total(bu, dv, c) - along_v * point[c]) / weight for c in range(3)]
    return s_u, s_v


def exact_normal(net, weights, u, v):
    a, b = exact_partials(net, weights, u, v)
    n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    largest = max(abs(x) for x in n)
    n = np.array([float(x / largest) for x in n])
    return n / np.linalg.norm(n)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("side", range(4))
def test_normals_beside_a_collapsed_edge_have_all_digits(side, rational):
    degree = [(3, 3), (2, 2), (2, 4), (5, 1)][side]
    net, weights = collapsed(side, degree, rational, 10 + side)
    surface = BezierPatches([net], [weights] if rational else None)
    for away in (2.0**-10, 2.0**-24, 2.0**-37, 2.0**-44):
        for along in (0.1, 0.5, 0.8):
            at = away if side % 2 == 0 else 1.0 - away
            u, v = (at, along) if side < 2 else (along, at)
            # Sums of some dozen products each, of a net whose tangents are not nearly parallel. The
            # points of a rational net are rounded to its size, which turns S_u by that over `away`
            # only if it does not vanish on the edge.
            error = np.abs(surface.normal(u, v) - exact_normal(net, weights, u, v)).max()
            assert error <= 200 * EPS, (side, away, along)
            s_u, s_v = surface.partials(u, v)
            for found, exact in zip((s_u, s_v), exact_partials(net, weights, u, v), strict=True):
                true = np.array([float(x) for x in exact])
                assert np.abs(found - true).max() <= 500 * EPS * np.abs(true).max()


def test_second_partials_beside_a_pole_are_as_small_as_they_are():
    # S is (v (1 - v) C(u), v^2) over weights; S_uu vanishes with v, to its own digits.
    net, weights = collapsed(2, (2, 2), True, 3)
    surface = BezierPatches([net], [weights])
    v = np.array([2.0**-20, 2.0**-30, 2.0**-40])
    uu, uv, _ = surface.second_partials(0.3, v)
    limit = uv[-1] * 0.0 + (uu[-1] / v[-1])
    assert np.abs(uu / v[:, None] - limit).max() <= 20.0 * v[0] * np.abs(limit).max()
    step = 2.0**-12
    around = (surface.partials(0.3 + step, v[1])[0] - surface.partials(0.3 - step, v[1])[0]) / (
        2.0 * step
    )
    # Central differences: third derivatives times step^2 / 6.
    assert np.abs(around - uu[1]).max() <= 100.0 * step**2 * np.abs(uu[1]).max()


@pytest.mark.parametrize("radius", [1.0, 1e-3, 7e4])
def test_hits_beside_the_pole_of_a_sphere(radius):
    matrix = np.diag([radius, radius, radius, 1.0])
    tracer = Intersector([nurbs_sphere().transformed(matrix)], coarse="none")
    for distance in DISTANCES:
        x, y = about_the_axis(radius * distance)
        origins = np.column_stack([x, y, np.full(len(x), 5.0 * radius)])
        hits = tracer.intersect(origins, (0.0, 0.0, -1.0))
        assert (hits.status == Status.HIT).all(), distance
        z = radius * np.sqrt(1.0 - (distance) ** 2)
        assert (np.abs(hits.t - (5.0 * radius - z)) <= hits.t_bound).all()
        assert hits.t_bound.max() <= 2e-13 * radius
        truth = np.column_stack([x, y, np.full(len(x), z)]) / radius
        normal = hits.normal * np.sign(hits.normal[:, 2:])
        # The point is right to about 100 eps of the ray's length, and so the normal.
        assert np.abs(normal - truth).max() <= 600 * EPS, distance


def test_rays_at_a_pole_whose_surface_is_open_say_so():
    whole = octants()
    some = BezierPatches(list(whole.patches[:7]), list(whole.weights[:7]))
    tracer = Intersector([some], coarse="none")
    missing = whole.patches[7].reshape(-1, 3).mean(axis=0)
    z = 5.0 * np.sign(missing[2])
    hits = tracer.intersect((0.0, 0.0, z), (0.0, 0.0, -np.sign(z)))
    assert hits.status[0] == Status.TANGENT
    # From the other end no octant is missing.
    hits = tracer.intersect((0.0, 0.0, -z), (0.0, 0.0, np.sign(z)))
    assert hits.status[0] == Status.HIT
    assert hits.flags[0] & Flag.NORMAL_DEGENERATE
