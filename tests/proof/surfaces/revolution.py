"""Surfaces of revolution: a polynomial in the profile's parameter."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import SurfaceOfRevolution
from proof.exact.crossings import (
    Crosser,
    bits,
    cross,
    distance,
    inside,
    on_curve,
    rational,
    rationals,
)
from proof.exact.revolution import revolution_crosser
from proof.exact.touches import SAMPLES, SampledTouches
from proof.filters.kernels import profiles, turned
from proof.surface import Gap, IsTouched, Judged, double_double, fractions, scratch, solver_scratch

# Highest degree of profiles.
MOST_DEGREE = 30


class JudgedRevolution(Judged, of=SurfaceOfRevolution):
    """Crossings with a surface of revolution."""

    surface: SurfaceOfRevolution

    def __init__(self, surface: SurfaceOfRevolution) -> None:
        super().__init__(surface)
        # The screen leaves rational profiles and parts of a turn to exact arithmetic.
        if surface.is_whole_turn and not surface.is_rational:
            self.kernel = turned.first_on_turned

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of the eliminated polynomials."""
        return revolution_crosser(self.surface)

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v), in balls because of the cosine."""
        surface = self.surface
        origin = rationals(surface.origin)
        frame = [rationals(v) for v in (surface.axis, surface.radial, surface.binormal)]
        # w z, w r and w, as fractions.
        segments = [
            [
                [*(rational(x) * rational(b) for x in p), rational(b)]
                for p, b in zip(net, w, strict=True)
            ]
            for net, w in (
                (net, [1.0] * len(net) if w is None else w)
                for net, w in zip(surface.segments, surface.weights, strict=True)
            )
        ]
        begin, end = rationals(surface.u_range)

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            z, r, w = on_curve(segments[patch], inside(v))
            z, r = z / w, r / w
            with bits(256):
                turn = flint.arb(2 * (begin + inside(u) * (end - begin)))
                c, s = turn.cos_pi(), turn.sin_pi()
                there = [
                    o + z * a + r * (c * p + s * q)
                    for o, a, p, q in zip(origin, *frame, strict=True)
                ]
                return distance(there, point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        surface = self.surface
        local = SurfaceOfRevolution._from_frame(
            list(surface.segments), np.zeros(3), surface.axis, surface.radial, surface.weights,
            surface.u_range,
        )  # fmt: skip
        whole = surface.is_whole_turn
        return SampledTouches(local, np.array(surface.origin), SAMPLES, wraps=whole, ends=not whole)

    def tables(self) -> tuple[Any, Any]:
        """Return the profile and the inverse of the frame."""
        surface = self.surface
        # A segment on the axis has no area.
        segments = [net for net in surface.segments if net[:, 1].any()]
        points = np.concatenate(segments)
        lengths = [len(net) for net in segments]
        degree = max(lengths) - 1
        height = 0.5 * (points[:, 0].min() + points[:, 0].max())
        centre = np.asarray(surface.origin) + height * np.asarray(surface.axis)
        # The centre is rounded, by eps of its coordinates.
        rounding = 1e-15 * (float(np.abs(surface.origin).max()) + abs(height))
        radius = float(np.hypot(points[:, 0] - height, points[:, 1]).max())
        table = profiles.Turned(
            control=np.ascontiguousarray(points),
            starts=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
            weights=np.concatenate([_weights(n - 1) for n in lengths]),
            duals=double_double(_inverse([surface.axis, surface.radial, surface.binormal])),
            origin=np.array(surface.origin),
            centre=centre,
            radius=radius + rounding,
            middle=self.middle,
            size=self.size,
        )
        return table, profiles.TurnedScratch(
            **solver_scratch(2 * degree),
            factors=np.zeros((3, degree + 1, 3)),
            local=np.zeros((4, degree + 1)),
            spare=np.zeros((4, degree + 1)),
            pieces=np.zeros((32, 3)),
            line=np.zeros((6, 3)),
            **scratch()._asdict(),
        )


def _weights(n: int) -> FloatArray:
    """Return the weights of products of Bernstein coefficients, (n + 1, 31, 2)."""
    weights = np.zeros((n + 1, MOST_DEGREE + 1), dtype=object)
    for i in range(n + 1):
        for j in range(i, n + 1):
            times = 1 if i == j else 2
            weights[i, j] = Fraction(
                times * math.comb(n, i) * math.comb(n, j), math.comb(2 * n, i + j)
            )
    return double_double(weights)


def _inverse(rows: Any) -> Any:
    """Return the rows of the inverse of a matrix by columns, exactly."""
    a, b, c = fractions(rows)
    sides = np.array([cross(b, c), cross(c, a), cross(a, b)], dtype=object)
    return sides / sum(a * sides[0])
