"""Flat faces in fractions: parallelograms and triangles."""

from __future__ import annotations

import math
from typing import Any

import flint

from proof.exact.crossings import (
    ALONG,
    POINT,
    Crossing,
    Rational,
    RationalVector,
    ball_of,
    cosine_of,
    cross,
    dot,
    norm,
)


class Face:
    """A parallelogram, or the half of it that is a triangle."""

    def __init__(self, number: int, corner: Any, edge_u: Any, edge_v: Any, half: bool) -> None:
        self.number, self.half = number, half
        self.corner, self.edge_u, self.edge_v = (
            [flint.fmpq(x.numerator, x.denominator) for x in vector]
            for vector in (corner, edge_u, edge_v)
        )
        self.normal = cross(self.edge_u, self.edge_v)

    def crossings(self, o: RationalVector, d: RationalVector) -> list[Crossing]:
        """Return the crossing, or the stretch within the face."""
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
        cosine = cosine_of(self.normal, d)
        return [Crossing(ball_of(t), self.number, float(u), float(v), cosine, to_edge=to_edge)]

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
        # Sides of u and v end at 1, which has no slope.
        slopes[2:] = [slope - 1 for slope in slopes[2:]]
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
                ball_of(low), self.number, float(u), float(v), 0.0, kind,
                None if kind == POINT else ball_of(high),
            )
        ]  # fmt: skip
