"""Judges rational patches: Newton on (u, v, t) to many digits; decisions are for exact crossings."""

from __future__ import annotations

from hybrid_rt.verify.judges.surface_judge import Vector, Worker
from hybrid_rt.verify.judges.surfaces.bezier import BezierJudge
from meshing.bezier import RationalPatches


class RationalJudge(BezierJudge, of=RationalPatches):
    """What is known of rational patches."""

    surface: RationalPatches

    def worker(self, object_id: int) -> Worker:
        """Refuse: the float64 oracle bisects polynomial nets only.

        Raises
        ------
        TypeError
        """
        raise TypeError(
            f"surface {object_id} is rational: ask hybrid_rt.verify.exact, the oracle knows "
            "polynomial patches only"
        )

    def _nets(self) -> list[list[list[Vector]]]:
        """Return the control points times their weights, and the weights."""
        from hybrid_rt.verify.judges.digits import numbers

        return [
            [
                [
                    [number * w for number in numbers((*point, 1.0))]
                    for point, w in zip(row, numbers(weights), strict=True)
                ]
                for row, weights in zip(net, of_patch, strict=True)
            ]
            for net, of_patch in zip(self.surface.patches, self.surface.weights, strict=True)
        ]

    def _quotient(self, sums: Vector, by_u: Vector, by_v: Vector) -> tuple[Vector, Vector, Vector]:
        """Return point and partials by the rule of quotients."""
        (*scaled, w), (*of_u, wu), (*of_v, wv) = sums, by_u, by_v
        point = [p / w for p in scaled]
        along_u = [(p - wu * s) / w for p, s in zip(of_u, point, strict=True)]
        along_v = [(p - wv * s) / w for p, s in zip(of_v, point, strict=True)]
        return point, along_u, along_v
