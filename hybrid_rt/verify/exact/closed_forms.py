"""All crossings of a ray with spheres, planes, parallelograms, boxes and triangles, in fractions.

Each surface is what its object holds: centre and radius; a point and the unit normal, floats taken
for exact; corner and edges; two corners; vertices. Only the square root of a sphere's discriminant
is a ball; its sign is that of a fraction.
"""

from __future__ import annotations

import math
from typing import Any

import flint
import numpy as np

from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.verify.exact.crossings import (
    ALONG,
    POINT,
    Crosser,
    Crossing,
    Rational,
    RationalVector,
    bits,
    cross,
    dot,
    is_narrow,
    norm,
    precisions,
    rational,
    rationals,
)

# Triangles farther from the ray than this part of everything's extent are not looked at.
CLEAR = 1e-9


def sphere_crosser(surface: Sphere) -> Crosser:
    """Return a function that finds both crossings of a ray with a sphere."""
    center, radius = rationals(surface.center), rational(surface.radius)

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        w = [x - c for x, c in zip(o, center, strict=True)]
        a, b, c = dot(d, d), dot(d, w), dot(w, w) - radius * radius
        square = b * b - a * c
        if square < 0:
            return []
        scale = (norm([float(x) for x in w]) + float(radius)) / norm([float(x) for x in d])
        cosine = math.sqrt(float(square / (a * radius * radius)))
        if square == 0:
            return [Crossing(flint.arb(-b / a), 0, 0.0, 0.0, 0.0, to_edge=math.inf)]
        for number in precisions():
            with bits(number):
                root = flint.arb(square).sqrt()
                ts = [(-b - root) / a, (-b + root) / a]
            if all(is_narrow(t, scale) for t in ts):
                return [Crossing(t, 0, 0.0, 0.0, cosine, to_edge=math.inf) for t in ts]
        raise ArithmeticError("t that cannot be narrowed")

    return crossings


def plane_crosser(surface: Plane) -> Crosser:
    """Return a function that finds the crossing of a ray with a plane."""
    at, normal = rationals(surface.origin), rationals(surface.unit_normal)

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        slope = dot(normal, d)
        gap = dot(normal, [p - x for p, x in zip(at, o, strict=True)])
        if slope == 0:
            if gap != 0:
                return []
            return [Crossing(-flint.arb("inf"), 0, 0.0, 0.0, 0.0, ALONG, flint.arb("inf"))]
        t = _ball(gap / slope)
        return [Crossing(t, 0, 0.0, 0.0, _cosine(normal, d), to_edge=math.inf)]

    return crossings


def rectangle_crosser(surface: Rectangle) -> Crosser:
    """Return a function that finds the crossing of a ray with a parallelogram."""
    face = _Face(0, surface.corner, surface.edge_u, surface.edge_v, False)
    return face.crossings


def box_crosser(surface: Box) -> Crosser:
    """Return a function that finds all crossings of a ray with the faces of a box."""
    lo, hi = np.asarray(surface.lo), np.asarray(surface.hi)
    faces = []
    for axis in range(3):
        for upper in range(2):
            # Corner and edges would be rounded: the face is given by what it is between.
            faces.append(_BoxFace(2 * axis + upper, axis, lo, hi))

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        return [found for face in faces for found in face.crossings(o, d)]

    return crossings


def mesh_crosser(surface: TriangleMesh) -> Crosser:
    """Return a function that finds all crossings with triangles, on shared edges one for each."""
    corners = surface.vertices[surface.faces]
    faces: dict[int, _Face] = {}
    extent = float(np.abs(corners).max())

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        near = _near(corners, np.array([float(x) for x in o]), [float(x) for x in d], extent)
        found = []
        for k in near.tolist():
            if k not in faces:
                faces[k] = _Face(k, *_triangle(corners[k]), True)
            found += faces[k].crossings(o, d)
        return found

    return crossings


def _near(corners: Any, o: Any, d: list[float], extent: float) -> Any:
    """Return the triangles whose hull the ray may meet, by float64 far beyond rounding."""
    k = int(np.abs(d).argmax())
    i, j = (k + 1) % 3, (k + 2) % 3
    away = corners - o
    margin = CLEAR * (extent + float(np.abs(o).max())) * abs(d[k])
    is_near = np.ones(len(corners), np.bool_)
    for c in (i, j):
        f = d[k] * away[:, :, c] - d[c] * away[:, :, k]
        is_near &= (f.min(axis=1) <= margin) & (f.max(axis=1) >= -margin)
    return np.flatnonzero(is_near)


def _triangle(corners: Any) -> tuple[Any, Any, Any]:
    a, b, c = (rationals(corner) for corner in corners)
    return a, [x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)]


class _Face:
    """A parallelogram, or the half of it that is a triangle."""

    def __init__(self, number: int, corner: Any, edge_u: Any, edge_v: Any, half: bool) -> None:
        self.number, self.half = number, half
        self.corner, self.edge_u, self.edge_v = (_exact(x) for x in (corner, edge_u, edge_v))
        self.normal = cross(self.edge_u, self.edge_v)

    def crossings(self, o: RationalVector, d: RationalVector) -> list[Crossing]:
        if all(x == 0 for x in self.normal):
            return []
        away = [x - c for x, c in zip(o, self.corner, strict=True)]
        slope = dot(self.normal, d)
        if slope == 0:
            return self._within(away, d)
        # away + t d = u edge_u + v edge_v, by Cramer's rule.
        t = -dot(self.normal, away) / slope
        turned = cross(away, d)
        u, v = dot(turned, self.edge_v) / -slope, dot(turned, self.edge_u) / slope
        sides = self._sides(u, v)
        if any(side < 0 for side in sides):
            return []
        to_edge = self._to_edge(sides, slope, d)
        cosine = _cosine(self.normal, d)
        return [Crossing(_ball(t), self.number, float(u), float(v), cosine, to_edge=to_edge)]

    def _sides(self, u: Rational, v: Rational) -> list[Rational]:
        """Return what is not negative inside."""
        return [u, v, 1 - u - v] if self.half else [u, v, 1 - u, 1 - v]

    def _to_edge(self, sides: list[Rational], slope: Rational, d: RationalVector) -> float:
        edges = [self.edge_v, self.edge_u]
        if self.half:
            edges.append([a - b for a, b in zip(self.edge_v, self.edge_u, strict=True)])
        else:
            edges += edges
        least = math.inf
        for side, edge in zip(sides, edges, strict=True):
            across = norm([float(x) for x in cross(edge, d)])
            least = min(least, abs(float(side * slope)) / across if across > 0.0 else 0.0)
        return least

    def _within(self, away: RationalVector, d: RationalVector) -> list[Crossing]:
        """Return the stretch of a ray in the plane of the face."""
        if dot(self.normal, away) != 0:
            return []
        square = dot(self.normal, self.normal)

        def place(p: RationalVector) -> tuple[Rational, Rational]:
            return (
                dot(cross(p, self.edge_v), self.normal) / square,
                -dot(cross(p, self.edge_u), self.normal) / square,
            )

        (u0, v0), (u1, v1) = place(away), place(d)
        low = high = None
        starts, slopes = self._sides(u0, v0), self._sides(u1, v1)
        if self.half:
            slopes[2] -= 1
        else:
            slopes[2] -= 1
            slopes[3] -= 1
        for start, slope in zip(starts, slopes, strict=True):
            if slope == 0:
                if start < 0:
                    return []
                continue
            t = -start / slope
            if slope > 0:
                low = t if low is None or t > low else low
            else:
                high = t if high is None or t < high else high
        if low is None or high is None or low > high:
            return []
        u, v = u0 + low * u1, v0 + low * v1
        kind = POINT if low == high else ALONG
        return [
            Crossing(
                _ball(low), self.number, float(u), float(v), 0.0, kind,
                None if kind == POINT else _ball(high),
            )
        ]  # fmt: skip


class _BoxFace:
    """One face of a box along the axes."""

    def __init__(self, number: int, axis: int, lo: Any, hi: Any) -> None:
        self.number, self.axis = number, axis
        self.lo, self.hi = rationals(lo), rationals(hi)
        self.at = (self.hi if number % 2 else self.lo)[axis]

    def crossings(self, o: RationalVector, d: RationalVector) -> list[Crossing]:
        gap = self.at - o[self.axis]
        others = [c for c in range(3) if c != self.axis]
        if d[self.axis] == 0:
            return [] if gap != 0 else self._within(o, d, others)
        t = gap / d[self.axis]
        to_edge = math.inf
        for c in others:
            p = o[c] + t * d[c]
            if not self.lo[c] <= p <= self.hi[c]:
                return []
            # The edge runs along the third axis; the ray is moved across both.
            share = abs(float(d[self.axis])) / math.hypot(float(d[self.axis]), float(d[c]))
            to_edge = min(to_edge, float(min(p - self.lo[c], self.hi[c] - p)) * share)
        cosine = abs(float(d[self.axis])) / norm([float(x) for x in d])
        return [Crossing(_ball(t), self.number, 0.0, 0.0, cosine, to_edge=to_edge)]

    def _within(self, o: RationalVector, d: RationalVector, others: list[int]) -> list[Crossing]:
        low = high = None
        for c in others:
            if d[c] == 0:
                if not self.lo[c] <= o[c] <= self.hi[c]:
                    return []
                continue
            a, b = sorted([(self.lo[c] - o[c]) / d[c], (self.hi[c] - o[c]) / d[c]])
            low = a if low is None or a > low else low
            high = b if high is None or b < high else high
        if low is None or high is None or low > high:
            return []
        return [Crossing(_ball(low), self.number, 0.0, 0.0, 0.0, ALONG, _ball(high))]


def _exact(values: Any) -> list[Rational]:
    return [x if isinstance(x, flint.fmpq) else rational(x) for x in values]


def _ball(x: Rational) -> Any:
    with bits(512):
        return flint.arb(x)


def _cosine(normal: RationalVector, d: RationalVector) -> float:
    square = dot(normal, normal) * dot(d, d)
    with bits(128):
        return float(abs(flint.arb(dot(normal, d))) / flint.arb(square).sqrt())
