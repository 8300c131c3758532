"""Surfaces of revolution of all objects: their profiles in pieces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.intersection.kernels.revolution import (
    DEPTH,
    PIECE,
    RevolutionScratch,
    RevolutionTable,
    finish_revolutions,
    guess_pieces,
    measure_pieces,
    refine_revolutions,
    trace_revolutions,
)
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import Finished
from meshing import SurfaceOfRevolution

if TYPE_CHECKING:
    from hybrid_rt.intersection.coarse.proposals import Coarse

# Pieces per segment: enough that most hold at most one root of a ray.
PIECES = 8
# Segment ends that agree to this part of the profile's size are joined.
JOINED = 2.0**-30


class RevolutionKind:
    """First hits on surfaces of revolution.

    Parameters
    ----------
    surfaces : sequence of (object id, SurfaceOfRevolution)
    """

    def __init__(self, surfaces: Sequence[tuple[int, SurfaceOfRevolution]]) -> None:
        middle, to_frame, size = [], [], []
        control, ends, first_segment, segment_id = [], [], [0], []
        for _, surface in surfaces:
            points = np.concatenate(surface.segments)
            centre = 0.5 * points[:, 0].min() + 0.5 * points[:, 0].max()
            point = surface.origin + centre * surface.axis
            # The point is rounded: the profile is taken about where it really is.
            centre = float((point - surface.origin) @ surface.axis)
            radius = np.hypot(points[:, 0] - centre, points[:, 1]).max()
            scale = float(2.0 ** -np.ceil(np.log2(radius)))
            middle.append(point)
            to_frame.append(scale)
            size.append(radius * scale)
            for number, segment in enumerate(surface.segments):
                if segment[:, 1].any():  # else it lies on the axis and has no area
                    control.append((segment - [centre, 0.0]) * scale)
                    segment_id.append(number)
                    ends.append(_open_ends(surface, number))
            first_segment.append(len(control))
        degree = np.array([len(net) - 1 for net in control], np.int64)
        n_pieces = np.where(degree == 1, 1, np.where(degree > 6, 2 * PIECES, PIECES))
        first_piece = np.concatenate([[0], n_pieces.cumsum()]).astype(np.int64)
        self.table = RevolutionTable(
            middle=np.array(middle),
            to_frame=np.array(to_frame),
            turn=np.array([np.stack([s.radial, s.binormal, s.axis]) for _, s in surfaces]),
            size=np.array(size),
            first_segment=np.array(first_segment, np.int64),
            object_id=np.array([i for i, _ in surfaces], np.int32),
            control=np.concatenate(control),
            start=np.concatenate([[0], (degree + 1).cumsum()[:-1]]).astype(np.int64),
            degree=degree,
            segment_id=np.array(segment_id, np.int32),
            open_ends=np.array(ends, np.int64),
            first_piece=first_piece,
            span=np.empty((len(degree), 4)),
            whole=np.empty((len(surfaces), 3)),
            piece=np.empty((int(first_piece[-1]), PIECE)),
        )
        t = self.table
        measure_pieces(t.control, t.start, t.degree, t.first_piece, t.span, t.piece)
        first = t.first_segment[:-1]
        t.whole[:, 0] = np.minimum.reduceat(t.span[:, 0], first)
        t.whole[:, 1] = np.maximum.reduceat(t.span[:, 1], first)
        t.whole[:, 2] = np.maximum.reduceat(t.span[:, 3], first)

    def _rows(self, n_objects: int) -> NDArray[np.int64]:
        """Return for each object its row in the table, -1 for objects of other kinds."""
        row_of = np.full(max(n_objects, int(self.table.object_id.max()) + 1), -1, np.int64)
        row_of[self.table.object_id] = np.arange(len(self.table.object_id))
        return row_of

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the first hits on the surfaces of revolution."""
        pieces = np.empty(0, np.int32) if guess is None else guess
        trace_revolutions(self.table, rays, pieces, best, any_hit, _new_scratch(self.table), work)

    def guesses(self, coarse: Coarse, hits: CoarseHits) -> IntArray:
        """Return the piece of each coarse hit, -1 where there is none on these surfaces."""
        guess = np.empty(len(hits.face), np.int32)
        guess_pieces(hits, coarse.triangles, self._rows(coarse.n_objects), self.table, guess)
        return guess

    def refine(
        self,
        coarse: Coarse,
        hits: CoarseHits,
        rows: NDArray[np.int64],
        rays: Rays,
        best: Nearest,
        accepted: BoolArray,
    ) -> None:
        """Move coarse hits onto the surfaces by Newton iteration, and offer what is found."""
        refine_revolutions(
            self.table, hits, coarse.triangles, self._rows(coarse.n_objects), rows, rays, best,
            np.empty(9), accepted,
        )  # fmt: skip

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits that are on surfaces of revolution."""
        row_of = self._rows(len(kind_of))
        row_of[kind_of != kind] = -1
        finish_revolutions(self.table, rays, best, row_of, np.empty(9), out)


def _open_ends(surface: SurfaceOfRevolution, number: int) -> int:
    """Bits of the ends (s = 0, s = 1) of a segment that neither touch the axis nor go on."""
    ends = [end for segment in surface.segments for end in (segment[0], segment[-1])]
    size = np.abs(np.concatenate(surface.segments)).max()
    bits = 0
    for bit in range(2):
        here = ends[2 * number + bit]
        others = [e for k, e in enumerate(ends) if k != 2 * number + bit]
        is_joined = any(np.abs(here - other).max() <= JOINED * size for other in others)
        if not is_joined and here[1] > JOINED * size:
            bits |= 1 << bit
    return bits


def _new_scratch(table: RevolutionTable) -> RevolutionScratch:
    """Return scratch for one call of `trace_revolutions`."""
    return RevolutionScratch(
        net=np.empty((int(table.degree.max()) + 1, 2)),
        stack=np.empty((DEPTH, 2)),
        piece=np.empty(PIECE),
        ray=np.empty(9),
    )
