"""Judges Bezier patches: plain bisection in the oracle, Newton on (u, v, t) to many digits."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches
from proof.judges.kernels import bezier, events, patch_bisection, patch_roots
from proof.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker

# Deepest stack of pieces: 50 halvings in each of two parameters.
DEPTH = 110


def weighted_points(
    control: FloatArray, weight: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return points whose sum is (w P, w), exactly, or P without weights, each (total, k)."""
    if weight is None:
        return control, np.zeros_like(control)
    total, n_axes = control.shape
    points, rest = np.empty((2, total, n_axes + 1))
    bezier.weighted(control, weight, points, rest)
    return points, rest


class BezierJudge(SurfaceJudge, of=BezierPatches):
    """What is known of Bezier patches."""

    surface: BezierPatches

    def worker(self, object_id: int) -> Worker:
        """Return a function that bisects the control nets."""
        patches, weight = self.surface.patches, self._weight()
        control = np.concatenate([net.reshape(-1, 3) for net in patches])
        lengths = [len(net) * net.shape[1] for net in patches]
        boxes = np.array([[net.min(axis=(0, 1)), net.max(axis=(0, 1))] for net in patches])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        points, rest = weighted_points(control, weight)
        # Newton's iteration has all digits; bisection, which leaves the band open, those of floats.
        if self.surface.remainder is not None:
            by = 1.0 if weight is None else weight[:, None]
            rest[:, :3] += by * self.surface.remainder
        nets = patch_roots.Nets(
            control=control,
            weight=np.ones(len(control)) if weight is None else weight,
            points=points,
            rest=rest,
            starts=np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
            degrees=np.array([(len(net) - 1, net.shape[1] - 1) for net in patches], np.int64),
            centre=boxes.mean(axis=1),
            radius=0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1),
            middle=0.5 * (low + high),
            size=float(np.linalg.norm(high - low)),
            object_id=object_id,
        )

        def work(
            first: int, o: FloatArray, d: FloatArray, t: FloatArray, out: events.Events
        ) -> None:
            scratch = patch_roots.Scratch(
                nets=np.empty((DEPTH, 4 * max(lengths))),
                plain=np.empty(0 if weight is None else 3 * max(lengths)),
                spans=np.empty((DEPTH, 4)),
                leaves=np.empty((patch_bisection.MOST_LEAVES, 6)),
                one=np.empty((1, 6)),
                rejected=np.empty((patch_bisection.MOST_REJECTED, 2)),
                rows=np.empty((31, 4)),
                high=np.empty(31),
                low=np.empty(31),
                out=np.empty((4, 7)),
                frame=np.empty((3, 3)),
                point=np.empty((3, 2)),
            )
            patch_roots.patch_events(nets, first, o, d, t, scratch, out)

        return work

    def solver(self) -> Solver:
        """Return Newton's method for S(u, v) = o + t d."""
        import mpmath

        from proof.judges.digits import MOST_STEPS, SMALL, curve, numbers, solved

        nets, quotient = self._nets(), self._quotient

        def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            net, x = nets[patch], numbers((u, v, t))
            for _ in range(MOST_STEPS):
                rows = [curve(row, x[1]) for row in net]
                sums, by_u = curve([row[0] for row in rows], x[0])
                by_v, _ = curve([row[1] for row in rows], x[0])
                point, along_u, along_v = quotient(sums, by_u, by_v)
                gap = [p - a - x[2] * b for p, a, b in zip(point, o, d, strict=True)]
                step = solved([along_u, along_v, [-b for b in d]], gap)
                if step is None:
                    break
                x = [a - b for a, b in zip(x, step, strict=True)]
                if abs(step[2]) <= SMALL * abs(x[2]) and max(abs(step[0]), abs(step[1])) <= SMALL:
                    return x[2]
            return mpmath.nan

        return solve

    def _weight(self) -> FloatArray | None:
        """Return the weights of all control points, (total,); None: there are none."""
        return None

    def _nets(self) -> list[list[list[Vector]]]:
        """Return the control points of the patches, row by row, as numbers of many digits."""
        from proof.judges.digits import numbers

        return [
            [
                [
                    [a + b for a, b in zip(numbers(point), numbers(left), strict=True)]
                    for point, left in zip(row, of_row, strict=True)
                ]
                for row, of_row in zip(net, rest, strict=True)
            ]
            for net, rest in zip(self.surface.patches, self.surface.remainders, strict=True)
        ]

    def _quotient(self, sums: Vector, by_u: Vector, by_v: Vector) -> tuple[Vector, Vector, Vector]:
        """Return point and partials, of which these are the Bernstein sums."""
        return sums, by_u, by_v
