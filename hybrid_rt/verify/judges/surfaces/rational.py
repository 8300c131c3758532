"""Judges rational patches: Newton on (u, v, t) to many digits; decisions are for exact crossings."""

from __future__ import annotations

from hybrid_rt.verify.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker
from meshing.bezier import RationalPatches


class RationalJudge(SurfaceJudge, of=RationalPatches):
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

    def solver(self) -> Solver:
        """Return Newton's method for S(u, v) = o + t d."""
        import mpmath

        from hybrid_rt.verify.judges.digits import MOST_STEPS, SMALL, curve, numbers, solved

        nets = [
            [
                [
                    [number * w for number in numbers((*point, 1.0))]
                    for point, w in zip(row, numbers(weights), strict=True)
                ]
                for row, weights in zip(net, of_patch, strict=True)
            ]
            for net, of_patch in zip(self.surface.patches, self.surface.weights, strict=True)
        ]

        def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            net, x = nets[patch], numbers((u, v, t))
            for _ in range(MOST_STEPS):
                rows = [curve(row, x[1]) for row in net]
                (*scaled, w), (*by_u, wu) = curve([row[0] for row in rows], x[0])
                (*by_v, wv), _ = curve([row[1] for row in rows], x[0])
                point = [p / w for p in scaled]
                along_u = [(p - wu * s) / w for p, s in zip(by_u, point, strict=True)]
                along_v = [(p - wv * s) / w for p, s in zip(by_v, point, strict=True)]
                gap = [p - a - x[2] * b for p, a, b in zip(point, o, d, strict=True)]
                step = solved([along_u, along_v, [-b for b in d]], gap)
                if step is None:
                    break
                x = [a - b for a, b in zip(x, step, strict=True)]
                if abs(step[2]) <= SMALL * abs(x[2]) and max(abs(step[0]), abs(step[1])) <= SMALL:
                    return x[2]
            return mpmath.nan

        return solve
