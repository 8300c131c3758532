"""Trimmed surfaces: crossings with the whole surface that are inside the loops."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing.trimmed import TrimmedSurface
from proof.exact.crossings import EITHER, POINT, Crosser, Crossing, RationalVector, bits
from proof.exact.loops import ExactLoops
from proof.exact.trims import TrimEdges
from proof.filters.kernels.first import FOUND, UNSURE_FROM
from proof.surface import Gap, IsTouched, Judged, judged_of


class JudgedTrimmed(Judged, of=TrimmedSurface):
    """Crossings with the part of a surface inside loops.

    Parameters of crossings are rounded, so the side of one that is within rounding of a curve is open;
    the judge finds such crossings doubtful, since rays beside have none. What a gap lets count beyond
    the loops is measured in float64, and near the end of the gap either answer is right.
    """

    surface: TrimmedSurface

    def __init__(self, surface: TrimmedSurface) -> None:
        super().__init__(surface)
        self._whole = judged_of(surface.surface)
        self._loops = ExactLoops(surface.loops, surface.closes)
        self._edges = TrimEdges(surface) if surface.gap > 0.0 else None

    def crosser(self) -> Crosser:
        """Return a function that finds the crossings of the whole surface and leaves some out."""
        crosser, locate, spans = self._whole.crosser(), self._whole.locate(), self.surface.spans

        def decided(one: Crossing, o: RationalVector, d: RationalVector) -> Crossing | None:
            if one.kind != POINT:
                return one
            at = one.u, one.v
            if locate is not None:
                with bits(256):
                    at = locate([a + one.t * b for a, b in zip(o, d, strict=True)])
            u, v = map(Fraction, at)
            if spans is not None:
                u0, u1, v0, v1 = map(Fraction, spans[one.patch_id].tolist())
                u, v = u0 + u * (u1 - u0), v0 + v * (v1 - v0)
            if self._loops.is_inside(_within(u), _within(v)) is not False:
                return one
            if self._edges is None:
                return None
            direction = np.array([float(x) for x in d])
            is_outside = self._edges.is_outside(float(u), float(v), one.patch_id, direction)
            if is_outside is None:
                return replace(one, kind=EITHER)
            return None if is_outside else one

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            found = (decided(one, o, d) for one in crosser(o, d))
            return [one for one in found if one is not None]

        return crossings

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v) of the whole surface."""
        gap, spans = self._whole.gap(), self.surface.joined_spans
        if spans is None:
            return gap

        def gap_of_segment(patch: int, u: float, v: float, point: list[Any]) -> float:
            _, _, v0, v1 = spans[patch].tolist()
            return gap(patch, u, (v - v0) / (v1 - v0), point)

        return gap_of_segment

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent to the whole surface."""
        return self._whole.touch()

    def ball(self) -> tuple[list[float], float | None]:
        """Return middle and diameter of the whole surface."""
        return self._whole.ball()

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say which rays certainly miss the whole surface."""
        out = self._whole.first(origins, directions, leaves, hit_t)
        open_ = out[:, FOUND] != 0.0
        out[open_] = 0.0
        out[open_, UNSURE_FROM] = -np.inf
        return out


def _within(x: Fraction) -> Fraction:
    """Return a parameter just inside the border: loops along it enclose it."""
    least = Fraction(1, 1 << 60)
    return min(max(x, least), 1 - least)
