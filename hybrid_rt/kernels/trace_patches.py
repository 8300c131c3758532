"""First hits of a batch of rays on Bezier patches, each proven to be the first.

The walk through the tree meets cells front to back. Where the cell's cone admits at most one root
(`patch_cells`) one Newton solve settles it: the root is in the cell, a hit; or beside it, and there
is none. Everything else goes to `slow_solve`. A root is offered only by the cell that holds it
(and, within rounding, by its neighbour), so what a ray finds does not depend on the order of the
walk, nor on any hit that was guessed beforehand: a guess only names the cell to begin with, and so
how much of the tree need not be seen.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.kernels.patch import CONVERGED, newton, offer_root, rounding_of_root
from hybrid_rt.kernels.patch_cells import (
    BOX,
    CENTRE,
    GROWTH,
    HALF,
    MIDDLE,
    ROW_N,
    ROW_U,
    ROW_V,
    SPREAD,
)
from hybrid_rt.kernels.subdivide import (
    BORDER_SLACK,
    CELLS,
    COUNTER_NAMES,
    DEPTH,
    NEWTONS,
    NODES,
    STEPS,
    slow_solve,
)
from hybrid_rt.kernels.tree import FRAME_RADIUS, push_children, safe_reciprocal, test_children
from meshing.kernels.jit import inner, kernel

# Boxes within this of the nearest root are still looked into (times 1 + |t|, in frame units): far
# more than two cells can disagree on the t of a root on their common border.
CUT_SLACK = 2.0**-20


class PatchTable(NamedTuple):
    """Patches and their cells, in a frame where they all lie within `FRAME_RADIUS` of 0."""

    middle: Any  # (3,) float64: the frame's origin, world
    to_frame: float  # power of two: frame = (world - middle) * to_frame
    control: Any  # (total, 3) nets relative to `centre`, frame units, one after the other
    start: Any  # (k,) int64: first control point
    degree: Any  # (k, 2) int64
    centre: Any  # (k, 3): the middle of each net, frame
    size: Any  # (k,): largest distance of a control point from the centre
    open_edges: Any  # (k,) int64: bits for borders that no other patch continues
    object_id: Any  # (k,) int32
    patch_id: Any  # (k,) int32: number within its surface
    grid: Any  # (k, 2) int64: cells along u and v
    first_cell: Any  # (k,) int64
    record: Any  # (n, RECORD): the cells
    cell_patch: Any  # (n,) int32


@inner
def enter_frame(o, d, middle, to_frame):
    """Bring a ray's origin into a frame, near the frame's ball, without losing a digit.

    Returns the origin in two parts (their sum is exact to 2**-100) and by how much t was advanced,
    in frame units: frame origin + (t to_frame - shift) d.
    """
    h0, l0 = two_difference(o[0], middle[0])
    h1, l1 = two_difference(o[1], middle[1])
    h2, l2 = two_difference(o[2], middle[2])
    h0, l0, h1, l1, h2, l2 = (
        h0 * to_frame, l0 * to_frame, h1 * to_frame, l1 * to_frame, h2 * to_frame, l2 * to_frame,
    )  # fmt: skip
    square = h0 * h0 + h1 * h1 + h2 * h2
    if square <= 4.0 * FRAME_RADIUS * FRAME_RADIUS:
        return h0, h1, h2, l0, l1, l2, 0.0
    dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    # To the foot of the perpendicular, less 1.5 radii.
    shift = -(h0 * d[0] + h1 * d[1] + h2 * d[2]) / dd - 1.5 * FRAME_RADIUS / np.sqrt(dd)
    h0, l0 = advance(h0, l0, shift, d[0])
    h1, l1 = advance(h1, l1, shift, d[1])
    h2, l2 = advance(h2, l2, shift, d[2])
    return h0, h1, h2, l0, l1, l2, shift


@inner
def two_difference(a, b):
    """Return a - b rounded, and what the rounding left (Knuth)."""
    s = a - b
    z = s - a
    return s, (a - (s - z)) - (b + z)


@inner
def advance(high, low, t, d):
    """high + low + t d as an unevaluated sum of two numbers (Dekker's product)."""
    p = t * d
    c = 134217729.0 * t
    th = c - (c - t)
    tl = t - th
    c = 134217729.0 * d
    dh = c - (c - d)
    dl = d - dh
    e = ((th * dh - p) + th * dl + tl * dh) + tl * dl
    s = high + p
    z = s - high
    low = low + ((high - (s - z)) + (p - z)) + e
    r = s + low
    return r, low - (r - s)


@inner
def solve_cell(
    i, cell, record, cell_patch, control, start, degree, centre, size, open_edges,
    object_id, basis, nets, boxes,
    x, y, z, lx, ly, lz, dx, dy, dz, t_lo, t_cut, shift, to_world,
    t_min, known, best, counters,
):  # fmt: skip
    """Settle one cell for one ray: offer its root, or know that there is none that matters."""
    c = record[cell]
    px, py, pz = x - c[CENTRE], y - c[CENTRE + 1], z - c[CENTRE + 2]
    ou = c[ROW_U] * px + c[ROW_U + 1] * py + c[ROW_U + 2] * pz
    ov = c[ROW_V] * px + c[ROW_V + 1] * py + c[ROW_V + 2] * pz
    on = c[ROW_N] * px + c[ROW_N + 1] * py + c[ROW_N + 2] * pz
    du = c[ROW_U] * dx + c[ROW_U + 1] * dy + c[ROW_U + 2] * dz
    dv = c[ROW_V] * dx + c[ROW_V + 1] * dy + c[ROW_V + 2] * dz
    dn = c[ROW_N] * dx + c[ROW_N + 1] * dy + c[ROW_N + 2] * dz
    # --- the skew box: three slabs
    t0, t1 = -np.inf, np.inf
    for axis in range(3):
        o, d = (ou, du) if axis == 0 else ((ov, dv) if axis == 1 else (on, dn))
        lo, hi = c[BOX + 2 * axis] - o, c[BOX + 2 * axis + 1] - o
        if d == 0.0:
            if lo > 0.0 or hi < 0.0:
                return
            continue
        inv = 1.0 / d
        a, b = lo * inv, hi * inv
        if a > b:
            a, b = b, a
        t0, t1 = max(t0, a), min(t1, b)
    if t0 > t1 or t1 < t_lo or t0 > t_cut:
        return
    counters[CELLS] += 1
    patch = cell_patch[cell]
    ox, oy, oz = (x - centre[patch, 0]) + lx, (y - centre[patch, 1]) + ly, (z - centre[patch, 2]) + lz
    um, vm, hu, hv = c[MIDDLE], c[MIDDLE + 1], c[HALF], c[HALF + 1]
    first, m, n = start[patch], degree[patch, 0], degree[patch, 1]
    dd = dx * dx + dy * dy + dz * dz
    if dn * dn > c[SPREAD] * dd:
        # --- at most one root: Newton from the middle of the box along the normal
        t = min(max((0.5 * (c[BOX + 4] + c[BOX + 5]) - on) / dn, t0), t1)
        counters[NEWTONS] += 1
        status, u, v, t, steps, n_dot_d, gain_u, gain_v = newton(
            control, first, m, n, basis, ox, oy, oz, dx, dy, dz,
            um + hu * (ou + t * du), vm + hv * (ov + t * dv), t, hu, hv, 1.0,
        )  # fmt: skip
        counters[STEPS] += steps
        if status == CONVERGED:
            beside_u, beside_v = abs(u - um), abs(v - vm)
            grown = 1.0 + 2.0 * GROWTH
            if beside_u <= grown * hu and beside_v <= grown * hv:
                error, _ = rounding_of_root(m, n, size[patch], ox, oy, oz, dx, dy, dz, t)
                if (
                    beside_u <= hu * (1.0 + BORDER_SLACK) + error * gain_u
                    and beside_v <= hv * (1.0 + BORDER_SLACK) + error * gain_v
                ):
                    offer_root(
                        i, u, v, t, n_dot_d, gain_u, gain_v, m, n, size[patch],
                        ox, oy, oz, dx, dy, dz, open_edges[patch], shift, to_world,
                        object_id[patch], patch, t_min, known, best,
                    )  # fmt: skip
                return
    slow_solve(
        i, nets, boxes, basis, control, first, m, n, size[patch], ox, oy, oz, dx, dy, dz,
        um - hu, um + hu, vm - hv, vm + hv, t_lo, t_cut, open_edges[patch], shift, to_world,
        object_id[patch], patch, t_min, known, best, counters,
    )  # fmt: skip


@kernel
def trace_patches(table, tree, rays, guess, best, any_hit, counters):
    """Lower ``best`` to the first hits on the patches of the table.

    ``guess`` (n,) int32 names a cell to begin with for each ray, -1 for none; an empty array means
    no guesses at all. With ``any_hit`` a ray stops at its first hit, and rays that have one are
    passed over.
    """
    middle, to_frame = table.middle, table.to_frame
    control, start, degree = table.control, table.start, table.degree
    centre, size, open_edges = table.centre, table.size, table.open_edges
    object_id, record, cell_patch = table.object_id, table.record, table.cell_patch
    rows, child, count, order = tree.rows, tree.child, tree.count, tree.order
    origin, direction, t_min, known = rays.origin, rays.direction, rays.t_min, rays.known
    t_best = best.t
    to_world = 1.0 / to_frame
    widest = 2
    for k in range(degree.shape[0]):
        widest = max(widest, degree[k, 0] + 1, degree[k, 1] + 1)
    basis = np.empty((4, widest))
    nets = np.empty((DEPTH, widest, widest, 3))
    boxes = np.empty((DEPTH, 4))
    entry = np.empty(8, np.float32)
    stack_node = np.empty(tree.stack, np.int32)
    stack_count = np.empty(tree.stack, np.int32)
    stack_entry = np.empty(tree.stack, np.float32)
    for i in range(origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        x, y, z, lx, ly, lz, shift = enter_frame(origin[i], direction[i], middle, to_frame)
        t_lo = t_min[i] * to_frame - shift
        t_lo -= CUT_SLACK * (1.0 + abs(t_lo))
        t_cut = t_best[i] * to_frame - shift
        t_cut += CUT_SLACK * (1.0 + abs(t_cut))
        done = -1
        if guess.shape[0] > 0 and guess[i] >= 0:
            done = guess[i]
            solve_cell(
                i, done, record, cell_patch, control, start, degree, centre, size, open_edges,
                object_id, basis, nets, boxes, x, y, z, lx, ly, lz, dx, dy, dz, t_lo, t_cut,
                shift, to_world, t_min, known, best, counters,
            )  # fmt: skip
            if any_hit and best.object_id[i] >= 0:
                continue
            t_cut = t_best[i] * to_frame - shift
            t_cut += CUT_SLACK * (1.0 + abs(t_cut))
        fx, fy, fz = np.float32(x), np.float32(y), np.float32(z)
        rx, ry, rz = safe_reciprocal(dx), safe_reciprocal(dy), safe_reciprocal(dz)
        sx, sy, sz = 0 if rx > 0 else 3, 0 if ry > 0 else 3, 0 if rz > 0 else 3
        lo = np.float32(t_lo)
        top = 1
        stack_node[0], stack_count[0], stack_entry[0] = 0, 0, lo
        while top > 0:
            top -= 1
            if stack_entry[top] > t_cut:
                continue
            node = stack_node[top]
            if stack_count[top] == 0:
                counters[NODES] += 1
                test_children(
                    rows, node, fx, fy, fz, rx, ry, rz, sx, sy, sz, lo, np.float32(t_cut), entry
                )
                top = push_children(
                    child, count, node, entry, stack_node, stack_count, stack_entry, top
                )
                continue
            for k in range(node, node + stack_count[top]):
                cell = order[k]
                if cell == done:
                    continue
                solve_cell(
                    i, cell, record, cell_patch, control, start, degree, centre, size,
                    open_edges, object_id, basis, nets, boxes, x, y, z, lx, ly, lz, dx, dy, dz,
                    t_lo, t_cut, shift, to_world, t_min, known, best, counters,
                )  # fmt: skip
            if any_hit and best.object_id[i] >= 0:
                break
            t_cut = t_best[i] * to_frame - shift
            t_cut += CUT_SLACK * (1.0 + abs(t_cut))
