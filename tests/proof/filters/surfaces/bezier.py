"""The filter of Bezier patches."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing import BezierPatches
from meshing.bezier import RationalPatches
from proof.filters.kernels import patches
from proof.filters.kernels.first import N_COLUMNS
from proof.filters.surface_filter import (
    SurfaceFilter,
    crossings_scratch,
    double_double,
    fractions,
)


class PatchesFilter(SurfaceFilter, of=BezierPatches):
    """Bisects the projections of all patches that a ray may meet."""

    surface: BezierPatches

    def __init__(self, surface: BezierPatches) -> None:
        super().__init__(surface)
        nets = [np.asarray(net) for net in surface.patches]
        middle, size = self.ball()
        self._origin = middle
        flat = np.concatenate([net.reshape(-1, 3) for net in nets])
        rest = np.concatenate([rest.reshape(-1, 3) for rest in surface.remainders])
        points = double_double(fractions(flat) + fractions(rest) - fractions(middle))
        counts = [net.shape[0] * net.shape[1] for net in nets]
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        balls = np.zeros((len(nets), 4))
        for k, (a, b) in enumerate(pairwise(starts)):
            own = points[a:b, :, 0]
            balls[k, :3] = 0.5 * (own.min(axis=0) + own.max(axis=0))
            balls[k, 3] = np.linalg.norm(own - balls[k, :3], axis=1).max()
        most = max([31, *counts])
        weights = np.ones(len(flat))
        if isinstance(surface, RationalPatches):
            weights = surface.homogeneous[:, 3].copy()
        self._table = patches.Patches(
            points=points,
            weights=weights,
            is_rational=isinstance(surface, RationalPatches),
            starts=starts,
            degrees=np.array([(net.shape[0] - 1, net.shape[1] - 1) for net in nets]),
            balls=balls,
            origin=middle,
            radius=float(np.linalg.norm(points[..., 0], axis=1).max()),
            middle=middle,
            size=size,
        )
        self._scratch = patches.PatchScratch(
            nets=np.zeros((patches.DEPTH + 2, 4, most)),
            spans=np.zeros((patches.DEPTH + 1, 4)),
            radii=np.zeros(patches.DEPTH + 1),
            height=np.zeros((2, most)),
            weight=np.zeros((2, most)),
            work=np.zeros((4, most)),
            turned=np.zeros((4, most)),
            values=np.zeros(12),
            away=np.zeros((3, 3)),
            crossings=crossings_scratch(),
        )
        local = np.split(points[..., 0], starts[1:-1])
        self._local = BezierPatches(
            [own.reshape(net.shape) for own, net in zip(local, nets, strict=True)], surface.weights
        )

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Bisect the patches near each ray."""
        out = np.zeros((len(origins), N_COLUMNS))
        patches.first_on_patches(
            self._table, origins, directions, leaves, hit_t, self._scratch, out
        )
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v), in coordinates about the surface."""
        points = self._local.point(u, v, patch)
        distance: FloatArray = np.linalg.norm(points + (self._origin - origins) - along, axis=1)
        return distance
