"""Sheets: what is known of their patches."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.sheet import PatchSheet
from meshing.spans import within_patch
from proof.exact.crossings import Crosser
from proof.surface import ExactSurface, Gap, IsTouched, SurfaceFilter, filter_of
from proof.surfaces.bezier import ExactPatches


class ExactSheet(ExactSurface, of=PatchSheet):
    """Exact crossings with a sheet of patches."""

    surface: PatchSheet

    def __init__(self, surface: PatchSheet) -> None:
        super().__init__(surface)
        self._pieces = ExactPatches(surface.pieces)

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


class SheetFilter(SurfaceFilter, of=PatchSheet):
    """Asks the filter of a sheet's patches."""

    surface: PatchSheet

    def __init__(self, surface: PatchSheet) -> None:
        super().__init__(surface)
        self._pieces = filter_of(surface.pieces)

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say what is certain of the first crossing with a patch."""
        return self._pieces.first(origins, directions, leaves, hit_t)

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v), (u, v) across the sheet."""
        a, b = within_patch(self.surface.spans, u, v, patch)
        return self._pieces.gap(origins, along, a, b, patch)
