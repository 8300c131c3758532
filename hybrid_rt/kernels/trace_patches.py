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

from hybrid_rt.kernels.frame import enter_frame
from hybrid_rt.kernels.patch import (
    CONVERGED,
    TANGENT_BAND,
    evaluate_any,
    newton,
    newton_inlined,
    offer_root,
    offer_root_inlined,
    rounding_of_root,
)
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
    CHANGED,
    NEWTONS,
    NODES,
    STEPS,
    slow_solve,
)
from hybrid_rt.kernels.tree import push_children, safe_reciprocal
from meshing.kernels.bernstein import second_partials, unit_normal
from meshing.kernels.jit import hot_kernel, inlined

# Boxes within this of the nearest root are still looked into (times 1 + |t|, in frame units): far
# more than two cells can disagree on the t of a root on their common border.
CUT_SLACK = 2.0**-20
# Only hits flatter than this can lie within rounding of a silhouette: sqrt(2 * 64 eps), with air.
GRAZING = 1e-5
# Squares of tangents (over the size) and of sines below this leave the normal to `unit_normal`.
CLEAR_TANGENT = 1e-16
NORMAL_DEGENERATE = 1  # `hybrid_rt.records.Flag`


class PatchTable(NamedTuple):
    """Patches and their cells, in a frame where they all lie within 1 of the origin."""

    middle: Any  # (3,) float64: the frame's origin, world
    to_frame: float  # power of two: frame = (world - middle) * to_frame
    control: Any  # (total, 4) nets relative to `centre`, frame units, one after the other, and 0
    start: Any  # (k,) int64: first control point
    degree: Any  # (k, 2) int64
    centre: Any  # (k, 3): the middle of each net, frame
    size: Any  # (k,): largest distance of a control point from the centre
    open_edges: Any  # (k,) int64: bits for borders that no other patch continues
    object_id: Any  # (k,) int32
    patch_id: Any  # (k,) int32: number within its surface
    grid: Any  # (k, 2) int64: cells along u and v
    first_cell: Any  # (k,) int64
    place: Any  # (n,) int32: where each cell of the grids stands below, in the order of the tree
    record: Any  # (n or 5 n, RECORD): the cells, then the four quarters of each if there are any
    cell_patch: Any  # (n or 5 n,) int32


class PatchScratch(NamedTuple):
    """What one thread needs while it traces; contents mean nothing between calls."""

    basis: Any  # (4, w), w - 1 the highest degree
    nets: Any  # (DEPTH, w, w, 3)
    boxes: Any  # (DEPTH, 4)
    entry: Any  # (8,) float32
    stack_node: Any  # (tree.stack,) int32
    stack_count: Any  # (tree.stack,) int32
    stack_entry: Any  # (tree.stack,) float32


@inlined
def solve_cell(
    i, cell, record, cell_patch, control, start, degree, centre, size, open_edges,
    object_id, basis, nets, boxes,
    x, y, z, lx, ly, lz, dx, dy, dz, t_lo, t_cut, shift, to_world,
    t_min, known, best, counters, quartered,
):  # fmt: skip
    """Settle one cell for one ray: offer its root, or know that there is none that matters.

    With ``quartered`` a cell that turns too much is left to its quarters; then the answer is True.
    """
    px, py, pz = (
        x - record[cell, CENTRE],
        y - record[cell, CENTRE + 1],
        z - record[cell, CENTRE + 2],
    )
    ou = record[cell, ROW_U] * px + record[cell, ROW_U + 1] * py + record[cell, ROW_U + 2] * pz
    ov = record[cell, ROW_V] * px + record[cell, ROW_V + 1] * py + record[cell, ROW_V + 2] * pz
    on = record[cell, ROW_N] * px + record[cell, ROW_N + 1] * py + record[cell, ROW_N + 2] * pz
    du = record[cell, ROW_U] * dx + record[cell, ROW_U + 1] * dy + record[cell, ROW_U + 2] * dz
    dv = record[cell, ROW_V] * dx + record[cell, ROW_V + 1] * dy + record[cell, ROW_V + 2] * dz
    dn = record[cell, ROW_N] * dx + record[cell, ROW_N + 1] * dy + record[cell, ROW_N + 2] * dz
    # --- the skew box: three slabs
    t0, t1 = -np.inf, np.inf
    for axis in range(3):
        o, d = (ou, du) if axis == 0 else ((ov, dv) if axis == 1 else (on, dn))
        lo, hi = record[cell, BOX + 2 * axis] - o, record[cell, BOX + 2 * axis + 1] - o
        if d == 0.0:
            if lo > 0.0 or hi < 0.0:
                return False
            continue
        inv = 1.0 / d
        a, b = lo * inv, hi * inv
        if a > b:
            a, b = b, a
        t0, t1 = max(t0, a), min(t1, b)
    if t0 > t1 or t1 < t_lo or t0 > t_cut:
        return False
    counters[CELLS] += 1
    patch = cell_patch[cell]
    ox, oy, oz = (
        (x - centre[patch, 0]) + lx,
        (y - centre[patch, 1]) + ly,
        (z - centre[patch, 2]) + lz,
    )
    um, vm, hu, hv = (
        record[cell, MIDDLE],
        record[cell, MIDDLE + 1],
        record[cell, HALF],
        record[cell, HALF + 1],
    )
    first, m, n = start[patch], degree[patch, 0], degree[patch, 1]
    dd = dx * dx + dy * dy + dz * dz
    if dn * dn > record[cell, SPREAD] * dd:
        # --- at most one root: Newton from the middle of the box along the normal
        t = min(max((0.5 * (record[cell, BOX + 4] + record[cell, BOX + 5]) - on) / dn, t0), t1)
        counters[NEWTONS] += 1
        status, u, v, t, steps, n_dot_d, gain_u, gain_v = newton_inlined(
            control, first, m, n, basis, size[patch], ox, oy, oz, dx, dy, dz,
            um + hu * (ou + t * du), vm + hv * (ov + t * dv), t, hu, hv,
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
                    offer_root_inlined(
                        i, u, v, t, n_dot_d, gain_u, gain_v, control, first, basis, m, n, size[patch],
                        ox, oy, oz, dx, dy, dz, open_edges[patch], shift, to_world,
                        object_id[patch], patch, t_min, known, best,
                    )  # fmt: skip
                return False
    elif quartered:
        return True
    slow_solve(
        i, nets, boxes, basis, control, first, m, n, size[patch], ox, oy, oz, dx, dy, dz,
        um - hu, um + hu, vm - hv, vm + hv, t_lo, t_cut, open_edges[patch], shift, to_world,
        object_id[patch], patch, t_min, known, best, counters,
    )  # fmt: skip
    return False


@hot_kernel
def trace_patches(table, tree, rays, guess, best, any_hit, scratch, counters):
    """Lower ``best`` to the first hits on the patches of the table.

    ``guess`` (n,) int32 names a cell to begin with for each ray, -1 for none; an empty array means
    no guesses at all. With ``any_hit`` a ray stops at its first hit, and rays that have one are
    passed over.
    """
    middle, to_frame = table.middle, table.to_frame
    control, start, degree = table.control, table.start, table.degree
    centre, size, open_edges = table.centre, table.size, table.open_edges
    object_id, record, cell_patch = table.object_id, table.record, table.cell_patch
    # Cells come before their quarters.
    n_cells = table.place.shape[0]
    n_quartered = n_cells if record.shape[0] > n_cells else 0
    rows, links = tree.rows, tree.links
    origin, direction, t_min, known = rays.origin, rays.direction, rays.t_min, rays.known
    t_best = best.t
    to_world = 1.0 / to_frame
    mx, my, mz = middle[0], middle[1], middle[2]
    basis, nets, boxes = scratch.basis, scratch.nets, scratch.boxes
    entry, stack_entry = scratch.entry, scratch.stack_entry
    stack_node, stack_count = scratch.stack_node, scratch.stack_count
    for i in range(origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        x, y, z, lx, ly, lz, shift = enter_frame(
            origin[i, 0], origin[i, 1], origin[i, 2], dx, dy, dz, mx, my, mz, to_frame
        )
        t_lo = t_min[i] * to_frame - shift
        t_lo -= CUT_SLACK * (1.0 + abs(t_lo))
        t_cut = t_best[i] * to_frame - shift
        t_cut += CUT_SLACK * (1.0 + abs(t_cut))
        fx, fy, fz = np.float32(x), np.float32(y), np.float32(z)
        rx, ry, rz = safe_reciprocal(dx), safe_reciprocal(dy), safe_reciprocal(dz)
        sx, sy, sz = 0 if rx > 0 else 3, 0 if ry > 0 else 3, 0 if rz > 0 else 3
        lo = np.float32(t_lo)
        top = 1
        stack_node[0], stack_count[0], stack_entry[0] = 0, 0, lo
        # The guess lies on top: its root is known before the tree is walked.
        done = np.int64(-1)
        if guess.shape[0] > 0:
            done = np.int64(guess[i])
        t_guess, is_walking = -np.inf, False
        if done >= 0:
            stack_node[1], stack_count[1], stack_entry[1] = done, 1, lo
            top = 2
        while top > 0:
            top -= 1
            if stack_entry[top] > t_cut:
                continue
            node = np.int64(stack_node[top])
            if stack_count[top] == 0:
                counters[NODES] += 1
                if node == 0:
                    t_guess, is_walking = t_best[i], True
                top = push_children(
                    rows, links, node, fx, fy, fz, rx, ry, rz, sx, sy, sz,
                    lo, np.float32(t_cut), entry, stack_node, stack_count, stack_entry, top,
                )  # fmt: skip
                continue
            if node == done and is_walking:
                continue
            left = solve_cell(
                i, node, record, cell_patch, control, start, degree, centre, size, open_edges,
                object_id, basis, nets, boxes, x, y, z, lx, ly, lz, dx, dy, dz, t_lo, t_cut,
                shift, to_world, t_min, known, best, counters, node < n_quartered,
            )  # fmt: skip
            if left:
                for k in range(4):
                    stack_node[top], stack_count[top] = n_quartered + 4 * node + k, 1
                    stack_entry[top] = lo
                    top += 1
                continue
            if any_hit and best.object_id[i] >= 0:
                break
            t_cut = t_best[i] * to_frame - shift
            t_cut += CUT_SLACK * (1.0 + abs(t_cut))
        if guess.shape[0] > 0 and t_best[i] < t_guess:
            counters[CHANGED] += 1


@hot_kernel
def refine_patches(
    table,
    face,
    t,
    u,
    v,
    corner_uv,
    object_of,
    piece,
    first_patch,
    rows,
    rays,
    best,
    basis,
    accepted,
):
    """Newton from coarse hits, with no proof of anything (accuracy "refined")."""
    degree = table.degree
    for j in range(face.shape[0]):
        i, f = rows[j], face[j]
        if first_patch[object_of[f]] < 0:
            continue
        k = first_patch[object_of[f]] + piece[f]
        o, middle = rays.origin[i], table.middle
        w = 1.0 - u[j] - v[j]
        a = w * corner_uv[f, 0, 0] + u[j] * corner_uv[f, 1, 0] + v[j] * corner_uv[f, 2, 0]
        b = w * corner_uv[f, 0, 1] + u[j] * corner_uv[f, 1, 1] + v[j] * corner_uv[f, 2, 1]
        d = rays.direction[i]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], table.to_frame
        )
        c = table.centre[k]
        ox, oy, oz = hx - c[0] + lx, hy - c[1] + ly, hz - c[2] + lz
        m, n = degree[k, 0], degree[k, 1]
        status, a, b, s, _, n_dot_d, gain_u, gain_v = newton(
            table.control, table.start[k], m, n, basis, table.size[k], ox, oy, oz, d[0], d[1], d[2],
            a, b, t[j] * table.to_frame - shift, 1.0, 1.0,
        )  # fmt: skip
        if status == CONVERGED and offer_root(
            i, a, b, s, n_dot_d, gain_u, gain_v, table.control, table.start[k], basis, m, n, table.size[k],
            ox, oy, oz, d[0], d[1], d[2], table.open_edges[k], shift, 1.0 / table.to_frame,
            table.object_id[k], k, rays.t_min, rays.known, best,
        ):  # fmt: skip
            accepted[j] = True


@hot_kernel
def finish_patches(table, rays, best, kind_of, kind, basis, out):
    """Fill what a hit record says of the rays whose nearest root is on a patch.

    ``kind_of`` (objects,) names the kind of each object; rows of other kinds are left alone.
    """
    middle, to_world = table.middle, 1.0 / table.to_frame
    control, start, degree, centre, size = (
        table.control, table.start, table.degree, table.centre, table.size,
    )  # fmt: skip
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or kind_of[best.object_id[i]] != kind:
            continue
        k = best.primitive[i]
        u, v = best.a[i], best.b[i]
        m, n = degree[k, 0], degree[k, 1]
        o, d = rays.origin[i], rays.direction[i]
        dx, dy, dz = d[0], d[1], d[2]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], dx, dy, dz, middle[0], middle[1], middle[2], table.to_frame
        )
        ox, oy, oz = hx - centre[k, 0] + lx, hy - centre[k, 1] + ly, hz - centre[k, 2] + lz
        x, y, z, ux, uy, uz, vx, vy, vz = evaluate_any(control, start[k], m, n, u, v, basis)
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        guu, guv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz
        gvv = vx * vx + vy * vy + vz * vz
        smallest = CLEAR_TANGENT * size[k] * size[k]
        is_degenerate = False
        if guu > smallest and gvv > smallest and length * length > CLEAR_TANGENT * guu * gvv:
            nx, ny, nz = nx / length, ny / length, nz / length
        else:
            nx, ny, nz, is_degenerate = unit_normal(control, start[k], m, n, u, v)
        out.patch_id[i] = table.patch_id[k]
        out.u[i], out.v[i] = u, v
        out.position[i, 0] = middle[0] + (centre[k, 0] + x) * to_world
        out.position[i, 1] = middle[1] + (centre[k, 1] + y) * to_world
        out.position[i, 2] = middle[2] + (centre[k, 2] + z) * to_world
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = nx, ny, nz
        if is_degenerate:
            out.flags[i] = NORMAL_DEGENERATE
        t = best.t[i] * table.to_frame - shift
        rx, ry, rz = ox + t * dx - x, oy + t * dy - y, oz + t * dz - z
        residual = np.sqrt(rx * rx + ry * ry + rz * rz)
        out.residual[i] = residual * to_world
        # --- grazing: how deep does the ray run under the silhouette?
        dd = dx * dx + dy * dy + dz * dz
        slope = nx * dx + ny * dy + nz * dz
        if slope * slope > GRAZING * GRAZING * dd or is_degenerate:
            continue
        # d = p S_u + q S_v along the surface; the normal curvature along it bends the surface
        # away from the ray, which therefore lies slope^2 / (2 bend) deep.
        a0, a1, a2, b0, b1, b2, c0, c1, c2 = second_partials(control, start[k], m, n, u, v)
        du, dv = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        det = guu * gvv - guv * guv
        if not det > 0.0:
            continue
        p, q = (gvv * du - guv * dv) / det, (guu * dv - guv * du) / det
        bend = abs(
            nx * (p * p * a0 + 2.0 * p * q * b0 + q * q * c0)
            + ny * (p * p * a1 + 2.0 * p * q * b1 + q * q * c1)
            + nz * (p * p * a2 + 2.0 * p * q * b2 + q * q * c2)
        )
        _, scale = rounding_of_root(m, n, size[k], ox, oy, oz, dx, dy, dz, t)
        if slope * slope < 2.0 * bend * TANGENT_BAND * scale:
            best.tangent[i] = 1
