"""Rays against triangles in float64, watertight.

Each vertex is brought into the ray's sheared frame by the same operations whichever triangle asks
(Woop, Benthin, Wald 2013, "Watertight ray/triangle intersection"), so the edge function of a shared
edge has exactly opposite values for its two triangles, and no ray passes between them.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import product
from hybrid_rt.intersection.kernels.search.counters import CELLS, NODES
from hybrid_rt.intersection.kernels.search.frame import (
    any_normal,
    begin_of,
    end_of,
    enter_frame,
)
from hybrid_rt.intersection.kernels.search.members import FARTHEST
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    SUSPECT,
    begins_at,
    doubt,
    is_known,
    not_zero,
    note_departure,
    offer,
)
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.tree import box_ray, next_leaf
from meshing.kernels.jit import inlined, inner, kernel

# |n.d| below which a triangle's weights would lose more than a digit.
SLIVER = 3e-2
# Roundings of `away` by which the weights of a sliver may move its point beside the ray, and that the
# point and its t add.
SLIVER_ROUNDINGS = 32.0
# So many times as long as high, about: a needle.
NEEDLE = 16.0


class TriangleTable(NamedTuple):
    """Triangles of all meshes, in a frame where they all lie within 1 of the origin."""

    middle: Any  # (4,) world: and the largest `meshing.surface.Surface.moved` of the meshes
    to_frame: float  # power of two
    vertex: Any  # (v, 3) world
    face: Any  # (f, 3) int64
    around: Any  # (objects, 5) world: middle of each mesh, the diameter of its box, and its `moved`
    object_id: Any  # (f,) int32
    patch_id: Any  # (f,) int32: number within its mesh
    corner: Any  # (f, 9) world: the three vertices of each face, faces in the order of the trees
    order: Any  # (f,) int32: face of each row of `corner`


class Shear(NamedTuple):
    """What brings vertices into a ray's own frame, where it runs along the third axis through 0."""

    kx: Any  # the coordinates, in the order in which the last is the largest of the direction
    ky: Any
    kz: Any
    sx: Any  # less this much of the last one
    sy: Any
    qx: Any  # and less this: how far the ray is moved
    qy: Any


@inlined
def _across(p):
    """Return the cross product of two edges of a triangle, (9,)."""
    ex, ey, ez = p[3] - p[0], p[4] - p[1], p[5] - p[2]
    fx, fy, fz = p[6] - p[0], p[7] - p[1], p[8] - p[2]
    return ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx


@inlined
def _normal(vertex, face, f):
    a, b, c = vertex[face[f, 0]], vertex[face[f, 1]], vertex[face[f, 2]]
    bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx


@inner
def cross(ax, ay, bx, by):
    """Return ax by - ay bx with both products exact (Dekker 1971)."""
    p, e = product(ax, by)
    q, f = product(ay, bx)
    return (p - q) + (e - f)


@inlined
def _on_edge(px, py, qx, qy):
    """Return the weights of an edge's ends p and q at its point next to the ray (the origin)."""
    ex, ey = qx - px, qy - py
    square = ex * ex + ey * ey
    s = 0.0
    if square > 0.0:
        s = min(max(-(px * ex + py * ey) / square, 0.0), 1.0)
    return 1.0 - s, s


@inlined
def band_at(around, object_id, o):
    """Return 64 eps x scale for a mesh and a ray's origin, and how far rounding has moved the mesh."""
    m = around[object_id]
    x, y, z = o[0] - m[0], o[1] - m[1], o[2] - m[2]
    return TANGENT_BAND * max(np.sqrt(x * x + y * y + z * z), m[3]) + m[4]


@inner
def _note_beside(i, k, corner, order, around, object_id, o, d, t_min, known, best):
    """Note a doubt if a face that ray i does not meet comes within the band of it."""
    p = corner[k]
    band = band_at(around, object_id[order[k]], o)
    dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    for edge in range(3):
        a, b = 3 * edge, 3 * ((edge + 1) % 3)
        x, y, z = p[a] - o[0], p[a + 1] - o[1], p[a + 2] - o[2]
        ex, ey, ez = p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]
        t, along = (x * d[0] + y * d[1] + z * d[2]) / dd, (ex * d[0] + ey * d[1] + ez * d[2]) / dd
        x, y, z = x - t * d[0], y - t * d[1], z - t * d[2]
        ex, ey, ez = ex - along * d[0], ey - along * d[1], ez - along * d[2]
        square = ex * ex + ey * ey + ez * ez
        # The point of the edge next to the ray, and its beginning, if it is seen from its end.
        s = 0.0
        if square > 0.0:
            s = min(max(-(x * ex + y * ey + z * ez) / square, 0.0), 1.0)
        for _ in range(2):
            gx, gy, gz = x + s * ex, y + s * ey, z + s * ez
            if gx * gx + gy * gy + gz * gz <= band * band:
                doubt(i, t + s * along, band, t_min, known, best)
                if around[object_id[order[k]], 4] > 0.0 and not t + s * along > t_min[i]:
                    # The face that was meant may be met ahead: by the band over the slope.
                    nx, ny, nz = _across(p)
                    length = np.sqrt(nx * nx + ny * ny + nz * nz)
                    slope = abs(nx * d[0] + ny * d[1] + nz * d[2])
                    ahead = slope * (t + s * along - t_min[i]) + 2.0 * band * (slope + length) > 0.0
                    if ahead and not is_known(i, t_min[i], 8.0 * band, 1.0, known):
                        best.doubt[i] = min(best.doubt[i], t_min[i])
                if known.shape[0] > 0 and abs(t + s * along - known[i, 0]) <= 8.0 * band:
                    # Where the ray begins next to a face, it may have left that one.
                    nx, ny, nz = _across(p)
                    length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
                    nx, ny, nz = nx / length, ny / length, nz / length
                    note_departure(i, nx, ny, nz, t_min, known, best)
            s = 0.0


@inlined
def offer_triangle(i, k, table, o, d, shear, reach, near, rays, best):
    """Offer the hit of ray i on face order[k], if it has one.

    ``reach`` is the band or more; ``near`` is that times the longest side of a face.
    """
    corner, order, around, object_id = table.corner, table.order, table.around, table.object_id
    t_min, known = rays.t_min, rays.known
    kx, ky, kz, sx, sy, qx, qy = shear
    p = corner[k]
    az, bz, cz = p[kz] - o[kz], p[3 + kz] - o[kz], p[6 + kz] - o[kz]
    ax, ay = (p[kx] - o[kx]) - sx * az - qx, (p[ky] - o[ky]) - sy * az - qy
    bx, by = (p[3 + kx] - o[kx]) - sx * bz - qx, (p[3 + ky] - o[ky]) - sy * bz - qy
    cx, cy = (p[6 + kx] - o[kx]) - sx * cz - qx, (p[6 + ky] - o[ky]) - sy * cz - qy
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    least, most = min(u, v, w), max(u, v, w)
    if least < 0.0 and most > 0.0:
        if min(-least, most) <= near:
            _note_beside(i, k, corner, order, around, object_id, o, d, t_min, known, best)
        return
    total = u + v + w
    if total == 0.0:
        _note_beside(i, k, corner, order, around, object_id, o, d, t_min, known, best)
        return
    nx, ny, nz = _across(p)
    slope = nx * d[0] + ny * d[1] + nz * d[2]
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return
    if slope == 0.0:
        # The normal of a needle has fewer digits than the area that the ray sees.
        slope = total * d[kz]
    wx, wy, wz = p[0] - o[0], p[1] - o[1], p[2] - o[2]
    t = (nx * wx + ny * wy + nz * wz) / slope
    n_dot_d = abs(slope) / length
    # The normal of a needle has fewer digits than its vertices.
    ex, ey, ez = p[3] - p[0], p[4] - p[1], p[5] - p[2]
    fx, fy, fz = p[6] - p[0], p[7] - p[1], p[8] - p[2]
    longest = max(ex * ex + ey * ey + ez * ez, fx * fx + fy * fy + fz * fz)
    is_sliver = n_dot_d < SLIVER or longest > NEEDLE * length
    if t > best.t[i] and not is_sliver:
        return
    away = max(abs(az), abs(bz), abs(cz)) + max(
        abs(ax), abs(bx), abs(cx), abs(ay), abs(by), abs(cy)
    )
    # Differences, a cross product and a dot product: 12 roundings of lengths up to `away`; the
    # normal of a needle turns by its rounding over its height, which is length over its side.
    side = max(abs(bx - ax), abs(cx - ax), abs(bx - cx), abs(by - ay), abs(cy - ay), abs(by - cy))
    side += max(abs(bz - az), abs(cz - az), abs(bz - cz))
    moved = around[object_id[order[k]], 4]
    error = UNIT_ROUNDOFF * away * (12.0 + 8.0 * side * side / length) + moved
    t_bound = error / n_dot_d + 4.0 * UNIT_ROUNDOFF * abs(t)
    # --- a sliver, or one as the ray sees it: its weights by exact products, and t from them, so that
    # the point they name stays on the ray
    su, sv, sw = u, v, w
    if is_sliver:
        u, v, w = cross(cx, cy, bx, by), cross(ax, ay, cx, cy), cross(bx, by, ax, ay)
        if u + v + w < 0.0:
            u, v, w = -u, -v, -w
        if min(u, v, w) < 0.0 or error > n_dot_d * away:
            # Seen so flatly that rounding places the hit on one edge or the other.
            _note_beside(i, k, corner, order, around, object_id, o, d, t_min, known, best)
        if u < 0.0:
            v, w = _on_edge(bx, by, cx, cy)
            u = 0.0
        elif v < 0.0:
            w, u = _on_edge(cx, cy, ax, ay)
            v = 0.0
        elif w < 0.0:
            u, v = _on_edge(ax, ay, bx, by)
            w = 0.0
        if u + v + w == 0.0:
            u, v, w = su, sv, sw
        total = u + v + w
        px, py, pz = (
            (u * wx + v * (p[3] - o[0]) + w * (p[6] - o[0])) / total,
            (u * wy + v * (p[4] - o[1]) + w * (p[7] - o[1])) / total,
            (u * wz + v * (p[5] - o[2]) + w * (p[8] - o[2])) / total,
        )
        t = (px * d[0] + py * d[1] + pz * d[2]) / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        # These weights are exact for vertices that lie a few roundings beside the true ones, so the
        # point lies on the face, and so near the ray. How thin the face is counts only by n.d.
        turn = UNIT_ROUNDOFF * 16.0 * side * side / length
        if n_dot_d > 2.0 * turn:
            rounding = (UNIT_ROUNDOFF * SLIVER_ROUNDINGS * away + moved) / (n_dot_d - turn)
            t_bound = min(t_bound, rounding + 4.0 * UNIT_ROUNDOFF * abs(t))
    t = not_zero(t, moved)
    # --- near an edge the hit may be lost when the ray moves
    f = order[k]
    tangent = CLEAR
    for edge in range(3):
        if edge == 0:
            e, ex, ey = su, cx - bx, cy - by
        elif edge == 1:
            e, ex, ey = sv, ax - cx, ay - cy
        else:
            e, ex, ey = sw, bx - ax, by - ay
        if e * e <= reach * reach * (ex * ex + ey * ey):
            tangent = SUSPECT
    if begins_at(i, t, t_bound, n_dot_d, known):
        note_departure(i, nx / length, ny / length, nz / length, t_min, known, best)
    offer(
        i, t, t_bound, n_dot_d, tangent, object_id[f], f, v / total, w / total, t_min, known, best
    )


@inlined
def _reach(table, o):
    """Return more than the band of any mesh: sheared distances are up to sqrt(3) times as long."""
    m = table.middle
    away = abs(o[0] - m[0]) + abs(o[1] - m[1]) + abs(o[2] - m[2])
    return 2.0 * (TANGENT_BAND * (away + 2.0 / table.to_frame) + m[3])


@inlined
def _axes(d):
    """Return the coordinates in the order in which the last is the largest of a direction."""
    kz = 0
    if abs(d[1]) > abs(d[kz]):
        kz = 1
    if abs(d[2]) > abs(d[kz]):
        kz = 2
    return (kz + 1) % 3, (kz + 2) % 3, kz


@kernel
def trace_triangles(table, members, longest, rays, aside, best, any_hit, stack, counters):
    """Lower ``best`` to the first hits on the triangles of one tree; ``stack`` is scratch.

    ``members`` counts rows of `corner`; ``longest`` is the longest side of these faces. ``aside``, (n, 3)
    or (0, 3), moves each ray, in lengths of the world.
    """
    tree, begin, middle, to_frame = members
    for i in range(rays.origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        o, d = rays.origin[i], rays.direction[i]
        kx, ky, kz = _axes(d)
        sx, sy = d[kx] / d[kz], d[ky] / d[kz]
        qx = qy = 0.0
        if aside.shape[0] > 0:
            qx, qy = aside[i, kx] - sx * aside[i, kz], aside[i, ky] - sy * aside[i, kz]
        shear, reach = Shear(kx, ky, kz, sx, sy, qx, qy), _reach(table, o)
        x, y, z, _, _, _, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], to_frame
        )  # fmt: skip
        ray = box_ray(x, y, z, d[0], d[1], d[2])
        t_lo = begin_of(rays.t_min[i], to_frame, shift)
        t_cut = end_of(best.t[i], to_frame, shift)
        is_far = abs(shift) > FARTHEST
        top, first, count = -1, np.int64(0), np.int64(tree.order.shape[0])
        while True:
            if not is_far:
                top, first, count, nodes = next_leaf(tree, ray, t_lo, t_cut, stack, top)
                counters[NODES] += nodes
            for k in range(begin + first, begin + first + count):
                counters[CELLS] += 1
                offer_triangle(i, k, table, o, d, shear, reach, reach * longest, rays, best)
            if is_far or count == 0 or (any_hit and best.object_id[i] >= 0):
                break
            t_cut = end_of(best.t[i], to_frame, shift)


@kernel
def rows_of_faces(hits, triangles, first_face, place, row):
    """Turn coarse hits into rows of `corner` (-1: no hit, or not on a mesh)."""
    for i in range(hits.face.shape[0]):
        f = hits.face[i]
        row[i] = -1
        if f >= 0 and first_face[triangles.object_id[f]] >= 0:
            row[i] = place[first_face[triangles.object_id[f]] + triangles.piece[f]]


@kernel
def refine_triangles(table, place, rows, rays, best, accepted):
    """Offer the coarse stage's own faces, met in float64."""
    for j in range(place.shape[0]):
        if place[j] < 0:
            continue
        i = rows[j]
        o, d = rays.origin[i], rays.direction[i]
        kx, ky, kz = _axes(d)
        shear = Shear(kx, ky, kz, d[kx] / d[kz], d[ky] / d[kz], 0.0, 0.0)
        before = best.t[i]
        offer_triangle(i, np.int64(place[j]), table, o, d, shear, 0.0, -1.0, rays, best)
        accepted[j] = best.t[i] < before


@kernel
def finish_triangles(table, rays, best, kind_of, kind, out):
    """Describe the hits on triangles."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or kind_of[best.object_id[i]] != kind:
            continue
        f = best.primitive[i]
        v, w = best.a[i], best.b[i]
        a = table.vertex[table.face[f, 0]]
        b = table.vertex[table.face[f, 1]]
        c = table.vertex[table.face[f, 2]]
        nx, ny, nz = _normal(table.vertex, table.face, f)
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = (
            nx / length, ny / length, nz / length,
        )  # fmt: skip
        gap = 0.0
        for k in range(3):
            p = a[k] + (v * (b[k] - a[k]) + w * (c[k] - a[k]))
            out.position[i, k] = p
            gap += (p - (rays.origin[i, k] + best.t[i] * rays.direction[i, k])) ** 2
        out.u[i], out.v[i] = v, w
        out.patch_id[i] = table.patch_id[f]
        out.residual[i] = np.sqrt(gap)


@kernel
def aim_at_triangles(table, rays, best, rows, bands, outward, is_edge):
    """Say where to move rays whose hits are `SUSPECT`; see `kernels.patch.finish.aim_at_patches`."""
    for j in range(rows.shape[0]):
        i = rows[j]
        f = np.int64(best.primitive[i])
        o, d = rays.origin[i], rays.direction[i]
        band = band_at(table.around, table.object_id[f], o)
        bands[j] = band
        n_near = 0
        nx, ny, nz = _normal(table.vertex, table.face, f)
        sign = 1.0 if nx * d[0] + ny * d[1] + nz * d[2] < 0.0 else -1.0
        wx = wy = wz = 0.0
        for edge in range(3):
            a = table.vertex[table.face[f, edge]]
            b = table.vertex[table.face[f, (edge + 1) % 3]]
            x, y, z = a[0] - o[0], a[1] - o[1], a[2] - o[2]
            ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            # Normal to edge and ray; seen from the side where corners turn left it points out.
            mx, my, mz = ey * d[2] - ez * d[1], ez * d[0] - ex * d[2], ex * d[1] - ey * d[0]
            square = mx * mx + my * my + mz * mz
            gap = x * mx + y * my + z * mz
            if gap * gap <= 4.0 * band * band * square:
                n_near += 1
                length = sign * np.sqrt(square)
                if length != 0.0:
                    wx, wy, wz = -mx / length, -my / length, -mz / length
        is_edge[j] = n_near == 1
        if wx == 0.0 and wy == 0.0 and wz == 0.0:
            wx, wy, wz = any_normal(d[0], d[1], d[2])
        outward[j, 0], outward[j, 1], outward[j, 2] = wx, wy, wz
