"""The t of hits to 60 digits (needs mpmath): what proven bounds of t are judged by.

A hit is where Newton's method starts; it ends at the root of the surface's own definition, floats
taken for what they are. Nothing of the tracer or the oracle is used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import comb
from typing import Any

import mpmath
import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from meshing import BezierPatches, SurfaceOfRevolution

DIGITS = 60
# Newton's steps double the digits, from 16 or, where a ray nearly touches, from 8 or fewer; at a
# pole, where the radius is a double root, each gains a bit.
MOST_STEPS = 300
# A pole itself has no first derivative to go by: this far beside it along the profile there is one.
ASIDE = mpmath.mpf(2) ** -40
# A last step below this part of the root leaves fewer than its square.
SMALL = mpmath.mpf(10) ** -40

# Numbers of mpmath, which has no types.
Number = Any
Vector = list[Any]
# The t of the root near a hit: from patch, v, u, t, origin and direction.
Solver = Callable[[int, float, float, float, Vector, Vector], Number]


def exact_t(
    surfaces: Sequence[Any], hits: HitRecord, origins: FloatArray, directions: FloatArray
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
            solvers[number](int(patch), float(u), float(v), float(t), _exact(o), _exact(d))
            for number, patch, u, v, t, o, d in rows
        ]


def excess(t: FloatArray, exact: Sequence[Number]) -> FloatArray:
    """Return |t - exact t|, (n,) float64, rounded once only."""
    with mpmath.workdps(DIGITS):
        gaps = [abs(mpmath.mpf(float(a)) - b) for a, b in zip(t, exact, strict=True)]
        return np.array([float(gap) for gap in gaps])


def _exact(values: Sequence[float] | FloatArray) -> Vector:
    return [mpmath.mpf(float(x)) for x in values]


def _solver(surface: Any) -> Solver:
    if isinstance(surface, BezierPatches):
        return _patch_solver(surface)
    if isinstance(surface, SurfaceOfRevolution):
        return _revolution_solver(surface)
    if isinstance(surface, Sphere):
        return _sphere_solver(surface)
    if isinstance(surface, Plane):
        at, normal = _exact(surface.origin), _exact(surface.unit_normal)
        return lambda _patch, _u, _v, _t, o, d: _on_plane(at, normal, o, d)
    if isinstance(surface, Rectangle):
        at, normal = _exact(surface.corner), _cross(_exact(surface.edge_u), _exact(surface.edge_v))
        return lambda _patch, _u, _v, _t, o, d: _on_plane(at, normal, o, d)
    if isinstance(surface, Box):
        return _box_solver(surface)
    if isinstance(surface, TriangleMesh):
        return _mesh_solver(surface)
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )


def _patch_solver(surface: BezierPatches) -> Solver:
    nets = [[[_exact(point) for point in row] for row in net] for net in surface.patches]

    def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        net, x = nets[patch], _exact((u, v, t))
        for _ in range(MOST_STEPS):
            rows = [_curve(row, x[1]) for row in net]
            point, along_u = _curve([row[0] for row in rows], x[0])
            along_v, _ = _curve([row[1] for row in rows], x[0])
            gap = [p - a - x[2] * b for p, a, b in zip(point, o, d, strict=True)]
            step = _solved([along_u, along_v, [-b for b in d]], gap)
            if step is None:
                break
            x = [a - b for a, b in zip(x, step, strict=True)]
            if abs(step[2]) <= SMALL * abs(x[2]) and max(abs(step[0]), abs(step[1])) <= SMALL:
                return x[2]
        return mpmath.nan

    return solve


def _revolution_solver(surface: SurfaceOfRevolution) -> Solver:
    origin = _exact(surface.origin)
    frame = [_exact(v) for v in (surface.axis, surface.radial, surface.binormal)]
    profiles = [[_exact(point) for point in segment] for segment in surface.segments]

    def solve(patch: int, _u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
        start = _solved(frame, [a - b for a, b in zip(o, origin, strict=True)])
        way = _solved(frame, d)
        assert start is not None
        assert way is not None
        x = _exact((v, t))
        for _ in range(MOST_STEPS):
            (z, r), (dz, dr) = _curve(profiles[patch], x[0])
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


def _sphere_solver(surface: Sphere) -> Solver:
    center, radius = _exact(surface.center), mpmath.mpf(float(surface.radius))

    def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
        w = [a - b for a, b in zip(o, center, strict=True)]
        a, b, c = _dot(d, d), _dot(d, w), _dot(w, w) - radius * radius
        square = b * b - a * c
        if square < 0:
            return mpmath.nan
        roots = [(-b + sign * mpmath.sqrt(square)) / a for sign in (-1, 1)]
        return min(roots, key=lambda root: abs(root - t))

    return solve


def _box_solver(surface: Box) -> Solver:
    sides = [_exact(surface.lo), _exact(surface.hi)]

    def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
        axis, upper = divmod(patch, 2)
        return (sides[upper][axis] - o[axis]) / d[axis] if d[axis] != 0 else mpmath.nan

    return solve


def _mesh_solver(surface: TriangleMesh) -> Solver:
    def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
        a, b, c = (_exact(corner) for corner in surface.vertices[surface.faces[patch]])
        sides = [[x - y for x, y in zip(corner, a, strict=True)] for corner in (b, c)]
        return _on_plane(a, _cross(*sides), o, d)

    return solve


def _on_plane(at: Vector, normal: Vector, o: Vector, d: Vector) -> Number:
    slope = _dot(normal, d)
    gap = [a - b for a, b in zip(at, o, strict=True)]
    return _dot(normal, gap) / slope if slope != 0 else mpmath.nan


def _curve(points: list[Vector], x: Number) -> tuple[Vector, Vector]:
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
    point = [_dot(weights, column) for column in columns]
    steps = [[b - a for a, b in pairwise(column)] for column in columns]
    return point, [_dot(slopes, step) for step in steps]


def _dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    return mpmath.fdot(a, b)


def _cross(a: Vector, b: Vector) -> Vector:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def _solved(columns: list[Vector], right: Vector) -> Vector | None:
    """Solve three equations by Cramer's rule; None if the columns lie in a plane."""
    a, b, c = columns
    across = _cross(b, c)
    determinant = _dot(a, across)
    if determinant == 0:
        return None
    return [
        _dot(right, across) / determinant,
        _dot(a, _cross(right, c)) / determinant,
        _dot(a, _cross(b, right)) / determinant,
    ]
