"""Judges rational patches as others, by their nets of (w P, w)."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing.bezier import RationalPatches
from proof.judges.surface_judge import Vector
from proof.judges.surfaces.bezier import BezierJudge


class RationalJudge(BezierJudge, of=RationalPatches):
    """What is known of rational patches."""

    surface: RationalPatches

    def _weight(self) -> FloatArray | None:
        """Return the weights of all control points, (total,)."""
        return np.concatenate([of_patch.ravel() for of_patch in self.surface.weights])

    def _nets(self) -> list[list[list[Vector]]]:
        """Return the control points times their weights, and the weights."""
        from proof.judges.digits import numbers

        return [
            [
                [
                    [number * w for number in (*point, 1)]
                    for point, w in zip(row, numbers(weights), strict=True)
                ]
                for row, weights in zip(net, of_patch, strict=True)
            ]
            for net, of_patch in zip(super()._nets(), self.surface.weights, strict=True)
        ]

    def _quotient(self, sums: Vector, by_u: Vector, by_v: Vector) -> tuple[Vector, Vector, Vector]:
        """Return point and partials by the rule of quotients."""
        (*scaled, w), (*of_u, wu), (*of_v, wv) = sums, by_u, by_v
        point = [p / w for p in scaled]
        along_u = [(p - wu * s) / w for p, s in zip(of_u, point, strict=True)]
        along_v = [(p - wv * s) / w for p, s in zip(of_v, point, strict=True)]
        return point, along_u, along_v
