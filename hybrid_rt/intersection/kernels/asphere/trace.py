"""Rays against even aspheres, each first hit proven to be the first.

In the frame of the vertex the surface is z = sag(w), w = x^2 + y^2, and along a ray with unit direction

    g(s) = z(s) - sag(w(s)),   g' = v_z - F w',   g'' = -(F' w'^2 + F w''),   F = d sag / dw

where w' = 2 (x v_x + y v_y) is linear in s and w'' constant. The ray is cut to the cylinder of the
aperture; bounds of F and F' over the w in between, kept in a table, then say of a piece of it that g
runs one way (one root, or none, as its ends tell), or that it bends one way (Newton's iteration on g'
finds the extremum that parts two roots, or shows that there is none), or that g keeps away from zero;
else the piece is halved, the half that comes first is taken first. So most rays of a lens need one
piece. No polynomial in s is formed.

|g| over the length of its gradient (1, 2 r F) is to first order the distance from the surface: what is
decided within rounding shows by itself. docs/rounding_aspheres.md has the analysis behind `RAY_NOISE`.

The bounds of ranges are interval arithmetic as in Moore, Kearfott, Cloud, "Introduction to Interval
Analysis", SIAM 2009.
"""

import numpy as np

from hybrid_rt.intersection.kernels.asphere.search import search
from hybrid_rt.intersection.kernels.asphere.solve import (
    Line,
    doubt_kept,
    gradient,
    look,
    pass_rim,
    side_of_root,
)
from hybrid_rt.intersection.kernels.asphere.table import asphere_table  # noqa: F401  (for the registry)
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.frame import (
    MARGIN,
    clearly_passes,
    cut_to_slab,
    cylinder_roots,
    enter_turned_frame,
    share_of_turn,
    turned,
    turned_point,
)
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_each, offer_near
from hybrid_rt.intersection.kernels.search.rays import EDGE
from hybrid_rt.intersection.kernels.search.trims import has_gap
from meshing.kernels.jit import inlined, inner, kernel

# The origin of s is moved to the point nearest the axis unless that is farther away than this.
NEAR_AXIS = 2.5


@inlined
def offer_asphere(i, k, table, rays, best):
    """Offer the first root of ray i with asphere k."""
    to_frame = table.to_frame[k]
    ray = enter_turned_frame(
        i, rays, best, table.origin[k], table.frame[k], to_frame, table.size[k] * to_frame
    )
    if ray.half <= 0.0:
        return
    x, y, z, vx, vy, vz, half, length, t_of_zero, band = ray
    per_t, to_world = 1.0 / length, 1.0 / to_frame
    band = max(band, table.height[k, 3]) + table.origin[k, 3]
    # --- within the slab of the sag
    thick = 2.0 * band + MARGIN
    bottom, top = table.height[k, 0] - thick, table.height[k, 1] + thick
    lo, hi = cut_to_slab(-half, half, z, vz, bottom, top)
    if lo >= hi:
        return
    # --- from the point nearest the axis, unless the ray runs along that
    across, turn = vx * vx + vy * vy, x * vx + y * vy
    if abs(turn) <= NEAR_AXIS * across and across > 0.0:
        step = -turn / across
        x, y, z = x + step * vx, y + step * vy, z + step * vz
        lo, hi, t_of_zero = lo - step, hi - step, t_of_zero + step * per_t
        turn = 0.0
    line = Line(x, y, z, vx, vy, vz, across, turn, table.curvature[k], table.under_root[k])
    # --- within the cylinder of the aperture: from s0 to s1
    rim, rim_square, rim_height = table.rim[k, 0], table.rim[k, 1], table.rim[k, 2]
    s0, s1, beside = -np.inf, np.inf, x * x + y * y - rim_square
    is_within = True
    if across > 0.0:
        square = turn * turn - across * beside
        is_within = square > 0.0
        root = np.sqrt(max(square, 0.0))
        s0, s1 = cylinder_roots(across, turn, beside, root)
    elif beside > 0.0:
        is_within = False
    # --- which places of the ray may be at the rim?
    first_rim = second_rim = np.inf
    # From the rim to the cylinder a ray may go on along it: by the root of the band.
    loose = 4.0 * (band + np.sqrt(band))
    if across <= 0.5:
        s = (rim_height - z) / vz
        px, py = x + s * vx, y + s * vy
        if abs(np.sqrt(px * px + py * py) - rim) <= 2.0 * loose:
            first_rim = pass_rim(line, rim, rim_height, s, band)
    else:
        if abs(z + s0 * vz - rim_height) <= loose * (1.0 + 2.0 * abs(vz)):
            first_rim = pass_rim(line, rim, rim_height, s0, band)
        if abs(z + s1 * vz - rim_height) <= loose * (1.0 + 2.0 * abs(vz)):
            second_rim = pass_rim(line, rim, rim_height, s1, band)
    for s in (first_rim, second_rim):
        if s < np.inf:
            t = (t_of_zero + s * per_t) * to_world
            doubt_kept(i, k, line, s, t, band, table, rays, best)
    lo, hi = max(lo, s0), min(hi, s1)
    if is_within and lo < hi:
        rims = first_rim, second_rim, band
        search(i, k, line, lo, hi, t_of_zero, per_t, rims, table, rays, best)


@inlined
def _offer_if_near(i, k, table, rays, best):
    # Most rays clearly pass the ball around an asphere: there is nothing to solve.
    if not clearly_passes(i, rays, table.origin[k], table.size[k]):
        offer_asphere(i, k, table, rays, best)


@kernel
def trace_aspheres(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the aspheres up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, _offer_if_near, end, table, rays, best, any_hit)


@kernel
def trace_asphere_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_aspheres`, for the aspheres in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(i, _offer_if_near, table, members, rays, best, any_hit, stack)


@inner
def is_edge(i, k, line, trim, table, rays):
    """Tell whether a hit at the origin of a line is within the gap of an edge of asphere k."""
    if trim is None:
        return False
    d = rays.direction[i]
    vx, vy, vz = turned(table.frame[k], d[0], d[1], d[2])
    along = Line(
        line.x, line.y, line.z, vx, vy, vz, 0.0, 0.0, line.curvature, line.under_root
    )  # fmt: skip
    return side_of_root(trim, k, along, 0.0, table, 0.0)[2] > 0.0


@inlined
def _finish_asphere(table, k, rays, best, i, out):
    """Describe the hit of ray i on asphere k."""
    c, e, to_frame = table.origin[k], table.frame[k], table.to_frame[k]
    x, y, z = turned_point(i, rays, best.t[i], c, e, to_frame)
    # Rounding may have put it beyond the rim.
    rho, rim = np.sqrt(x * x + y * y), table.rim[k, 0]
    if rho > rim:
        x, y, rho = x * (rim / rho), y * (rim / rho), rim
    line = Line(
        x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, table.curvature[k], table.under_root[k]
    )  # fmt: skip
    g, _, _, rate = look(line, table.coefficient, k, 0.0)
    size = gradient(line, 0.0, rate)
    s = table.orientation[k]
    out.residual[i] = abs(g) / to_frame
    if has_gap(table.trim, k) and is_edge(i, k, line, table.trim, table, rays):
        out.flags[i] |= EDGE
    z -= g
    nx, ny, nz = 2.0 * rate * x * s / size, 2.0 * rate * y * s / size, -s / size
    for j in range(3):
        out.position[i, j] = c[j] + (x * e[0, j] + y * e[1, j] + z * e[2, j]) / to_frame
        out.normal[i, j] = nx * e[0, j] + ny * e[1, j] + nz * e[2, j]
    v = min(rho / rim, 1.0)
    if table.trim is None:
        out.u[i], out.v[i] = share_of_turn(y, x), (v if s > 0.0 else 1.0 - v)
    else:
        out.u[i], out.v[i] = best.a[i], best.b[i]
    out.patch_id[i] = 0


@kernel
def finish_aspheres(table, rays, best, row_of, out):
    """Describe the hits on aspheres; ``row_of`` (objects,) is the object's row here or -1."""
    finish_each(_finish_asphere, table, rays, best, row_of, out)
