"""Judges sheets by their patches."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing.sheet import PatchSheet
from meshing.spans import across, within_patch
from proof.judges.kernels import events
from proof.judges.surface_judge import (
    Number,
    Solver,
    SurfaceJudge,
    Vector,
    Worker,
    judge_of,
)


class SheetJudge(SurfaceJudge, of=PatchSheet):
    """What is known of sheets of patches."""

    surface: PatchSheet

    def worker(self, object_id: int) -> Worker:
        """Return the function of the patches, with (u, v) across the sheet."""
        inner, spans = judge_of(self.surface.pieces).worker(object_id), self.surface.spans

        def work(
            first: int, o: FloatArray, d: FloatArray, low: FloatArray, out: events.Events
        ) -> None:
            begin = int(out.count[0])
            inner(first, o, d, low, out)
            mine = slice(begin, int(out.count[0]))
            out.u[mine], out.v[mine] = across(spans, out.u[mine], out.v[mine], out.patch_id[mine])

        return work

    def within(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the parameters of hits, or those of a point of their patch's border."""
        u0, u1, v0, v1 = self.surface.spans[patch_id].T
        return np.clip(u, u0, u1), np.clip(v, v0, v1)

    def solver(self) -> Solver:
        """Return the function of the patches, from (u, v) across the sheet."""
        inner = judge_of(self.surface.pieces).solver()

        def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            at = np.array([u]), np.array([v]), np.array([patch])
            a, b = within_patch(self.surface.spans, *at)
            return inner(patch, float(a[0]), float(b[0]), t, o, d)

        return solve
