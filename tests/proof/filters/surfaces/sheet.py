"""The filter of sheets: that of their patches."""

from __future__ import annotations

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.sheet import PatchSheet
from meshing.spans import within_patch
from proof.filters.surface_filter import SurfaceFilter, filter_of


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
