"""First hits of a batch of rays on surfaces of revolution, each proven to be the first.

Objects, their segments and the pieces of these are passed over where the ray stays away from their
boxes; what is left is settled piece by piece, on one sheet of the ray after the other. A guess names
the piece to begin with.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.revolution.profile import R1, Z0, Z1, segment_of
from hybrid_rt.intersection.kernels.revolution.sheets import (
    BAND,
    BESIDE,
    SHIFT,
    enter_axis_frame,
    height_range,
    sheet_interval,
)
from hybrid_rt.intersection.kernels.revolution.subdivide import solve_piece
from hybrid_rt.intersection.kernels.search.coarse import parameters_at
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.frame import begin_of, end_of
from hybrid_rt.intersection.kernels.search.members import offer_near
from meshing.kernels.jit import inlined, kernel


class RevolutionScratch(NamedTuple):
    """What one thread needs while it traces; contents mean nothing between calls."""

    net: Any  # (w, 3), w - 1 the highest degree
    stack: Any  # (DEPTH, 2)
    piece: Any  # (PIECE,)
    ray: Any  # (RAY,)


@inlined
def solve_segment(
    i, k, seg, done, is_guess, t_lo, z_low, z_high, table, rays, best, work, counters
):
    """Settle the pieces of one segment: only piece ``done`` where it is the guess, else the others.

    ``z_low`` to ``z_high``: where the ray is near the object, see `height_range`.
    """
    span, piece, first_piece, ray = table.span, table.piece, table.first_piece, work.ray
    to_frame, shift, segment = table.to_frame[k], ray[SHIFT], segment_of(table, k, seg)
    nearest = ray[BESIDE] - ray[BAND]
    for sheet in range(2):
        after = sheet == 1
        t0, t1 = sheet_interval(
            span[seg, 0], span[seg, 1], max(span[seg, 2], 0.0), span[seg, 3], ray, after, ray[BAND]
        )
        t_cut = end_of(best.t[i], to_frame, shift)
        if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
            continue
        for p in range(first_piece[seg], first_piece[seg + 1]):
            if (p == done) != is_guess:
                continue
            if piece[p, Z0] > z_high or piece[p, Z1] < z_low or piece[p, R1] < nearest:
                continue
            solve_piece(i, segment, piece[p], ray, after, t_lo, t_cut, rays, best, work, counters)
            t_cut = end_of(best.t[i], to_frame, shift)


@inlined
def _offer_object(i, k, done, is_guess, any_hit, table, rays, best, work, counters):
    """Settle the segments of object k: only piece ``done`` where it is the guess, else the others."""
    o, d, ray = rays.origin[i], rays.direction[i], work.ray
    first_piece, span, whole = table.first_piece, table.span, table.whole
    to_frame = table.to_frame[k]
    shift = enter_axis_frame(k, table, o[0], o[1], o[2], d[0], d[1], d[2], ray)
    t_lo = begin_of(rays.t_min[i], to_frame, shift)
    t_cut = end_of(best.t[i], to_frame, shift)
    z_low, z_high = height_range(whole[k, 0], whole[k, 1], whole[k, 2], ray, t_lo, t_cut, ray[BAND])
    if z_low > z_high:
        return
    nearest = ray[BESIDE] - ray[BAND]
    for seg in range(table.first_segment[k], table.first_segment[k + 1]):
        if is_guess and not (first_piece[seg] <= done < first_piece[seg + 1]):
            continue
        if span[seg, 0] > z_high or span[seg, 1] < z_low or span[seg, 3] < nearest:
            continue
        solve_segment(
            i, k, seg, done, is_guess, t_lo, z_low, z_high, table, rays, best, work, counters
        )
        if any_hit and best.object_id[i] >= 0:
            return


@inlined
def _object_of(table, piece):
    """Return the object that a piece is of."""
    low, high = 0, table.object_id.shape[0]
    while high - low > 1:
        middle = (low + high) // 2
        if table.first_piece[table.first_segment[middle]] <= piece:
            low = middle
        else:
            high = middle
    return low


@kernel
def trace_revolutions(table, end, rays, guess, best, any_hit, t_guess, work, counters):
    """Lower ``best`` to the first hits on the guessed pieces and on the objects up to row ``end``.

    ``rays``, Rays of n rows; ``best``, Nearest of n rows, changed; ``counters`` (counters,),
    changed.
    ``guess`` (n,) or (0,) int32: names a piece to begin with, -1 for none.
    ``any_hit``: a ray stops at its first hit, and rays that have one are passed over.
    ``t_guess`` (n,) or (0,): receives the nearest t once the guess is settled; like ``guess``.
    """
    for i in range(rays.origin.shape[0]):
        done = np.int64(guess[i]) if guess.shape[0] > 0 else np.int64(-1)
        for turn in range(2):
            is_guess = turn == 0
            first, last = 0, end
            if is_guess:
                if done < 0:
                    continue
                first = _object_of(table, done)
                last = first + 1
            for k in range(first, last):
                if any_hit and best.object_id[i] >= 0:
                    break
                _offer_object(i, k, done, is_guess, any_hit, table, rays, best, work, counters)
            if is_guess:
                t_guess[i] = best.t[i]


class _Others(NamedTuple):
    """What `offer_near` hands on for the objects that a ray comes near."""

    table: Any
    done: Any
    any_hit: Any
    work: Any
    counters: Any


@inlined
def _offer_other(i, k, others, rays, best):
    table, done, any_hit, work, counters = others
    _offer_object(i, k, done, False, any_hit, table, rays, best, work, counters)


@kernel
def trace_revolution_tree(table, members, rays, guess, best, any_hit, work, stack, counters):
    """As `trace_revolutions`, for the objects in a tree; guessed pieces are settled already."""
    for i in range(rays.origin.shape[0]):
        done = np.int64(guess[i]) if guess.shape[0] > 0 else np.int64(-1)
        others = _Others(table, done, any_hit, work, counters)
        counters[NODES] += offer_near(i, _offer_other, others, members, rays, best, any_hit, stack)


@kernel
def guess_pieces(hits, triangles, row_of, table, guess):
    """Turn coarse hits into pieces (-1: no hit, or on no surface of revolution)."""
    for i in range(hits.face.shape[0]):
        f = hits.face[i]
        guess[i] = -1
        if f < 0 or row_of[triangles.object_id[f]] < 0:
            continue
        k = row_of[triangles.object_id[f]]
        for seg in range(table.first_segment[k], table.first_segment[k + 1]):
            if table.segment_id[seg] == triangles.piece[f]:
                _, s = parameters_at(triangles, f, hits.u[i], hits.v[i])
                n = table.first_piece[seg + 1] - table.first_piece[seg]
                guess[i] = table.first_piece[seg] + min(max(int(s * n), 0), n - 1)
