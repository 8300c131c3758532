"""t_bound holds for the surface that was given, not only for the numbers that it is converted to.

The judge evaluates the given control points, knots, weights and matrices at 40 digits, by de Boor's
algorithm, and finds the root next to each hit by Newton's iteration.
"""

import pickle
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from mpmath import mp, mpf

from hybrid_rt import Intersector, TrimmedSurface, polygon
from meshing import (
    BezierPatches,
    Cone,
    Cylinder,
    Extrusion,
    NurbsSurface,
    PatchSheet,
    SurfaceOfRevolution,
    circular_arc,
)

CLAMPED = [0, 0, 0, 1, 4, 7, 8, 8, 8]
PERIODIC = [-0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
# Bezier patches are splines with knots at their ends only.
ENDS = {n: [0] * (n + 1) + [1] * (n + 1) for n in range(1, 6)}
UNEVEN = [0.1, 0.13, 0.7, 0.7, 1.1, 1.9, 2.3, 2.31, 3.7]
OFFSETS = (0.0, 1e3, 1e7)


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(40):
        yield


def de_boor(points, knots, degree, x):
    """Value and derivative of a B-spline, points being lists of mpf."""
    knots = [mpf(float(k)) for k in knots]
    p = len(points)
    k = max(i for i in range(degree, p) if knots[i] <= x or i == degree)
    d = [points[k - degree + j] for j in range(degree + 1)]
    for r in range(1, degree):
        for j in range(degree, r - 1, -1):
            low, high = knots[j + k - degree], knots[j + 1 + k - r]
            d[j] = [
                ((high - x) * a + (x - low) * b) / (high - low)
                for a, b in zip(d[j - 1], d[j], strict=True)
            ]
    low, high = knots[k], knots[k + 1]
    value = [
        ((high - x) * a + (x - low) * b) / (high - low)
        for a, b in zip(d[degree - 1], d[degree], strict=True)
    ]
    return value, [
        degree * (b - a) / (high - low) for a, b in zip(d[degree - 1], d[degree], strict=True)
    ]


class Given:
    """A tensor product spline as given, and its images, at many digits."""

    def __init__(self, control, knots_u, knots_v, degree, weights=None, matrices=()):
        control = np.asarray(control, float)
        weights = np.ones(control.shape[:2]) if weights is None else weights
        rows = [[[mpf(float(c)) for c in point] for point in row] for row in control]
        for matrix in matrices:
            m = [[mpf(float(x)) for x in row] for row in np.asarray(matrix)]
            rows = [
                [
                    [
                        sum(a * x for a, x in zip(line[:3], point, strict=True)) + line[3]
                        for line in m[:3]
                    ]
                    for point in row
                ]
                for row in rows
            ]
        self.rows = [
            [
                [mpf(float(w)) * c for c in point] + [mpf(float(w))]
                for point, w in zip(row, ws, strict=True)
            ]
            for row, ws in zip(rows, weights, strict=True)
        ]
        self.knots, self.degree = (knots_u, knots_v), degree

    def at(self, u, v):
        (ku, kv), (m, n) = self.knots, self.degree
        curves = [de_boor(row, kv, n, v) for row in self.rows]
        (s, su), (sv, _) = (de_boor([c[k] for c in curves], ku, m, u) for k in (0, 1))
        point = [x / s[3] for x in s[:3]]
        along = [
            [(x - d[3] * p) / s[3] for x, p in zip(d[:3], point, strict=True)] for d in (su, sv)
        ]
        return point, *along

    def root(self, u, v, t, o, d):
        """T of the root near (u, v, t), u and v over the unit square."""
        (ku, kv), (m, n) = self.knots, self.degree
        ends = [(mpf(float(k[g])), mpf(float(k[-g - 1]))) for k, g in ((ku, m), (kv, n))]
        u, v = (a + mpf(float(x)) * (b - a) for x, (a, b) in zip((u, v), ends, strict=True))
        o, d, t = [mpf(float(x)) for x in o], [mpf(float(x)) for x in d], mpf(float(t))
        for _ in range(60):
            point, su, sv = self.at(u, v)
            gap = mpmath.matrix([p - a - t * b for p, a, b in zip(point, o, d, strict=True)])
            jacobian = mpmath.matrix([[a, b, -c] for a, b, c in zip(su, sv, d, strict=True)])
            du, dv, dt = mpmath.lu_solve(jacobian, gap)
            u, v, t = u - du, v - dv, t - dt
            if abs(dt) < mpf(10) ** -25 * (1 + abs(t)):
                return t
        raise AssertionError("Newton's iteration does not end")


def rays_at(surface, n, rng):
    """Rays from about the surface to points of it."""
    u, v = rng.uniform(0.02, 0.98, (2, n))
    ids = rng.integers(len(surface), size=n) if isinstance(surface, BezierPatches) else None
    target = surface.point(u, v) if ids is None else surface.point(u, v, ids)
    directions = rng.normal(size=(n, 3))
    size = np.ptp(surface.bounds, axis=0).max()
    return target - directions * size, directions


def hold(surface, given, rng, n=12, tight=60.0):
    """Every bound holds; and where nothing but rounding is in it, it is as tight as that."""
    o, d = rays_at(surface, n, rng)
    hits = Intersector(surface, coarse="none", threads=1).intersect(o, d)
    assert hits.hit.sum() > n // 2
    for i in np.flatnonzero(hits.status == 1):
        true = given.root(hits.u[i], hits.v[i], hits.t[i], o[i], d[i])
        assert abs(true - mpf(float(hits.t[i]))) <= mpf(float(hits.t_bound[i])), (i, hits.t[i])
    # The bound of a surface at the origin: some 100 roundings of size and way over the slope.
    size = np.ptp(surface.bounds, axis=0).max()
    slope = np.abs(np.einsum("ij,ij->i", hits.normal, d)) / np.linalg.norm(d, axis=1)
    steep = (hits.status == 1) & (slope > 0.3)
    assert hits.t_bound[steep].max() <= tight * 2.0**-52 * (4.0 * size + hits.t[steep].max()) / 0.3


def net_of(rng, far, p=6, q=5):
    u, v = np.meshgrid(np.arange(p), np.arange(q), indexing="ij")
    net = np.stack([1.3 * u, v, np.zeros((p, q))], -1) + rng.uniform(0, 0.5, (p, q, 3))
    return net + far * np.array([0.3, -0.7, 1.0])


TURN = np.array(
    [[0.36, 0.48, -0.8, 1.1], [-0.8, 0.6, 0, -3.7], [0.48, 0.64, 0.6, 0.3], [0, 0, 0, 1]]
)


def moved(far):
    matrix = TURN @ np.diag([1.0, 1.1, 0.7, 1.0])
    matrix[:3, 3] += far * np.array([0.31, 1.0, -0.57])
    return matrix


@pytest.mark.parametrize("far", OFFSETS)
@pytest.mark.parametrize(
    "knots_u", [CLAMPED, PERIODIC, UNEVEN], ids=["clamped", "periodic", "uneven"]
)
@pytest.mark.parametrize("is_rational", [False, True], ids=["plain", "rational"])
@pytest.mark.parametrize("is_moved", [False, True], ids=["given", "transformed"])
def test_nurbs(far, knots_u, is_rational, is_moved):
    rng = np.random.default_rng(5)
    knots_v = [0, 0, 0, 0, 0.3, 1, 1, 1, 1]
    net = net_of(rng, far, 6, 5)
    weights = rng.uniform(0.3, 2.0, (6, 5)) if is_rational else None
    args = net, knots_u, knots_v, (2, 3), weights
    matrices = [moved(far), moved(-0.4 * far)] if is_moved else []
    surface = NurbsSurface(*args)
    for matrix in matrices:
        surface = surface.transformed(matrix)
    hold(surface, Given(*args, matrices), rng)


def rotated(far):
    """A rotation as callers build it, by rounded sines, scaled, and a shift."""
    a, c = np.sin(0.7), np.cos(0.7)
    matrix = np.eye(4)
    matrix[:3, :3] = 1.3 * np.array([[c, -a, 0], [a, c, 0], [0, 0, 1]]) @ TURN[:3, :3]
    matrix[:3, 3] = far * np.array([0.31, 1.0, -0.57])
    return matrix


class GivenTurned:
    """A turned Bezier profile as given, and its images, at many digits."""

    def __init__(self, profile, weights, origin, axis, matrices=()):
        self.profile = [[mpf(float(x)) for x in point] for point in profile]
        self.weights = (
            [mpf(1)] * len(profile) if weights is None else [mpf(float(w)) for w in weights]
        )
        axis = mpmath.matrix([mpf(float(x)) for x in axis])
        self.axis = axis / mpmath.norm(axis)
        self.origin = mpmath.matrix([mpf(float(x)) for x in origin])
        # What is turned back is the ray.
        self.back = []
        for matrix in reversed(matrices):
            m = mpmath.matrix([[mpf(float(x)) for x in row[:3]] for row in matrix[:3]])
            self.back.append((m, mpmath.matrix([mpf(float(row[3])) for row in matrix[:3]])))

    def radius(self, s):
        """Z, R and their derivatives."""

        def sums(values, n):
            return sum(
                mpmath.binomial(n, k) * s**k * (1 - s) ** (n - k) * x for k, x in enumerate(values)
            )

        n, w = len(self.weights) - 1, self.weights
        nets = [[x[c] * a for x, a in zip(self.profile, w, strict=True)] for c in (0, 1)] + [w]
        (z, r, h), (dz, dr, dh) = (
            [sums(net, n) for net in nets],
            [n * sums([b - a for a, b in pairwise(net)], n - 1) for net in nets],
        )
        return z / h, r / h, (dz - dh * z / h) / h, (dr - dh * r / h) / h

    def root(self, u, v, t, o, d):
        del u
        o, d = (mpmath.matrix([mpf(float(x)) for x in y]) for y in (o, d))
        for m, shift in self.back:
            o, d = mpmath.lu_solve(m, o - shift), mpmath.lu_solve(m, d)
        t, s = mpf(float(t)), mpf(float(v))
        for _ in range(60):
            away = o + t * d - self.origin
            along = sum(a * b for a, b in zip(away, self.axis, strict=True))
            rise = sum(a * b for a, b in zip(d, self.axis, strict=True))
            across = away - along * self.axis
            rho = mpmath.norm(across)
            rate = sum(a * b for a, b in zip(across, d - rise * self.axis, strict=True)) / rho
            z, r, dz, dr = self.radius(s)
            ds, dt = mpmath.lu_solve(
                mpmath.matrix([[dz, -rise], [dr, -rate]]), mpmath.matrix([z - along, r - rho])
            )
            s, t = s - ds, t - dt
            if abs(dt) < mpf(10) ** -25 * (1 + abs(t)):
                return t
        raise AssertionError("Newton's iteration does not end")


@pytest.mark.parametrize("gap", [9e-13, 1e-14, 2.0**-53])
@pytest.mark.parametrize("is_rational", [False, True], ids=["plain", "rational"])
@pytest.mark.parametrize("at", ["inside", "first", "last"])
def test_knots_that_are_nearly_equal(gap, is_rational, at):
    """Without the short span the surface moves by gap times its slopes: bounds say so."""
    rng = np.random.default_rng(29)
    knots = {
        "inside": [0, 0, 0, 0.5, 0.5 + gap, 1, 1, 1],
        "first": [-2, -1, 0, gap, 0.6, 1, 1, 1],
        "last": [0, 0, 0, 0.4, 1 - gap, 1, 2, 3],
    }[at]
    net = net_of(rng, 10.0, 5, 4)
    weights = rng.uniform(0.5, 2.0, (5, 4)) if is_rational else None
    args = net, knots, [0, 0, 0, 0, 1, 1, 1, 1], (2, 3), weights
    surface = NurbsSurface(*args)
    assert len(surface) == 2
    hold(surface, Given(*args), rng, 12, tight=1e5)
    # Beside the crease, where all of it counts.
    u = 0.5 + np.array([-1e-9, -1e-12, 1e-12, 1e-9])
    target, d = surface.point(u, np.full(4, 0.4)), rng.normal(size=(4, 3))
    hits = Intersector(surface, coarse="none", threads=1).intersect(target - d, d)
    for i in np.flatnonzero(hits.status == 1):
        true = Given(*args).root(hits.u[i], hits.v[i], hits.t[i], target[i] - d[i], d[i])
        assert abs(true - mpf(float(hits.t[i]))) <= mpf(float(hits.t_bound[i]))


@pytest.mark.parametrize("far", OFFSETS)
@pytest.mark.parametrize("weights", [None, [1.0, 0.4, 1.7]], ids=["plain", "rational"])
@pytest.mark.parametrize("is_moved", [False, True], ids=["given", "transformed"])
def test_extrusion(far, weights, is_moved):
    rng = np.random.default_rng(11)
    profile = np.array([(0.1, 0, 0), (1.3, 0.9, 0.2), (2.2, 0.3, 0.6)]) + far * np.array(
        [1, -0.4, 0.7]
    )
    direction = np.array([0.1, 0.2, 1.7])
    surface = Extrusion(profile, direction, weights)
    matrices = [moved(far), moved(-0.4 * far)] if is_moved else []
    for matrix in matrices:
        surface = surface.transformed(matrix)
    # The end of the direction, to all digits: a matrix that moves the profile by it.
    given = Given(
        np.stack([profile, profile], 1),
        ENDS[2],
        ENDS[1],
        (2, 1),
        None if weights is None else np.column_stack([weights, weights]),
    )
    for row in given.rows:
        row[1][:3] = [
            x + row[1][3] * mpf(float(d)) for x, d in zip(row[1][:3], direction, strict=True)
        ]
    given.rows = [[transformed(point, matrices) for point in row] for row in given.rows]
    hold(surface, given, rng)


def transformed(point, matrices):
    """The image of a homogeneous point."""
    for matrix in matrices:
        m = [[mpf(float(x)) for x in row] for row in matrix]
        point = [sum(a * x for a, x in zip(row, point, strict=True)) for row in m]
    return point


@pytest.mark.parametrize("far", OFFSETS)
def test_images_of_patches_sheets_and_trimmed_ones(far):
    rng = np.random.default_rng(13)
    net = rng.uniform(0, 0.4, (4, 3, 3))
    net[..., 0] += np.arange(4)[:, None]
    net[..., 1] += np.arange(3)
    matrices = [moved(far), moved(-0.4 * far)]
    given = Given(net, ENDS[3], ENDS[2], (3, 2), None, matrices)
    patches = BezierPatches([net])
    square = [
        polygon([(0, 0), (1, 0), (1, 1), (0, 1)]),
        polygon([(0.4, 0.4), (0.6, 0.4), (0.5, 0.6)]),
    ]
    for surface in (patches, PatchSheet(patches, [(0, 1, 0, 1)]), TrimmedSurface(patches, square)):
        image = surface.transformed(matrices[0]).transformed(matrices[1])
        hold(pickle.loads(pickle.dumps(image)), given, rng, 12)
        # Swapped u and v, the same points.
        again = image.flipped().flipped()
        assert again.point(0.3, 0.2).tolist() == image.point(0.3, 0.2).tolist()
        hold(again, given, rng, 8)


@pytest.mark.parametrize("far", OFFSETS)
def test_polynomials(far):
    # z = far + y^2 / 7 + x / 3 - x y over a rectangle, whose sides follow u and v linearly.
    rng = np.random.default_rng(17)
    c = np.array([[far, 0.0, 1 / 7], [1 / 3, -1.0, 0.0]])
    surface = BezierPatches.from_polynomial(c, (0.1, 1.4), (-0.3, 1.1))
    o, d = rays_at(surface, 25, rng)
    hits = Intersector(surface, coarse="none", threads=1).intersect(o, d)
    c = [[mpf(float(x)) for x in row] for row in c]
    for i in np.flatnonzero(hits.status == 1):
        (ox, oy, oz), (dx, dy, dz) = ([mpf(float(x)) for x in y[i]] for y in (o, d))

        def gap(t, ox=ox, oy=oy, oz=oz, dx=dx, dy=dy, dz=dz):
            x, y = ox + t * dx, oy + t * dy
            return sum(c[j][k] * x**j * y**k for j in range(2) for k in range(3)) - oz - t * dz

        # At 40 digits, beside a hit that is right to 9.
        true = mpmath.findroot(
            gap, (mpf(float(hits.t[i])), mpf(float(hits.t[i])) + mpf(10) ** -9), tol=1e-50
        )
        assert abs(true - mpf(float(hits.t[i]))) <= mpf(float(hits.t_bound[i]))


VASE = [(0.0, 0.4), (0.5, 1.6), (1.2, 0.3), (2.0, 0.8)]
HEAVY = [1.0, 0.3, 2.0, 0.7]
AXES = {"z": (0, 0, 1), "oblique": (1, -2, 3.3)}


@pytest.mark.parametrize("far", OFFSETS)
@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
@pytest.mark.parametrize("weights", [None, HEAVY], ids=["plain", "rational"])
@pytest.mark.parametrize("is_moved", [False, True], ids=["given", "transformed"])
@pytest.mark.parametrize("along", [0.0, 1e4], ids=["here", "far along the axis"])
def test_turned(far, axis, weights, is_moved, along):
    rng = np.random.default_rng(7)
    profile = [(z + along, r) for z, r in VASE]
    origin = far * np.array([0.3, -0.7, 1.0])
    matrices = [rotated(far), rotated(-0.4 * far)] if is_moved else []
    surface = SurfaceOfRevolution(profile, origin, axis, weights=weights)
    for matrix in matrices:
        surface = surface.transformed(matrix)
    # Far along the axis the scale of the image, or points that count as rounded, take their part.
    tight = 120.0 if along == 0.0 or not (is_moved or weights) else 1e6
    hold(surface, GivenTurned(profile, weights, origin, axis, matrices), rng, 15, tight)


@pytest.mark.parametrize("far", OFFSETS)
def test_cylinders_and_cones(far):
    rng = np.random.default_rng(19)
    origin, axis = far * np.array([0.3, -0.7, 1.0]), (1, -2, 3.3)
    for surface, top in (
        (Cylinder(origin, axis, 0.7, 1.3), 0.7),
        (Cone(origin, axis, 0.7, 1.3, 0.2), 0.2),
    ):
        matrices = [rotated(far), rotated(-0.4 * far)]
        profile = [(0.0, 0.7), (1.3, top)]
        hold(surface, GivenTurned(profile, None, origin, axis), rng, 10)
        image = pickle.loads(pickle.dumps(surface.transformed(matrices[0]))).transformed(
            matrices[1]
        )
        hold(image, GivenTurned(profile, None, origin, axis, matrices), rng, 10, 120.0)


# Center, radius, begin and end in turns: rings and shallow lenses; far along the axis, and far from it.
ARCS = [
    ((0, 2), 0.7, 1, 0), ((0.3, 2), 0.71, 0.03, 0.4), ((1e4, 2), 0.7, 0.9, 0.1),
    ((100, 0), 100, 0.5, 0.49), ((-1e5, 0), 1e5, 0, 1e-5), ((0.1, 1e3), 0.7, 1, 0),
]  # fmt: skip


@pytest.mark.parametrize("arc", ARCS, ids=str)
def test_circular_arcs_are_circles(arc):
    (z0, r0), radius, _, _ = arc
    segments, weights = circular_arc(*arc)
    surface = SurfaceOfRevolution(segments, (0, 0, 0), (0, 0, 1), weights=weights)
    rng = np.random.default_rng(23)
    o, d = rays_at(surface, 0, rng)
    u, v = rng.uniform(0.05, 0.95, (2, 40))
    target = surface.point(u, v, rng.integers(len(surface), size=40))
    d = rng.normal(size=(40, 3))
    o = target - d * np.ptp(surface.bounds, axis=0).max()
    hits = Intersector(surface, coarse="none", threads=1).intersect(o, d)
    assert hits.hit.sum() > 20
    z0, r0, radius = (mpf(float(x)) for x in (z0, r0, radius))
    for i in np.flatnonzero(hits.status == 1):
        ray = [[mpf(float(x)) for x in y[i]] for y in (o, d)]

        def gap(t, ray=ray):
            x, y, z = (a + t * b for a, b in zip(*ray, strict=True))
            # Of a circle about the axis, without the root: else rounding at its center is all there is.
            return (mpmath.sqrt(x * x + y * y) - r0) ** 2 + (z - z0) ** 2 - radius**2

        t, bound = mpf(float(hits.t[i])), mpf(float(hits.t_bound[i]))
        # A change of sign within the bound; flat crossings of the same circle come in pairs.
        slope = abs(mpmath.diff(gap, t))
        assert gap(t - bound) * gap(t + bound) <= 0 or abs(gap(t)) <= bound * slope
