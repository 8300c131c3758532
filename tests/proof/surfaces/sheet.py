"""Sheets: what is known of their patches."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing.sheet import PatchSheet
from meshing.spans import within_patch
from proof.exact.crossings import Crosser
from proof.surface import Gap, IsTouched, Judged, judged_of


class JudgedSheet(Judged, of=PatchSheet):
    """Crossings with a sheet of patches."""

    surface: PatchSheet

    def __init__(self, surface: PatchSheet) -> None:
        super().__init__(surface)
        self._pieces = judged_of(surface.pieces)

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of all patches."""
        return self._pieces.crosser()

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v), (u, v) across the sheet."""
        inner = self._pieces.gap()

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            at = np.array([u]), np.array([v]), np.array([patch])
            a, b = within_patch(self.surface.spans, *at)
            return inner(patch, float(a[0]), float(b[0]), point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        return self._pieces.touch()

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say what is certain of the first crossing with a patch."""
        return self._pieces.first(origins, directions, leaves, hit_t)
