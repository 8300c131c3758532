"""Surfaces cut by curves in their parameters: holes, and faces of parts with any outline."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import (
    BoolArray,
    FloatArray,
    IdArray,
    as_affine,
    as_floats,
    broadcast_parameters,
    freeze,
    number,
    shown,
)
from meshing.curve2 import Curve2
from meshing.kernels.trims import TrimTable, classify_points
from meshing.spans import within_patch
from meshing.surface import Surface
from meshing.trimmed_area import TrimmedCells
from meshing.trims import JOINED, as_loops, boxes_outside, make_table, sides_of_boxes

# A shorter segment of a profile would have too few digits of v for curves across it.
LEAST_SHARE = 1e-9
# Corners on each curve of the polygon by which a loop's overlap with copies of itself is looked for, and
# the whole turns by which these are moved; the opposite ones tell the same.
SAMPLES = 32
WHOLE_TURNS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 0), (0, 2), (2, 1), (2, -1), (1, 2), (1, -2))
# Borders nearer to each other than this, over the size of the surface, were meant to meet; a loop that leaves the
# unit square by less is not meant to go on beyond.
MEANT_TO_MEET, BEYOND, GAPS = 1e-9, 1e-5, 4.0


def _own(name: str) -> Any:
    """Return a property that is that of the untrimmed surface."""
    return property(attrgetter(f"surface.{name}"), doc="That of the untrimmed surface.")


class TrimmedSurface(Surface):
    """The part of a surface inside closed loops of curves in its (u, v).

    A point belongs to the surface if the loops together go around its (u, v) an odd number of
    times. So loops may be an outline, holes in it and islands in these, in any order and direction. (A hole
    that reaches over the outline is an island where it is outside.)
    To cut a hole into a whole surface, add the border of the unit square as a loop. Parts of loops
    outside the unit square enclose nothing. On a surface that closes on itself (`closes`), write a
    loop across the seam in one piece, with u or v below 0 or above 1; its copies one turn away count
    as well. Surfaces of revolution close around the axis, or where the profile ends where it begins;
    patches, sheets and NURBS surfaces close where the first and the last control points are equal to
    the bit; a periodic NURBS surface where those of its Bezier patches are, as with whole numbers for knots.

    A hit is the first root inside the loops. Which side of a curve a point is on is decided by the
    curves as they are given, without approximation. If rounding leaves it undecided, the hit or
    miss is TANGENT.

    As a lamp it shines inside the loops. Hits within the gap of an edge shine as well, but no points
    are sampled there, and no photons start there.

    Parameters
    ----------
    surface : Surface
        One Bezier patch, a sheet of patches or a `NurbsSurface`; a `SurfaceOfRevolution`
        (`Cylinder`, `Cone`); or a `hybrid_rt.Rectangle`, `Sphere`, `Torus` or `Asphere`. Of a
        profile of several segments u and v are those of a sheet: v goes on from segment to segment,
        which begin at `SurfaceOfRevolution.v_breaks`. Loops, hits and `point` take and give that v.
        Of what is turned (`Asphere`, `SurfaceOfRevolution`, `Sphere`) u is the azimuth over a turn: a hole
        about the axis ends at a straight line of constant v, not at a circle in (u, v).
    loops : sequence of sequences of Curve2
        In each loop a curve begins where the one before ends, and the first where the last one
        ends. Ends that are up to 1e-5 apart are joined by a straight line.
    gap : float
        Distance, in scene units, by which neighbouring faces of a part may disagree about their
        common edge; at a curve its `gap_share` of it. Roots outside the loops within ``gap / |cos|`` of a
        curve are hits too, where cos is the cosine between ray and normal, and at least 1e-3. They and the
        roots equally near inside have the flag EDGE, and ``gap / |cos|`` is part of their ``t_bound``. 0: no
        such hits. Where a loop runs along the border of the surface itself only the roots inside have the
        flag, as there is no surface beyond: let it reach at least a gap farther than its loops.

    Raises
    ------
    TypeError, ValueError
        For any other surface, no loops, an empty or open loop, a segment shorter than 1e-9 of its
        profile, and a negative gap. For a loop beyond a border at which the surface closes up to
        rounding only: half of what it encloses would be missing. And for a loop that, wrapped around a
        surface that closes, overlaps itself by more than 1e-5: it would cancel itself there. (It may
        touch itself, as a band from u = 0 to 1 does; different loops may overlap, see above.)

    Attributes
    ----------
    surface, loops, gap
        As given; the loops are tuples that include the joining lines.
    """

    def __init__(
        self, surface: Surface, loops: Iterable[Iterable[Curve2]], gap: float = 0.0
    ) -> None:
        if not isinstance(surface, Surface) or not surface.flip_of_uv:
            raise TypeError(
                f"TrimmedSurface surface is {shown(surface)}: pass one of Bezier patches, a "
                "NurbsSurface, a SurfaceOfRevolution, a Rectangle, Sphere, Torus or Asphere; no other "
                "is trimmed"
            )
        if surface.v_breaks is not None:
            _check_shares(surface, surface.v_breaks)
        elif len(surface) != 1 and surface.spans is None:
            raise ValueError(
                f"TrimmedSurface surface is {shown(surface)}, of {len(surface)} pieces with (u, v) of "
                "their own: trim each alone, or patches side by side as a PatchSheet"
            )
        self.surface = surface
        self.loops = as_loops(loops)
        self.gap = number(gap, "TrimmedSurface gap", at_least=0.0, hint="in scene units")
        self._refuse_missed_seams()
        for k, loop in enumerate(self.loops):
            _refuse_overlap(loop, self.closes, k)

    def _refuse_missed_seams(self) -> None:
        """Refuse loops across a seam that was meant to close: what lies beyond would be lost unseen."""
        size = float(np.linalg.norm(np.ptp(self.surface.bounds, axis=0)))
        # A face of a part may reach some gaps beyond its border.
        beyond = max(BEYOND, GAPS * self.gap / size)
        for axis in np.flatnonzero(np.logical_not(self.closes)).tolist():
            apart: float | None = None
            for k, loop in enumerate(self.loops):
                x = np.concatenate([c.control[:, axis] for c in loop])
                if x.min() >= -beyond and x.max() <= 1.0 + beyond:
                    continue
                at = np.concatenate([c.point([0.0, *c.cuts(), 1.0])[:, axis] for c in loop])
                low, high = float(at.min()), float(at.max())
                # One that leaves by both sides goes all around.
                if (low < -beyond) == (high > 1.0 + beyond):
                    continue
                apart = self._borders_apart(axis) if apart is None else apart
                if apart > MEANT_TO_MEET * size:
                    break
                name, value = "uv"[axis], low if low < 0.0 else high
                raise ValueError(
                    f"TrimmedSurface loops[{k}] goes on to {name} = {value:.6g}, but the surface closes along "
                    f"{name} only up to {apart:.1g}: make its first and last control points, and weights, "
                    "equal to the bit (of a periodic NurbsSurface: by whole numbers as knots), or end the "
                    "loop at the border and add its other part at the other one"
                )

    def _borders_apart(self, axis: int) -> float:
        """Return how far the borders of an axis are apart at most, as far as 33 points tell."""
        along = np.linspace(0.0, 1.0, 33)
        begin, end = (
            self.point(*((np.full(33, at), along) if axis == 0 else (along, np.full(33, at))))
            for at in (0.0, 1.0)
        )
        return float(np.linalg.norm(end - begin, axis=1).max())

    closes, poles = _own("closes"), _own("poles")
    is_freeform, is_flat = _own("is_freeform"), _own("is_flat")
    bounds, middle, size = _own("bounds"), _own("middle"), _own("size")
    rounding_reach, revolution_frame = _own("rounding_reach"), _own("revolution_frame")
    pieces = _own("pieces")

    def __len__(self) -> int:
        """Return the number of patches of the surface."""
        return len(self.surface)

    def __repr__(self) -> str:
        """Name the surface, and count loops and curves."""
        n, curves = len(self.loops), sum(map(len, self.loops))
        words = f"{n} loop{'s' * (n > 1)} of {curves} curve{'s' * (curves > 1)}"
        return f"TrimmedSurface({self.surface!r}, {words}{f', gap={self.gap:g}' * (self.gap > 0)})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle surface and loops; loading checks them again."""
        return type(self), (self.surface, [list(loop) for loop in self.loops], self.gap)

    def contains(self, u: ArrayLike, v: ArrayLike) -> tuple[BoolArray, BoolArray]:
        """Tell which (u, v) are inside the loops.

        Parameters
        ----------
        u, v : float array-like, broadcast with each other, from 0 to 1
            Points of the border of the unit square count as just inside it.

        Returns
        -------
        inside : (...) bool
            The axes are those of the broadcast arguments: none for scalars.
        in_band : (...) bool
            Whether rounding leaves the side undecided: a curve of degree d passes within
            2^-52 (8 d + 14), or twice that if curves leave the unit square. Elsewhere ``inside`` is
            proven.
        """
        u, v, _, shape = broadcast_parameters(u, v, 0, 1)
        inside, in_band = np.empty(u.size, np.bool_), np.empty(u.size, np.bool_)
        classify_points(self.table, 0, u, v, inside, in_band)
        return inside.reshape(shape), in_band.reshape(shape)

    def is_outside(self, boxes: FloatArray) -> BoolArray:
        """Tell which boxes (k, 4), given as u0, u1, v0, v1, have no point inside the loops."""
        return boxes_outside(self.table, 0, boxes)

    def sides(self, boxes: FloatArray) -> NDArray[np.uint8]:
        """Tell whether boxes (k, 4) u0, u1, v0, v1 are `INSIDE` the loops, `OUTSIDE` or `CROSSED`.

        These are of `meshing.kernels.trims`; the first two are proven.
        """
        return sides_of_boxes(self.table, 0, boxes)

    @cached_property
    def table(self) -> TrimTable:
        """The loops as the classifier takes them."""
        return make_table([self])

    @cached_property
    def spans(self) -> FloatArray | None:
        """(k, 4): u0, u1, v0, v1 of each patch or segment; None: there is one."""
        at, border = self.surface.v_breaks, np.zeros(len(self.surface))
        if at is None or len(self.surface) == 1:
            return self.surface.spans
        return freeze(np.stack([border, border + 1.0, at[:-1], at[1:]], axis=1))

    @property
    def joined_spans(self) -> FloatArray | None:
        """The ``spans`` of segments, each of which has a (u, v) of its own in the untrimmed surface.

        None: the (u, v) of both surfaces are the same.
        """
        return self.spans if self.surface.spans is None else None

    def _patch_at(self, u: ArrayLike, v: ArrayLike) -> ArrayLike:
        if self.joined_spans is None:
            return self.surface._patch_at(u, v)
        return np.searchsorted(self.joined_spans[1:, 2], as_floats(v, "v"), side="right")

    def _within(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> tuple[Any, ...]:
        """Return what the surface's own functions take of points."""
        spans = self.joined_spans
        return *((u, v) if spans is None else within_patch(spans, u, v, patch_id)), patch_id

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        return self.surface._points(*self._within(u, v, patch_id))

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        s_u, s_v = self.surface._partials(*self._within(u, v, patch_id))
        if self.joined_spans is not None:
            s_v /= np.diff(self.joined_spans[patch_id, 2:], axis=1)
        return s_u, s_v

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        return self.surface._normals(*self._within(u, v, patch_id))

    def transformed(self, matrix: ArrayLike) -> TrimmedSurface:
        """Return the image, with the same (u, v) and loops; the gap grows by the largest scale."""
        image = self.surface.transformed(matrix)
        linear, _ = as_affine(matrix, "TrimmedSurface")
        # Similarities keep a gap to the bit where their scale is a power of two.
        scale = float(np.linalg.norm(linear, 2)) if self.gap > 0.0 else 1.0
        return TrimmedSurface(image, self.loops, self.gap * scale)

    def flipped(self) -> TrimmedSurface:
        """Return the same surface with its normal reversed; loops follow its (u, v)."""
        return TrimmedSurface(
            self.surface.flipped(),
            [[self._turned(c) for c in loop] for loop in self.loops],
            self.gap,
        )

    def _turned(self, curve: Curve2) -> Curve2:
        if self.surface.flip_of_uv == "swapped":
            return Curve2(curve.control[:, ::-1], curve.weights, curve.gap_share)
        if self.surface.flip_of_uv == "u reversed":
            scale, shift = (-1.0, 1.0), (1.0, 0.0)
        else:
            scale, shift = (1.0, -1.0), (0.0, 1.0)
        return Curve2(curve.control * scale + shift, curve.weights, curve.gap_share)

    def area_sampler(self) -> TrimmedCells:
        """Return the area sampler: some points that it chooses are outside the loops."""
        return self._area_sampler

    @cached_property
    def _area_sampler(self) -> TrimmedCells:
        return TrimmedCells(self)


def _refuse_overlap(loop: Sequence[Curve2], closes: tuple[bool, bool], number: int) -> None:
    """Refuse a loop that covers a part twice when it is wrapped around: that would count as outside."""
    hull = np.ptp(np.concatenate([c.control for c in loop]), axis=0)
    if (hull <= np.where(closes, 1.0 + JOINED, np.inf)).all():
        return  # copies a turn away do not reach it
    along = np.linspace(0.0, 1.0, 2 * SAMPLES, endpoint=False)
    samples = np.concatenate([c.point(along) for c in loop])
    corners = samples[::2]
    width = np.ptp(corners, axis=0)
    # How far curves are from the polygon of every second point, about.
    bend = np.abs(samples[1::2] - 0.5 * (corners + np.roll(corners, -1, axis=0))).max()
    for turn in WHOLE_TURNS:
        if any(t and not c for t, c in zip(turn, closes, strict=True)):
            continue
        if (width <= np.abs(turn) + JOINED).any():
            continue  # the boxes of both copies meet in no more than a border
        points = samples + turn
        deep = points[_depths(points, corners) > JOINED + 4.0 * bend]
        if len(deep):
            u, v = (deep[0] % 1.0).tolist()
            raise ValueError(
                f"TrimmedSurface loops[{number}] is {width[0]:.6g} wide in u and {width[1]:.6g} in v, and overlaps "
                f"itself after whole turns, at (u, v) = ({u:.6g}, {v:.6g}) for one: what it covers twice would be "
                "outside. End it where it began a turn before: a band all around goes from 0 to 1"
            )


def _depths(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return how far each point (n, 2) is from the border of a polygon, below zero outside."""
    begin, way = corners, np.roll(corners, -1, axis=0) - corners
    square = np.maximum((way**2).sum(axis=1), 1e-300)
    depths = np.empty(len(points))
    for k, point in enumerate(points):
        away = point - begin
        share = np.clip((away * way).sum(axis=1) / square, 0.0, 1.0)
        distance = np.hypot(*(away - share[:, None] * way).T).min()
        straddles = (away[:, 1] >= 0.0) != (away[:, 1] >= way[:, 1])
        at = away[straddles, 1] / way[straddles, 1] * way[straddles, 0]
        is_inside = np.count_nonzero(away[straddles, 0] < at) % 2
        depths[k] = distance if is_inside else -distance
    return depths


def _check_shares(surface: Surface, breaks: FloatArray) -> None:
    """Refuse segments too short for one v across all of them."""
    shares = np.diff(breaks)
    k = int(shares.argmin())
    if not shares[k] >= LEAST_SHARE:
        raise ValueError(
            f"TrimmedSurface surface is {shown(surface)}, of which segment {k} is {shares[k]:.3g} of "
            f"the profile: pass segments of at least {LEAST_SHARE:g}, or leave it out"
        )
