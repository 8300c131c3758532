"""The filter of rational patches: it is sure of nothing, so the exact judge is asked about all."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.verify.filters.kernels.first import N_COLUMNS, UNSURE_FROM
from hybrid_rt.verify.filters.surface_filter import SurfaceFilter
from meshing.bezier import RationalPatches


class RationalFilter(SurfaceFilter, of=RationalPatches):
    """Leaves every ray to the exact judge."""

    surface: RationalPatches

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say of each ray that it may cross anywhere."""
        del directions, leaves, hit_t
        out = np.zeros((len(origins), N_COLUMNS))
        out[:, UNSURE_FROM] = -np.inf
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v)."""
        distance: FloatArray = np.linalg.norm(
            self.surface.point(u, v, patch) - origins - along, axis=1
        )
        return distance
