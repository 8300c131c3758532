"""The filter of Bezier patches: so far a second certificate, see `second_certificate`."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray, NamedPoints, Status
from hybrid_rt.verify.filters.kernels import first
from hybrid_rt.verify.filters.surface_filter import SurfaceFilter
from hybrid_rt.verify.judges.second_certificate import Bisection
from meshing import BezierPatches


class PatchesFilter(SurfaceFilter, of=BezierPatches):
    """Bisects every cell that a ray hits; rows that say TANGENT are unsure."""

    surface: BezierPatches

    def __init__(self, surface: BezierPatches) -> None:
        super().__init__(surface)
        self._second = Bisection([surface], threads=1)
        self._centre = np.mean([net.mean(axis=(0, 1)) for net in surface.patches], axis=0)
        self._local = BezierPatches([net - self._centre for net in surface.patches])

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Ask the second certificate."""
        source = NamedPoints(np.where(leaves, 0, -1).astype(np.int32), origins)
        hits = self._second.intersect(origins, directions, source=source if leaves.any() else None)
        out = np.zeros((len(origins), first.N_COLUMNS))
        out[:, first.FOUND] = hits.hit
        out[:, first.T] = hits.t
        out[:, first.T_ERROR] = hits.t_bound
        with np.errstate(invalid="ignore"):
            out[:, first.APART] = hit_t - hits.t
        out[:, first.APART_ERROR] = hits.t_bound
        out[:, first.UNSURE_FROM] = np.where(hits.status == Status.TANGENT, -np.inf, np.inf)
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v), in coordinates about the surface."""
        points = self._local.point(u, v, patch)
        distance: FloatArray = np.linalg.norm(points + (self._centre - origins) - along, axis=1)
        return distance
