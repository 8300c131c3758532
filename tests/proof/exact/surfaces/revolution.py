"""Exact crossings with surfaces of revolution."""

from __future__ import annotations

from typing import Any

import flint
import numpy as np

from meshing import SurfaceOfRevolution
from proof.exact.crossings import (
    Crosser,
    bits,
    distance,
    inside,
    on_curve,
    rational,
    rationals,
)
from proof.exact.exact_surface import ExactSurface, Gap, IsTouched
from proof.exact.revolution import revolution_crosser
from proof.exact.touches import SAMPLES, SampledTouches


class ExactRevolution(ExactSurface, of=SurfaceOfRevolution):
    """Exact crossings with a surface of revolution."""

    surface: SurfaceOfRevolution

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
