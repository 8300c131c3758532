"""On which side of a trimmed surface's loops points are, and whether a curve passes near them.

Every arc is halved into short pieces once. A piece in whose box a point is not may be replaced by its
chord, as in `proof.exact.loops`; so most points are settled by comparisons of floats, all at
once, and the others by that exact arithmetic. Whether a curve passes within a distance is asked of
the control points seen from the point: they are halved until their hull is beyond it, or an end within.
"""

from __future__ import annotations

from collections import Counter
from itertools import product
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing import Curve2, TrimmedSurface
from proof.exact.loops import ExactLoops

# An arc becomes 2**HALVINGS pieces: finer ones leave few points to exact arithmetic, and take longer.
HALVINGS = 5
# Boxes of pieces are grown by this, far beyond what rounds.
GROWN = 2.0**-40
# Points are taken this far inside the border of the unit square: loops along it enclose them.
WITHIN = 2.0**-53
# Hulls smaller than this part of the distance asked for are points.
SMALL = 1e-6
DEEPEST = 200
# Points times pieces compared at once.
AT_ONCE = 4_000_000


class Arc(NamedTuple):
    """One arc: control points (n + 1, 2) and weights (n + 1,)."""

    points: FloatArray
    weights: FloatArray


class TrimSides:
    """The loops of one trimmed surface.

    Parameters
    ----------
    surface : TrimmedSurface
    """

    def __init__(self, surface: TrimmedSurface) -> None:
        self._poles = surface.poles
        self._exact = ExactLoops(surface.loops, surface.closes)
        turns = [(-2.0, -1.0, 0.0, 1.0, 2.0) if closed else (0.0,) for closed in surface.closes]
        arcs = [
            Arc(curve.control + np.array(turn), _weights(curve))
            for loop in surface.loops
            for turn in product(*turns)
            if _reaches(loop, turn)
            for curve in loop
        ]
        self._arcs = arcs
        ends, boxes, owners = [], [], []
        for k, arc in enumerate(arcs):
            at, box = _pieces(arc)
            ends.append(np.stack([at[:-1], at[1:]], axis=1))
            boxes.append(box)
            owners.append(np.full(len(box), k))
        self._ends = np.concatenate(ends)  # (p, 2, 2)
        self._boxes = np.concatenate(boxes)  # (p, 2, 2): lower and upper corner
        owner = np.concatenate(owners)
        is_edge = _are_edges(arcs, surface)
        self._edge_boxes, self._edge_owner = self._boxes[is_edge[owner]], owner[is_edge[owner]]

    def inside(self, u: FloatArray, v: FloatArray) -> BoolArray:
        """Tell which points (n,) of the unit square the loops go around an odd number of times."""
        at = np.clip(np.stack([u, v], axis=1), WITHIN, 1.0 - WITHIN)
        found = np.empty(len(at), np.bool_)
        step = max(AT_ONCE // len(self._boxes), 1)
        for begin in range(0, len(at), step):
            rows = slice(begin, begin + step)
            x, y = at[rows, :1], at[rows, 1:]
            low, high = self._boxes[:, 0], self._boxes[:, 1]
            is_in = (low[:, 0] <= x) & (x <= high[:, 0]) & (low[:, 1] <= y) & (y <= high[:, 1])
            first, last = (
                _quarter(self._ends[:, k, 0] - x, self._ends[:, k, 1] - y) for k in (0, 1)
            )
            turned = ((last - first + 1) % 4 - 1).sum(axis=1)
            found[rows] = turned // 4 % 2 == 1
            for i in np.flatnonzero(is_in.any(axis=1)) + begin:
                # On a curve either side will do.
                found[i] = self._exact.is_inside(float(at[i, 0]), float(at[i, 1])) is not False
        return found

    def passes(
        self, u: FloatArray, v: FloatArray, steps: FloatArray, reach: FloatArray
    ) -> tuple[BoolArray, BoolArray]:
        """Tell near which points a curve passes, to first order.

        Parameters
        ----------
        u, v : (n,) float64
        steps : (n, 2, 2) float64
            Columns: where a step of 1 in u leads in a plane, and one in v.
        reach : (n,) float64
            Distance in that plane.

        Returns
        -------
        passes : (n,) bool
        is_wide : (n,) bool
            First order says nothing: the distance reaches past a pole, or a quarter turn.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            area = np.abs(np.linalg.det(steps))
            half = reach[:, None] * np.linalg.norm(steps, axis=1)[:, ::-1] / area[:, None]
        is_wide = ~(half <= 0.25).all(axis=1)
        if self._poles[0]:
            is_wide |= v < half[:, 1]
        if self._poles[1]:
            is_wide |= 1.0 - v < half[:, 1]
        found = np.zeros(len(u), np.bool_)
        at = np.stack([u, v], axis=1)
        low, high = self._edge_boxes[:, 0], self._edge_boxes[:, 1]
        step = max(AT_ONCE // max(len(low), 1), 1)
        some = np.flatnonzero(~is_wide)
        for rows in (some[k : k + step] for k in range(0, len(some), step)):
            first, last = (at[rows] - half[rows])[:, None], (at[rows] + half[rows])[:, None]
            meets = ((low <= last) & (high >= first)).all(axis=2)
            for j in np.flatnonzero(meets.any(axis=1)):
                i = rows[j]
                found[i] = any(
                    _comes_near(self._arcs[k], at[i], steps[i], float(reach[i]))
                    for k in np.unique(self._edge_owner[meets[j]])
                )
        return found, is_wide


def _weights(curve: Curve2) -> FloatArray:
    return np.ones(len(curve.control)) if curve.weights is None else curve.weights


def _reaches(loop: tuple[Curve2, ...], turn: tuple[float, ...]) -> bool:
    """Tell whether a loop moved by whole turns comes near the unit square."""
    points = np.concatenate([curve.control for curve in loop]) + np.array(turn)
    return bool((points.min(axis=0) <= 1.5).all() and (points.max(axis=0) >= -0.5).all())


def _are_edges(arcs: list[Arc], surface: TrimmedSurface) -> BoolArray:
    """Tell which arcs bound the surface.

    Lines that lie on each other in pairs, as outlines at a seam do, cancel; at a pole there is no edge.
    """
    lines = [
        tuple(sorted(map(tuple, arc.points.tolist()))) if len(arc.points) == 2 else k
        for k, arc in enumerate(arcs)
    ]
    count = Counter(lines)
    poles = [v for v, is_pole in zip((0.0, 1.0), surface.poles, strict=True) if is_pole]
    return np.array([
        count[line] % 2 == 1 and not any((arc.points[:, 1] == v).all() for v in poles)
        for line, arc in zip(lines, arcs, strict=True)
    ])  # fmt: skip


def _pieces(arc: Arc) -> tuple[FloatArray, FloatArray]:
    """Return the ends (p + 1, 2) of the pieces of an arc, and the boxes (p, 2, 2) of their hulls."""
    nets = np.concatenate([arc.points * arc.weights[:, None], arc.weights[:, None]], axis=1)[None]
    for _ in range(HALVINGS):
        nets = np.stack(_halves(nets), axis=1).reshape(-1, *nets.shape[1:])
    hulls = nets[..., :2] / nets[..., 2:]
    ends = np.concatenate([hulls[:, 0], hulls[-1:, -1]])
    # Arcs meet in the very numbers that were given.
    ends[0], ends[-1] = arc.points[0], arc.points[-1]
    all_of = np.concatenate([hulls, ends[:-1, None], ends[1:, None]], axis=1)
    return ends, np.stack([all_of.min(axis=1) - GROWN, all_of.max(axis=1) + GROWN], axis=1)


def _halves(nets: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both halves of curves (..., n + 1, k) in Bernstein form."""
    rows, left, right = nets, [nets[..., 0, :]], [nets[..., -1, :]]
    while rows.shape[-2] > 1:
        rows = 0.5 * (rows[..., :-1, :] + rows[..., 1:, :])
        left.append(rows[..., 0, :])
        right.append(rows[..., -1, :])
    return np.stack(left, axis=-2), np.stack(right[::-1], axis=-2)


def _quarter(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return which quarter plane points are in, 0 to 3; each has one of its sides."""
    others = np.where((x <= 0) & (y > 0), 1, np.where(x < 0, 2, 3))
    return np.where((x > 0) & (y >= 0), 0, others)


def _comes_near(arc: Arc, at: FloatArray, steps: FloatArray, reach: float) -> bool:
    """Tell whether an arc passes a point within a distance of the plane of steps."""
    away = (arc.points - at) @ steps.T
    stack = [(np.concatenate([away * arc.weights[:, None], arc.weights[:, None]], axis=1), 0)]
    while stack:
        net, depth = stack.pop()
        points = net[:, :2] / net[:, 2:]
        if min(np.hypot(*points[0]), np.hypot(*points[-1])) <= reach:
            return True
        chord, middle = points[-1] - points[0], points[0] + points[-1]
        ways = np.array([(1.0, 0.0), (0.0, 1.0), (-chord[1], chord[0]), middle])
        ways /= np.maximum(np.linalg.norm(ways, axis=1), 1e-300)[:, None]
        # Beyond: on one side of a line that is as far from the point as is asked for.
        beside = points @ ways.T
        low, high = beside.min(axis=0), beside.max(axis=0)
        if (low > reach).any() or (high < -reach).any():
            continue
        if depth == DEEPEST or (high - low).max() <= SMALL * reach:
            return True
        stack += [(half, depth + 1) for half in _halves(net)]
    return False
