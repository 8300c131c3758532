"""Bezier patches: two polynomials in (u, v), bisected."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from meshing import BezierPatches
from meshing.bezier import RationalPatches
from proof.exact.crossings import Crosser, distance, inside, on_curve, rationals
from proof.exact.patches import patches_crosser, weights_of
from proof.exact.touches import SAMPLES, touch_of_nets
from proof.filters.kernels import patches
from proof.surface import (
    ExactSurface,
    Gap,
    IsTouched,
    SurfaceFilter,
    crossings_scratch,
    double_double,
    fractions,
)


class ExactPatches(ExactSurface, of=BezierPatches):
    """Exact crossings with Bezier patches."""

    surface: BezierPatches

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of all patches."""
        return patches_crosser(self.surface)

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v) by exact arithmetic."""
        surface = self.surface
        parts = zip(surface.patches, surface.remainders, weights_of(surface), strict=True)
        nets = [
            [
                [
                    [w * x for x in (*map(sum, zip(rationals(p), rationals(q), strict=True)), 1)]
                    for p, q, w in zip(row, rest, rationals(ws), strict=True)
                ]
                for row, rest, ws in zip(*part, strict=True)
            ]
            for part in parts
        ]

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            rows = [on_curve(row, inside(v)) for row in nets[patch]]
            *scaled, weight = on_curve(rows, inside(u))
            return distance([x / weight for x in scaled], point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        return touch_of_nets(list(self.surface.patches), SAMPLES, self.surface.weights)


class PatchesFilter(SurfaceFilter, of=BezierPatches):
    """Bisects the projections of all patches that a ray may meet."""

    kernel = staticmethod(patches.first_on_patches)

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

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from S(u, v), in coordinates about the surface."""
        points = self._local.point(u, v, patch)
        distance: FloatArray = np.linalg.norm(points + (self._origin - origins) - along, axis=1)
        return distance
