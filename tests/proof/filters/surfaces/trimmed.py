"""The filter of trimmed surfaces: what misses the whole surface misses the trimmed one."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.spans import within_patch
from meshing.trimmed import TrimmedSurface
from proof.filters.kernels.first import FOUND, UNSURE_FROM
from proof.filters.surface_filter import SurfaceFilter, filter_of


class TrimmedFilter(SurfaceFilter, of=TrimmedSurface):
    """Asks for exact arithmetic wherever a ray may meet the whole surface."""

    surface: TrimmedSurface

    def __init__(self, surface: TrimmedSurface) -> None:
        super().__init__(surface)
        self._whole = filter_of(surface.surface)

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say which rays certainly miss the whole surface."""
        out = self._whole.first(origins, directions, leaves, hit_t)
        open_ = out[:, FOUND] != 0.0
        out[open_] = 0.0
        out[open_, UNSURE_FROM] = -np.inf
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v) of the whole surface."""
        if self.surface.joined_spans is not None:
            u, v = within_patch(self.surface.joined_spans, u, v, patch)
        return self._whole.gap(origins, along, u, v, patch)

    def ball(self) -> tuple[FloatArray, float]:
        """Return middle and diameter of the whole surface."""
        return self._whole.ball()
