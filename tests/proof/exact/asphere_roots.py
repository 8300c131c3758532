"""All roots of a ray on an even asphere, from a polynomial with rational coefficients.

With G = z - sum a_2i w^i the conic under the polynomial is met where w + (1 + k) G^2 = 2 R G (for a plane
base: where G = 0). z is linear in t and w quadratic, so that is a polynomial in t of degree 4 n; its
roots are isolated. Of the conic's two sheets the sag is the one with 1 - (1 + k) G / R > 0, which is the
square root itself. Radius, conic constant and coefficients are floats taken for exact; the axis' length
is rational to 300 bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import flint

from proof.exact.crossings import (
    Ball,
    Polynomial,
    Rational,
    bits,
    cross,
    dot,
    is_narrow,
    precisions,
    rational,
    value,
)

AXIS_BITS = 300
# Pairs of roots that are farther apart than this, over the size, touch nothing.
TOUCHING = 1e-2
# Places farther beyond the rim than this, over the size, are left out.
BESIDE_RIM = 1e-3


@dataclass(frozen=True)
class Root:
    """A place where a ray meets the sag, or nearly does.

    ``cosine``: |n.d| / |d|.
    ``gap``: distance of the ray from the surface where it is nearest; 0 of a root.
    ``depth``: how far the ray would have to be moved for this root and the next one to be one, or none.
    ``beyond``: how far outside the rim t is: its distance from the axis less the rim's radius.
    ``from_rim``: how far the ray would have to be moved to meet the rim next to t, to first order.
    ``times``: multiplicity; 0 of a near miss.
    """

    t: Ball
    cosine: float
    gap: float
    depth: float
    beyond: float
    from_rim: float
    times: int


class AsphereRoots:
    """Finds the roots of rays on one asphere."""

    def __init__(self, surface: Any) -> None:
        self.centre = [rational(x) for x in surface.origin]
        axis = [rational(x) for x in surface.axis]
        square = sum((x * x for x in axis), flint.fmpq(0))
        with bits(AXIS_BITS):
            mantissa, exponent = flint.arb(1 / square).sqrt().mid().man_exp()
        two = flint.fmpq(2)
        self.axis = [x * mantissa * two ** int(exponent) for x in axis]
        self._radius = None if math.isinf(surface.radius) else rational(surface.radius)
        self._factor = 1 + rational(surface.conic)
        self._coefficients = [rational(a) for a in surface.coefficients]
        self._rim = rational(0.5 * surface.aperture)
        self._size = float(surface.size)
        with bits(AXIS_BITS):
            self._rim_height = self._height_of_rim()

    def __call__(self, o: list[Rational], d: list[Rational]) -> list[Root]:
        """Return roots and near misses of a ray within and just beyond the rim, in order of t."""
        away = [x - c for x, c in zip(o, self.centre, strict=True)]
        # From a point near the vertex: no digits are lost on a long way.
        begin = flint.fmpq(*float(-dot(away, d) / dot(d, d)).as_integer_ratio())
        away = [x + begin * y for x, y in zip(away, d, strict=True)]
        z = flint.fmpq_poly([dot(away, self.axis), dot(d, self.axis)])
        w = flint.fmpq_poly([dot(away, away), 2 * dot(away, d), dot(d, d)]) - z * z
        power, rest = flint.fmpq_poly([1]), z
        for a in self._coefficients:
            power = power * w
            rest = rest - a * power
        whole: Polynomial = rest
        if self._radius is not None:
            whole = w + self._factor * rest * rest - 2 * self._radius * rest
        length = math.sqrt(float(dot(d, d)))
        scale = self._size / length
        for number in precisions():
            with bits(number):
                roots = whole.numer().complex_roots() if whole.degree() > 0 else []
                if all(is_narrow(x, scale) for root, _ in roots for x in (root.real, root.imag)):
                    found = self._places(roots, z, w, rest, away, d, length)
                    return [replace(place, t=begin + place.t) for place in found]
        raise ArithmeticError("roots that cannot be narrowed")

    def _places(
        self, roots: list[Any], z: Any, w: Any, rest: Any, away: Any, d: Any, length: float
    ) -> list[Root]:

        def place(t: Ball, times: int) -> Root | None:
            return self._place(t, times, z, w, rest, away, d, length)

        found = [
            place(root.real, times)
            for root, times in sorted(roots, key=lambda root: root[0].real.mid())
            if root.imag == 0
        ]
        real = [one for one in found if one is not None]
        # --- where two roots become one, by the ray's distance from the surface in between
        for k, (one, other) in enumerate(pairwise(real)):
            if float((other.t - one.t).mid()) * length < TOUCHING * self._size:
                middle = place(flint.arb(((one.t + other.t) / 2).mid()), 0)
                depth = math.inf if middle is None else middle.gap
                real[k] = replace(real[k], depth=min(real[k].depth, depth))
                real[k + 1] = replace(other, depth=depth)
        for root, _ in roots:
            if root.imag > 0 and float(root.imag.mid()) * length < TOUCHING * self._size:
                near = place(flint.arb(root.real.mid()), 0)
                if near is not None:
                    real.append(near)
        # --- where the ray passes the rim
        for root, _ in (w - self._rim * self._rim).numer().complex_roots():
            if root.imag == 0 and (passed := place(flint.arb(root.real.mid()), 0)) is not None:
                real.append(replace(passed, gap=min(passed.gap, passed.from_rim)))
        return sorted(real, key=lambda one: float(one.t.mid()))

    def _place(
        self, t: Ball, times: int, z: Any, w: Any, rest: Any, away: Any, d: Any, length: float
    ) -> Root | None:
        """Describe the ray at t; None far beyond the rim, and on the other sheet of the conic."""
        is_root = times > 0
        z_t, w_t, rest_t = (value(p, t) for p in (z, w, rest))
        radius = math.sqrt(max(float(w_t.mid()), 0.0))
        if radius > float(self._rim) + BESIDE_RIM * self._size:
            return None
        root = flint.arb(1)
        rate = flint.arb(0)
        gap = rest_t
        if self._radius is not None:
            kappa = self._factor / (self._radius * self._radius)
            under = 1 - kappa * w_t
            if not under > 0 or (is_root and not 1 - self._factor * rest_t / self._radius > 0):
                return None
            root = under.sqrt()
            gap = rest_t - w_t / (self._radius * (1 + root))
            rate = 1 / (2 * self._radius * root)
        for k, a in enumerate(self._coefficients, start=1):
            rate = rate + k * a * w_t ** (k - 1)
        size = (1 + 4 * w_t * rate * rate).sqrt()
        slope = z.derivative()[0] - rate * value(w.derivative(), t)
        point = [x + t * y for x, y in zip(away, d, strict=True)]
        return Root(
            t=t,
            cosine=abs(float((slope / size).mid())) / length,
            gap=0.0 if is_root else abs(float((gap / size).mid())),
            depth=math.inf if times == 1 else 0.0,
            beyond=radius - float(self._rim),
            from_rim=self._from_rim(
                point, 2 * w_t.sqrt() * rate, 0 if is_root else z_t - self._rim_height, d
            ),
            times=times,
        )

    def _from_rim(self, point: list[Ball], slope: Ball, lift: Ball, d: Any) -> float:
        """Return how far a ray is from the rim, whose circle is taken for its tangent.

        The rim is where the surface's tangent at a point of the ray, of a slope, meets its cylinder,
        and lower by a lift.
        """
        share = dot(point, self.axis)
        out = [x - share * a for x, a in zip(point, self.axis, strict=True)]
        rho = dot(out, out).sqrt()
        if not rho > 0:
            return math.inf
        out = [x / rho for x in out]
        across = cross(d, cross(self.axis, out))
        size = float(dot(across, across).sqrt().mid())
        beside = rho - self._rim
        height = beside * slope + lift
        to_rim = [beside * x + height * a for x, a in zip(out, self.axis, strict=True)]
        return abs(float(dot(to_rim, across).mid())) / max(size, 1e-300)

    def _height_of_rim(self) -> Ball:
        """Return the sag at the rim."""
        w = self._rim * self._rim
        z = sum((a * w**k for k, a in enumerate(self._coefficients, start=1)), flint.fmpq(0))
        total = flint.arb(z)
        if self._radius is not None:
            under = 1 - self._factor / (self._radius * self._radius) * w
            total += w / (self._radius * (1 + flint.arb(under).sqrt()))
        return total
