"""Bezier patches: two polynomials in (u, v), bisected."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from meshing import BezierPatches
from meshing.bezier import RationalPatches
from proof.exact.crossings import Crosser, distance, inside, on_curve, rationals
from proof.exact.patches import patches_crosser, weights_of
from proof.exact.touches import SAMPLES, touch_of_nets
from proof.filters.kernels import patches
from proof.surface import Gap, IsTouched, Judged, double_double, fractions, scratch


class JudgedPatches(Judged, of=BezierPatches):
    """Crossings with Bezier patches."""

    surface: BezierPatches
    kernel = staticmethod(patches.first_on_patches)

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

    def tables(self) -> tuple[Any, Any]:
        """Return all control points about the middle."""
        surface = self.surface
        nets = [np.asarray(net) for net in surface.patches]
        flat = np.concatenate([net.reshape(-1, 3) for net in nets])
        rest = np.concatenate([rest.reshape(-1, 3) for rest in surface.remainders])
        points = double_double(fractions(flat) + fractions(rest) - fractions(self.middle))
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
        table = patches.Patches(
            points=points,
            weights=weights,
            is_rational=isinstance(surface, RationalPatches),
            starts=starts,
            degrees=np.array([(net.shape[0] - 1, net.shape[1] - 1) for net in nets]),
            balls=balls,
            origin=self.middle,
            radius=float(np.linalg.norm(points[..., 0], axis=1).max()),
            size=self.size,
        )
        return table, patches.PatchScratch(
            nets=np.zeros((patches.DEPTH + 2, 4, most)),
            spans=np.zeros((patches.DEPTH + 1, 4)),
            radii=np.zeros(patches.DEPTH + 1),
            height=np.zeros((2, most)),
            weight=np.zeros((2, most)),
            work=np.zeros((4, most)),
            turned=np.zeros((4, most)),
            values=np.zeros(12),
            **scratch()._asdict(),
        )
