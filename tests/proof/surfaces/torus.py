"""Crossings with tori: the roots of a quartic, by the screen in Bernstein form.

With x = o + t d - c, axis a and radii R and r a torus is where F(t) = (|x|^2 + R^2 - r^2)^2 - 4 R^2
(|x|^2 - (x.a)^2 / |a|^2) vanishes; centre, axis and radii are floats taken for exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.torus import Torus
from proof.exact.crossings import (
    Crosser,
    Crossing,
    Polynomial,
    Rational,
    RationalVector,
    along_frame,
    bits,
    dot,
    is_narrow,
    norm,
    precisions,
    rational,
    rationals,
    share,
    turns,
)
from proof.filters.kernels import torus
from proof.surface import Gap, IsTouched, Judged, Locate, scratch, solver_scratch


class JudgedTorus(Judged, of=Torus):
    """Crossings with a torus."""

    surface: Torus
    kernel = staticmethod(torus.first_on_torus)

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of the quartic; a double root is a touch."""
        quartic = self._quartic()
        center, axis = rationals(self.surface.origin), rationals(self.surface.axis)
        major, minor = rational(self.surface.major_radius), rational(self.surface.minor_radius)

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            w = [x - c for x, c in zip(o, center, strict=True)]
            length = norm([float(x) for x in d])
            scale = (norm([float(x) for x in w]) + float(major + minor)) / length
            polynomial = quartic(w, d, minor).numer()
            for number in precisions():
                with bits(number):
                    roots = _real_roots(polynomial)
                    if not all(is_narrow(t, scale) for t, _ in roots):
                        continue
                    return [
                        Crossing(
                            t, 0, 0.0, 0.0, _cosine(w, d, t, axis, major) if times % 2 else 0.0,
                            to_edge=math.inf,
                        )
                        for t, times in roots
                    ]  # fmt: skip
            raise ArithmeticError("t that cannot be narrowed")

        return crossings

    def locate(self) -> Locate:
        """Return a function that takes both angles of a point."""
        surface, center = self.surface, rationals(self.surface.origin)
        frame = surface.radial, surface.binormal, surface.axis
        major = rational(surface.major_radius)

        def locate(point: list[Any]) -> tuple[float, float]:
            with bits(256):
                x, y, z = along_frame(frame, center, point)
                about = turns(surface.orientation * z, (x * x + y * y).sqrt() - major)
                return share(turns(y, x)), share(about)

        return locate

    def gap(self) -> Gap:
        """Return a function that measures from the torus itself."""
        center, axis = rationals(self.surface.origin), rationals(self.surface.axis)
        major, minor = rational(self.surface.major_radius), rational(self.surface.minor_radius)

        def gap(_patch: int, _u: float, _v: float, point: list[Any]) -> float:
            away = [x - c for x, c in zip(point, center, strict=True)]
            height = dot(away, axis)
            with bits(256):
                square = flint.arb(height * height / dot(axis, axis))
                ring = (flint.arb(dot(away, away)) - square).sqrt() - major
                return abs(float((ring * ring + square).sqrt() - minor))

        return gap

    def touch(self) -> IsTouched:
        """Return a function that counts the crossings with a thicker and a thinner tube.

        A ray that grazes the torus crosses one of the two more often than the other.
        """
        quartic, surface = self._quartic(), self.surface
        center = rationals(surface.origin)

        def is_touched(origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
            w = [x - c for x, c in zip(rationals(origin), center, strict=True)]
            counts = set()
            for tube in (surface.minor_radius + reach, surface.minor_radius - reach):
                counts.add(_crossings_ahead(quartic(w, rationals(d), rational(tube)), reach))
            if len(counts) > 1:
                return True
            away = origin - surface.origin
            height = away @ surface.axis
            ring = np.linalg.norm(away - height * surface.axis) - surface.major_radius
            gap = float(np.hypot(ring, height)) - surface.minor_radius
            return not leaves and abs(gap) <= reach

        return is_touched

    def ball(self) -> tuple[list[float], float | None]:
        """Return the middle of the ring and the outer diameter."""
        surface = self.surface
        return surface.origin.tolist(), 2.0 * (surface.major_radius + surface.minor_radius)

    def tables(self) -> tuple[Any, Any]:
        """Return centre, axis and radii."""
        surface = self.surface
        ring = torus.Ring(
            centre=np.array(surface.origin),
            axis=np.array(surface.axis),
            major=float(surface.major_radius),
            minor=float(surface.minor_radius),
            size=self.size,
        )
        return ring, torus.TorusScratch(**solver_scratch(4), **scratch()._asdict())

    def _quartic(self) -> Callable[[RationalVector, RationalVector, Rational], Polynomial]:
        """Return a function that makes F(t), for a ray from the middle and a radius of the tube."""
        axis, major = rationals(self.surface.axis), rational(self.surface.major_radius)
        axis_square = dot(axis, axis)

        def quartic(w: RationalVector, d: RationalVector, tube: Rational) -> Polynomial:
            square = flint.fmpq_poly([dot(w, w), 2 * dot(w, d), dot(d, d)])
            height = flint.fmpq_poly([dot(w, axis), dot(d, axis)])
            across = square - height * height / axis_square
            whole = square + (major * major - tube * tube)
            return whole * whole - 4 * major * major * across

        return quartic


def _crossings_ahead(quartic: Polynomial, reach: float) -> int:
    """Return the number of crossings not behind a ray's origin by more than a reach."""
    with bits(256):
        roots = _real_roots(quartic.numer())
    return sum(times for t, times in roots if float(t.mid()) > -reach)


def _real_roots(polynomial: Any) -> list[tuple[Any, int]]:
    return [(root.real, times) for root, times in polynomial.complex_roots() if root.imag == 0]


def _cosine(
    w: RationalVector, d: RationalVector, t: Any, axis: RationalVector, major: Rational
) -> float:
    """Return |n.d| / |d| at a root, in balls."""
    x = [flint.arb(a) + t * b for a, b in zip(w, d, strict=True)]
    share = dot(x, axis) / dot(axis, axis)
    across = [a - share * b for a, b in zip(x, axis, strict=True)]
    shrink = 1 - major / dot(across, across).sqrt()
    tube = [shrink * a + share * b for a, b in zip(across, axis, strict=True)]
    cosine = dot(tube, d) / (dot(tube, tube) * dot(d, d)).sqrt()
    return abs(float(cosine.mid()))
