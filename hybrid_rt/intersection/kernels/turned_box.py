"""Rays against boxes that do not lie along the axes: parallelepipeds.

Such a box is what lies between three pairs of planes, so its faces leave no gap at their edges.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import two_difference
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import offer_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, WITHIN_BAND, doubt_start, offer
from hybrid_rt.intersection.kernels.search.tolerances import (
    NEARLY_WITHIN,
    TANGENT_BAND,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import hot_kernel, inlined, inner


class TurnedBoxTable(NamedTuple):
    """Boxes ``corner + a edge_0 + b edge_1 + c edge_2``, a, b, c in [0, 1]."""

    corner: Any  # (k, 3)
    edge: Any  # (k, 3, 3)
    normal: Any  # (k, 3, 3) unit: across the other two edges, toward the end of each edge
    depth: Any  # (k, 3): normal . edge, the distance of each pair of faces
    size: Any  # (k,): sum of the edges' lengths
    skew: Any  # (k,): what the rounding of the normals grows by, 1 for right angles
    orientation: Any  # (k,): 1 normals outward, -1 inward
    handed: Any  # (k,): 1 edges right-handed, -1 left-handed
    object_id: Any  # (k,) int32


def turned_box_table(boxes, object_id):
    """Return the table of a list of turned boxes."""
    edge, normal = np.array([b.edges for b in boxes]), np.array([b.across for b in boxes])
    length = np.linalg.norm(edge, axis=2)
    areas = np.array([b.areas[::2] for b in boxes])
    squares = np.stack([length[:, k - 2] * length[:, k - 1] for k in range(3)], axis=1)
    return TurnedBoxTable(
        corner=np.array([b.lo for b in boxes]),
        edge=edge,
        normal=normal,
        depth=np.einsum("ijk,ijk->ij", normal, edge),
        size=length.sum(axis=1),
        skew=(squares / areas).max(axis=1),
        orientation=np.array([float(b.orientation) for b in boxes]),
        handed=np.array([float(b.handedness) for b in boxes]),
        object_id=object_id,
    )


@inlined
def _dot(rows, k, c, x, y, z):
    return rows[k, c, 0] * x + rows[k, c, 1] * y + rows[k, c, 2] * z


@inner
def _margin(table, k, o, d):
    """Return how far within the outline of a box a ray passes, and what rounding leaves open.

    As for boxes along the axes; the planes of two faces meet at an angle.
    """
    wx, ex = two_difference(o[0], table.corner[k, 0])
    wy, ey = two_difference(o[1], table.corner[k, 1])
    wz, ez = two_difference(o[2], table.corner[k, 2])
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    error = UNIT_ROUNDOFF * (12.0 * away + 8.0 * table.size[k]) * table.skew[k]
    normal, depth, least = table.normal, table.depth, np.inf
    for c in range(3):
        p = _dot(normal, k, c, d[0], d[1], d[2])
        a = _dot(normal, k, c, wx, wy, wz) + _dot(normal, k, c, ex, ey, ez)
        a = -a if p >= 0.0 else a - depth[k, c]
        for e in range(3):
            q = _dot(normal, k, e, d[0], d[1], d[2])
            cosine = _dot(normal, k, c, normal[k, e, 0], normal[k, e, 1], normal[k, e, 2])
            across = p * p + q * q - 2.0 * p * q * cosine
            if e == c or not across > 0.0:
                continue
            b = _dot(normal, k, e, wx, wy, wz) + _dot(normal, k, e, ex, ey, ez)
            b = depth[k, e] - b if q >= 0.0 else b
            least = min(least, (b * abs(p) - a * abs(q)) / np.sqrt(across))
    return least, max(TANGENT_BAND * max(away, table.size[k]), 2.0 * error)


@inlined
def _offer_turned_box(i, k, table, rays, best):
    """Offer where ray i enters box k and where it leaves it."""
    corner, normal, depth, size = table.corner, table.normal, table.depth, table.size
    skew, object_id, t_min, known = table.skew, table.object_id, rays.t_min, rays.known
    o, d = rays.origin[i], rays.direction[i]
    ox, oy, oz, dx, dy, dz = o[0], o[1], o[2], d[0], d[1], d[2]
    wx, ex = two_difference(ox, corner[k, 0])
    wy, ey = two_difference(oy, corner[k, 1])
    wz, ez = two_difference(oz, corner[k, 2])
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    # Of the distance of a point from a face: as for parallelograms, and the face's own distance.
    error = UNIT_ROUNDOFF * (12.0 * away + 8.0 * size[k]) * skew[k]
    band = TANGENT_BAND * max(away, size[k])
    # A ray that leaves the plane of a face outward has left the box there, one that leaves it inward
    # has entered. Rounding may have put its start to the other side of that plane: beside an edge
    # the ray would meet the next face first, or pass by.
    start, reach = 0.0, -1.0
    if known.shape[0] and known[i, 1] >= 0.0:
        start, reach = known[i, 0], known[i, 1] + error
    has_left, departed, is_beside = False, 0, False
    # Where the ray lies almost within a face, that face's t has few digits: beside an edge it must
    # not win over the next face by its rounding. So the face is taken that is entered last by the
    # lower ends of all intervals of rounding; the largest upper end bounds what that may miss.
    enter, leave, goes_on = -np.inf, np.inf, np.inf
    surely_in, surely_out = -np.inf, np.inf
    latest_in, earliest_out = -np.inf, np.inf
    face_in = face_out = -1
    p = q = 0.0
    least = np.inf
    for c in range(3):
        below = _dot(normal, k, c, wx, wy, wz) + _dot(normal, k, c, ex, ey, ez)
        slope = _dot(normal, k, c, dx, dy, dz)
        if slope == 0.0:
            if below < -band or below > depth[k, c] + band:
                return
            is_beside |= below < 0.0 or below > depth[k, c]
            continue
        least = min(least, abs(slope))
        height = below + start * slope
        if abs(height) <= reach:
            has_left |= slope < 0.0
            departed |= 1 << (2 * c)
        if abs(height - depth[k, c]) <= reach:
            has_left |= slope > 0.0
            departed |= 2 << (2 * c)
        a, b = -below / slope, (depth[k, c] - below) / slope
        first, second = 2 * c, 2 * c + 1
        if slope < 0.0:
            a, b = b, a
            first, second = second, first
        rounding_a = error / abs(slope) + 4.0 * UNIT_ROUNDOFF * abs(a)
        rounding_b = error / abs(slope) + 4.0 * UNIT_ROUNDOFF * abs(b)
        latest_in, earliest_out = max(latest_in, a + rounding_a), min(earliest_out, b - rounding_b)
        if a - rounding_a > surely_in:
            surely_in, enter, face_in, p = a - rounding_a, a, first, slope
        if b + rounding_b < surely_out:
            goes_on = leave
            surely_out, leave, face_out, q = b + rounding_b, b, second, slope
        else:
            goes_on = min(goes_on, b)
    if face_in < 0 or face_out < 0:
        return
    bound_in = max(enter - surely_in, latest_in - enter)
    bound_out = max(surely_out - leave, leave - earliest_out)
    # How far the ray runs inside, seen across it at the edge between the two faces: in the plane
    # across that edge the ray and the two faces make a triangle, and this is its height.
    starts_there = (departed >> face_in) & 1 != 0
    if starts_there:
        enter = start
    inside = leave - enter
    m, n = face_in // 2, face_out // 2
    if m == n:
        height = inside * abs(p)
    else:
        cosine = _dot(normal, k, m, normal[k, n, 0], normal[k, n, 1], normal[k, n, 2])
        across = np.sqrt(max(p * p + q * q - 2.0 * p * q * cosine, 0.0))
        height = inside * (abs(p) * abs(q) / across) if across > 0.0 else inside
    if height < band and departed == 0:
        # By so little that other pairs of faces count: of slabs that the ray runs along t says little.
        height, _ = _margin(table, k, o, d)
    if height < -error or is_beside or (starts_there and leave <= start):
        if height > -band and leave > t_min[i]:
            best.doubt[i] = min(best.doubt[i], leave)
        return
    p, q = abs(p), abs(q)
    crossed = 0.0
    if enter > leave:
        # By rounding, at an edge: a point of the ray next to it.
        crossed = enter - leave
        enter = leave = (enter * p * p + leave * q * q) / (p * p + q * q)
    if least < NEARLY_WITHIN:
        for c in range(3):
            below = _dot(normal, k, c, wx, wy, wz) + _dot(normal, k, c, ex, ey, ez)
            slope = _dot(normal, k, c, dx, dy, dz)
            if slope != 0.0:
                for bound in (0.0, depth[k, c]):
                    t = (bound - below) / slope
                    doubt_start(i, t, abs(slope), enter, leave, band, t_min, known, best)
    # What is passed by because the ray has left there is met by the ray as rounding has put it: at
    # another face than that of its departure this is a matter of rounding.
    if not ((has_left or starts_there) and enter >= start):
        bound = bound_in + crossed
        offer(i, enter, bound, p, CLEAR, object_id[k], face_in, 0.0, 0.0, t_min, known, best)
    elif (departed >> face_in) & 1 == 0 and enter > t_min[i]:
        best.doubt[i] = min(best.doubt[i], enter)
    if not (has_left and leave >= start):
        bound = bound_out + crossed
        offer(i, leave, bound, q, CLEAR, object_id[k], face_out, 0.0, 0.0, t_min, known, best)
    elif (departed >> face_out) & 1 == 0 and leave > t_min[i]:
        best.doubt[i] = min(best.doubt[i], leave)
    elif (goes_on - leave) * q < band:
        # It leaves the face so slowly that it passes the next one within the band.
        best.doubt[i] = min(best.doubt[i], goes_on)


@hot_kernel
def trace_turned_boxes(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the boxes up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, _offer_turned_box, end, table, rays, best, any_hit)


@hot_kernel
def trace_turned_box_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_turned_boxes`, for the boxes in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(
            i, _offer_turned_box, table, members, rays, best, any_hit, stack
        )


@hot_kernel
def finish_turned_boxes(table, rays, best, row_of, out):
    """Describe the hits on boxes."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k = row_of[best.object_id[i]]
        o, d, t = rays.origin[i], rays.direction[i], best.t[i]
        margin, open_width = _margin(table, k, o, d)
        if margin < open_width:
            best.tangent[i] = WITHIN_BAND
        face = best.primitive[i]
        axis, is_upper = face // 2, face % 2 == 1
        wx, ex = two_difference(o[0], table.corner[k, 0])
        wy, ey = two_difference(o[1], table.corner[k, 1])
        wz, ez = two_difference(o[2], table.corner[k, 2])
        x, y, z = wx + t * d[0] + ex, wy + t * d[1] + ey, wz + t * d[2] + ez
        first, second = (axis + 1) % 3, (axis + 2) % 3
        u = min(max(_dot(table.normal, k, first, x, y, z) / table.depth[k, first], 0.0), 1.0)
        v = min(max(_dot(table.normal, k, second, x, y, z) / table.depth[k, second], 0.0), 1.0)
        # Normals of flat boxes are rounded by more than u and v: what is left is taken out once more.
        for c in range(3):
            rest = u * table.edge[k, first, c] + v * table.edge[k, second, c]
            if is_upper:
                rest += table.edge[k, axis, c]
            if c == 0:
                x -= rest
            elif c == 1:
                y -= rest
            else:
                z -= rest
        u += _dot(table.normal, k, first, x, y, z) / table.depth[k, first]
        v += _dot(table.normal, k, second, x, y, z) / table.depth[k, second]
        u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        gap = 0.0
        side = table.orientation[k] if is_upper else -table.orientation[k]
        for c in range(3):
            p = u * table.edge[k, first, c] + v * table.edge[k, second, c]
            if is_upper:
                p += table.edge[k, axis, c]
            p += table.corner[k, c]
            gap += (p - (o[c] + t * d[c])) ** 2
            out.position[i, c] = p
            out.normal[i, c] = side * table.normal[k, axis, c]
        out.u[i], out.v[i] = u, v
        if side * table.handed[k] < 0.0:
            out.u[i], out.v[i] = v, u
        out.patch_id[i] = face
        out.residual[i] = np.sqrt(gap)
        # Flat boxes leave so much open that their points may lie beside the ray.
        if out.residual[i] > 0.25 * open_width:
            best.tangent[i] = WITHIN_BAND
