"""Judges turned boxes: three pairs of planes in double-double, and to many digits."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from hybrid_rt.primitives import Box
from hybrid_rt.primitives.box import TurnedBox
from proof.judges.kernels.turned_box import turned_box_events
from proof.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker

# Columns (x, y, z, 1): a turn by 3, 4, 5, and a skew to the other side with a reflection.
TURN = ((0.8, -0.6, 0, 0.3), (0.6, 0.8, 0, -0.2), (0, 0, 1, 0.1), (0, 0, 0, 1))
SKEW = ((-1, 0.6, 0.2, 1.5), (0, 1, -0.4, 0.3), (0.3, 0, 1, 0.2), (0, 0, 0, 1))


class TurnedBoxJudge(SurfaceJudge, of=TurnedBox):
    """What is known of a turned box."""

    surface: TurnedBox
    examples: ClassVar = {
        "turned boxes": lambda: [
            Box((-1, -0.5, -0.25), (1, 1, 0.5)).transformed(TURN),
            Box((-0.5, -0.5, -0.5), (0.5, 1, 0.5)).transformed(SKEW).flipped(),
        ]
    }

    def worker(self, object_id: int) -> Worker:
        """Return a function that meets the slabs."""
        corner, edges = np.array(self.surface.lo), np.array(self.surface.edges)
        return lambda first, o, d, _low, out: turned_box_events(
            corner, edges, object_id, first, o, d, out
        )

    def solver(self) -> Solver:
        """Return a function that meets a face's plane to many digits."""
        from proof.judges.digits import cross, numbers, on_plane

        corner = numbers(self.surface.lo)
        edges = [numbers(edge) for edge in self.surface.edges]
        ends = [[a + b for a, b in zip(corner, edge, strict=True)] for edge in edges]
        normals = [cross(edges[k - 2], edges[k - 1]) for k in range(3)]

        def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
            axis, upper = divmod(patch, 2)
            return on_plane(ends[axis] if upper else corner, normals[axis], o, d)

        return solve
