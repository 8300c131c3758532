"""Holds hits against what filters know; the exact judge is asked about the rest.

A row is confirmed if its decision is certain and the hit is right: the same object, the exact t
within t_bound, its point within half a band of the ray; or a miss where there is no crossing. All
others are put to the exact judge, so that nothing is held against a hit but by exact arithmetic.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray
from proof.filters.kernels import first
from proof.kernels.bands import BAND
from proof.surface import judged_of

# A point of a hit is measured in float64; farther from the ray it is measured exactly.
NEAR = 0.5


class Screen:
    """Filters of a list of surfaces.

    Raises TypeError for a surface that is not known.
    """

    def __init__(self, surfaces: Sequence[Any]) -> None:
        self.filters = [judged_of(surface) for surface in surfaces]

    def confirmed(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        leaves: IntArray | None = None,
    ) -> BoolArray:
        """Tell which rows are certainly right, (n,) bool.

        ``leaves``: the objects that the rays leave from; -1 for none.
        """
        n = len(hits)
        origins, directions = np.ascontiguousarray(origins), np.ascontiguousarray(directions)
        first_t, error, owner = np.full(n, np.inf), np.zeros(n), np.full(n, -1)
        apart, apart_error = np.full(n, np.nan), np.zeros(n)
        said = []
        for k, one in enumerate(self.filters):
            is_own = hits.object_id == k
            is_left = np.zeros(n, np.bool_) if leaves is None else np.asarray(leaves) == k
            out = one.first(origins, directions, is_left, np.where(is_own, hits.t, np.nan))
            nearer = (out[:, first.FOUND] == 1.0) & (out[:, first.T] < first_t)
            first_t = np.where(nearer, out[:, first.T], first_t)
            error = np.where(nearer, out[:, first.T_ERROR], error)
            owner = np.where(nearer, k, owner)
            apart = np.where(is_own, out[:, first.APART], apart)
            apart_error = np.where(is_own, out[:, first.APART_ERROR], apart_error)
            said.append(out)
        sure = np.ones(n, np.bool_)
        for k, out in enumerate(said):
            begins = out[:, first.UNSURE_FROM]
            sure &= (begins == np.inf) | (begins > first_t + error)
            rival = (out[:, first.FOUND] == 1.0) & (owner != k)
            begins = np.where(rival, out[:, first.T] - out[:, first.T_ERROR], np.inf)
            sure &= ~(rival & ~(begins > first_t + error))
        with np.errstate(invalid="ignore"):
            is_tight = np.abs(apart) + apart_error <= hits.t_bound
        near = self._gaps(hits, origins, directions) <= NEAR
        right = np.where(hits.hit, (owner == hits.object_id) & is_tight & near, owner < 0)
        confirmed: BoolArray = sure & right
        return confirmed

    def _gaps(self, hits: HitRecord, origins: FloatArray, directions: FloatArray) -> FloatArray:
        """Return the distances of S(u, v) from o + t d, in bands; 0 for a miss."""
        gaps = np.zeros(len(hits))
        for k, one in enumerate(self.filters):
            rows = np.flatnonzero(hits.object_id == k)
            if not len(rows):
                continue
            o, t = origins[rows], hits.t[rows]
            along = t[:, None] * directions[rows]
            size = np.linalg.norm(along, axis=1) if one.size < 0.0 else one.size
            scale = np.maximum(np.linalg.norm(o - one.middle, axis=1), size)
            distance = one.rough_gap(o, along, hits.u[rows], hits.v[rows], hits.patch_id[rows])
            gaps[rows] = distance / (BAND * scale)
        return gaps
