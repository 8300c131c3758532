"""Exact crossings with Bezier patches."""

from __future__ import annotations

from typing import Any

from meshing import BezierPatches
from proof.exact.crossings import Crosser, distance, inside, on_curve, rationals
from proof.exact.exact_surface import ExactSurface, Gap, IsTouched
from proof.exact.patches import patches_crosser, weights_of
from proof.exact.touches import SAMPLES, touch_of_nets


class ExactPatches(ExactSurface, of=BezierPatches):
    """Exact crossings with Bezier patches."""

    surface: BezierPatches

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of all patches."""
        return patches_crosser(self.surface)

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v) by exact arithmetic."""
        surface = self.surface
        parts = zip(surface.patches, surface.remainders, weights_of(surface), strict=True)
        nets = [
            [
                [
                    [w * x for x in (*map(sum, zip(rationals(p), rationals(q), strict=True)), 1)]
                    for p, q, w in zip(row, rest, rationals(ws), strict=True)
                ]
                for row, rest, ws in zip(*part, strict=True)
            ]
            for part in parts
        ]

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            rows = [on_curve(row, inside(v)) for row in nets[patch]]
            *scaled, weight = on_curve(rows, inside(u))
            return distance([x / weight for x in scaled], point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        return touch_of_nets(list(self.surface.patches), SAMPLES, self.surface.weights)
