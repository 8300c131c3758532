"""Triangles of trimmed surfaces, cut along their loops.

Leaves inside the loops are triangulated whole, those that a curve crosses within what the chords of the
curves enclose. With |S_u| <= p and |S_v| <= q, points (du, dv) apart in (u, v) are at most p |du| + q |dv| apart
in space. That bounds how far arcs are from their chords, and so how far points inside the loops and not the
chords, or the other way round, are from the other's border, as they lie between an arc and its chord. This and
the bound of the leaves add up.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from meshing.bounds import TooManyTrianglesError
from meshing.checks import BoolArray, FloatArray, IdArray, shown
from meshing.kernels import clipping
from meshing.kernels.trims import (
    CROSSED,
    GAP_SHARE,
    INSIDE,
    OUTSIDE,
    X_HIGH,
    X_LOW,
    Y_HIGH,
    Y_LOW,
)
from meshing.leaves import Cut, cut, rings_of_leaves
from meshing.profiles import halve_curve
from meshing.seams import label_points
from meshing.spans import across
from meshing.trimmed import TrimmedSurface

# The share of a tolerance for the leaves; that for the chords is the rest of it.
OF_LEAVES = 0.75
# Curves of files miss the border of the unit square by as much where they are meant to run along it.
ON_BORDER = 1e-9
# Points of edges that meet agree up to roundings of many steps; over the largest coordinate.
ROUNDING = 2.0**-40
# Parts of an interval in which the nearest point is looked for, of which two are left each time.
SECTIONS, SEARCH_STEPS = 10, 20
# Leaves that more chords cross are cut into four.
MOST_CHORDS = 48
# Halvings of an arc into chords.
DEEPEST = 30


class Face:
    """A trimmed surface cut into leaves."""

    points: FloatArray
    faces: NDArray[np.int64]
    uv: FloatArray
    patch_id: NDArray[np.int32]
    border: NDArray[np.int64]
    """Rows of ``points`` on edges of one triangle."""
    gaps: FloatArray
    """The gap at each of these, and what rounding adds."""
    bound: float

    def __init__(self, surface: TrimmedSurface, tolerance: float, max_triangles: int) -> None:
        self.surface, self.tolerance, self.max_triangles = surface, tolerance, max_triangles
        whole = surface.surface.pieces
        pieces = cut(whole, OF_LEAVES * tolerance, max_triangles)
        leaves, boxes, states = self._kept(pieces, pieces.leaves)
        is_crossed = states == CROSSED
        steps = self._steps_in(boxes[is_crossed], leaves[is_crossed, 0])
        widths = boxes[is_crossed, 1::2] - boxes[is_crossed, ::2]
        # From the middle of a leaf the first partials change by half the second ones, which are at most twelve
        # times the bound.
        most = (steps + 6.0 * pieces.bound / widths).max(axis=0, initial=0.0)
        # Ends of curves that miss the border by roundings are on it.
        ends = surface.table.piece.copy()
        for column in (X_LOW, Y_LOW, X_HIGH, Y_HIGH):
            nearest = np.round(ends[:, column])
            is_near = np.abs(ends[:, column] - nearest) <= ON_BORDER
            ends[is_near, column] = nearest[is_near]
        self._table = surface.table._replace(piece=ends)
        # (u, v) of vertices are rounded, and so is what they are on their patch.
        rounded = (
            float(np.abs(ends - surface.table.piece).max(initial=0.0))
            + 2.0 * float(surface.table.error[0])
            + 8.0 * clipping.NEAR
            + 2.0**-51 / min(1.0, widths.min(initial=1.0))
        )
        self._rounded = rounded * float(most.sum())
        bound = pieces.bound + self._rounded
        allowed = max(tolerance - bound, (1.0 - OF_LEAVES) * tolerance)
        self._nets = surface.table.net * (*np.maximum(most, 1e-300), 1.0)
        cuts_of = {
            start: self._cuts_of_arc(self._nets[start : start + degree + 1], allowed)
            for start, degree in np.unique(surface.table.arc, axis=0).tolist()
        }
        self._cuts = [cuts_of[start] for start in surface.table.arc[:, 0].tolist()]
        self._leaf_bound = bound
        # The time that a leaf takes grows as the square of its chords.
        while (many := self._has_many_chords(leaves, boxes, states)).any():
            quarters = self._kept(pieces, _quarters(leaves[many]))
            leaves = np.concatenate([leaves[~many], quarters[0]])
            boxes = np.concatenate([boxes[~many], quarters[1]])
            states = np.concatenate([states[~many], quarters[2]])
        self._rings = rings_of_leaves(whole, pieces._replace(leaves=leaves))
        self._at = np.stack(self._across(*self._rings.at, self._rings.patch), axis=1)
        self._is_inside, is_crossed = states == INSIDE, states == CROSSED
        self._boxes, self._patch = boxes[is_crossed], leaves[is_crossed, 0].astype(np.int64)
        self._steps = self._steps_in(self._boxes, self._patch)
        self.rounding = ROUNDING * max(surface.reach, surface.size)

    def _kept(
        self, pieces: Cut, leaves: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], FloatArray, NDArray[np.uint8]]:
        """Return the leaves that are not outside the loops, their boxes, and on which side they are."""
        patch, *sides = leaves.T.astype(np.int64)
        u0, v0 = self._across(sides[0] / pieces.units[0], sides[2] / pieces.units[1], patch)
        u1, v1 = self._across(sides[1] / pieces.units[0], sides[3] / pieces.units[1], patch)
        boxes = np.stack([u0, u1, v0, v1], axis=1)
        states = self.surface.sides(boxes)
        kept = states != OUTSIDE
        return leaves[kept], boxes[kept], states[kept]

    def _steps_in(self, boxes: FloatArray, patch: IdArray) -> FloatArray:
        """Return |S_u| and |S_v| (n, 2) in the middle of leaves."""
        u0, u1, v0, v1 = boxes.T
        steps = self.surface.partials(0.5 * (u0 + u1), 0.5 * (v0 + v1), patch)
        return np.stack([np.linalg.norm(step, axis=1) for step in steps], axis=1)

    def _has_many_chords(
        self, leaves: NDArray[np.int32], boxes: FloatArray, states: NDArray[np.uint8]
    ) -> BoolArray:
        """Tell which leaves are to be quartered, and can be."""
        many: BoolArray = ((leaves[:, [2, 4]] - leaves[:, [1, 3]]) % 2 == 0).any(axis=1)
        many &= states == CROSSED
        cuts, first_cut = self._all_cuts()
        for i in np.flatnonzero(many):
            data = self._table, boxes[i], cuts, first_cut, np.empty((0, 7))
            many[i] = clipping.chords_in_box(*data) > MOST_CHORDS
        return many

    def _all_cuts(self) -> tuple[FloatArray, NDArray[np.int64]]:
        first = np.cumsum([0, *map(len, self._cuts)])
        return np.concatenate([np.empty(0), *self._cuts]), first

    def _across(
        self, u: FloatArray, v: FloatArray, patch: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        spans = self.surface.spans
        return (u, v) if spans is None else across(spans, u, v, patch)

    def _cuts_of_arc(self, net: FloatArray, allowed: float) -> FloatArray:
        """Return parameters between which chords are near enough to an arc, in scene units."""
        parts, begins, width = net[:, None], np.zeros(1), 1.0
        found = [np.empty(0)]
        while True:
            # Two arcs with the same ends have different chords.
            limit = ROUNDING * allowed if width == 1.0 else allowed
            goes_on = (_distances_of_chords(parts) > limit) & (width > 2.0**-DEEPEST)
            if not goes_on.any():
                return np.sort(np.concatenate(found))
            begins, width = begins[goes_on], 0.5 * width
            found.append(begins + width)
            if 2 * len(begins) > self.max_triangles:
                raise TooManyTrianglesError(2.0 * len(begins), self.max_triangles, self.tolerance)
            parts = np.concatenate(halve_curve(parts[:, goes_on]), axis=1)
            begins = np.concatenate([begins, found[-1]])

    def _chords_off(self) -> float:
        """Bound how far chords are from their arcs, in space."""
        arcs = self._table.arc[self._chords[:, 4].astype(np.int64)]
        largest = 0.0
        for start, degree in np.unique(arcs, axis=0).tolist():
            s = self._chords[arcs[:, 0] == start, 5:]
            parts = _parts_of_arc(self._nets[start : start + degree + 1], *s.T)
            largest = max(largest, float(_distances_of_chords(parts).max()))
        return largest

    def add_cuts(self, places: FloatArray) -> None:
        """Cut pieces at places (k, 2), piece and parameter, as well."""
        pieces, at = places[:, 0].astype(np.int64), places[:, 1]
        for p in np.unique(pieces):
            self._cuts[p] = np.union1d(self._cuts[p], at[pieces == p])

    def triangulate(self) -> None:
        """Make the triangles, with vertices at all cuts."""
        rings = self._rings
        faces, uv, patch_id = rings.triangles(self._is_inside, self.tolerance, self.max_triangles)
        u, v = self._across(uv[..., 0], uv[..., 1], patch_id[:, None].astype(np.int64))
        corners, owner = self._crossed_triangles()
        # A vertex is known by its patch, u and v.
        grid = np.column_stack([rings.patch, self._at])
        wanted = np.column_stack([np.repeat(owner, 3), corners.reshape(-1, 2)])
        rows, place = np.unique(np.concatenate([grid, wanted]), axis=0, return_inverse=True)
        row_of = np.full(len(rows), -1)
        row_of[place[: len(grid)]] = rings.weld
        new = np.flatnonzero(row_of < 0)
        row_of[new] = len(rings.points) + np.arange(len(new))
        patch = rows[new, 0].astype(np.int64)
        added = self.surface.point(rows[new, 1], rows[new, 2], patch).reshape(-1, 3)
        points = np.concatenate([rings.points, added])
        faces = np.concatenate([faces, row_of[place[len(grid) :]].reshape(-1, 3)])
        uv = np.concatenate([np.stack([u, v], axis=-1), corners])
        patch_id = np.concatenate([patch_id, owner.astype(np.int32)])
        # Both sides of a seam, and what meets at a pole.
        border = _border(faces)
        label, _ = label_points(points[border], self.rounding) if len(border) else (border, 0.0)
        _, chosen, row = np.unique(label, return_index=True, return_inverse=True)
        target = np.arange(len(points))
        target[border] = border[chosen][row]
        moved = float(np.linalg.norm(points - points[target], axis=1).max(initial=0.0))
        faces = target[faces]
        kept = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        self.points, self.faces = points, faces[kept]
        self.uv, self.patch_id = uv[kept], patch_id[kept]
        self.border = _border(self.faces)
        self.gaps = self._gaps_at(points[self.border])
        self.bound = self._leaf_bound + self._chords_off() + moved

    def _gaps_at(self, border: FloatArray) -> FloatArray:
        """Return the gap at vertices of the border: that of the widest curve with an end of a chord there."""
        n = len(border)
        gaps = np.full(n, self.surface.gap)
        if n and self.surface.gap:
            ends = self._points(self._chords[:, :4].reshape(-1, 2))
            label, _ = label_points(np.concatenate([border, ends]), self.rounding + self._rounded)
            share = self._table.piece[self._chords[:, 4].astype(np.int64), GAP_SHARE]
            widest = np.full(n + len(ends), -1.0)
            np.maximum.at(widest, label[n:], np.repeat(share, 2))
            own = widest[label[:n]]
            gaps *= np.where(own < 0.0, 1.0, own)
        found: FloatArray = gaps + self.rounding
        return found

    @property
    def box(self) -> FloatArray:
        """(2, 3) corners of a box around the part inside the loops; of nothing it meets none."""
        points = self.points[self.faces.ravel()]
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        return np.stack([low - self.bound, high + self.bound])

    def _crossed_triangles(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return (u, v) of the corners of triangles in crossed leaves, (n, 3, 2), and their patches."""
        table, boxes = self._table, self._boxes
        cuts, first_cut = self._all_cuts()
        room = np.empty((len(cuts) + len(self._cuts), 7))
        counts, found = [], [np.empty((0, 7))]
        for box in boxes:
            counts.append(clipping.chords_in_box(table, box, cuts, first_cut, room))
            found.append(room[: counts[-1]].copy())
        self._chords = np.concatenate(found)
        ends = self._chords[:, :4].reshape(-1, 2)
        lines = self._lines(ends, np.repeat(boxes, 2 * np.array(counts, np.int64), axis=0))
        chords = np.split(ends.reshape(-1, 4), np.cumsum(counts)[:-1])
        rings = [_ring(box, lines, self.surface.closes) for box in boxes]
        # Which parts of sides are inside tell their middles, where these and points a little inside agree.
        beside = 4.0 * ON_BORDER
        middles = [0.5 * (ring + np.roll(ring, -1, axis=0)) for ring in rings]
        within = [
            np.clip(at, box[::2] + beside, box[1::2] - beside)
            for at, box in zip(middles, boxes, strict=True)
        ]
        on_side, in_band = self.surface.contains(*np.concatenate([np.empty((0, 2)), *middles]).T)
        is_inside, _ = self.surface.contains(*np.concatenate([np.empty((0, 2)), *within]).T)
        sides = is_inside, in_band | (on_side != is_inside)
        first = np.cumsum([0, *map(len, rings)])
        filled, owner = [np.empty((0, 3, 2))], [np.empty(0, np.int64)]
        for i, ring in enumerate(rings):
            own = [side[first[i] : first[i + 1]] for side in sides]
            filled.append(self._fill(i, ring, chords[i], *own))
            owner.append(np.full(len(filled[-1]), self._patch[i]))
        return np.concatenate(filled), np.concatenate(owner)

    def _lines(self, ends: FloatArray, boxes: FloatArray) -> list[NDArray[np.complex128]]:
        """Return all vertices on lines of constant u, u + v i, and on those of constant v, v + u i; sorted.

        Ends of chords (n, 2) in boxes (n, 4) move onto sides that are nearer than NEAR, and along these onto
        vertices as near, one across the seam included: both sides of it have the same vertices.
        """
        lines = []
        for axis in (0, 1):
            is_on = np.zeros(len(ends), np.bool_)
            for side in boxes[:, 2 * axis], boxes[:, 2 * axis + 1]:
                is_near = np.abs(ends[:, axis] - side) <= clipping.NEAR
                ends[is_near, axis] = side[is_near]
                is_on |= is_near
            points = np.concatenate([self._at, ends[is_on]])
            line, along = points[:, axis], points[:, 1 - axis]
            if self.surface.closes[axis]:
                line = np.where(line == 1.0, 0.0, line)
            order = np.lexsort((along, line))
            begins = np.diff(line[order], prepend=-1.0) != 0.0
            begins |= np.diff(along[order], prepend=-1.0) > clipping.NEAR
            # The first of those given: one of the grid, if there is one.
            chosen = np.minimum.reduceat(order, np.flatnonzero(begins)) if len(order) else order
            moved = np.empty(len(order))
            moved[order] = along[chosen][np.cumsum(begins) - 1]
            ends[is_on, 1 - axis] = moved[len(self._at) :]
            lines.append(line[chosen] + 1j * along[chosen])
        return lines

    def _fill(
        self, i: int, ring: FloatArray, chords: FloatArray, inside: BoolArray, is_open: BoolArray
    ) -> FloatArray:
        """Return the (u, v) of triangles of a leaf, (n, 3, 2).

        Each part of its ring is ``inside`` or not, but where that ``is_open``.
        """
        corner, far = self._boxes[i, ::2], self._boxes[i, 1::2]
        ends = chords.reshape(-1, 2)
        near, which = np.nonzero(
            np.abs(ends[:, None] - ring).max(axis=2, initial=0.0) <= clipping.NEAR
        )
        ends[near] = ring[which]
        a, b = chords[:, :2], chords[:, 2:]
        chords = chords[~((a == b) & ((a == corner) | (a == far) | (a == b)[:, ::-1])).any(axis=1)]
        room, split = chords, -1
        while split < 0:
            room = np.resize(room, (2 * len(room) + 16, 4))
            room[: len(chords)] = chords
            split = clipping.split_at_crossings(room, len(chords), self._boxes[i])
        chords = _without_pairs(room[:split])
        n = len(ring)
        points = np.concatenate([ring, chords.reshape(-1, 2)])
        _, chosen, place = np.unique(points @ (1.0, 1j), return_index=True, return_inverse=True)
        is_end = np.bincount(place[n:], minlength=len(chosen))[place[:n]] % 2 == 1
        # Past each end of a chord the ring changes sides.
        is_odd = (np.cumsum(is_end) - is_end[0]) % 2 == 1
        lengths = np.abs(np.roll(ring, -1, axis=0) - ring) @ self._steps[i] + 1e-300
        votes = np.where(is_open, 1e-9, 1.0) * lengths
        base = bool(2.0 * votes[inside ^ is_odd].sum() > votes.sum())
        at_left, at_bottom = (
            ring[(ring[:, axis] == corner[axis]) & is_end, 1 - axis] for axis in (0, 1)
        )
        turned = np.empty(len(chords), np.bool_)
        clipping.turn_inside_left(chords, at_left, at_bottom[at_bottom > corner[0]], base, turned)
        edges = place[n:].reshape(-1, 2)
        edges = np.where(turned[:, None], edges[:, ::-1], edges)
        around = np.column_stack([place[:n], np.roll(place[:n], -1)])[is_odd ^ base]
        edges = np.concatenate([around, edges])
        front = np.empty((4 * len(edges) + 16, 2), np.int64)
        front[: len(edges)] = edges
        faces = np.empty((2 * len(edges) + 16, 3), np.int64)
        # Powers of two, so that what is on a line stays there.
        scale = np.ldexp(1.0, np.frexp(np.maximum(self._steps[i], 1e-300))[1])
        at = points[chosen]
        places = self.surface.point(at[:, 0], at[:, 1], self._patch[i]).reshape(-1, 3)
        count = clipping.fill((at - corner) * scale, places, front, len(edges), faces)
        filled: FloatArray = at[faces[:count]]
        area = np.linalg.det(np.stack([at[edges[:, 0]], at[edges[:, 1]]], axis=1) - corner).sum()
        areas = np.linalg.det(filled[:, 1:] - filled[:, :1])
        if abs(np.abs(areas).sum() - area) > ROUNDING * np.prod(far - corner):
            u, v = corner.tolist()
            raise ValueError(
                f"tessellate surface is {shown(self.surface)}: near (u, v) = ({u:.6g}, {v:.6g}) its loops come too "
                "near to each other to be told apart: move one, or leave out what they enclose there"
            )
        return filled

    def places_near(self, points: FloatArray) -> FloatArray:
        """Return places (k, 2) on pieces that are near points and have no vertex there yet.

        Points are (n, 4): x, y, z, and how near, besides the gap of the piece.
        """
        chords = self._chords
        chords = chords[chords[:, 5] != chords[:, 6]]
        gap_of = self.surface.gap * self._table.piece[:, GAP_SHARE]
        gap_of_chord = gap_of[chords[:, 4].astype(np.int64)]
        begin, end = (self._points(chords[:, k : k + 2]) for k in (0, 2))
        way, own = end - begin, self.points[self.border]
        square = np.maximum((way**2).sum(axis=1), 1e-300)
        chosen, owner = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for k, (*point, gap) in enumerate(points.tolist()):
            if (((own - point) ** 2).sum(axis=1) <= (gap + self.gaps) ** 2).any():
                continue
            away = point - begin
            share = np.clip((way * away).sum(axis=1) / square, 0.0, 1.0)
            apart = ((away - share[:, None] * way) ** 2).sum(axis=1)
            chosen.append(np.flatnonzero(apart <= (gap + gap_of_chord + 2.0 * self.bound) ** 2))
            owner.append(np.full(len(chosen[-1]), k))
        near, number = np.concatenate(chosen), np.concatenate(owner)
        if not len(near):
            return np.empty((0, 2))
        piece, a, b = chords[near, 4].astype(np.int64), chords[near, 5], chords[near, 6]
        aims, gaps = points[number, :3], points[number, 3]
        shares, rows = np.linspace(0.0, 1.0, SECTIONS + 1), np.arange(len(near))
        for _ in range(SEARCH_STEPS):
            s = a[:, None] + (b - a)[:, None] * shares
            uv = np.empty((s.size, 2))
            clipping.points_of_pieces(self._table, np.repeat(piece, len(shares)), s.ravel(), uv)
            off = self._points(uv).reshape(*s.shape, 3) - aims[:, None]
            apart = np.linalg.norm(off, axis=2)
            k = apart.argmin(axis=1)
            a, b = s[rows, np.maximum(k - 1, 0)], s[rows, np.minimum(k + 1, SECTIONS)]
        s, apart = s[rows, k], apart[rows, k]
        order = np.lexsort((apart, number))
        best = order[np.diff(number[order], prepend=-1) != 0]
        best = best[apart[best] <= gaps[best] + gap_of[piece[best]]]
        return np.column_stack([piece[best], s[best]])

    def _points(self, uv: FloatArray) -> FloatArray:
        points: FloatArray = self.surface.point(*np.clip(uv, 0.0, 1.0).T).reshape(-1, 3)
        return points


def _quarters(leaves: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return halves both ways of leaves, or one way where the other has no middle."""
    for low, high in ((1, 2), (3, 4)):
        middle = (leaves[:, low] + leaves[:, high]) // 2
        has_middle = (leaves[:, high] - leaves[:, low]) % 2 == 0
        second = leaves[has_middle]
        leaves = leaves.copy()
        leaves[has_middle, high] = second[:, low] = middle[has_middle]
        leaves = np.concatenate([leaves, second])
    return leaves


def _ring(
    box: FloatArray, lines: list[NDArray[np.complex128]], closes: tuple[bool, bool]
) -> FloatArray:
    """Return the vertices around a box, counterclockwise from its corner u0, v0."""
    u0, u1, v0, v1 = box.tolist()
    sides: list[FloatArray] = []
    for axis, at, begin, end in (
        (1, v0, u0, u1),
        (0, u1, v0, v1),
        (1, v1, u0, u1),
        (0, u0, v0, v1),
    ):
        line = 0.0 if closes[axis] and at == 1.0 else at
        first = np.searchsorted(lines[axis], line + 1j * begin)
        last = np.searchsorted(lines[axis], line + 1j * end)
        # Each without its last corner; the third and the fourth run back.
        along = lines[axis][first : last + 1].imag
        along = along[:-1] if len(sides) < 2 else along[:0:-1]
        sides.append(np.insert(along[:, None], axis, at, axis=1))
    return np.concatenate(sides)


def _parts_of_arc(net: FloatArray, s: FloatArray, t: FloatArray) -> FloatArray:
    """Return the nets (n + 1, k, 3) of an arc between parameters s and t (k,)."""
    parts = []
    for i in range(len(net)):
        # Its polar form at n - i times s and i times t.
        rows = net[:, None]
        for step in range(len(net) - 1):
            at = (s if step >= i else t)[:, None]
            rows = (1.0 - at) * rows[:-1] + at * rows[1:]
        parts.append(rows[0])
    return np.stack(parts)


def _distances_of_chords(nets: FloatArray) -> FloatArray:
    """Bound how far arcs are from their chords, (k,); nets (n + 1, k, 3) are w x, w y, w.

    The distance from a chord is convex, and 0 at its ends. So on the arc, a mean of control points, it is at
    most the largest of theirs times the weights of those between the ends, 1 - (1 - s)^n - s^n without w.
    """
    points, w = nets[..., :2] / nets[..., 2:], nets[..., 2]
    away, way = points - points[0], points[-1] - points[0]
    share = (away * way).sum(axis=-1) / np.maximum((way**2).sum(axis=-1), 1e-300)
    off = np.linalg.norm(away - np.clip(share, 0.0, 1.0)[..., None] * way, axis=-1).max(axis=0)
    ends = 2.0 ** (2 - len(nets)) * np.minimum(w[0], w[-1]) / w.max(axis=0)
    # Along u and along v together: at most sqrt(2) times the length.
    bound: FloatArray = math.sqrt(2.0) * (1.0 - ends) * off
    return bound


def _without_pairs(chords: FloatArray) -> FloatArray:
    """Return chords without those that lie on each other in pairs, and without points."""
    a, b = chords[:, :2], chords[:, 2:]
    swaps = (a[:, 0] > b[:, 0]) | ((a[:, 0] == b[:, 0]) & (a[:, 1] > b[:, 1]))
    ordered = np.where(swaps[:, None], chords[:, [2, 3, 0, 1]], chords)
    kept, counts = np.unique(ordered, axis=0, return_counts=True)
    odd: FloatArray = kept[(counts % 2 == 1) & (kept[:, :2] != kept[:, 2:]).any(axis=1)]
    return np.ascontiguousarray(odd)


def edges_of(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the edges of triangles, (n, 3, 2), the lower vertex first."""
    return np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)


def _border(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the vertices on edges that belong to one triangle."""
    kept, counts = np.unique(edges_of(faces).reshape(-1, 2), axis=0, return_counts=True)
    border: NDArray[np.int64] = np.unique(kept[counts == 1])
    return border
