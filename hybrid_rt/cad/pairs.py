"""Crossings of closed bodies in pairs: a ray goes in, out, in, out, whatever the gaps at edges are."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, Flag, Status
from hybrid_rt.intersection.crossings import Crossings

# What a ray that is outside, or inside, meets next: a front, a back.
OUTSIDE, INSIDE = True, False


def in_pairs(crossings: Crossings, body: NDArray[np.int64]) -> tuple[Crossings, BoolArray]:
    """Leave out rows within gaps of edges so that entries and exits of each body alternate.

    Where two solids of a body touch, one is left before the other is entered.

    Parameters
    ----------
    crossings : Crossings
    body : (m,) int
        The closed body of each row; -1: of none, its rows stay.

    Returns
    -------
    Crossings
    is_paired : (n,) bool
        For which rays that succeeded; of the others all rows stay.
    """
    is_front = crossings.hits.front_face
    # Whether there is a TANGENT one, rounding decides.
    is_free = ((crossings.hits.flags & Flag.EDGE) != 0) | (crossings.hits.status == Status.TANGENT)
    keeps, is_paired = np.ones(len(crossings), np.bool_), np.ones(len(crossings.count), np.bool_)
    order = np.lexsort((np.arange(len(body)), body, crossings.ray))
    key = np.stack([crossings.ray[order], body[order]])
    place = np.arange(len(body))
    ends = np.flatnonzero(np.any(np.diff(key, axis=1) != 0, axis=0)) + 1
    for begin, end in pairwise([0, *ends.tolist(), len(order)]):
        rows = order[begin:end]
        if not len(rows) or body[rows[0]] < 0:
            continue
        front = is_front[rows]
        if len(rows) % 2 == 0 and front[::2].all() and not front[1::2].any():
            continue
        kept = _fewest_left_out(front.tolist(), is_free[rows].tolist())
        if kept is None:
            t, bound = crossings.hits.t[rows], crossings.hits.t_bound[rows]
            is_tied = (np.diff(t) <= bound[1:] + bound[:-1]).tolist()
            rows = rows[_in_turn(front.tolist(), is_tied)]
            kept = _fewest_left_out(is_front[rows].tolist(), is_free[rows].tolist())
        if kept is None:
            is_paired[crossings.ray[rows[0]]] = False
        else:
            place[np.sort(rows)] = rows
            keeps[rows] = kept
    keeps |= ~is_paired[crossings.ray]
    place = place[keeps[place]]
    ray = crossings.ray[place]
    offsets = np.searchsorted(ray, np.arange(len(crossings.count) + 1)).astype(np.int64)
    return Crossings(crossings.hits[place], ray, offsets), is_paired


def _in_turn(front: list[bool], is_tied: list[bool]) -> list[int]:
    """Return an order of the crossings of a ray in which tied neighbours come as what the ray meets next."""
    order, state = list(range(len(front))), OUTSIDE
    for k, tied in enumerate(is_tied):
        if tied and front[order[k]] != state and front[k + 1] == state:
            order[k : k + 2] = k + 1, order[k]
        state ^= front[order[k]] == state
    return order


def _fewest_left_out(front: list[bool], free: list[bool]) -> list[bool] | None:
    """Return which crossings of a ray to keep: the fewest free ones left out; None if none will do."""
    # By what the ray meets next, the least number left out so far, and which are kept.
    best: dict[bool, tuple[int, list[bool]]] = {OUTSIDE: (0, [])}
    for is_front, is_free in zip(front, free, strict=True):
        following: dict[bool, tuple[int, list[bool]]] = {}
        for state, (number, kept) in best.items():
            choices = [(not state, number, True)] if state == is_front else []
            choices += [(state, number + 1, False)] if is_free else []
            for next_state, n, keep in choices:
                if next_state not in following or n < following[next_state][0]:
                    following[next_state] = n, [*kept, keep]
        best = following
    return best[OUTSIDE][1] if OUTSIDE in best else None
