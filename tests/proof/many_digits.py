"""The t of hits to 60 digits, by mpmath: an independent sample of the bounds on t.

Newton iteration starts at the hit and ends at the root of the surface's own definition, with floats
taken as exact. No code of the tracer or of the judges is used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import singledispatch
from itertools import pairwise
from math import comb
from typing import Any, TypeAlias

import mpmath
import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.box import TurnedBox
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from meshing.bezier import RationalPatches
from meshing.sheet import PatchSheet
from meshing.spans import within_patch
from meshing.surface import Surface

# Numbers of mpmath, which has no types.
Number: TypeAlias = Any
Vector: TypeAlias = list[Any]
Solver: TypeAlias = Callable[[int, float, float, float, Vector, Vector], Number]
"""The t of the root near a hit: from patch, u, v, t, origin and direction."""

DIGITS = 60
# Newton's steps double the digits, from 16 or, where a ray nearly touches, from 8 or fewer; at a
# pole, where the radius is a double root, each gains a bit.
MOST_STEPS = 300
# A pole itself has no first derivative to go by: this far beside it along the profile there is one.
ASIDE = mpmath.mpf(2) ** -40
# A last step below this part of the root leaves fewer than its square.
SMALL = mpmath.mpf(10) ** -40


def numbers(values: Sequence[float] | FloatArray) -> Vector:
    """Convert floats exactly to multiple-precision numbers."""
    return [mpmath.mpf(float(x)) for x in values]


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """Return the dot product."""
    return mpmath.fdot(a, b)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def solved(columns: list[Vector], right: Vector) -> Vector | None:
    """Solve three equations by Cramer's rule; None if the columns lie in a plane."""
    a, b, c = columns
    across = cross(b, c)
    determinant = dot(a, across)
    if determinant == 0:
        return None
    return [
        dot(right, across) / determinant,
        dot(a, cross(right, c)) / determinant,
        dot(a, cross(b, right)) / determinant,
    ]


def on_plane(at: Vector, normal: Vector, o: Vector, d: Vector) -> Number:
    """Return the t at which a ray meets a plane; nan if it never does."""
    slope = dot(normal, d)
    gap = [a - b for a, b in zip(at, o, strict=True)]
    return dot(normal, gap) / slope if slope != 0 else mpmath.nan


def curve(points: list[Vector], x: Number) -> tuple[Vector, Vector]:
    """Return point and derivative of a Bezier curve, each coordinate for itself."""
    n = len(points) - 1
    y = 1 - x
    powers_x, powers_y = [mpmath.mpf(1)], [mpmath.mpf(1)]
    for _ in range(n):
        powers_x.append(powers_x[-1] * x)
        powers_y.append(powers_y[-1] * y)
    weights = [comb(n, k) * powers_x[k] * powers_y[n - k] for k in range(n + 1)]
    slopes = [n * comb(n - 1, k) * powers_x[k] * powers_y[n - 1 - k] for k in range(n)]
    columns = list(zip(*points, strict=True))
    point = [dot(weights, column) for column in columns]
    steps = [[b - a for a, b in pairwise(column)] for column in columns]
    return point, [dot(slopes, step) for step in steps]


def exact_t(
    surfaces: Sequence[Surface], hits: HitRecord, origins: FloatArray, directions: FloatArray
) -> list[Number]:
    """Return the t of the roots at which some hits are, to 60 digits; nan if Newton finds none.

    Parameters
    ----------
    surfaces : sequence of surfaces
    hits : HitRecord of n rows, none of them a miss
    origins, directions : (n, 3) float64
    """
    with mpmath.workdps(DIGITS):
        solvers = [_solver(surface) for surface in surfaces]
        rows = zip(
            hits.object_id, hits.patch_id, hits.u, hits.v, hits.t, origins, directions, strict=True
        )
        return [
            solvers[number](int(patch), float(u), float(v), float(t), numbers(o), numbers(d))
            for number, patch, u, v, t, o, d in rows
        ]


def excess(t: FloatArray, exact: Sequence[Number]) -> FloatArray:
    """Return |t - exact t|, (n,) float64, rounded once only."""
    with mpmath.workdps(DIGITS):
        gaps = [abs(mpmath.mpf(float(a)) - b) for a, b in zip(t, exact, strict=True)]
        return np.array([float(gap) for gap in gaps])


@singledispatch
def _solver(surface: Any) -> Solver:
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )


@_solver.register
def _sphere(surface: Sphere) -> Solver:
    """Return a function that solves the quadratic to many digits."""
    center, radius = numbers(surface.center), mpmath.mpf(float(surface.radius))

    def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
        w = [a - b for a, b in zip(o, center, strict=True)]
        a, b, c = dot(d, d), dot(d, w), dot(w, w) - radius * radius
        square = b * b - a * c
        if square < 0:
            return mpmath.nan
        roots = [(-b + sign * mpmath.sqrt(square)) / a for sign in (-1, 1)]
        return min(roots, key=lambda root: abs(root - t))

    return solve


@_solver.register
def _plane(surface: Plane) -> Solver:
    """Return a function that meets the plane to many digits."""
    at, normal = numbers(surface.origin), numbers(surface.exact_normal)
    return lambda _patch, _u, _v, _t, o, d: on_plane(at, normal, o, d)


@_solver.register
def _rectangle(surface: Rectangle) -> Solver:
    """Return a function that meets the face's plane to many digits."""
    edges = numbers(surface.edge_u), numbers(surface.edge_v)
    at, normal = numbers(surface.corner), cross(*edges)
    return lambda _patch, _u, _v, _t, o, d: on_plane(at, normal, o, d)


@_solver.register
def _box(surface: Box) -> Solver:
    """Return a function that meets a face's plane to many digits."""
    sides = [numbers(surface.lo), numbers(surface.hi)]

    def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
        axis, upper = divmod(patch, 2)
        return (sides[upper][axis] - o[axis]) / d[axis] if d[axis] != 0 else mpmath.nan

    return solve


@_solver.register
def _turned_box(surface: TurnedBox) -> Solver:
    """Return a function that meets a face's plane to many digits."""
    corner = numbers(surface.lo)
    edges = [numbers(edge) for edge in surface.edges]
    ends = [[a + b for a, b in zip(corner, edge, strict=True)] for edge in edges]
    normals = [cross(edges[k - 2], edges[k - 1]) for k in range(3)]

    def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
        axis, upper = divmod(patch, 2)
        return on_plane(ends[axis] if upper else corner, normals[axis], o, d)

    return solve


@_solver.register
def _mesh(surface: TriangleMesh) -> Solver:
    """Return a function that meets a face's plane to many digits."""

    def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
        a, b, c = (numbers(corner) for corner in surface.vertices[surface.faces[patch]])
        sides = [[x - y for x, y in zip(corner, a, strict=True)] for corner in (b, c)]
        return on_plane(a, cross(*sides), o, d)

    return solve


@_solver.register
def _torus(surface: Torus) -> Solver:
    """Return Newton's method on the quartic."""
    center, axis = numbers(surface.origin), numbers(surface.axis)
    major, minor = numbers((surface.major_radius, surface.minor_radius))

    def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
        w = [a - b for a, b in zip(o, center, strict=True)]

        def at(x: Number) -> tuple[Number, Number]:
            point = [a + x * b for a, b in zip(w, d, strict=True)]
            height, climb = dot(point, axis), dot(d, axis)
            square, slope = dot(point, point), 2 * dot(point, d)
            whole = square + major**2 - minor**2
            f = whole**2 - 4 * major**2 * (square - height**2 / dot(axis, axis))
            f_t = 2 * whole * slope
            f_t -= 4 * major**2 * (slope - 2 * height * climb / dot(axis, axis))
            return f, f_t

        return _newton(at, t)

    return solve


@_solver.register
def _asphere(surface: Asphere) -> Solver:
    """Return Newton's method on the sag, to many digits."""
    center, axis = numbers(surface.origin), numbers(surface.axis)
    conic, coefficients = mpmath.mpf(surface.conic), numbers(surface.coefficients)
    c = mpmath.mpf(0) if math.isinf(surface.radius) else 1 / mpmath.mpf(surface.radius)
    length = mpmath.sqrt(dot(axis, axis))
    axis = [x / length for x in axis]

    def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
        away = [a - b for a, b in zip(o, center, strict=True)]

        def at(x: Number) -> tuple[Number, Number]:
            point = [a + x * b for a, b in zip(away, d, strict=True)]
            z, climb = dot(point, axis), dot(d, axis)
            w = dot(point, point) - z**2
            rate = 2 * (dot(point, d) - z * climb)
            root = mpmath.sqrt(1 - (1 + conic) * c**2 * w)
            f = z - c * w / (1 + root) - sum(a * w**k for k, a in enumerate(coefficients, 1))
            f_w = c / (2 * root) + sum(k * a * w ** (k - 1) for k, a in enumerate(coefficients, 1))
            # Beyond its end the conic goes nowhere.
            return f, climb - f_w * rate if mpmath.im(root) == 0 else 0

        return _newton(at, t)

    return solve


def _newton(at: Callable[[Number], tuple[Number, Number]], t: float) -> Number:
    """Return the root near t of a function that gives its value and slope; nan: there is none."""
    x = mpmath.mpf(t)
    for _ in range(MOST_STEPS):
        f, f_t = at(x)
        if f_t == 0:
            return x if f == 0 else mpmath.nan
        x -= f / f_t
        if abs(f) <= SMALL * abs(f_t * x):
            return x
    return mpmath.nan


@_solver.register
def _revolution(surface: SurfaceOfRevolution) -> Solver:
    """Return Newton's method for the height on the axis and the distance from it."""
    origin = numbers(surface.origin)
    frame = [numbers(v) for v in (surface.axis, surface.radial, surface.binormal)]
    profiles = [
        [
            numbers(point) if w is None else [x * w[k] for x in (*numbers(point), 1)]
            for k, point in enumerate(segment)
        ]
        for segment, given in zip(surface.segments, surface.weights, strict=True)
        for w in (None if given is None else numbers(given),)
    ]

    def solve(patch: int, _u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        start = solved(frame, [a - b for a, b in zip(o, origin, strict=True)])
        way = solved(frame, d)
        assert start is not None
        assert way is not None
        x = numbers((v, t))
        for _ in range(MOST_STEPS):
            (z, r), (dz, dr) = _quotient(*curve(profiles[patch], x[0]))
            a, b, c = (p + x[1] * q for p, q in zip(start, way, strict=True))
            # The height on the axis, and the square of the distance from it, of profile and ray.
            f, g = z - a, r * r - b * b - c * c
            f_t, g_t = -way[0], -2 * (b * way[1] + c * way[2])
            determinant = dz * g_t - f_t * 2 * r * dr
            if determinant == 0:
                x[0] += ASIDE
                continue
            step = [(f * g_t - f_t * g) / determinant, (dz * g - 2 * r * dr * f) / determinant]
            x = [x[0] - step[0], x[1] - step[1]]
            if abs(step[1]) <= SMALL * abs(x[1]) and abs(step[0]) <= SMALL:
                return x[1]
        return mpmath.nan

    return solve


@_solver.register
def _patches(surface: BezierPatches) -> Solver:
    """Return Newton's method for S(u, v) = o + t d."""
    nets = _nets(surface)

    def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        net, x = nets[patch], numbers((u, v, t))
        for _ in range(MOST_STEPS):
            rows = [curve(row, x[1]) for row in net]
            sums, by_u = curve([row[0] for row in rows], x[0])
            by_v, _ = curve([row[1] for row in rows], x[0])
            point, along_u, along_v = _partials(sums, by_u, by_v)
            gap = [p - a - x[2] * b for p, a, b in zip(point, o, d, strict=True)]
            step = solved([along_u, along_v, [-b for b in d]], gap)
            if step is None:
                break
            x = [a - b for a, b in zip(x, step, strict=True)]
            if abs(step[2]) <= SMALL * abs(x[2]) and max(abs(step[0]), abs(step[1])) <= SMALL:
                return x[2]
        return mpmath.nan

    return solve


def _nets(surface: BezierPatches) -> list[list[list[Vector]]]:
    """Return the control points of the patches row by row: of rational ones w P, and w."""
    nets = [
        [
            [
                [a + b for a, b in zip(numbers(point), numbers(left), strict=True)]
                for point, left in zip(row, of_row, strict=True)
            ]
            for row, of_row in zip(net, rest, strict=True)
        ]
        for net, rest in zip(surface.patches, surface.remainders, strict=True)
    ]
    if not isinstance(surface, RationalPatches):
        return nets
    return [
        [
            [
                [number * w for number in (*point, 1)]
                for point, w in zip(row, numbers(weights), strict=True)
            ]
            for row, weights in zip(net, of_patch, strict=True)
        ]
        for net, of_patch in zip(nets, surface.weights, strict=True)
    ]


def _partials(sums: Vector, by_u: Vector, by_v: Vector) -> tuple[Vector, Vector, Vector]:
    """Return point and partials, of which these are the sums (with weights, w last)."""
    if len(sums) == 3:
        return sums, by_u, by_v
    (*scaled, w), (*of_u, wu), (*of_v, wv) = sums, by_u, by_v
    point = [p / w for p in scaled]
    along_u = [(p - wu * s) / w for p, s in zip(of_u, point, strict=True)]
    along_v = [(p - wv * s) / w for p, s in zip(of_v, point, strict=True)]
    return point, along_u, along_v


@_solver.register
def _sheet(surface: PatchSheet) -> Solver:
    """Return the function of the patches, from (u, v) across the sheet."""
    inner = _solver(surface.pieces)

    def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        at = np.array([u]), np.array([v]), np.array([patch])
        a, b = within_patch(surface.spans, *at)
        return inner(patch, float(a[0]), float(b[0]), t, o, d)

    return solve


@_solver.register
def _trimmed(surface: TrimmedSurface) -> Solver:
    """Return the function of the whole surface."""
    inner, spans = _solver(surface.surface), surface.joined_spans

    def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        if spans is None:
            return inner(patch, u, v, t, o, d)
        a, b = within_patch(spans, np.array([u]), np.array([v]), np.array([patch]))
        return inner(patch, float(a[0]), float(b[0]), t, o, d)

    return solve


def _quotient(sums: Vector, slopes: Vector) -> tuple[Vector, Vector]:
    """Return Z and R, and their derivatives, of which these are the sums (with weights, w last)."""
    if len(sums) == 2:
        return sums, slopes
    (*scaled, w), (*of_scaled, dw) = sums, slopes
    point = [x / w for x in scaled]
    return point, [(x - dw * p) / w for x, p in zip(of_scaled, point, strict=True)]
