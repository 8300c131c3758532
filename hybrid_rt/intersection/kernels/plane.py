"""Rays against planes."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import product, two_difference
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_each
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    begins_at,
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


class PlaneTable(NamedTuple):
    """Planes."""

    origin: Any  # (k, 5): and `meshing.surface.Surface.moved`, `Plane.tilt`
    normal: Any  # (k, 3) unit
    exact_normal: Any  # (k, 3) not rounded, of any length
    axes: Any  # (k, 2) int64: the coordinates whose fractions are (u, v)
    object_id: Any  # (k,) int32


def plane_table(planes, object_id):
    """Return the table of a list of planes."""
    return PlaneTable(
        origin=np.array([(*p.origin, p.moved, p.tilt) for p in planes]).reshape(-1, 5),
        normal=np.array([p.unit_normal for p in planes]).reshape(-1, 3),
        exact_normal=np.array([p.exact_normal for p in planes]).reshape(-1, 3),
        axes=np.array([p.axes for p in planes], np.int64).reshape(-1, 2),
        object_id=object_id,
    )


@inner
def _exact_dot(n, d):
    """Return the scalar product of two vectors for which most of it cancels, to 2^-100 of them."""
    p, e = product(n[0], d[0])
    q, f = product(n[1], d[1])
    r, g = product(n[2], d[2])
    s, h = two_difference(p, -q)
    t, k = two_difference(s, -r)
    return t + (k + h + (e + f + g))


@inlined
def offer_plane(i, k, table, rays, best):
    """Offer the root of ray i with plane k."""
    o, d = rays.origin[i], rays.direction[i]
    c, n = table.origin[k], table.normal[k]
    n_dot_d = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
    is_nearly_within = abs(n_dot_d) < NEARLY_WITHIN
    if is_nearly_within:
        # A plane has no end: what rounding hides in this product, or in the unit normal, may bring
        # a root, far away.
        m = table.exact_normal[k]
        n_dot_d = _exact_dot(m, d) / np.sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2])
    wx, ex = two_difference(o[0], c[0])
    wy, ey = two_difference(o[1], c[1])
    wz, ez = two_difference(o[2], c[2])
    height = (n[0] * wx + n[1] * wy + n[2] * wz) + (n[0] * ex + n[1] * ey + n[2] * ez)
    slope = abs(n_dot_d)
    length = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    away = np.sqrt(wx * wx + wy * wy + wz * wz)
    # How far an image is moved where the ray begins, and how fast that grows along it.
    off, tilt = c[3] + c[4] * away, c[4] * length
    if tilt > 0.0 and slope <= 2.0 * tilt:
        # The ray may be parallel to the plane that was meant, or meet it anywhere from here on.
        first = (abs(height) - off - 8.0 * UNIT_ROUNDOFF * away) / (slope + tilt)
        best.doubt[i] = min(best.doubt[i], max(first, rays.t_min[i]))
    if n_dot_d == 0.0:
        return
    t = not_zero(-height / n_dot_d, off)
    # As for parallelograms; the rounding of n.d itself counts for distant points, unless it is exact.
    turn = 0.0 if is_nearly_within else 6.0 * abs(t) * length
    error = UNIT_ROUNDOFF * (8.0 * away + turn)
    t_bound = error / slope + 8.0 * UNIT_ROUNDOFF * abs(t)
    if off > 0.0 or tilt > 0.0:
        t_bound += (off + tilt * abs(t)) / (slope - tilt) if slope > tilt else np.inf
    if is_nearly_within:
        band = TANGENT_BAND * away + off
        doubt_start(i, t, slope, -np.inf, np.inf, band, rays.t_min, rays.known, best)
    if begins_at(i, t, t_bound, slope, rays.known):
        note_departure(i, n[0], n[1], n[2], rays.t_min, rays.known, best)
    offer(
        i, t, t_bound, slope, CLEAR, table.object_id[k], 0, 0.0, 0.0,
        rays.t_min, rays.known, best,
    )  # fmt: skip


@kernel
def trace_planes(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the planes up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, offer_plane, end, table, rays, best, any_hit)


@inlined
def finish_plane(table, k, rays, best, i, out):
    """Describe the hit of ray i on plane k."""
    o, d, t = rays.origin[i], rays.direction[i], best.t[i]
    gap = 0.0
    for c in range(3):
        p = o[c] + t * d[c]
        gap += table.normal[k, c] * (p - table.origin[k, c])
        out.position[i, c] = p
        out.normal[i, c] = table.normal[k, c]
    # What came from afar carries the rounding of the way. Off the plane by more than its own
    # coordinates round, a point would be met again by the rays that leave it.
    for c in range(3):
        out.position[i, c] -= gap * table.normal[k, c]
    a, b = out.position[i, table.axes[k, 0]], out.position[i, table.axes[k, 1]]
    out.u[i], out.v[i], out.patch_id[i] = a - np.floor(a), b - np.floor(b), 0
    out.residual[i] = abs(gap)


@kernel
def finish_planes(table, rays, best, row_of, out):
    """Describe the hits on planes."""
    finish_each(finish_plane, table, rays, best, row_of, out)
