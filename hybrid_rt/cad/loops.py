"""Loops of CAD faces: curves in a face's own (u, v), closed, and mapped to the unit square of a surface."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.cad.records import ELLIPSE, SPLINE
from meshing import Curve2, bspline
from meshing.checks import FloatArray

# Arcs of conics are refitted, where their parameter is bent, to this of the unit square, by this degree.
FITTED, FIT_DEGREE, MOST_HALVINGS = 1e-13, 9, 12
HALVINGS = 60
# Loops leave the unit square by at most one.
OUTSIDE = (-1.0, 2.0)


class RefusedFaceError(ValueError):
    """A face has no exact form here; the message says why."""


@dataclass(frozen=True)
class Arc:
    """A B-spline curve in (u, v), or a straight line (no knots), and its ends in space."""

    points: FloatArray  # (n, 2)
    degree: int = 1
    weights: FloatArray | None = None
    knots: FloatArray | None = None
    ends: FloatArray | None = None  # (2, 3); None: a line that closes a loop
    reach: float = 0.0  # how far, by the file, its ends may be from those of its neighbours
    gap: float = 0.0  # how far the other face's curve may be

    def moved(self, scale: ArrayLike, shift: ArrayLike) -> Arc:
        """Return the arc with u and v multiplied and shifted."""
        return replace(self, points=self.points * np.asarray(scale) + np.asarray(shift))


@dataclass(frozen=True)
class Axis:
    """How a parameter of a face becomes u or v of a surface, from 0 to 1.

    Between ``native`` breaks it grows from one ``unit`` break to the next, evenly or, where ``bends`` says
    so, as the parameter of a rational arc of a conic does: (form, angle at its middle).
    """

    native: FloatArray
    unit: FloatArray
    bends: tuple[tuple[int, float], ...] = ()

    def to_unit(self, x: FloatArray) -> FloatArray:
        """Return the unit parameter of native ones, beyond the ends as outside the surface."""
        last = len(self.native) - 2
        return self.along(x, np.clip(np.searchsorted(self.native, x, side="right") - 1, 0, last))

    def along(self, x: FloatArray, segment: NDArray[np.int64] | int) -> FloatArray:
        """Return the unit parameter of native ones, each on a segment between breaks."""
        begin, end = self.native[segment], self.native[np.asarray(segment) + 1]
        low, high = self.unit[segment], self.unit[np.asarray(segment) + 1]
        share = np.asarray((x - begin) / (end - begin))
        for k, (form, middle) in enumerate(self.bends):
            here = (np.asarray(segment) == k) & (share > 0.0) & (share < 1.0)
            if form != SPLINE and here.any():
                # Differences of tangents, (tan x - tan a) / (tan b - tan a), without cancellation.
                sine, cosine = (np.sin, np.cos) if form == ELLIPSE else (np.sinh, np.cosh)
                first, last = self.native[k : k + 2]
                share[here] = (
                    sine(0.5 * (x[here] - first)) / sine(0.5 * (last - first))
                    * cosine(0.5 * (last - middle)) / cosine(0.5 * (x[here] - middle))
                )  # fmt: skip
        image: FloatArray = np.where(share == 1.0, high, low + share * (high - low))
        return image

    def reversed(self) -> Axis:
        """Return the axis of minus the native parameter, to 1 minus the unit one."""
        bends = tuple((form, -middle) for form, middle in self.bends[::-1])
        return Axis(-self.native[::-1], 1.0 - self.unit[::-1], bends)

    def within(self, low: float, high: float) -> Axis:
        """Return the axis with a segment more on each side, to where loops may reach."""
        none = (SPLINE, 0.0)
        bends = (none, *(self.bends or (none,) * (len(self.unit) - 1)), none)
        native = np.concatenate([[low], self.native, [high]])
        return Axis(native, np.concatenate([OUTSIDE[:1], self.unit, OUTSIDE[1:]]), bends)


def even_axis(low: float, high: float) -> Axis:
    """Return the axis of a parameter that grows evenly."""
    return Axis(np.array([low, high]), np.array([0.0, 1.0]))


def closed_loops(wires: Sequence[Sequence[Arc]], periods: Sequence[float]) -> list[list[Arc]]:
    """Return wires as loops: arcs follow each other in (u, v), and straight lines close small gaps.

    Parameters
    ----------
    wires : sequence of sequences of Arc
        In order, or nearly.
    periods : (2,) floats
        Of u and of v; 0: none.

    Raises
    ------
    RefusedFaceError
        Where the next arc begins farther away than the file allows.
    """
    return [_chained(list(wire), np.array(periods), k) for k, wire in enumerate(wires) if wire]


def _chained(left: list[Arc], periods: FloatArray, number: int) -> list[Arc]:
    """Return the arcs of one wire, each shifted by periods to where the one before ends."""
    loop = [left.pop(0)]
    while left:
        gaps = [_gap(loop[-1], arc) for arc in left]
        k = 0 if gaps[0] <= _reach(loop[-1], left[0]) else int(np.argmin(gaps))
        arc = left.pop(k)
        if gaps[k] > _reach(loop[-1], arc):
            raise RefusedFaceError(f"loop {number} is open by {gaps[k]:.3g}")
        here = loop[-1].points[-1]
        arc = arc.moved((1.0, 1.0), _turns(here - arc.points[0], periods))
        loop += [*_joint(loop[-1], arc, gaps[k]), arc]
    if (gap := _gap(loop[-1], loop[0])) > _reach(loop[-1], loop[0]):
        raise RefusedFaceError(f"loop {number} is open by {gap:.3g}")
    end, begin = loop[-1].points[-1], loop[0].points[0]
    if _turns(end - begin, periods).any():
        raise RefusedFaceError(f"loop {number} goes around without an edge along the seam")
    return [*loop, *_joint(loop[-1], loop[0], gap)]


def _turns(way: FloatArray, periods: FloatArray) -> FloatArray:
    """Return the whole periods nearest to a way in (u, v)."""
    whole: FloatArray = np.round(way / np.where(periods > 0.0, periods, np.inf)) * periods
    return whole


def _joint(one: Arc, other: Arc, apart: float) -> list[Arc]:
    """Return the straight line between two arcs that are apart in space; the gap there is no less."""
    ends = np.stack([one.points[-1], other.points[0]])
    if (ends[0] == ends[1]).all():
        return []
    return [Arc(ends, reach=_reach(one, other), gap=max(one.gap, other.gap, apart))]


def _gap(one: Arc, other: Arc) -> float:
    assert one.ends is not None
    assert other.ends is not None
    return math.dist(one.ends[1], other.ends[0])


def _reach(one: Arc, other: Arc) -> float:
    return 2.0 * max(one.reach, other.reach)


def extent(loops: Sequence[Sequence[Arc]]) -> FloatArray:
    """Return the least and the largest (u, v) of control points, (2, 2)."""
    points = np.concatenate([arc.points for loop in loops for arc in loop])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def gathered(
    loops: list[list[Arc]], periods: Sequence[float], begin: Sequence[float] = (0.0, 0.0)
) -> list[list[Arc]]:
    """Return loops, each shifted by whole periods to the widest of them, and that to the first period."""
    if not loops or not any(periods):
        return loops
    boxes = [extent([loop]) for loop in loops]
    middles = np.array([box.mean(axis=0) for box in boxes])
    wide = int(np.argmax([np.ptp(box, axis=0).sum() for box in boxes]))
    each = np.array(periods)
    lowest = np.floor((middles[wide] - begin) / np.where(each > 0.0, each, np.inf)) * each
    moves = [_turns(middles[wide] - middle, each) - lowest for middle in middles]
    return [
        [arc.moved((1.0, 1.0), move) for arc in loop]
        for loop, move in zip(loops, moves, strict=True)
    ]


def as_curves(
    loops: Sequence[Sequence[Arc]], axes: tuple[Axis, Axis], widest: float
) -> list[list[Curve2]]:
    """Return loops in the unit square of a surface; ``widest`` is the largest of their gaps."""
    low = np.array([axis.native[0] for axis in axes])
    high = np.array([axis.native[-1] for axis in axes])
    far = (extent(loops) - low) / (high - low)
    fits = far.min() >= OUTSIDE[0] and far.max() <= OUTSIDE[1]
    bent: tuple[Axis, ...] = ()
    if not fits or any(len(axis.native) > 2 or axis.bends for axis in axes):
        bent = axes
    # First evenly to the square that holds both loops and surface, then as the axes have it.
    if bent:
        low, high = np.minimum(low, extent(loops)[0]), np.maximum(high, extent(loops)[1])
        low, high = low - 1e-3 * (high - low), high + 1e-3 * (high - low)
    wholes = [axis.within(float(low[k]), float(high[k])) for k, axis in enumerate(bent)]
    found = []
    for loop in loops:
        found.append(list[Curve2]())
        for arc in loop:
            curves = _arcs(arc, low, high)
            for k, whole in enumerate(wholes):
                curves = [piece for c in curves for piece in _mapped(c, k, whole)]
            share = arc.gap / widest if widest else 1.0
            found[-1] += [Curve2(c.control, c.weights, share) for c in curves]
    return found


def _arcs(arc: Arc, low: FloatArray, high: FloatArray) -> list[Curve2]:
    """Return an arc, evenly mapped."""
    if arc.knots is None or (arc.degree == 1 and len(arc.points) == 2):
        points = (arc.points - low) / (high - low)
        return [] if (points[0] == points[1]).all() else [Curve2(points)]
    if (arc.points == arc.points[0]).all():
        return []
    return bspline(arc.points, arc.knots, arc.degree, arc.weights, low=low, high=high)


def _mapped(curve: Curve2, k: int, axis: Axis) -> list[Curve2]:
    """Return a curve with coordinate k mapped: cut at the breaks of the axis, refitted where it is bent."""
    low, width = axis.native[0], axis.native[-1] - axis.native[0]
    breaks = (axis.native - low) / width
    # From its lowest value on: so far from 0 short segments have no less digits.
    near = Axis(axis.native - low, axis.unit, tuple((form, at - low) for form, at in axis.bends))
    found = []
    for piece in _cut_at(curve, k, breaks):
        x = piece.control[:, k]
        segment = int(np.searchsorted(breaks, 0.5 * (x.min() + x.max()), side="right")) - 1
        segment = min(max(segment, 0), len(breaks) - 2)

        def image(x: FloatArray, segment: int = segment) -> FloatArray:
            y = near.along(x * width, segment)
            y = np.where(x == breaks[segment], axis.unit[segment], y)
            return np.where(x == breaks[segment + 1], axis.unit[segment + 1], y)

        if axis.bends[segment][0] == SPLINE or np.ptp(x) == 0.0:
            points = piece.control.copy()
            points[:, k] = image(x)
            if (points != points[0]).any():
                found.append(Curve2(points, piece.weights))
        else:
            found += _fitted(piece, k, image, 0.0, 1.0, MOST_HALVINGS)
    return found


def _fitted(
    curve: Curve2, k: int, image: Callable[[FloatArray], FloatArray], a: float, b: float, more: int
) -> list[Curve2]:
    """Return polynomial arcs through the image of part of a curve, within `FITTED` of it."""

    def place(s: FloatArray) -> FloatArray:
        points = curve.point(a + s * (b - a))
        points[:, k] = image(points[:, k])
        return points

    n = FIT_DEGREE
    at = 0.5 - 0.5 * np.cos(np.pi * np.arange(n + 1) / n)
    control = np.linalg.solve(_bernstein(at, n), place(at))
    control[[0, -1]] = place(np.array([0.0, 1.0]))
    between = 0.5 * (at[:-1] + at[1:])
    off = np.abs(_bernstein(between, n) @ control - place(between)).max()
    if off <= FITTED or more == 0:
        return [Curve2(np.clip(control, *OUTSIDE))]
    m = 0.5 * (a + b)
    halves = (a, m), (m, b)
    return [piece for ends in halves for piece in _fitted(curve, k, image, *ends, more - 1)]


def _bernstein(at: FloatArray, n: int) -> FloatArray:
    i = np.arange(n + 1)
    binomial = np.array([math.comb(n, int(j)) for j in i], np.float64)
    basis: FloatArray = binomial * at[:, None] ** i * (1.0 - at[:, None]) ** (n - i)
    return basis


def _cut_at(curve: Curve2, k: int, breaks: FloatArray) -> list[Curve2]:
    """Return the parts of a curve between values of coordinate k."""
    x = curve.control[:, k]
    inside = [float(value) for value in breaks if x.min() < value < x.max()]
    if not inside:
        return [curve]
    cuts: list[tuple[float, float]] = []  # parameter and value
    for a, b in pairwise(curve.cuts()):
        ends = curve.point([a, b])[:, k]
        for value in inside:
            if (ends[0] - value) * (ends[1] - value) < 0.0:
                cuts.append((_where(curve, k, value, a, b, bool(ends[1] > ends[0])), value))
    rest, begin, found = curve, 0.0, []
    for s, value in sorted(cuts):
        if not begin < s < 1.0:
            continue
        one, rest = _halves(rest, (s - begin) / (1.0 - begin), k, value)
        found.append(one)
        begin = s
    return [*found, rest]


def _where(curve: Curve2, k: int, value: float, a: float, b: float, rises: bool) -> float:
    for _ in range(HALVINGS):
        m = 0.5 * (a + b)
        is_beyond = bool(curve.point([m])[0, k] >= value) == rises
        a, b = (a, m) if is_beyond else (m, b)
    return 0.5 * (a + b)


def _halves(curve: Curve2, s: float, k: int, value: float) -> tuple[Curve2, Curve2]:
    """Return both parts of a curve cut at s, where coordinate k is ``value``."""
    parts = []
    for side, end in zip(halved(curve.homogeneous(), s), (-1, 0), strict=True):
        points = side[:, :2] / side[:, 2:]
        points[end, k] = value
        parts.append(Curve2(points, None if curve.weights is None else side[:, 2]))
    return parts[0], parts[1]


def halved(row: FloatArray, s: float) -> tuple[FloatArray, FloatArray]:
    """Return the Bezier points of both parts of a curve cut at s."""
    left, right = [row[0]], [row[-1]]
    while len(row) > 1:
        row = (1.0 - s) * row[:-1] + s * row[1:]
        left.append(row[0])
        right.append(row[-1])
    return np.array(left), np.array(right[::-1])
