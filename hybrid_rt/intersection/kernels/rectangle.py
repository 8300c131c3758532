"""Rays against rectangles."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import two_difference
from hybrid_rt.intersection.kernels.parallelogram import onto_parallelogram, weights_of_point
from hybrid_rt.intersection.kernels.reach import (
    ALL,
    BLOCK,
    FEW,
    FIRST_BIT,
    NEXT,
    parallelogram_columns,
    parallelograms_in_reach,
)
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    WITHIN_BAND,
    begins_at,
    doubt,
    doubt_start,
    is_left_behind,
    not_zero,
    note_departure,
    offer,
)
from hybrid_rt.intersection.kernels.search.rays import EDGE
from hybrid_rt.intersection.kernels.search.tolerances import (
    NEARLY_WITHIN,
    TANGENT_BAND,
    UNIT_ROUNDOFF,
)
from hybrid_rt.intersection.kernels.search.trims import (
    NEARBY,
    decide,
    has_gap,
    side_of_tile,
    sure_side,
)
from meshing.kernels.jit import inlined, inner, kernel
from meshing.kernels.trims import CROSSED, INSIDE, OUTSIDE

# Rounding of the height of a point of a parallelogram, over its size: 12 + 4 units, see below.
START = 16.0 * UNIT_ROUNDOFF
# A quotient is more than a number if its dividend is by this more than number x divisor.
BEYOND = 1.0 + 2.0**-50


class RectangleTable(NamedTuple):
    """Rectangles, and other parallelograms."""

    corner: Any  # (k, 4): and `meshing.surface.Surface.moved`
    normal: Any  # (k, 3) unit
    edge_u: Any  # (k, 3)
    edge_v: Any  # (k, 3)
    row_u: Any  # (k, 3) dual basis: row_u . (x - corner) is u
    row_v: Any  # (k, 3)
    size: Any  # (k,) |edge_u| + |edge_v|; more, if rounding has moved an image
    object_id: Any  # (k,) int32
    trim: Any  # None: they are whole; else `search.trims.Trim`
    reach: Any  # (15, more) float64, see `parallelograms_in_reach`


def rectangle_table(rectangles, object_id, trim=None):
    """Return the table of a list of rectangles, and of the loops that trim all of them."""
    edge_u = np.array([r.edge_u for r in rectangles]).reshape(-1, 3)
    edge_v = np.array([r.edge_v for r in rectangles]).reshape(-1, 3)
    normal = np.array([r.unit_normal for r in rectangles]).reshape(-1, 3)
    area = np.array([r.area for r in rectangles])[:, None]
    corner = np.array([(*r.corner, r.moved) for r in rectangles]).reshape(-1, 4)
    row_u, row_v = np.cross(edge_v, normal) / area, np.cross(normal, edge_u) / area
    size = np.linalg.norm(edge_u, axis=1) + np.linalg.norm(edge_v, axis=1)
    # All errors below are those of its height, which have four roundings of the size.
    size += corner[:, 3] / (4.0 * UNIT_ROUNDOFF)
    return RectangleTable(
        corner=corner,
        normal=normal,
        edge_u=edge_u,
        edge_v=edge_v,
        row_u=row_u,
        row_v=row_v,
        size=size,
        object_id=object_id,
        trim=trim,
        reach=parallelogram_columns(corner[:, :3], normal, row_u, row_v, size),
    )


@inlined
def _width(edge, k, dx, dy, dz):
    """|edge x d|: how long an edge looks from along the ray, times |d|; never zero."""
    x = edge[k, 1] * dz - edge[k, 2] * dy
    y = edge[k, 2] * dx - edge[k, 0] * dz
    z = edge[k, 0] * dy - edge[k, 1] * dx
    return max(np.sqrt(x * x + y * y + z * z), 1e-300)


@inlined
def _area(row_u, row_v, k):
    """Return the parallelogram's area, from its dual basis."""
    x = row_u[k, 1] * row_v[k, 2] - row_u[k, 2] * row_v[k, 1]
    y = row_u[k, 2] * row_v[k, 0] - row_u[k, 0] * row_v[k, 2]
    z = row_u[k, 0] * row_v[k, 1] - row_u[k, 1] * row_v[k, 0]
    return 1.0 / np.sqrt(x * x + y * y + z * z)


@inlined
def _is_skew(edge_u, row_u, k):
    """Tell whether the edges enclose less than 15 degrees: |edge_u| |row_u| is 1 / sin."""
    e = edge_u[k, 0] * edge_u[k, 0] + edge_u[k, 1] * edge_u[k, 1] + edge_u[k, 2] * edge_u[k, 2]
    p = row_u[k, 0] * row_u[k, 0] + row_u[k, 1] * row_u[k, 1] + row_u[k, 2] * row_u[k, 2]
    return e * p > 16.0


@inner(outlined=True)
def _weights(i, k, t, table, rays):
    """Return (u, v) of the point at t of ray i, which is within the rim of parallelogram k."""
    o, d, c = rays.origin[i], rays.direction[i], table.corner[k]
    p, q, edge_u, edge_v = table.row_u[k], table.row_v[k], table.edge_u[k], table.edge_v[k]
    wx, ex = two_difference(o[0], c[0])
    wy, ey = two_difference(o[1], c[1])
    wz, ez = two_difference(o[2], c[2])
    x, y, z = wx + t * d[0] + ex, wy + t * d[1] + ey, wz + t * d[2] + ez
    u, v = weights_of_point(x, y, z, edge_u, edge_v, p[0], p[1], p[2], q[0], q[1], q[2])
    return onto_parallelogram(u, v, x, y, z, edge_u, edge_v)


@inlined
def _move_to_rim(u, v, t, du, dv, most):
    """Walk along the ray to where u is in [0, 1], if that is no farther than rounding leads."""
    inside = min(max(u, 0.0), 1.0)
    if u != inside and abs(inside - u) <= most * abs(du):
        step = (inside - u) / du
        return inside, v + step * dv, t + step
    return inside, v, t


@inlined
def _within(x, dx, low, high):
    """Return the part of low <= t <= high where 0 <= x + t dx <= 1; empty: low > high."""
    if dx == 0.0:
        return (low, high) if 0.0 <= x <= 1.0 else (1.0, 0.0)
    a, b = -x / dx, (1.0 - x) / dx
    return max(low, min(a, b)), min(high, max(a, b))


@inner
def _offer_nearly_within(i, k, table, n_dot_d, rays, best):
    """Offer the root of a ray that runs almost within the plane of parallelogram k.

    Such a root has few digits or none, and (u, v) computed from it would have less: so the stretch
    of the ray above the parallelogram comes first, and the root is where the ray passes the plane
    within that stretch.
    """
    o, d, n = rays.origin[i], rays.direction[i], table.normal[k]
    wx, ex = two_difference(o[0], table.corner[k, 0])
    wy, ey = two_difference(o[1], table.corner[k, 1])
    wz, ez = two_difference(o[2], table.corner[k, 2])
    x, y, z = wx + ex, wy + ey, wz + ez
    p, q = table.row_u[k], table.row_v[k]
    u, du = p[0] * x + p[1] * y + p[2] * z, p[0] * d[0] + p[1] * d[1] + p[2] * d[2]
    v, dv = q[0] * x + q[1] * y + q[2] * z, q[0] * d[0] + q[1] * d[1] + q[2] * d[2]
    low, high = _within(u, du, -np.inf, np.inf)
    low, high = _within(v, dv, low, high)
    if not low <= high or high <= rays.t_min[i]:
        return
    height = (n[0] * wx + n[1] * wy + n[2] * wz) + (n[0] * ex + n[1] * ey + n[2] * ez)
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    error = UNIT_ROUNDOFF * (12.0 * away + 4.0 * table.size[k])
    band = TANGENT_BAND * max(away, table.size[k])
    # The heights at both ends of the stretch: by how much does the ray come from above to below?
    first, last = height + low * n_dot_d, height + high * n_dot_d
    depth = min(abs(first), abs(last)) if first * last < 0.0 else -min(abs(first), abs(last))
    if depth < -error or n_dot_d == 0.0:
        if depth > -band:
            best.doubt[i] = min(best.doubt[i], max(low, rays.t_min[i]))
        return
    t = not_zero(min(max(-height / n_dot_d, low), high), table.corner[k, 3])
    slope = abs(n_dot_d)
    t_bound = min(error / slope, high - low) + 4.0 * UNIT_ROUNDOFF * abs(t)
    u, v = min(max(u + t * du, 0.0), 1.0), min(max(v + t * dv, 0.0), 1.0)
    if _is_skew(table.edge_u, table.row_u, k):
        u, v = _weights(i, k, t, table, rays)
    tangent = WITHIN_BAND if depth < band else CLEAR
    is_kept, is_within, edge = _side_of_loops(i, k, u, v, t, band, table.trim, table, rays, best)
    if is_kept or is_within:
        doubt_start(i, t, slope, low, high, band, rays.t_min, rays.known, best)
    if not is_kept:
        return
    tangent = WITHIN_BAND if is_within else tangent
    t_bound += edge
    if begins_at(i, t, t_bound, slope, rays.known):
        note_departure(i, n[0], n[1], n[2], rays.t_min, rays.known, best)
    offer(i, t, t_bound, slope, tangent, table.object_id[k], 0, u, v, rays.t_min, rays.known, best)


@inlined
def _side_of_loops(i, k, u, v, t, band, trim, table, rays, best):
    """Decide about a root on trimmed parallelogram k; note a doubt if the band decides it is none.

    Returns ``is_kept``, ``is_within``: it is a hit; moving the ray by the band may change that.
    ``edge``: what the gap of an edge adds to the bound of t.
    """
    if trim is None:  # an argument of its own: numba leaves the rest out where it is
        return True, False, 0.0
    d, p, q = rays.direction[i], table.edge_u[k], table.edge_v[k]
    is_hit, is_within, edge = decide(
        trim, k, u, v, p[0], p[1], p[2], q[0], q[1], q[2], d[0], d[1], d[2], band
    )
    if is_within and not is_hit:
        doubt(i, t, band, rays.t_min, rays.known, best)
    if edge > 0.0:
        edge /= np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    return is_hit, is_within, edge


@inlined
def _sure_side(trim, k, u, v, slope, band, rim_u, rim_v):
    """Return the side of a root that ``band`` moves by less than rim_u / slope in u; CROSSED: look."""
    if trim is None:
        return INSIDE
    # |d| is less than 2, and lengths are no more than sums of absolute values.
    most = NEARBY * slope / (1.0 + 2.0 * trim.gap[k] / band)
    if rim_u > most or rim_v > most:
        return CROSSED
    return side_of_tile(trim, k, u, v)


@inner
def _note_start(i, k, table, x, y, z, rays, best):
    """Note where ray i begins, (x, y, z) from the corner, if that is within parallelogram k."""
    p, q, n = table.row_u[k], table.row_v[k], table.normal[k]
    u, v = p[0] * x + p[1] * y + p[2] * z, q[0] * x + q[1] * y + q[2] * z
    reach = rays.known[i, 1] + TANGENT_BAND * table.size[k]
    u_reach = reach * (abs(p[0]) + abs(p[1]) + abs(p[2]))
    v_reach = reach * (abs(q[0]) + abs(q[1]) + abs(q[2]))
    if -u_reach <= u <= 1.0 + u_reach and -v_reach <= v <= 1.0 + v_reach:
        note_departure(i, n[0], n[1], n[2], rays.t_min, rays.known, best)


@inlined
def offer_parallelogram(i, k, table, rays, best):
    """Offer the root of ray i in the plane of parallelogram k, if it is within its rim."""
    corner, normal, row_u, row_v = table.corner, table.normal, table.row_u, table.row_v
    size, object_id, edge_u, edge_v = table.size, table.object_id, table.edge_u, table.edge_v
    t_min, known = rays.t_min, rays.known
    o, d = rays.origin[i], rays.direction[i]
    ox, oy, oz, dx, dy, dz = o[0], o[1], o[2], d[0], d[1], d[2]
    nx, ny, nz = normal[k, 0], normal[k, 1], normal[k, 2]
    n_dot_d = nx * dx + ny * dy + nz * dz
    if abs(n_dot_d) < NEARLY_WITHIN:
        _offer_nearly_within(i, k, table, n_dot_d, rays, best)
        return
    wx, ex = two_difference(ox, corner[k, 0])
    wy, ey = two_difference(oy, corner[k, 1])
    wz, ez = two_difference(oz, corner[k, 2])
    height = (nx * wx + ny * wy + nz * wz) + (nx * ex + ny * ey + nz * ez)
    slope = abs(n_dot_d)
    if known.shape[0] > 0 and abs(height) <= known[i, 1] + START * size[k]:
        # Also where the root lies behind, and is not looked for.
        _note_start(i, k, table, wx + ex, wy + ey, wz + ez, rays, best)
    # Without the division: behind the origin, or beyond the nearest root by more than roundings.
    if (height > 0.0) == (n_dot_d > 0.0):
        near = START * (abs(wx) + abs(wy) + abs(wz) + size[k])
        if t_min[i] >= 0.0 and abs(height) > near:
            return
    elif abs(height) > best.t[i] * slope * BEYOND:
        return
    t = not_zero(-height / n_dot_d, corner[k, 3])
    if t > best.t[i]:
        return
    if not t > t_min[i]:
        near = START * (abs(wx) + abs(wy) + abs(wz) + size[k])
        if is_left_behind(i, t, near / slope, t_min, known):
            return
    px, py, pz = wx + t * dx + ex, wy + t * dy + ey, wz + t * dz + ez
    u = row_u[k, 0] * px + row_u[k, 1] * py + row_u[k, 2] * pz
    v = row_v[k, 0] * px + row_v[k, 1] * py + row_v[k, 2] * pz
    # Clear of the rim by this, u and v need no roots to be compared with it: twice the band, as sums
    # of absolute values are no less than lengths, and |d| < sqrt(3).
    band = 2.0 * TANGENT_BAND * (abs(wx) + abs(wy) + abs(wz) + size[k]) * (1.75 + slope)
    rim_u = band * (abs(row_u[k, 0]) + abs(row_u[k, 1]) + abs(row_u[k, 2]))
    rim_v = band * (abs(row_v[k, 0]) + abs(row_v[k, 1]) + abs(row_v[k, 2]))
    within_u, within_v = slope * min(u, 1.0 - u), slope * min(v, 1.0 - v)
    if within_u < -rim_u or within_v < -rim_v:
        return
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    # The normal is rounded (2), its two products have 3 roundings each, quotient and sums 4.
    error = UNIT_ROUNDOFF * (12.0 * away + 4.0 * size[k])
    t_bound = error / slope + 4.0 * UNIT_ROUNDOFF * abs(t)
    side, tangent = CROSSED, False
    if within_u > rim_u and within_v > rim_v:
        if table.trim is not None and _is_skew(edge_u, row_u, k):
            u, v = _weights(i, k, t, table, rays)
        side = _sure_side(table.trim, k, u, v, slope, band, rim_u, rim_v)
        if side == OUTSIDE:
            return
    else:
        band = TANGENT_BAND * max(away, size[k])
        # A step across the ray moves the point by up to |d| / |n.d| along the plane.
        lean = max(1.0, np.sqrt(dx * dx + dy * dy + dz * dz) / slope)
        lu = np.sqrt(row_u[k, 0] ** 2 + row_u[k, 1] ** 2 + row_u[k, 2] ** 2)
        lv = np.sqrt(row_v[k, 0] ** 2 + row_v[k, 1] ** 2 + row_v[k, 2] ** 2)
        depth = min(min(u, 1.0 - u) / lu, min(v, 1.0 - v) / lv)
        if depth < -band * lean:
            return
        if depth < band * lean:
            # --- near the rim: how far does the ray pass from the lines that its edges lie on?
            across = slope * _area(row_u, row_v, k)
            depth = across * min(
                min(u, 1.0 - u) / _width(edge_v, k, dx, dy, dz),
                min(v, 1.0 - v) / _width(edge_u, k, dx, dy, dz),
            )
            if depth < -error:
                if depth > -band and t > t_min[i]:
                    best.doubt[i] = min(best.doubt[i], t)
                return
            tangent = depth < band
            computed = t
            u, v, t = _move_to_rim(
                u, v, t, row_u[k, 0] * dx + row_u[k, 1] * dy + row_u[k, 2] * dz,
                row_v[k, 0] * dx + row_v[k, 1] * dy + row_v[k, 2] * dz, 4.0 * error / slope,
            )  # fmt: skip
            v, u, t = _move_to_rim(
                v, u, t, row_v[k, 0] * dx + row_v[k, 1] * dy + row_v[k, 2] * dz,
                row_u[k, 0] * dx + row_u[k, 1] * dy + row_u[k, 2] * dz, 4.0 * error / slope,
            )  # fmt: skip
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
            t_bound += abs(t - computed)
        if table.trim is not None and _is_skew(edge_u, row_u, k):
            u, v = _weights(i, k, t, table, rays)
    if side == CROSSED:
        band = TANGENT_BAND * max(away, size[k])
        is_kept, is_within, edge = _side_of_loops(
            i, k, u, v, t, band, table.trim, table, rays, best
        )
        if not is_kept:
            return
        tangent |= is_within
        t_bound += edge
    offer(i, t, t_bound, slope, tangent, object_id[k], 0, u, v, t_min, known, best)


@inlined
def offer_parallelograms(i, end, table, rays, best, any_hit):
    """Offer the roots of ray i on the parallelograms up to row ``end``.

    ``any_hit``: until there is a hit.
    """
    o, d = rays.origin[i], rays.direction[i]
    for begin in range(0, end, BLOCK):
        if any_hit and best.object_id[i] >= 0:
            return
        mask = ALL
        if end > FEW:
            mask = parallelograms_in_reach(
                table.reach, begin, min(begin + BLOCK, table.reach.shape[1]),
                o[0], o[1], o[2], d[0], d[1], d[2], rays.t_min[i], best.t[i],
            )  # fmt: skip
        for k in range(begin, min(begin + BLOCK, end)):
            if mask & FIRST_BIT:
                offer_parallelogram(i, k, table, rays, best)
                if any_hit and best.object_id[i] >= 0:
                    return
            mask >>= NEXT


@kernel
def trace_rectangles(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the parallelograms up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_parallelograms(i, end, table, rays, best, any_hit)


@kernel
def trace_rectangle_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_rectangles`, for the parallelograms in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(
            i, offer_parallelogram, table, members, rays, best, any_hit, stack
        )


@inlined
def finish_rectangle(table, k, rays, best, i, out):
    """Describe the hit of ray i on parallelogram k."""
    o, d, t = rays.origin[i], rays.direction[i], best.t[i]
    u, v = best.a[i], best.b[i]
    if _is_skew(table.edge_u, table.row_u, k):
        u, v = _weights(i, k, t, table, rays)
    gap = 0.0
    for c in range(3):
        p = table.corner[k, c] + (u * table.edge_u[k, c] + v * table.edge_v[k, c])
        gap += (p - (o[c] + t * d[c])) ** 2
        out.position[i, c] = p
        out.normal[i, c] = table.normal[k, c]
    out.u[i], out.v[i], out.patch_id[i] = u, v, 0
    out.residual[i] = np.sqrt(gap)
    if has_gap(table.trim, k) and is_edge(k, u, v, d, table.trim, table):
        out.flags[i] |= EDGE


@inner
def is_edge(k, u, v, d, trim, table):
    """Tell whether a hit on parallelogram k is within the gap of an edge."""
    if trim is None:
        return False
    p, q, n, a, b = (
        table.edge_u[k],
        table.edge_v[k],
        table.normal[k],
        table.row_u[k],
        table.row_v[k],
    )
    slope = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    room = slope * slope / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    per_u, per_v = a[0] * a[0] + a[1] * a[1] + a[2] * a[2], b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
    if sure_side(trim, k, u, v, per_u, per_v, 0.0, room) != CROSSED:
        return False
    edge = decide(trim, k, u, v, p[0], p[1], p[2], q[0], q[1], q[2], d[0], d[1], d[2], 0.0)[2]
    return edge > 0.0


@kernel
def finish_rectangles(table, rays, best, row_of, out):
    """Describe the hits on parallelograms."""
    finish_each(finish_rectangle, table, rays, best, row_of, out)
