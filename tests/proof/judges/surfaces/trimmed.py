"""Judges trimmed surfaces: the roots of the whole surface, each decided by the loops.

A root is certain if no curve passes it within the band, as seen along the ray, to first order in S_u and
S_v. Near an edge of the surface itself, and where a root is doubtful anyway, a curve must not pass within
as far as the band makes of t. Roots with a curve nearby are doubtful: both decisions are right.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing import TrimmedSurface
from meshing.spans import across, within_patch
from meshing.surface import Surface
from proof.judges.kernels import events
from proof.judges.surface_judge import (
    Number,
    Solver,
    SurfaceJudge,
    Vector,
    Worker,
    judge_of,
    new_events,
)
from proof.judges.trim_edges import AROUND_GAP, TrimEdges

# Flatter than this the band moves a root by more than first order says.
FLAT, TWICE = 1e-5, 2.0
# Beside an edge of the surface itself the partials are those of one side.
ROOMY = 4.0


class TrimmedJudge(SurfaceJudge, of=TrimmedSurface):
    """What is known of the part of a surface inside loops."""

    surface: TrimmedSurface

    def __init__(self, surface: TrimmedSurface) -> None:
        super().__init__(surface)
        self._whole = judge_of(surface.surface)
        self._edges = TrimEdges(surface)

    def worker(self, object_id: int) -> Worker:
        """Return a function that finds the roots of the whole surface and leaves some out."""
        inner = self._whole.worker(object_id)

        def work(
            first: int, o: FloatArray, d: FloatArray, low: FloatArray, out: events.Events
        ) -> None:
            found = new_events(out.t.size)
            inner(first, o, d, low, found)
            if found.count[0] > out.t.size:
                found = new_events(int(found.count[0]))
                inner(first, o, d, low, found)
            own = events.Events(found.count, *(column[: found.count[0]] for column in found[1:]))
            rows = own.ray - first
            is_kept, own = self._decided(own, o[rows], d[rows])
            begin = int(out.count[0])
            out.count[0] += is_kept.sum()
            room = max(out.t.size - begin, 0)
            for into, column in zip(out[1:], own[1:], strict=True):
                kept = column[is_kept][:room]
                into[begin : begin + len(kept)] = kept

        return work

    def solver(self) -> Solver:
        """Return the function of the whole surface."""
        inner = self._whole.solver()

        def solve(patch: int, u: float, v: float, t: float, o: Vector, d: Vector) -> Number:
            a, b = self._own(np.array([u]), np.array([v]), np.array([patch]))
            return inner(patch, float(a[0]), float(b[0]), t, o, d)

        return solve

    def gap(
        self,
        origins: FloatArray,
        along: FloatArray,
        u: FloatArray,
        v: FloatArray,
        patch_id: NDArray[Any],
    ) -> FloatArray:
        """Return distances from the whole surface; inf where a hit is outside, beyond the band."""
        distance = self._whole.gap(origins, along, *self._own(u, v, patch_id), patch_id)
        scale = np.maximum(np.linalg.norm(origins - self.surface.middle, axis=1), self.surface.size)
        distance[self._edges.are_outside(u, v, patch_id, along, events.BAND * scale)] = np.inf
        return distance

    def about_itself(self) -> tuple[Surface, FloatArray]:
        """Return the whole surface, moved to where its points round least."""
        return self._whole.about_itself()

    def _own(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return (u, v) as the whole surface counts them."""
        spans = self.surface.joined_spans
        return (u, v) if spans is None else within_patch(spans, u, v, patch_id)

    def _decided(
        self, own: events.Events, o: FloatArray, d: FloatArray
    ) -> tuple[BoolArray, events.Events]:
        """Return which events of rays from o along d count, and all with their kind, u and v."""
        u, v = self._located(own, o, d)
        seen, lies, cosine = self._edges.steps(u, v, own.patch_id, d)
        is_plain = (own.kind == events.ROOT) & (own.at_edge == 0)
        moved = own.band / np.maximum(own.cosine, events.LEAST_COSINE)
        reach = np.where(
            is_plain, events.SHIFT * own.band * np.where(cosine < FLAT, TWICE, 1.0), ROOMY * moved
        )
        near, is_wide = self._edges.sides.passes(
            u, v, np.where(is_plain[:, None, None], seen, lies), reach
        )
        inside, is_open = self._edges.sides.inside(u, v), near | is_wide
        if self.surface.gap > 0.0:
            within = self._edges.reach(cosine)
            surely, _ = self._edges.sides.passes(u, v, lies, (1.0 - AROUND_GAP) * within)
            perhaps, is_wide = self._edges.sides.passes(
                u, v, lies, (1.0 + AROUND_GAP) * within + moved
            )
            # Roots up to the end of the gap count, and those inside do anyway.
            inside |= surely
            is_open = np.where(perhaps, ~inside, is_open) | is_wide
        given_up = own.kind == events.UNDECIDED
        kind = np.where(is_open & ~given_up, np.uint8(events.DOUBTFUL), own.kind)
        return inside | is_open | given_up, own._replace(kind=kind.astype(np.uint8), u=u, v=v)

    def _located(
        self, own: events.Events, o: FloatArray, d: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return u and v of events on the surface, from 0 to 1."""
        found = self._whole.locate(o + own.t[:, None] * d)
        u, v = (own.u, own.v) if found is None else found
        if self.surface.joined_spans is not None:
            u, v = across(self.surface.joined_spans, u, v, own.patch_id)
        return np.clip(u, 0.0, 1.0), np.clip(v, 0.0, 1.0)
