"""All crossings of a ray with a surface of revolution, by elimination in rational arithmetic.

The surface is S(u, s) = origin + Z(s) axis + R(s) (cos 2 pi u radial + sin 2 pi u binormal), 0 <=
s <= 1, with the four vectors as the object holds them: floats, taken for exact. They are orthonormal
only up to rounding, so the surface is the image of a true surface of revolution under a linear map
that differs from a rotation by roundings; that map is inverted exactly.

In coordinates (a, x, y) along the three vectors the ray is a straight line, and the surface is
a = Z(s), x^2 + y^2 = R(s)^2. Where a changes along the ray, t = (Z(s) - a0) / a1, and s is a root of

    f(s) = (a1 x0 + (Z(s) - a0) x1)^2 + (a1 y0 + (Z(s) - a0) y1)^2 - a1^2 R(s)^2,

a polynomial of degree 2n with rational coefficients. Of a rational profile Z = N / W, R = M / W all is
multiplied by W^2: the degree stays. Where only a part of the turn is there, crossings are dropped that lie
beyond the half-planes of its ends, which balls tell. Both halves of the ray, before and after the
axis, are roots of the same f. Where a does not change, s is a root of Z(s) = a0, and t then of a
quadratic. The method is independent of the tracer, which solves two equations in (s, t) by Newton
iteration and proves by intervals.
"""

from __future__ import annotations

import math
from typing import Any

import flint

from meshing import SurfaceOfRevolution
from proof.exact.crossings import (
    ALONG,
    OPEN,
    Ball,
    Crosser,
    Crossing,
    Polynomial,
    Rational,
    RationalVector,
    bernstein_form,
    bits,
    cross,
    dot,
    is_narrow,
    norm,
    precisions,
    rationals,
    roots_from_0_to_1,
    value,
)

# Directions around the axis in which a tip's normals are looked at.
AROUND_AXIS = 16
# Less than this a tip's least cosine says only that the ray passes it by.
LEAST_AT_AXIS = 1e-3


def revolution_crosser(surface: SurfaceOfRevolution) -> Crosser:
    """Return a function that finds all crossings of a ray with a surface of revolution."""
    origin = rationals(surface.origin)
    frame = [rationals(v) for v in (surface.axis, surface.radial, surface.binormal)]
    # Times the determinant, coordinates along the frame need no division: fractions stay dyadic.
    duals = [cross(frame[1], frame[2]), cross(frame[2], frame[0]), cross(frame[0], frame[1])]
    determinant = dot(frame[0], duals[0])
    segments = [
        _Segment(number, net, weights, determinant)
        for number, (net, weights) in enumerate(zip(surface.segments, surface.weights, strict=True))
        if net[:, 1].any()  # one on the axis has no area
    ]
    part = None if surface.is_whole_turn else _Part(*surface.u_range)
    vectors = [[float(x) for x in v] for v in (surface.axis, surface.radial, surface.binormal)]

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        away = [x - y for x, y in zip(o, origin, strict=True)]
        start = [dot(dual, away) for dual in duals]
        way = [dot(dual, d) for dual in duals]
        line = _Line(start, way, [float(x) for x in d], vectors, float(determinant), part)
        found = []
        for segment in segments:
            found += segment.crossings(line)
        return found

    return crossings


class _Part:
    """The part of a turn that a surface takes."""

    def __init__(self, begin: float, end: float) -> None:
        self.begin, self.share = begin, end - begin
        self._ends = rationals((begin, end))

    def to_end(self, x: Ball, y: Ball) -> float | None:
        """Return the distance of a point from the nearer end; None if it is beyond."""
        with bits(256):
            (ax, ay), (bx, by) = (
                ((2 * u).cos_pi(), (2 * u).sin_pi()) for u in map(flint.arb, self._ends)
            )
            from_begin, from_end = ax * y - ay * x, x * by - y * bx
            # Of half a turn or less a point is within if it is on the right side of both ends; of more
            # it is beyond if it is on the wrong side of both.
            if self.share <= 0.5:
                is_beyond = from_begin < 0 or from_end < 0
            else:
                is_beyond = from_begin < 0 and from_end < 0
            if is_beyond:
                return None
            rho = math.hypot(float(x.mid()), float(y.mid()))
            distances = [
                abs(float(side.mid())) if along > 0 else rho
                for side, along in ((from_begin, ax * x + ay * y), (from_end, bx * x + by * y))
            ]
            return min(distances)


class _Line:
    """A ray in coordinates along the frame, times its determinant."""

    def __init__(
        self,
        start: list[Rational],
        way: list[Rational],
        d: list[float],
        vectors: list[list[float]],
        determinant: float,
        part: _Part | None,
    ) -> None:
        self.part = part
        self.a0, self.x0, self.y0 = start
        self.a1, self.x1, self.y1 = way
        self.d, self.length = d, norm(d)
        self.vectors = vectors
        self.determinant = determinant
        # Within a half-plane of the axis a ray keeps its side of the ends of a part.
        self.is_meridional = self.a1 != 0 and self.x0 * self.y1 == self.y0 * self.x1
        # t to be known to a part of this: the way to the origin, in lengths of d.
        self.scale = (norm([float(x) for x in start]) / determinant + 1e-300) / self.length

    def quadratic(self) -> tuple[Rational, Rational, Rational]:
        """Return A, B, C of x^2 + y^2 = A t^2 + 2 B t + C."""
        return (
            self.x1**2 + self.y1**2,
            self.x0 * self.x1 + self.y0 * self.y1,
            self.x0**2 + self.y0**2,
        )


class _Segment:
    """One segment of the profile; positions and radii times the frame's determinant.

    They are ``z`` / ``w`` and ``r`` / ``w``; ``dz`` and ``dr`` are w^2 times their derivatives.
    """

    def __init__(self, number: int, net: Any, weights: Any, determinant: Rational) -> None:
        self.number = number
        w = rationals([1.0] * len(net) if weights is None else weights)
        z, r = ([a * b for a, b in zip(rationals(net[:, k]), w, strict=True)] for k in (0, 1))
        self.z, self.r = determinant * bernstein_form(z), determinant * bernstein_form(r)
        self.w = bernstein_form(w)
        rate = self.w.derivative()
        self.dz = self.z.derivative() * self.w - self.z * rate
        self.dr = self.r.derivative() * self.w - self.r * rate
        self.squares = self.r * self.r

    def crossings(self, line: _Line) -> list[Crossing]:
        found = self._of_whole_turn(line)
        return [one for one in found if one is not None]

    def _of_whole_turn(self, line: _Line) -> list[Crossing | None]:
        height = self.z - line.a0 * self.w
        if line.a1 != 0:
            x, y = (
                line.a1 * p * self.w + height * q
                for p, q in ((line.x0, line.x1), (line.y0, line.y1))
            )
            f = x * x + y * y - line.a1**2 * self.squares
            if f == 0:
                return [self._ruling(line, height)]
            return self._by_height(line, f, height)
        if height == 0:
            return self._within_disc(line)
        return self._across(line, height)

    def _by_height(self, line: _Line, f: Polynomial, height: Polynomial) -> list[Crossing | None]:
        for number in precisions():
            roots = roots_from_0_to_1(f, number)
            with bits(2 * number):
                ts = [value(height, s) / (line.a1 * value(self.w, s)) for s in roots]
                if all(is_narrow(t, line.scale) for t in ts):
                    return [self._point(line, s, t) for s, t in zip(roots, ts, strict=True)]
        raise ArithmeticError("t that cannot be narrowed")

    def _across(self, line: _Line, height: Polynomial) -> list[Crossing | None]:
        """Solve Z(s) = a0 for s, then the quadratic for t."""
        a, b, c = line.quadratic()
        square = (b * b - a * c) * self.w * self.w + a * self.squares
        once = height // height.gcd(height.derivative())
        touching = once.gcd(square)
        found = []
        for s in roots_from_0_to_1(touching, precisions().__next__()):
            found.append(self._point(line, s, flint.arb(-b / a)))
        for number in precisions():
            roots = roots_from_0_to_1(once // touching, number)
            with bits(2 * number):
                squares = [value(square, s) for s in roots]
                if any(x.contains(0) for x in squares):
                    continue
                pairs = [
                    (s, (-b + sign * x.sqrt() / value(self.w, s)) / a)
                    for s, x in zip(roots, squares, strict=True)
                    if x > 0
                    for sign in (-1, 1)
                ]
                if all(is_narrow(t, line.scale) for _, t in pairs):
                    return found + [self._point(line, s, t) for s, t in pairs]
        raise ArithmeticError("t that cannot be narrowed")

    def _ruling(self, line: _Line, height: Polynomial) -> Crossing | None:
        """Return the stretch of a ray that lies in the surface."""
        ends = [
            (value(height, s) / (line.a1 * value(self.w, s)), s)
            for s in [flint.arb(0), flint.arb(1), *_turns(self.dz)]
        ]
        ends.sort(key=lambda end: float(end[0].mid()))
        (t, s), (t_end, _) = ends[0], ends[-1]
        return self._point(line, s, t, ALONG, t_end)

    def _within_disc(self, line: _Line) -> list[Crossing | None]:
        """Return the stretches of a ray in the plane of a flat segment."""
        a, b, c = line.quadratic()
        ends = [
            (value(self.squares, s) / value(self.w, s) ** 2, s)
            for s in [flint.arb(0), flint.arb(1), *_turns(self.dr)]
        ]
        ends.sort(key=lambda end: float(end[0].mid()))
        (low, inner), (high, outer) = ends[0], ends[-1]
        rest = b * b - a * c + a * high
        if not rest >= 0:  # it passes the rim by, or touches it within a narrow ball
            return []
        far = rest.sqrt()
        hole = b * b - a * c + a * low
        if not hole > 0:
            return [self._point(line, outer, (-b - far) / a, ALONG, (-b + far) / a)]
        near = hole.sqrt()
        return [
            self._point(line, outer, (-b - far) / a, ALONG, (-b - near) / a),
            self._point(line, inner, (-b + near) / a, ALONG, (-b + far) / a),
        ]

    def _point(
        self, line: _Line, s: Ball, t: Ball, kind: str = "point", t_end: Ball | None = None
    ) -> Crossing | None:
        at = [p + t * q for p, q in ((line.x0, line.x1), (line.y0, line.y1))]
        x, y = (float(p.mid()) for p in at)
        w = float(value(self.w, s).mid())
        dz, dr = (float(value(rate, s).mid()) / w**2 for rate in (self.dz, self.dr))
        cosine, per_s = self._slopes(line, x, y, dz, dr)
        v, u = float(s.mid()), math.atan2(y, x) / (2.0 * math.pi) % 1.0
        to_edge = min(v, 1.0 - v) * per_s
        if line.part is not None:
            if kind == ALONG and not line.is_meridional:  # the stretch may end within
                return Crossing(t, self.number, u, v, cosine, OPEN, t_end)
            beside = line.part.to_end(*at)
            if beside is None:
                return None
            u = (u - line.part.begin) % 1.0
            # Rounded to beyond an end it is at that.
            u = u / line.part.share if u <= 0.5 + 0.5 * line.part.share else 0.0
            to_edge = min(to_edge, beside / line.determinant * cosine)
        return Crossing(
            t=t,
            patch_id=self.number,
            u=min(u, 1.0),
            v=v,
            cosine=cosine,
            kind=kind,
            t_end=t_end,
            to_edge=to_edge,
        )

    def _slopes(self, line: _Line, x: float, y: float, dz: float, dr: float) -> tuple[float, float]:
        """Return |n.d| / |d|, and how far from the ray the point moves with s."""
        speed, rho = math.hypot(dz, dr), math.hypot(x, y)
        if speed == 0.0:
            return 0.0, 0.0
        if rho > 0.0:
            cosine = self._cosine(line, x / rho, y / rho, dz / speed, dr / speed)
            return cosine, cosine * speed / line.determinant
        turns = (2.0 * math.pi * k / AROUND_AXIS for k in range(AROUND_AXIS))
        least = min(
            self._cosine(line, math.cos(w), math.sin(w), dz / speed, dr / speed) for w in turns
        )
        return max(least, LEAST_AT_AXIS), 0.0

    @staticmethod
    def _cosine(line: _Line, c: float, s: float, dz: float, dr: float) -> float:
        axis, radial, binormal = line.vectors
        along = [
            dz * a + dr * (c * p + s * q) for a, p, q in zip(axis, radial, binormal, strict=True)
        ]
        around = [c * q - s * p for p, q in zip(radial, binormal, strict=True)]
        normal = cross(around, along)
        return abs(float(dot(normal, line.d))) / (norm(normal) * line.length)


def _turns(derivative: Polynomial) -> list[Ball]:
    """Return where a polynomial turns between 0 and 1, from its derivative."""
    if derivative == 0:
        return []
    return roots_from_0_to_1(derivative, precisions().__next__())
