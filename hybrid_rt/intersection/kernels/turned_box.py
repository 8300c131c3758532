"""Rays against boxes that do not lie along the axes: parallelepipeds.

Such a box is what lies between three pairs of planes, so its faces leave no gap at their edges.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import advance, product, two_difference
from hybrid_rt.intersection.kernels.parallelogram import onto_parallelogram, weights_of_point
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    WITHIN_BAND,
    doubt_start,
    not_zero,
    note_departure,
    offer,
)
from hybrid_rt.intersection.kernels.search.tolerances import (
    NEARLY_WITHIN,
    TANGENT_BAND,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner, kernel


class TurnedBoxTable(NamedTuple):
    """Boxes ``corner + a edge_0 + b edge_1 + c edge_2``, a, b, c in [0, 1]."""

    corner: Any  # (k, 4): and `meshing.surface.Surface.moved`
    edge: Any  # (k, 3, 3)
    normal: Any  # (k, 3, 3) unit: across the other two edges, toward the end of each edge
    depth: Any  # (k, 3): normal . edge, the distance of each pair of faces
    size: Any  # (k,): sum of the edges' lengths; more, if rounding has moved an image
    area: Any  # (k, 3): of the faces across the normals
    orientation: Any  # (k,): 1 normals outward, -1 inward
    handed: Any  # (k,): 1 edges right-handed, -1 left-handed
    object_id: Any  # (k,) int32


def turned_box_table(boxes, object_id):
    """Return the table of a list of turned boxes."""
    edge = np.array([b.edges for b in boxes])
    # All errors below are those of distances from faces, which have twelve roundings of the size.
    moved = np.array([b.moved for b in boxes]) / (12.0 * UNIT_ROUNDOFF)
    return TurnedBoxTable(
        corner=np.array([(*b.lo, b.moved) for b in boxes]),
        edge=edge,
        normal=np.array([b.across for b in boxes]),
        depth=np.array([b.depths for b in boxes]),
        size=np.linalg.norm(edge, axis=2).sum(axis=1) + moved,
        area=np.array([b.areas[::2] for b in boxes]),
        orientation=np.array([float(b.orientation) for b in boxes]),
        handed=np.array([float(b.handedness) for b in boxes]),
        object_id=object_id,
    )


@inlined
def _dot(rows, k, c, x, y, z):
    return rows[k, c, 0] * x + rows[k, c, 1] * y + rows[k, c, 2] * z


@inlined
def _minor(a, b, c, d):
    """Return a b - c d, both products exact."""
    p, e = product(a, b)
    q, f = product(c, d)
    return (p - q) + (e - f)


@inlined
def _volume(a, b, d):
    """Return a x b . d as if by twice the digits: its sign may hang on less than one rounding."""
    high = low = 0.0
    for k in range(3):
        p, e = product(a[(k + 1) % 3], b[(k + 2) % 3])
        q, f = product(a[(k + 2) % 3], b[(k + 1) % 3])
        high, low = advance(high, low, p, d[k])
        high, low = advance(high, low - (f - e) * d[k], -q, d[k])
    return high + low


@inner
def _margin(table, k, o, d):
    """Return how far within the outline of a box a ray passes; negative: beside it.

    As for boxes along the axes: an edge of the outline lies between a face that is entered and one
    that is left. It is measured from the line of the edge itself: faces that meet at a small angle a
    would tell where it is to eps / a only.
    """
    wx, ex = two_difference(o[0], table.corner[k, 0])
    wy, ey = two_difference(o[1], table.corner[k, 1])
    wz, ez = two_difference(o[2], table.corner[k, 2])
    edge, least = table.edge, np.inf
    # Of a ray that runs along two faces the slopes' signs decide which edges bound the outline.
    up = (
        table.handed[k] * _volume(edge[k, 1], edge[k, 2], d) >= 0.0,
        table.handed[k] * _volume(edge[k, 2], edge[k, 0], d) >= 0.0,
        table.handed[k] * _volume(edge[k, 0], edge[k, 1], d) >= 0.0,
    )
    for m in range(3):
        i, j = (m + 1) % 3, (m + 2) % 3
        # Across the ray and the edges along axis m.
        x = _minor(edge[k, m, 1], d[2], edge[k, m, 2], d[1])
        y = _minor(edge[k, m, 2], d[0], edge[k, m, 0], d[2])
        z = _minor(edge[k, m, 0], d[1], edge[k, m, 1], d[0])
        length = np.sqrt(x * x + y * y + z * z)
        if not length > 0.0:
            continue
        is_up_i, is_up_j = up[i], up[j]
        side = -table.handed[k] if is_up_i == is_up_j else table.handed[k]
        for entered in range(2):
            # Axis i is entered and j is left, then the other way round.
            upper_i, upper_j = (not is_up_i, is_up_j) if entered == 0 else (is_up_i, not is_up_j)
            ax, ay, az = wx, wy, wz
            if upper_i:
                ax, ay, az = ax - edge[k, i, 0], ay - edge[k, i, 1], az - edge[k, i, 2]
            if upper_j:
                ax, ay, az = ax - edge[k, j, 0], ay - edge[k, j, 1], az - edge[k, j, 2]
            gap = side * ((ax * x + ay * y + az * z) + (ex * x + ey * y + ez * z)) / length
            least = min(least, gap if entered == 0 else -gap)
    return least


@inlined
def _offer_turned_box(i, k, table, rays, best):
    """Offer where ray i enters box k and where it leaves it.

    With them go a lower bound of `_margin`, half the way inside times the least slope, and the band.
    """
    corner, normal, depth, size = table.corner, table.normal, table.depth, table.size
    object_id, t_min, known = table.object_id, rays.t_min, rays.known
    o, d = rays.origin[i], rays.direction[i]
    ox, oy, oz, dx, dy, dz = o[0], o[1], o[2], d[0], d[1], d[2]
    wx, ex = two_difference(ox, corner[k, 0])
    wy, ey = two_difference(oy, corner[k, 1])
    wz, ez = two_difference(oz, corner[k, 2])
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    # Of the distance of a point from a face: as for parallelograms, and the face's own distance.
    error = UNIT_ROUNDOFF * (12.0 * away + 12.0 * size[k])
    band = TANGENT_BAND * max(away, size[k])
    # A ray that leaves the plane of a face outward has left the box there, one that leaves it inward
    # has entered. Rounding may have put its start to the other side of that plane: beside an edge
    # the ray would meet the next face first, or pass by.
    start, reach = 0.0, -1.0
    if known.shape[0] and known[i, 1] >= 0.0:
        start, reach = known[i, 0], known[i, 1] + error
    has_left, departed, is_beside = False, 0, False
    begins, is_within = 0, True
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
        if reach >= 0.0:
            height = below + start * slope
            is_within &= -reach <= height <= depth[k, c] + reach
            at_lower, at_upper = abs(height) <= reach, abs(height - depth[k, c]) <= reach
            begins |= (at_lower + 2 * at_upper) << (2 * c)
            if slope != 0.0:
                has_left |= (at_lower and slope < 0.0) or (at_upper and slope > 0.0)
                departed |= (at_lower + 2 * at_upper) << (2 * c)
        if slope == 0.0:
            if below < -band or below > depth[k, c] + band:
                return
            is_beside |= below < 0.0 or below > depth[k, c]
            least = 0.0
            continue
        least = min(least, abs(slope))
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
    if begins != 0 and is_within:
        for face in range(6):
            if (begins >> face) & 1:
                side = normal[k, face // 2]
                note_departure(i, side[0], side[1], side[2], t_min, known, best)
    # How far the ray runs inside, seen across it at the edge between the two faces: in the plane
    # across that edge the ray and the two faces make a triangle, and this is its height.
    starts_there = (departed >> face_in) & 1 != 0
    if starts_there:
        enter = start
    inside = leave - enter
    m, n = face_in // 2, face_out // 2
    by_inside = abs(p)
    if m != n:
        across_x, across_y, across_z = (
            p * normal[k, n, 0] - q * normal[k, m, 0],
            p * normal[k, n, 1] - q * normal[k, m, 1],
            p * normal[k, n, 2] - q * normal[k, m, 2],
        )
        across = np.sqrt(across_x * across_x + across_y * across_y + across_z * across_z)
        by_inside = abs(p) * abs(q) / across if across > 0.0 else 1.0
    height = inside * by_inside
    if departed == 0 and (inside - bound_in - bound_out) * by_inside < band:
        # By so little that other pairs of faces count: of slabs that the ray runs along t says little,
        # and of faces that meet at a small angle.
        height = _margin(table, k, o, d)
    if height < -error or is_beside or (starts_there and leave <= start):
        if height > -band and leave > t_min[i]:
            best.doubt[i] = min(best.doubt[i], leave)
        return
    p, q = abs(p), abs(q)
    within = 0.5 * (inside - bound_in - bound_out) * least
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
        enter, bound = not_zero(enter, corner[k, 3]), bound_in + crossed
        offer(i, enter, bound, p, CLEAR, object_id[k], face_in, within, band, t_min, known, best)
    elif (departed >> face_in) & 1 == 0 and enter > t_min[i]:
        best.doubt[i] = min(best.doubt[i], enter)
    if not (has_left and leave >= start):
        leave, bound = not_zero(leave, corner[k, 3]), bound_out + crossed
        offer(i, leave, bound, q, CLEAR, object_id[k], face_out, within, band, t_min, known, best)
    elif (departed >> face_out) & 1 == 0 and leave > t_min[i]:
        best.doubt[i] = min(best.doubt[i], leave)
    elif (goes_on - leave) * q < band:
        # It leaves the face so slowly that it passes the next one within the band.
        best.doubt[i] = min(best.doubt[i], goes_on)


@kernel
def trace_turned_boxes(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the boxes up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, _offer_turned_box, end, table, rays, best, any_hit)


@kernel
def trace_turned_box_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_turned_boxes`, for the boxes in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(
            i, _offer_turned_box, table, members, rays, best, any_hit, stack
        )


@inlined
def _is_same_way(table, k, face, other, d):
    """Tell whether a ray enters both faces, or leaves both."""
    p = _dot(table.normal, k, face // 2, d[0], d[1], d[2])
    q = _dot(table.normal, k, other // 2, d[0], d[1], d[2])
    return (p * q > 0.0) == (face % 2 == other % 2)


@inner
def _describe_face(table, k, face, x, y, z, i, out):
    """Fill row i for the point of a face next to (x, y, z), as seen from the box's corner.

    Returns ``other``: the face on the far side of the rim that (x, y, z) is beyond; -1: it is
    within.
    ``gap``: distance of both points.
    """
    axis, is_upper = face // 2, face % 2 == 1
    first, second = (axis + 1) % 3, (axis + 2) % 3
    e, f, g, n = (
        table.edge[k, first],
        table.edge[k, second],
        table.edge[k, axis],
        table.normal[k, axis],
    )
    if is_upper:
        x, y, z = x - g[0], y - g[1], z - g[2]
    # The dual basis of e and f is f x n and n x e over the area, for right-handed edges.
    by = table.handed[k] / table.area[k, axis]
    u, v = weights_of_point(
        x, y, z, e, f,
        by * (f[1] * n[2] - f[2] * n[1]), by * (f[2] * n[0] - f[0] * n[2]),
        by * (f[0] * n[1] - f[1] * n[0]), by * (n[1] * e[2] - n[2] * e[1]),
        by * (n[2] * e[0] - n[0] * e[2]), by * (n[0] * e[1] - n[1] * e[0]),
    )  # fmt: skip
    other = -1
    if not 0.0 <= u <= 1.0:
        other = 2 * first + (u > 1.0)
    elif not 0.0 <= v <= 1.0:
        other = 2 * second + (v > 1.0)
    u, v = onto_parallelogram(u, v, x, y, z, e, f)
    side = table.orientation[k] if is_upper else -table.orientation[k]
    gap = 0.0
    for c in range(3):
        p = u * e[c] + v * f[c]
        gap += (p - (x if c == 0 else (y if c == 1 else z))) ** 2
        if is_upper:
            p += g[c]
        out.position[i, c] = p + table.corner[k, c]
        out.normal[i, c] = side * n[c]
    out.u[i], out.v[i] = u, v
    if side * table.handed[k] < 0.0:
        out.u[i], out.v[i] = v, u
    return other, np.sqrt(gap)


@inlined
def _finish_turned_box(table, k, rays, best, i, out):
    """Describe the hit of ray i on box k."""
    o, d, t = rays.origin[i], rays.direction[i], best.t[i]
    wx, ex = two_difference(o[0], table.corner[k, 0])
    wy, ey = two_difference(o[1], table.corner[k, 1])
    wz, ez = two_difference(o[2], table.corner[k, 2])
    band = best.b[i]
    if not best.a[i] > band and _margin(table, k, o, d) < band:
        best.tangent[i] = WITHIN_BAND
    x, y, z = wx + t * d[0] + ex, wy + t * d[1] + ey, wz + t * d[2] + ez
    face = best.primitive[i]
    other, gap = _describe_face(table, k, face, x, y, z, i, out)
    for _ in range(2):
        # Beside the edge of two nearly coplanar faces rounding hides which is met: the point is
        # on the one and beyond the rim of the other.
        if not gap > 0.125 * band or other < 0 or not _is_same_way(table, k, face, other, d):
            break
        beyond, closer = _describe_face(table, k, other, x, y, z, i, out)
        if not closer < gap:
            other, gap = _describe_face(table, k, face, x, y, z, i, out)
            break
        face, other, gap = other, beyond, closer
    if gap > 0.125 * band and other >= 0:
        # The ray passes an edge by what rounding allows: its point next to the edge.
        edge = table.edge[k, 3 - face // 2 - other // 2]
        along = d[0] * edge[0] + d[1] * edge[1] + d[2] * edge[2]
        along /= edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]
        ax, ay, az = d[0] - along * edge[0], d[1] - along * edge[1], d[2] - along * edge[2]
        px, py, pz = (
            out.position[i, 0] - table.corner[k, 0],
            out.position[i, 1] - table.corner[k, 1],
            out.position[i, 2] - table.corner[k, 2],
        )
        step = (px - x) * ax + (py - y) * ay + (pz - z) * az
        step /= max(ax * ax + ay * ay + az * az, 1e-300)
        t += step
        best.t[i], best.t_bound[i] = t, best.t_bound[i] + abs(step)
        x, y, z = x + step * d[0], y + step * d[1], z + step * d[2]
        _describe_face(table, k, face, x, y, z, i, out)
    out.patch_id[i] = face
    gap = 0.0
    for c in range(3):
        gap += (out.position[i, c] - (o[c] + t * d[c])) ** 2
    out.residual[i] = np.sqrt(gap)


@kernel
def finish_turned_boxes(table, rays, best, row_of, out):
    """Describe the hits on boxes."""
    finish_each(_finish_turned_box, table, rays, best, row_of, out)
