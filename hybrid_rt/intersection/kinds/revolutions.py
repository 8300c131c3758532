"""Surfaces of revolution of all objects: one table of profile pieces."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.intersection.kernels.revolution.finish import finish_revolutions, refine_revolutions
from hybrid_rt.intersection.kernels.revolution.profile import (
    BEGIN,
    BEND,
    END,
    END_KIND,
    END_NEXT,
    END_R,
    END_TANGENT,
    END_Z,
    PIECE,
    RIM,
    SHARE,
    TIP,
    RevolutionTable,
    measure_pieces,
)
from hybrid_rt.intersection.kernels.revolution.sheets import RAY
from hybrid_rt.intersection.kernels.revolution.trace import (
    RevolutionScratch,
    guess_pieces,
    trace_revolution_tree,
    trace_revolutions,
)
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.intersection.kernels.search.counters import CHANGED
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.tolerances import DEPTH, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.tree import new_stack
from hybrid_rt.intersection.kernels.search.trims import Trim
from hybrid_rt.intersection.kind import Finished, OneRow, Single, bottom, widen_bounds
from hybrid_rt.intersection.members import around, box_of, in_order
from hybrid_rt.intersection.trims import trim_of, trimmed_of, whole_of
from meshing import SurfaceOfRevolution, TrimmedSurface
from meshing.kernels.stored_calls import StoredCall
from meshing.profiles import cosine_and_sine, homogeneous

if TYPE_CHECKING:
    from hybrid_rt.intersection.coarse.proposals import Coarse
    from hybrid_rt.intersection.kernels.search.members import Members

# Pieces per segment: enough that most hold at most one root of a ray.
PIECES = 8
# Segment ends that agree to this part of the profile's size are joined; through a wider gap a ray
# may pass.
JOINED = 2.0**-50
# More roundings than these do not pass for a larger size.
FEW_ROUNDINGS = 16.0
# Where the profile bends by less than this there is no outline that its curvature does not show.
STRAIGHT = 1e-10


class RevolutionKind:
    """First hits on surfaces of revolution.

    ``members``, sequence of (object id, SurfaceOfRevolution or TrimmedSurface of one): all of them
    trimmed, or none; else TypeError.
    ``many``: number of surfaces from which on a tree is used.
    """

    def __init__(
        self, members: Sequence[tuple[int, SurfaceOfRevolution | TrimmedSurface]], many: int
    ) -> None:
        whole = [surface for _, surface in whole_of(members)]
        order, self._n_plain, self._in_trees = in_order(whole, many)
        self._plain_box = around([whole[k] for k in order[: self._n_plain]])
        members = [members[k] for k in order]
        trimmed = trimmed_of(members)
        surfaces: list[tuple[int, SurfaceOfRevolution]] = whole_of(members)
        middle, aside, to_frame, size, roundings, part = [], [], [], [], [], []
        moved: list[float] = []
        control, end, first_segment, segment_id = [], [], [0], []
        for _, surface in surfaces:
            points = np.concatenate(surface.segments)
            centre = 0.5 * points[:, 0].min() + 0.5 * points[:, 0].max()
            point = surface.origin + centre * surface.axis
            # The point is rounded: the profile is taken about where it really is.
            centre = float((point - surface.origin) @ surface.axis)
            radius = np.hypot(points[:, 0] - centre, points[:, 1]).max()
            inflated, off = _with_conversion(surface, points, radius)
            radius *= inflated
            moved += [off] * sum(bool(segment[:, 1].any()) for segment in surface.segments)
            scale = float(2.0 ** -np.ceil(np.log2(radius)))
            middle.append(point)
            aside.append(_from_rounded(surface, centre, point) * scale)
            to_frame.append(scale)
            size.append(radius * scale)
            part.append(_part(surface))
            # Of a rational segment numerator and denominator are halved alike.
            sums = [
                6.0 * len(net) + 2.0 if w is None else 12.0 * len(net) + 8.0
                for net, w in zip(surface.segments, surface.weights, strict=True)
            ]
            roundings.append(max(sums))
            for number, segment in enumerate(surface.segments):
                if segment[:, 1].any():  # else it lies on the axis and has no area
                    control.append(_net(surface, number, centre, scale))
                    segment_id.append(number)
                    end.append([_describe_end(surface, number, k, centre, scale) for k in (0, 1)])
            _number_rows(
                end[first_segment[-1] :], segment_id[first_segment[-1] :], first_segment[-1]
            )
            first_segment.append(len(control))
        self._moved, self._is_moved = np.array(moved), any(moved)
        degree = np.array([len(net) - 1 for net in control], np.int64)
        n_pieces = np.where(degree == 1, 1, np.where(degree > 6, 2 * PIECES, PIECES))
        first_piece = np.concatenate([[0], n_pieces.cumsum()]).astype(np.int64)
        self.table = RevolutionTable(
            middle=np.array(middle),
            aside=np.array(aside),
            to_frame=np.array(to_frame),
            turn=np.array([np.stack([s.radial, s.binormal, s.axis]) for _, s in surfaces]),
            part=np.array(part),
            size=np.array(size),
            roundings=np.array(roundings),
            first_segment=np.array(first_segment, np.int64),
            object_id=np.array([i for i, _ in surfaces], np.int32),
            control=np.concatenate(control),
            start=np.concatenate([[0], (degree + 1).cumsum()[:-1]]).astype(np.int64),
            degree=degree,
            segment_id=np.array(segment_id, np.int32),
            outlines=np.array([_outlines(ends) for ends in end], np.int64),
            end=np.array(end),
            first_piece=first_piece,
            span=np.empty((len(degree), 4)),
            whole=np.empty((len(surfaces), 3)),
            piece=np.empty((int(first_piece[-1]), PIECE)),
            trim=_trim(trimmed, first_segment, segment_id, part, to_frame) if trimmed else None,
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
        table, scratch = self.table, _new_scratch(self.table)
        pieces = np.empty(0, np.int32) if guess is None else guess
        t_guess = best.t[: len(pieces)].copy()
        trace_revolutions(table, self._n_plain, rays, pieces, best, any_hit, t_guess, scratch, work)
        for members in self._in_trees:
            stack = new_stack(members.tree)
            trace_revolution_tree(table, members, rays, pieces, best, any_hit, scratch, stack, work)
        work[CHANGED] += np.count_nonzero(best.t[: len(pieces)] < t_guess)

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
        """Refine coarse hits on the surfaces by Newton iteration; lower ``best`` to them."""
        refine_revolutions(
            self.table, hits, coarse.triangles, self._rows(coarse.n_objects), rows, rays, best,
            np.empty(RAY), accepted,
        )  # fmt: skip

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits that are on surfaces of revolution."""
        row_of = self._rows(len(kind_of))
        row_of[kind_of != kind] = -1
        finish_revolutions(self.table, rays, best, row_of, np.empty(RAY), out)
        if self._is_moved:
            widen_bounds(self._moved, rays, best, kind_of, kind, out)

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        rays, best, out, work = ray
        none, nowhere, scratch = np.empty(0, np.int32), np.empty(0), _new_scratch(self.table)

        def plain(any_hit: bool) -> list[StoredCall]:
            return [
                StoredCall(
                    trace_revolutions, self.table, self._n_plain, rays, none, best, any_hit,
                    nowhere, scratch, work,
                )
            ]  # fmt: skip

        def in_tree(members: Members, any_hit: bool) -> list[StoredCall]:
            return [
                StoredCall(
                    trace_revolution_tree, self.table, members, rays, none, best, any_hit,
                    scratch, new_stack(members.tree), work,
                )
            ]  # fmt: skip

        bottoms = [bottom(self._plain_box, plain)] if self._n_plain else []
        bottoms += [
            bottom(box_of(members.tree, *members[2:]), partial(in_tree, members))
            for members in self._in_trees
        ]
        row_of = self._rows(len(kind_of))
        row_of[kind_of != kind] = -1
        finish = StoredCall(finish_revolutions, self.table, rays, best, row_of, np.empty(RAY), out)
        return Single(bottoms, [finish])

    @property
    def n_trees(self) -> int:
        """Number of trees."""
        return len(self._in_trees)


def _with_conversion(
    surface: SurfaceOfRevolution, points: FloatArray, radius: float
) -> tuple[float, float]:
    """Return by what to multiply the size, and what else to add to bounds, for what rounding did.

    Points of rational segments count as rounded, as `circular_arc` gives them: half an ulp each, and
    their weights as much. A few roundings of the size belong to the sum of `rounding`, which has at
    least 34 of them. More are added to the bounds of hits.
    """
    moved = surface.moved
    if surface.is_rational:
        moved += UNIT_ROUNDOFF * (float(np.hypot(*np.abs(points).max(axis=0))) + 2.0 * radius)
    units = moved / (UNIT_ROUNDOFF * radius)
    return (1.0 + units / 34.0, 0.0) if units <= FEW_ROUNDINGS else (1.0, moved)


def _net(surface: SurfaceOfRevolution, number: int, centre: float, scale: float) -> FloatArray:
    """Return a segment as the kernels take it, see `RevolutionTable.control`."""
    points = (surface.segments[number] - [centre, 0.0]) * scale
    weights = surface.weights[number]
    if weights is None:
        return np.column_stack([points, np.zeros(len(points))])
    return homogeneous(points, weights)


def _trim(
    surfaces: Sequence[TrimmedSurface],
    first_segment: list[int],
    segment_id: list[int],
    part: list[FloatArray],
    to_frame: list[float],
) -> Trim:
    """Return the loops of trimmed surfaces, a row for each segment; the kernels count u in turns."""
    counts = np.diff(first_segment)
    begin, share = np.repeat(np.array(part), counts, axis=0)[:, [BEGIN, SHARE]].T
    spans, scale = np.zeros((len(segment_id), 4)), np.zeros((len(segment_id), 4))
    spans[:, 1], spans[:, 3] = 1.0 / share, 1.0
    for k, surface in enumerate(surfaces):
        if surface.spans is not None:
            rows = slice(first_segment[k], first_segment[k + 1])
            spans[rows, 2:] = surface.spans[segment_id[rows], 2:]
    scale[:, 0], scale[:, 1] = begin, share
    return trim_of(surfaces, counts.tolist(), spans, np.repeat(to_frame, counts), scale)


def _number_rows(ends: list[list[FloatArray]], segment_id: list[int], first: int) -> None:
    """Replace numbers of segments, where ends go on, by rows of the table."""
    row_of = {number: first + k for k, number in enumerate(segment_id)}
    for end in (end for pair in ends for end in pair):
        end[END_NEXT] = row_of.get(int(end[END_NEXT]), -1)


def _part(surface: SurfaceOfRevolution) -> FloatArray:
    """Return the part of a turn as the kernels take it, see `PART`."""
    begin, end = surface.u_range
    share = end - begin
    mx, my = cosine_and_sine(0.5 * (begin + end))
    cosine, sine = cosine_and_sine(0.5 * share)
    return np.array([float(share < 1.0), mx, my, cosine, sine, begin - np.floor(begin), share])


def _from_rounded(surface: SurfaceOfRevolution, centre: float, point: FloatArray) -> FloatArray:
    """Return the point of the axis at a height, less what it was rounded to: along u, across, up."""
    exact = [
        Fraction(o) + Fraction(p) + Fraction(centre) * (Fraction(a) + Fraction(b)) - Fraction(at)
        for o, p, a, b, at in zip(
            surface.origin.tolist(), surface.remainder[0].tolist(),
            surface.axis.tolist(), surface.remainder[1].tolist(), point.tolist(), strict=True,
        )
    ]  # fmt: skip
    gap = np.array([float(x) for x in exact])
    frame = np.stack([surface.radial, surface.binormal, surface.axis])
    return frame @ gap


def _describe_end(
    surface: SurfaceOfRevolution, number: int, side: int, centre: float, scale: float
) -> FloatArray:
    """Return an end of a segment (s = 0, s = 1) as the kernels take it, see `END`."""
    segments = [segment if k else segment[::-1] for segment in surface.segments for k in (1, 0)]
    weights = [w if k or w is None else w[::-1] for w in surface.weights for k in (1, 0)]
    size = np.abs(np.concatenate(surface.segments)).max()
    me = 2 * number + side
    net = segments[me]
    row = np.zeros(END)
    row[END_NEXT] = -1.0
    row[END_Z], row[END_R] = (net[0] - [centre, 0.0]) * scale
    row[END_TANGENT : END_TANGENT + 3] = tangent = _leave(net, weights[me], size, scale)
    if net[0, 1] <= JOINED * size:
        row[END_KIND], row[END_R] = TIP, 0.0
        row[END_TANGENT + 3 : END_NEXT] = tangent * (1.0, -1.0, -1.0)
        return row
    # The profile goes on in the segment drawn next, or in any that ends here.
    others = sorted(
        (k for k in range(len(segments)) if k != me), key=lambda k: abs(k - me - (2 * side - 1))
    )
    for k in others:
        if np.abs(segments[k][0] - net[0]).max() <= JOINED * size:
            row[END_KIND] = BEND
            row[END_TANGENT + 3 : END_NEXT] = _leave(segments[k], weights[k], size, scale)
            speed = _speed(segments[k], weights[k]) * scale
            row[END_NEXT:] = k // 2, k % 2, speed
            return row
    row[END_KIND] = RIM
    return row


def _leave(net: FloatArray, weights: FloatArray | None, size: float, scale: float) -> FloatArray:
    """Return the unit tangent (z, r) with which a segment begins, and its curvature there."""
    steps = np.hypot(*(net - net[0]).T)
    first = int(np.argmax(steps > JOINED * size))
    tz, tr = (net[first] - net[0]) / steps[first]
    curvature = 0.0  # of a resting start: none that a number could tell
    if first == 1 and len(net) > 2:
        n = len(net) - 1
        bend = (net[2] - net[1]) - (net[1] - net[0])
        curvature = (n - 1) / n * (tz * bend[1] - tr * bend[0]) / steps[1] ** 2 / scale
        if weights is not None:
            curvature *= weights[0] * weights[2] / weights[1] ** 2
    return np.array([tz, tr, curvature])


def _speed(net: FloatArray, weights: FloatArray | None) -> float:
    """Return the length of the derivative with which a segment begins."""
    ratio = 1.0 if weights is None else float(weights[1] / weights[0])
    return (len(net) - 1) * ratio * float(np.hypot(*(net[1] - net[0])))


def _outlines(ends: list[FloatArray]) -> int:
    """Bits of the ends of a segment (s = 0, s = 1) where the surface has an edge or a tip."""
    bits = 0
    for k, end in enumerate(ends):
        (az, ar, _), (bz, br, _) = np.split(end[END_TANGENT:END_NEXT], 2)
        bends = abs(az * br - ar * bz) > STRAIGHT or az * bz + ar * br > 0.0
        if end[END_KIND] == RIM or bends:
            bits |= 1 << k
    return bits


def _new_scratch(table: RevolutionTable) -> RevolutionScratch:
    """Return scratch for one call of `trace_revolutions`."""
    return RevolutionScratch(
        net=np.empty((int(table.degree.max()) + 1, 3)),
        stack=np.empty((DEPTH, 2)),
        piece=np.empty(PIECE),
        ray=np.empty(RAY),
    )
