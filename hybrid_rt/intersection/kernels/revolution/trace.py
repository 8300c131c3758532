"""First hits of a batch of rays on surfaces of revolution, each proven to be the first.

Objects, their segments and the pieces of these are passed over where the ray stays away from their
boxes; what is left is settled piece by piece, on one sheet of the ray after the other. A guess names
the piece to begin with.
"""

from typing import Any, NamedTuple

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
from hybrid_rt.intersection.kernels.search.counters import CHANGED
from hybrid_rt.intersection.kernels.search.frame import begin_of, end_of
from meshing.kernels.jit import hot_kernel, inlined


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


@hot_kernel
def trace_revolutions(table, rays, guess, best, any_hit, work, counters):
    """Lower ``best`` to the first hits; ``guess`` names a piece to begin with, -1 for none."""
    origin, direction, t_min = rays.origin, rays.direction, rays.t_min
    first_segment, first_piece, span = table.first_segment, table.first_piece, table.span
    whole, object_id, ray = table.whole, table.object_id, work.ray
    for i in range(origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        done = -1
        t_guess = best.t[i]
        for turn in range(2):
            is_guess = turn == 0
            if is_guess:
                if guess.shape[0] == 0 or guess[i] < 0:
                    continue
                done = guess[i]
            for k in range(object_id.shape[0]):
                first, last = first_segment[k], first_segment[k + 1]
                if is_guess and not (first_piece[first] <= done < first_piece[last]):
                    continue
                to_frame = table.to_frame[k]
                shift = enter_axis_frame(k, table, ox, oy, oz, dx, dy, dz, ray)
                t_lo = begin_of(t_min[i], to_frame, shift)
                t_cut = end_of(best.t[i], to_frame, shift)
                z_low, z_high = height_range(
                    whole[k, 0], whole[k, 1], whole[k, 2], ray, t_lo, t_cut, ray[BAND]
                )
                if z_low > z_high:
                    continue
                nearest = ray[BESIDE] - ray[BAND]
                for seg in range(first, last):
                    if is_guess and not (first_piece[seg] <= done < first_piece[seg + 1]):
                        continue
                    if span[seg, 0] > z_high or span[seg, 1] < z_low or span[seg, 3] < nearest:
                        continue
                    solve_segment(
                        i, k, seg, done, is_guess, t_lo, z_low, z_high, table, rays, best, work,
                        counters,
                    )  # fmt: skip
                    if any_hit and best.object_id[i] >= 0:
                        break
                if any_hit and best.object_id[i] >= 0:
                    break
            if is_guess:
                t_guess = best.t[i]
                if any_hit and best.object_id[i] >= 0:
                    break
        if guess.shape[0] > 0 and best.t[i] < t_guess:
            counters[CHANGED] += 1


@hot_kernel
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
