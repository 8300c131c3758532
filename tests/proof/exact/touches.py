"""Tests whether a ray grazes a surface, or begins near it: legitimate reasons for status TANGENT.

Uses sampling and damped Newton steps in float64, in coordinates about the surface. A reason that is
missed counts against the tracer, so the search may be incomplete without hiding faults.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches

Patches = NDArray[np.signedinteger[Any]]

# Samples along each parameter of a piece; triangles and flat faces do with fewer.
SAMPLES, FEW_SAMPLES = 17, 5
STEPS = 50
FIRST_DAMPING = 1e-3
# Crossings steeper than this are no touches; where the normal is lost anything may be one.
STEEP = 1e-5
# What float64 leaves of distances, in parts of the scale.
ROUNDING = 2.0**-50


class SampledTouches:
    """Tests whether a ray nearly touches a surface, by samples of it.

    ``local``: the surface, moved so that ``middle`` is the origin.
    ``samples``: along each parameter of a piece.
    ``wraps``: whether u = 0 and u = 1 coincide.
    ``ends``: whether the surface ends at u = 0 and u = 1: to pass such an end is a touch from any side.
    """

    def __init__(
        self,
        local: Any,
        middle: FloatArray,
        samples: int,
        *,
        wraps: bool = False,
        ends: bool = False,
    ) -> None:
        self._local, self._middle = local, middle
        self._samples, self._wraps, self._ends = samples, wraps, ends
        u, v, patch = self._grid(np.arange(len(local.patch_bounds)))
        # |S_u x S_v| where the surface is widest.
        self._widest = np.linalg.norm(np.cross(*local.partials(u, v, patch)), axis=1).max()

    def _grid(self, patches: Patches) -> tuple[FloatArray, FloatArray, Patches]:
        """Return u, v and patch of the samples on some patches."""
        side = np.linspace(0.0, 1.0, self._samples)
        u, v = (np.tile(x.ravel(), len(patches)) for x in np.meshgrid(side, side, indexing="ij"))
        return u, v, np.repeat(patches, self._samples**2)

    def __call__(self, origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
        """Tell whether the ray grazes the surface within a reach, or begins so near to it."""
        o = origin - self._middle
        return self._grazes(o, d, reach) or (not leaves and self._begins(o, reach))

    def _grazes(self, o: FloatArray, d: FloatArray, reach: float) -> bool:
        across = np.eye(3) - np.outer(d, d)
        u, v, patch, distance = self._nearest(o, across, reach)
        points = self._local.point(u, v, patch)
        su, sv = self._local.partials(u, v, patch)
        n = np.cross(su, sv)
        length = np.linalg.norm(n, axis=1)
        slack = self._slack(o, reach)
        lost = length <= max(1e-9 * self._widest, 1e-300)
        if self._ends:
            lost |= np.minimum(u, 1.0 - u) * np.linalg.norm(su, axis=1) <= slack
        ahead = (points - o) @ d > -slack
        flat = np.abs(n @ d) <= STEEP * length
        return bool(((distance <= slack) & (flat | lost) & ahead).any())

    def _begins(self, o: FloatArray, reach: float) -> bool:
        *_, distance = self._nearest(o, np.eye(3), reach)
        return bool((distance <= self._slack(o, reach)).any())

    def _slack(self, o: FloatArray, reach: float) -> float:
        size = float(np.abs(self._local.bounds).max())
        return reach + ROUNDING * (float(np.linalg.norm(o)) + size)

    def _nearest(self, o: FloatArray, across: FloatArray, reach: float) -> tuple[Any, ...]:
        """Return parameters where S - o, or its part across the ray, is shortest; and its length.

        Half the square of that length has the gradient and the second derivatives below; made
        positive, they give steps that are taken if they help. At a touch both tangents look the
        same way, and bends decide.
        """
        local = self._local
        boxes = local.patch_bounds
        middle, half = boxes.mean(axis=1), 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
        near = np.flatnonzero(np.linalg.norm((middle - o) @ across, axis=1) <= half + reach)
        u, v, patch = self._grid(near)
        damping = np.full(len(u), FIRST_DAMPING)
        gap = (local.point(u, v, patch) - o) @ across
        distance = np.linalg.norm(gap, axis=1)
        for _ in range(STEPS):
            su, sv = (x @ across for x in local.partials(u, v, patch))
            uu, uv, vv = ((x * gap).sum(axis=1) for x in local.second_partials(u, v, patch))
            uu, uv, vv = uu + (su * su).sum(1), uv + (su * sv).sum(1), vv + (sv * sv).sum(1)
            gu, gv = (su * gap).sum(1), (sv * gap).sum(1)
            lowest = 0.5 * (uu + vv) - np.hypot(0.5 * (uu - vv), uv)
            size = np.abs(uu) + np.abs(vv) + 1e-150
            shift = np.maximum(-lowest, 0.0) * 1.001 + damping * size
            uu, vv = uu + shift, vv + shift
            det = uu * vv - uv * uv
            new_u = u + (uv * gv - vv * gu) / det
            # All around an axis a turned surface has no border.
            new_u = new_u % 1.0 if self._wraps else np.clip(new_u, 0.0, 1.0)
            new_v = np.clip(v + (uv * gu - uu * gv) / det, 0.0, 1.0)
            new_gap = (local.point(new_u, new_v, patch) - o) @ across
            new_distance = np.linalg.norm(new_gap, axis=1)
            better = new_distance < distance
            u, v = np.where(better, new_u, u), np.where(better, new_v, v)
            gap = np.where(better[:, None], new_gap, gap)
            distance = np.where(better, new_distance, distance)
            damping = np.clip(np.where(better, 0.1 * damping, 10.0 * damping), 1e-15, 1e6)
        return u, v, patch, distance


def touch_of_nets(
    nets: list[FloatArray], samples: int, weights: Sequence[FloatArray] | None = None
) -> SampledTouches:
    """Return a function that finds touches of Bezier patches."""
    middle = np.mean([net.mean(axis=(0, 1)) for net in nets], axis=0)
    return SampledTouches(BezierPatches([net - middle for net in nets], weights), middle, samples)
