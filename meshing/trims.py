"""Loops of curves made ready for the classifier: joined, cut into monotone pieces, indexed."""

import math
from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshing.checks import BoolArray, FloatArray, shown
from meshing.curve2 import Curve2
from meshing.kernels.trims import OUTSIDE, TrimTable, classify_boxes, fill_tiles, mark_tiles

# Ends that are no farther apart are joined by a straight line: what files of parts leave between the
# curves of a loop (4.5e-6 was measured) is below it.
JOINED = 1e-5
LEAST_SLABS, MOST_SLABS = 16, 4096
LEAST_TILES, MOST_TILES = 64, 512
# So few surfaces have maps of at least FINE tiles a side: 64 KiB each.
FEW, FINE = 16, 256
# Whole turns by which loops are copied, and how far from the unit square copies still matter.
TURNS = (0.0, 1.0, -1.0, 2.0, -2.0)
NEAR_SEAM = 0.5


class Piece(NamedTuple):
    """A part of an arc along which u and v are monotone: its lower and its upper end."""

    arc: int
    s_low: float
    low: tuple[float, float]
    s_high: float
    high: tuple[float, float]


def as_loops(loops: Iterable[Iterable[Curve2]]) -> tuple[tuple[Curve2, ...], ...]:
    """Check loops, close the small gaps in them, and return them.

    Raises ValueError or TypeError: Where there is none, one is empty or open, or is made of
    something else.
    """
    if isinstance(loops, Curve2 | str | bytes) or not isinstance(loops, Iterable):
        raise TypeError(f"TrimmedSurface loops is {shown(loops)}: pass a list of lists of Curve2")
    closed = []
    for number, loop in enumerate(loops):
        name = f"TrimmedSurface loops[{number}]"
        if isinstance(loop, Curve2 | str | bytes) or not isinstance(loop, Iterable):
            raise TypeError(f"{name} is {shown(loop)}: pass a list of Curve2")
        curves = list(loop)
        for k, curve in enumerate(curves):
            if not isinstance(curve, Curve2):
                raise TypeError(f"{name}[{k}] is {shown(curve)}: pass a Curve2")
        if not curves:
            raise ValueError(f"{name} is empty: pass its curves, or leave it out")
        closed.append(tuple(_joined(curves, name)))
    if not closed:
        raise ValueError(
            "TrimmedSurface loops is empty: pass at least one loop, or the surface itself"
        )
    return tuple(closed)


def _joined(curves: list[Curve2], name: str) -> list[Curve2]:
    """Return the curves of a loop, with straight lines where ends do not quite meet."""
    found = []
    for k, curve in enumerate(curves):
        found.append(curve)
        following = (k + 1) % len(curves)
        other = curves[following]
        here, there = curve.control[-1], other.control[0]
        if (here == there).all():
            continue
        gap = float(np.hypot(*(there - here)))
        if gap > JOINED:
            raise ValueError(
                f"{name} is open: curve {k} ends at {here.tolist()}, curve {following} begins at "
                f"{there.tolist()}, {gap:.3g} away: pass curves that meet within {JOINED:g}"
            )
        found.append(Curve2([here, there], None, max(curve.gap_share, other.gap_share)))
    return found


def make_table(members: Sequence[Any]) -> TrimTable:
    """Return the table of the loops of trimmed surfaces, one member each."""
    nets: list[FloatArray] = []
    pieces: list[FloatArray] = []
    slabs = [np.zeros(1, np.int64)]
    arcs, listed, tiles, rows, errors = [], [], [], [], []
    n_points = n_slabs = n_tiles = 0
    least_tiles = LEAST_TILES if len(members) > FEW else FINE
    for member in members:
        curves = [curve for loop in member.loops for curve in loop]
        if any(member.closes):
            curves = _around(member.loops, member.closes)
        starts, degrees = [], []
        for curve in curves:
            starts.append(n_points)
            degrees.append(curve.degree)
            nets.append(curve.homogeneous())
            n_points += curve.degree + 1
        own = [piece for k, c in enumerate(curves) for piece in _cut(c, k)]
        own = _without_pairs(curves, _without_poles(own, member.poles))
        first = sum(len(before) for before in pieces)
        arcs.append(np.array([(starts[p.arc], degrees[p.arc]) for p in own], np.int64))
        pieces.append(
            np.array([(p.s_low, *p.low, p.s_high, *p.high, curves[p.arc].gap_share) for p in own])
        )
        count = _power_of_two(len(own), LEAST_SLABS, MOST_SLABS)
        begin, numbers = _slabs(pieces[-1].reshape(-1, 7), count)
        slabs.append(begin[1:] + slabs[-1][-1])
        listed.append(numbers + first)
        side = _power_of_two(8 * math.isqrt(len(own)), least_tiles, MOST_TILES)
        rows.append((n_slabs, count, n_tiles, side, len(own)))
        largest = max(float(np.abs(curve.control).max()) for curve in curves)
        # Twice the bound of `point_of_arc`, since what is computed need not be monotone by as much;
        # four for what names the point.
        errors.append(2.0**-53 * (2.0 * (8.0 * max(degrees) + 12.0) * max(largest, 1.0) + 4.0))
        tiles.append(np.full(side * side, OUTSIDE, np.uint8))
        n_slabs, n_tiles = n_slabs + count, n_tiles + side * side
    table = TrimTable(
        net=np.concatenate([np.empty((0, 3)), *nets]),
        arc=np.concatenate([np.empty((0, 2), np.int64), *(a.reshape(-1, 2) for a in arcs)]),
        piece=np.concatenate([np.empty((0, 7)), *(p.reshape(-1, 7) for p in pieces)]),
        slab=np.concatenate(slabs),
        listed=np.concatenate([np.empty(0, np.int32), *listed]).astype(np.int32),
        tile=np.concatenate([np.empty(0, np.uint8), *tiles]),
        member=np.array(rows, np.int64).reshape(-1, 5),
        error=np.array(errors),
    )
    at = 0
    for m, (_, _, first_tile, side, count) in enumerate(rows):
        # A gap flags hits beside every loop, border or not.
        closes = (True, True) if members[m].gap else members[m].closes
        own_tiles = table.tile[first_tile : first_tile + side * side]
        for p in range(at, at + count):
            mark_tiles(table, m, p, *closes, own_tiles)
        fill_tiles(table, m, own_tiles)
        at += count
    return table


def boxes_outside(table: TrimTable, member: int, boxes: FloatArray) -> BoolArray:
    """Tell which boxes (k, 4) u0, u1, v0, v1 have no point inside the loops of a member, (k,)."""
    return np.asarray(sides_of_boxes(table, member, boxes) == OUTSIDE)


def sides_of_boxes(table: TrimTable, member: int, boxes: FloatArray) -> NDArray[np.uint8]:
    """Tell whether boxes (k, 4) u0, u1, v0, v1 are `OUTSIDE` or `INSIDE` the loops, or `CROSSED`."""
    state = np.empty(len(boxes), np.uint8)
    classify_boxes(table, member, np.ascontiguousarray(boxes, dtype=np.float64), state)
    return state


def _cut(curve: Curve2, number: int) -> list[Piece]:
    """Return the monotone pieces of a curve; neighbours share an end bit for bit."""
    places = curve.cuts()
    points = [(float(x), float(y)) for x, y in curve.point(np.array(places))]
    points[0] = (float(curve.control[0, 0]), float(curve.control[0, 1]))
    points[-1] = (float(curve.control[-1, 0]), float(curve.control[-1, 1]))
    found = []
    for k in range(len(places) - 1):
        a, b = (places[k], points[k]), (places[k + 1], points[k + 1])
        low, high = (a, b) if a[1][1] <= b[1][1] else (b, a)
        found.append(Piece(number, low[0], low[1], high[0], high[1]))
    return found


def _around(loops: Iterable[Iterable[Curve2]], closes: tuple[bool, bool]) -> list[Curve2]:
    """Return the curves of loops, and copies of the loops whole turns away that come near enough.

    Near: within half a turn of the unit square. Beside a pole an edge on the other side of the seam
    is as near as one on this side.
    """
    found = []
    for loop in loops:
        curves = list(loop)
        points = np.concatenate([curve.control for curve in curves])
        low, high = points.min(axis=0), points.max(axis=0)
        for turn in product(*(TURNS if closed else (0.0,) for closed in closes)):
            if not any(turn) or (
                (low + turn <= 1.0 + NEAR_SEAM) & (high + turn >= -NEAR_SEAM)
            ).all():  # fmt: skip
                found += [_moved(curve, turn) for curve in curves]
    return found


def _moved(curve: Curve2, turn: tuple[float, ...]) -> Curve2:
    moved = Curve2.__new__(Curve2)
    moved.control, moved.weights = curve.control + np.array(turn), curve.weights
    moved.gap_share = curve.gap_share
    return moved


def _without_poles(pieces: list[Piece], poles: tuple[bool, bool]) -> list[Piece]:
    """Leave out pieces along v = 0 or 1 where that is a single point: no edge, and no change of sides."""
    at = [v for v, is_pole in zip((0.0, 1.0), poles, strict=True) if is_pole]
    return [p for p in pieces if not (p.low[1] == p.high[1] and p.low[1] in at)]


def _without_pairs(curves: list[Curve2], pieces: list[Piece]) -> list[Piece]:
    """Leave out straight pieces that lie on each other in pairs: together they bound nothing.

    Loops around a surface that closes on itself have such a pair at the seam.
    """
    seen: dict[tuple[Any, ...], int] = {}
    kept: list[Piece | None] = []
    for piece in pieces:
        if curves[piece.arc].degree == 1:
            key = tuple(sorted((piece.low, piece.high)))
            other = seen.pop(key, None)
            if other is not None:
                kept[other] = None
                continue
            seen[key] = len(kept)
        kept.append(piece)
    return [piece for piece in kept if piece is not None]


def _slabs(piece: FloatArray, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where each slab's pieces begin, (count + 1,), and their numbers.

    A piece is listed half a slab beyond its ends.
    """
    low = np.floor(piece[:, 2] * count - 0.5).astype(np.int64)
    high = np.floor(piece[:, 5] * count + 0.5).astype(np.int64)
    meets = (high >= 0) & (low < count)
    numbers = np.flatnonzero(meets)
    low, high = np.clip(low[meets], 0, count - 1), np.clip(high[meets], 0, count - 1)
    length = high - low + 1
    owner = np.repeat(np.arange(len(numbers)), length)
    slab = (
        np.repeat(low, length)
        + np.arange(length.sum())
        - np.repeat(length.cumsum() - length, length)
    )
    order = np.argsort(slab, kind="stable")
    begin = np.concatenate([[0], np.bincount(slab, minlength=count).cumsum()]).astype(np.int64)
    return begin, numbers[owner[order]]


def _power_of_two(number: int, least: int, most: int) -> int:
    return int(min(max(1 << max(number - 1, 0).bit_length(), least), most))
