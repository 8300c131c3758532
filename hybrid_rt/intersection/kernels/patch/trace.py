"""First hits of a batch of rays on Bezier patches, each proven to be the first.

The walk through the tree meets cells front to back. Where the cell's fan admits at most one root
(`patch.cells`) one Newton solve settles it: the root is in the cell, a hit; or beside it, and there
is none. Everything else waits in a queue for `settle_doubts`, a kernel of its own: three of a
hundred rays need it, and all others are faster without its code among theirs. A root is offered
only by the cell that holds it (and, within rounding, by its neighbour), so what a ray finds does
not depend on the order of the walk, nor on any hit that was guessed beforehand: a guess only names
the cell to begin with, and so how much of the tree need not be seen.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.cells import (
    BOX_SLACK,
    FAN,
    FAN_SLACK,
    GROWTH,
    HALF,
    MIDDLE_U,
    MIDDLE_V,
    ROW_N,
    side_at_point,
)
from hybrid_rt.intersection.kernels.patch.skew_box import LOWER, UPPER, meet_box
from hybrid_rt.intersection.kernels.patch.solve import (
    CONVERGED,
    band_of,
    from_centre,
    newton_inlined,
    offer_border,
    offer_root_inlined,
    patch_of,
    rounding_of_root,
)
from hybrid_rt.intersection.kernels.patch.subdivide import slow_solve
from hybrid_rt.intersection.kernels.search.boxes import NEVER_MET
from hybrid_rt.intersection.kernels.search.counters import CELLS, NEWTONS, NODES, STEPS
from hybrid_rt.intersection.kernels.search.frame import FrameRay, begin_of, end_of, enter_frame
from hybrid_rt.intersection.kernels.search.tolerances import BORDER_SLACK, OWNED
from hybrid_rt.intersection.kernels.search.tree import CHILD, COUNT, box_ray, cut_key, descend
from meshing.kernels.jit import inlined, kernel


class PatchTable(NamedTuple):
    """Patches and their cells, in a frame where they all lie within 1 of the origin."""

    middle: Any  # (3,) float64: the frame's origin, world
    to_frame: float  # power of two: frame = (world - middle) * to_frame
    # (total, 4) nets relative to `centre`, frame units, one after the other, and 0; of rational
    # patches times their weights, the largest of a patch in [1/2, 1), and these
    control: Any
    rational: Any  # None: all patches are polynomial; True; in a table for rare code also False
    start: Any  # (k,) int64: first control point
    degree: Any  # (k, 2) int64
    centre: Any  # (k, 3): the middle of each net, frame
    size: Any  # (k,): largest distance of a control point from the centre
    around: Any  # (k, 4): middle of each one's object, and the diameter of its box, frame units
    # (k, 37): bounds of the lengths of S_uu, S_uv and S_vv; squares of the longest S_u and S_v, roughly;
    # then for each side what is known of a closed pole (`kinds.closed_poles`)
    bend: Any
    object_id: Any  # (k,) int32
    patch_id: Any  # (k,) int32: number within its surface
    grid: Any  # (k, 2) int64: cells along u and v
    first_cell: Any  # (k,) int64
    place: Any  # (n,) int32: where each cell of the grids stands below, in the order of the tree
    record: Any  # (n or 5 n, RECORD): the cells, then the four quarters of each if there are any
    cell_patch: Any  # (n or 5 n,) uint32
    trim: Any  # None: patches are whole; else `search.trims.Trim`, a row for each patch, or none at all


class PatchScratch(NamedTuple):
    """What one thread needs while it traces; contents mean nothing between calls."""

    basis: Any  # (4, w), w - 1 the highest degree; None if all patches are bicubic
    nets: Any  # (DEPTH, w, w, 4); the last column is for rational patches
    room: Any  # (w, w, 3)
    boxes: Any  # (DEPTH, 4)
    stack: Any  # Stack with room for `MORE` besides the tree's children
    queue: Any  # (m, 2) int32: rays and cells still to settle; m at least the number of records


SETTLED, TO_QUARTERS, DOUBTFUL = 0, 1, 2
# A parent from here on is no node: less this it is a cell.
CELL = 2**31
# The guess, and the quarters of a cell.
MORE = 8
# So many cells of a patch that one ray leaves in doubt are first searched together. Cells this part of
# their sides from what may hold a root may offer it too, and cells at a border its points.
MANY, BESIDE = 8, 0.125


@inlined
def solve_cell(i, cell, table, basis, ray, t_lo, t_cut, rays, best, quartered):
    """Settle one cell for one ray: offer its root, or know that there is none that matters.

    Returns `SETTLED`; `DOUBTFUL`; with ``quartered``, `TO_QUARTERS` for a cell that turns too much.
    ``t`` of the patch's root that Newton came upon, in this cell or beside it; else inf.
    ``boxes`` 1 if the ray meets the cell's box.
    ``steps`` Newton steps.
    """
    record = table.record
    t0, t1, ou, ov, on, du, dv, dn = meet_box(
        record, cell, ray.x, ray.y, ray.z, ray.dx, ray.dy, ray.dz
    )
    if t0 > t1 or t1 < t_lo or t0 > t_cut:
        return SETTLED, np.inf, 0, 0
    r = record[cell]
    unsettled = TO_QUARTERS if quartered else DOUBTFUL
    if not abs(dn) > r[FAN] * abs(du) + r[FAN + 1] * abs(dv) + FAN_SLACK:
        return unsettled, np.inf, 1, 0
    # --- at most one root: Newton from the middle of the box along the normal
    k = table.cell_patch[cell]
    patch, line = patch_of(table, k, basis), from_centre(table, k, ray)
    um, vm, hu, hv = r[MIDDLE_U], r[MIDDLE_V], r[HALF], r[HALF + 1]
    t = min(max((0.5 * (r[LOWER + ROW_N] + r[UPPER + ROW_N]) - on) / dn, t0), t1)
    status, u, v, t, steps, n_dot_d, gain_u, gain_v = newton_inlined(
        patch, line, um + hu * (ou + t * du), vm + hv * (ov + t * dv), t, hu, hv
    )
    if status != CONVERGED:
        return unsettled, np.inf, 1, steps
    # What is beyond the patch has its nearest point on the border.
    in_u, in_v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    is_inside = u == in_u and v == in_v
    t_root = t if is_inside else np.inf
    grown = 1.0 + 2.0 * GROWTH
    if not (abs(u - um) <= grown * hu and abs(v - vm) <= grown * hv):
        return unsettled, t_root, 1, steps
    slack = OWNED * rounding_of_root(
        patch.degree_u, patch.degree_v, patch.rational, patch.size,
        line.ox, line.oy, line.oz, line.dx, line.dy, line.dz, t,
    )  # fmt: skip
    is_owner = (
        abs(in_u - um) <= hu * (1.0 + BORDER_SLACK) + slack * gain_u
        and abs(in_v - vm) <= hv * (1.0 + BORDER_SLACK) + slack * gain_v
    )
    if is_inside:
        if is_owner:
            offer_root_inlined(i, u, v, t, n_dot_d, patch, line, rays, best)
    elif abs(u - in_u) <= BOX_SLACK * gain_u and abs(v - in_v) <= BOX_SLACK * gain_v:
        band = band_of(table.around, k, ray)
        offer_border(i, u, v, t, n_dot_d, gain_u, gain_v, patch, line, band, is_owner, rays, best)
    return SETTLED, t_root, 1, steps


@kernel
def trace_patches(table, tree, rays, aside, guess, best, any_hit, scratch, t_guess, counters):
    """Lower ``best`` to the first hits on the patches, but for the doubts that are queued.

    ``rays``, Rays, n of them.
    ``aside`` (n, 3) or (0, 3): moves each ray, in lengths of the frame; empty: no ray is moved.
    ``guess`` (n,) or (0,) int32: a cell to begin with for each ray, -1 for none; empty: no guesses
    at all.
    ``any_hit``: a ray stops at its first hit, and rays that have one are passed over.
    ``t_guess`` (n,) or (0,): receives t of what each guess refines to, inf where that is nothing;
    like ``guess``.
    Returns ``end`` rays traced: all, or those before the queue was full.
    ``n_doubts`` rows of the queue to settle.
    """
    middle, to_frame = table.middle, table.to_frame
    record = table.record
    # Cells come before their quarters.
    n_cells = table.place.shape[0]
    n_quartered = n_cells if record.shape[0] > n_cells else 0
    links = tree.links
    origin, direction, t_min = rays.origin, rays.direction, rays.t_min
    t_best = best.t
    to_world = 1.0 / to_frame
    mx, my, mz = middle[0], middle[1], middle[2]
    basis, queue = scratch.basis, scratch.queue
    keys, parents = scratch.stack.key, scratch.stack.parent
    n_doubts = n_nodes = n_met = n_solves = n_steps = 0
    last = origin.shape[0]
    for i in range(origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        if n_doubts + record.shape[0] > queue.shape[0]:
            last = i
            break
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        x, y, z, lx, ly, lz, shift = enter_frame(
            origin[i, 0], origin[i, 1], origin[i, 2], dx, dy, dz, mx, my, mz, to_frame
        )
        if aside.shape[0] > 0:
            x, y, z = x + aside[i, 0], y + aside[i, 1], z + aside[i, 2]
        ray = FrameRay(x, y, z, lx, ly, lz, dx, dy, dz, shift, to_world)
        box = box_ray(x, y, z, dx, dy, dz)
        t_lo = begin_of(t_min[i], to_frame, shift)
        t_cut = end_of(t_best[i], to_frame, shift)
        t_hi = cut_key(t_cut)
        # The guess comes first, and before every t: its root is known before the tree is walked.
        top, done = 0, np.int64(-1)
        if guess.shape[0] > 0:
            done = np.int64(guess[i])
            t_guess[i] = np.inf
            if done >= 0:
                keys[0], parents[0] = NEVER_MET, CELL + done
                top = 1
        is_walking = False
        while True:
            if top > 0:
                top -= 1
                key, parent = np.int64(keys[top]), parents[top]
                if key > t_hi:
                    continue
                if parent < CELL:
                    node = np.int64(links[parent, CHILD, key & 7])
                    count = np.int64(links[parent, COUNT, key & 7])
                else:
                    node, count = np.int64(parent) - CELL, np.int64(1)
            elif is_walking:
                break
            else:
                is_walking = True
                key, node, count = np.int64(0), np.int64(0), np.int64(0)
            if count == 0:
                top, node, count, key, nodes = descend(
                    tree, node, box, t_lo, t_cut, scratch.stack, top
                )
                n_nodes += nodes
                if count == 0:
                    continue
            if is_walking and node == done:
                continue
            outcome, t, met, steps = solve_cell(
                i, node, table, basis, ray, t_lo, t_cut, rays, best, node < n_quartered
            )
            n_met += met
            n_steps += steps
            n_solves += 1 if steps > 0 else 0
            if not is_walking:
                t_guess[i] = min(t_guess[i], (t + shift) * to_world)
            if outcome == TO_QUARTERS:
                for k in range(4):
                    keys[top], parents[top] = key, CELL + n_quartered + 4 * node + k
                    top += 1
                continue
            if outcome == DOUBTFUL:
                queue[n_doubts, 0], queue[n_doubts, 1] = i, node
                n_doubts += 1
                continue
            if any_hit and best.object_id[i] >= 0:
                break
            t_cut = end_of(t_best[i], to_frame, shift)
            t_hi = cut_key(t_cut)
    counters[NODES] += n_nodes
    counters[CELLS] += n_met
    counters[NEWTONS] += n_solves
    counters[STEPS] += n_steps
    return last, n_doubts


@inlined
def _place_of(record, cell):
    """Return u0, u1, v0, v1 of a cell."""
    um, vm = record[cell, MIDDLE_U], record[cell, MIDDLE_V]
    hu, hv = record[cell, HALF], record[cell, HALF + 1]
    return um - hu, um + hu, vm - hv, vm + hv


@inlined
def _side_of(table, k, u0, u1, v0, v1):
    """Return on which side of a cell its patch ends in a point; else -1."""
    if u0 != 0.0 and u1 != 1.0 and v0 != 0.0 and v1 != 1.0:
        return -1
    return side_at_point(
        table.control, table.start[k], table.degree[k, 0], table.degree[k, 1], table.rational,
        u0, u1, v0, v1,
    )  # fmt: skip


@kernel
def settle_doubts(table, rays, aside, best, any_hit, scratch, n_doubts, counters):
    """Search the cells that `trace_patches` has queued, and lower ``best`` to what they hold.

    A ray along a patch leaves many of its cells in doubt, and one search of the rectangle around them shows
    that most hold no root. What is offered is always found from its own cell, so its bits do not depend on
    which cells wait.
    """
    middle, to_frame, record, queue = table.middle, table.to_frame, table.record, scratch.queue
    to_world, is_moved = 1.0 / to_frame, aside.shape[0] > 0
    end = 0
    while end < n_doubts:
        row, i = end, np.int64(queue[end, 0])
        while end < n_doubts and queue[end, 0] == i:
            end += 1
        o, d = rays.origin[i], rays.direction[i]
        x, y, z, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], to_frame
        )
        if is_moved:
            x, y, z = x + aside[i, 0], y + aside[i, 1], z + aside[i, 2]
        ray = FrameRay(x, y, z, lx, ly, lz, d[0], d[1], d[2], shift, to_world)
        t_lo = begin_of(rays.t_min[i], to_frame, shift)
        for first in range(row, end):
            if queue[first, 1] < 0 or (any_hit and best.object_id[i] >= 0):
                continue
            k = np.int64(table.cell_patch[queue[first, 1]])
            patch, line = patch_of(table, k, scratch.basis), from_centre(table, k, ray)
            n_cells, held = 0, (1.0, 0.0, 1.0, 0.0)
            for other in range(first, end):
                cell = np.int64(queue[other, 1])
                if cell < 0 or table.cell_patch[cell] != k:
                    continue
                u0, u1, v0, v1 = _place_of(record, cell)
                held = (min(held[0], u0), max(held[1], u1), min(held[2], v0), max(held[3], v1))
                n_cells += 1 if _side_of(table, k, u0, u1, v0, v1) < 0 else 0
            # All together first, if there are many; then each that may hold a root.
            for other in range(first - 1 if n_cells >= MANY else first, end):
                t_cut = end_of(best.t[i], to_frame, shift)
                u0, u1, v0, v1 = held
                if other >= first:
                    cell = np.int64(queue[other, 1])
                    if cell < 0 or table.cell_patch[cell] != k:
                        continue
                    queue[other, 1] = -1
                    u0, u1, v0, v1 = _place_of(record, cell)
                    du, dv = BESIDE * (u1 - u0), BESIDE * (v1 - v0)
                    is_free = (
                        min(u0, v0) > 0.0 and max(u1, v1) < 1.0
                        and (u0 - du > held[1] or u1 + du < held[0] or v0 - dv > held[3] or v1 + dv < held[2])
                    )  # fmt: skip
                    # What other cells have offered since may be in front of this one.
                    t0, t1, _, _, _, _, _, _ = meet_box(
                        record, int(cell), x, y, z, d[0], d[1], d[2]
                    )  # fmt: skip
                    is_over = any_hit and best.object_id[i] >= 0
                    if is_free or is_over or t1 < t_lo or t0 > t_cut:
                        continue
                    # All cells along a border that is a point are one search.
                    side = _side_of(table, k, u0, u1, v0, v1)
                    if side >= 0:
                        if side < 2:
                            v0, v1 = 0.0, 1.0
                        else:
                            u0, u1 = 0.0, 1.0
                        for more in range(other + 1, end):
                            cell = np.int64(queue[more, 1])
                            if cell < 0 or table.cell_patch[cell] != k:
                                continue
                            a0, a1, b0, b1 = _place_of(record, cell)
                            if _side_of(table, k, a0, a1, b0, b1) == side:
                                queue[more, 1] = -1
                around = slow_solve(
                    i, patch, line, (u0, u1, v0, v1), t_lo, t_cut, band_of(table.around, k, ray),
                    is_moved, other >= first, rays, best, scratch, counters,
                )  # fmt: skip
                if other < first:
                    held = around
