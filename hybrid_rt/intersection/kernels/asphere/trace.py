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

from hybrid_rt.core.kernels.compensated import advance, two_difference
from hybrid_rt.intersection.kernels.asphere.sag import Line, gradient, look
from hybrid_rt.intersection.kernels.asphere.search import search
from hybrid_rt.intersection.kernels.asphere.solve import pass_rim
from hybrid_rt.intersection.kernels.search.frame import enter_frame
from hybrid_rt.intersection.kernels.search.nearest import doubt
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from meshing.kernels.jit import hot_kernel, inner

# Rays that pass the ball, slab or rim by more than this, and the band, miss them.
MARGIN = 2.0**-30
# The origin of s is moved to the point nearest the axis unless that is farther away than this.
NEAR_AXIS = 2.5


@inner
def offer_asphere(i, k, table, rays, best):
    """Offer the first root of ray i with asphere k."""
    o, d, c, to_frame = rays.origin[i], rays.direction[i], table.origin[k], table.to_frame[k]
    dx, dy, dz = d[0], d[1], d[2]
    dd = dx * dx + dy * dy + dz * dz
    hx, hy, hz, lx, ly, lz, t_of_zero = enter_frame(
        o[0], o[1], o[2], dx, dy, dz, c[0], c[1], c[2], to_frame
    )
    # --- does the ray meet the ball around the vertex, and when?
    away = np.sqrt((o[0] - c[0]) ** 2 + (o[1] - c[1]) ** 2 + (o[2] - c[2]) ** 2) * to_frame
    size = table.size[k] * to_frame
    band = TANGENT_BAND * max(away, 2.0 * size)
    reach = size + 2.0 * band + MARGIN
    step = -(hx * dx + hy * dy + hz * dz) / dd
    x, y, z = hx + step * dx, hy + step * dy, hz + step * dz
    half = reach * reach - (x * x + y * y + z * z)
    if half <= 0.0:
        return
    length = np.sqrt(dd)
    half, per_t, to_world = np.sqrt(half), 1.0 / length, 1.0 / to_frame
    t_of_zero += step
    if (t_of_zero + half * per_t) * to_world <= rays.t_min[i]:
        return
    if (t_of_zero - half * per_t) * to_world > best.t[i]:
        return
    # --- the ray in the frame of the vertex, from its point nearest to that
    hx, _ = advance(hx, lx, step, dx)
    hy, _ = advance(hy, ly, step, dy)
    hz, _ = advance(hz, lz, step, dz)
    dx, dy, dz = dx * per_t, dy * per_t, dz * per_t
    e = table.frame[k]
    x = e[0, 0] * hx + e[0, 1] * hy + e[0, 2] * hz
    y = e[1, 0] * hx + e[1, 1] * hy + e[1, 2] * hz
    z = e[2, 0] * hx + e[2, 1] * hy + e[2, 2] * hz
    vx = e[0, 0] * dx + e[0, 1] * dy + e[0, 2] * dz
    vy = e[1, 0] * dx + e[1, 1] * dy + e[1, 2] * dz
    vz = e[2, 0] * dx + e[2, 1] * dy + e[2, 2] * dz
    # --- within the slab of the sag
    lo, hi, thick = -half, half, 2.0 * band + MARGIN
    bottom, top = table.height[k, 0] - thick, table.height[k, 1] + thick
    if vz != 0.0:
        a, b = (bottom - z) / vz, (top - z) / vz
        lo, hi = max(lo, min(a, b)), min(hi, max(a, b))
    elif not bottom < z < top:
        return
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
        if turn == 0.0:
            s0, s1 = -root / across, root / across
        else:
            q = -(turn + (root if turn > 0.0 else -root))
            a, b = q / across, (beside / q if q != 0.0 else 0.0)
            s0, s1 = min(a, b), max(a, b)
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
            doubt(i, t, band * to_world, rays.t_min, rays.known, best)
    lo, hi = max(lo, s0), min(hi, s1)
    if is_within and lo < hi:
        rims = first_rim, second_rim, band
        search(i, k, line, lo, hi, t_of_zero, per_t, rims, table, rays, best)


@hot_kernel
def trace_aspheres(table, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on all aspheres."""
    origin, direction, center, size = rays.origin, rays.direction, table.origin, table.size
    for i in range(origin.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        dd = dx * dx + dy * dy + dz * dz
        for k in range(size.shape[0]):
            if any_hit and best.object_id[i] >= 0:
                break
            # Most rays clearly pass the ball around an asphere: they are not worth a call.
            x, y, z = (
                origin[i, 0] - center[k, 0],
                origin[i, 1] - center[k, 1],
                origin[i, 2] - center[k, 2],
            )
            away, along = x * x + y * y + z * z, x * dx + y * dy + z * dz
            reach = (1.0 + MARGIN) * size[k] + 4.0 * TANGENT_BAND * np.sqrt(away)
            if away - along * along / dd <= reach * reach + 16.0 * UNIT_ROUNDOFF * away:
                offer_asphere(i, k, table, rays, best)


@hot_kernel
def finish_aspheres(table, rays, best, row_of, out):
    """Describe the hits on aspheres; ``row_of`` (objects,) is the object's row here or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k = row_of[best.object_id[i]]
        o, d, c, e, t = (
            rays.origin[i],
            rays.direction[i],
            table.origin[k],
            table.frame[k],
            best.t[i],
        )
        to_frame = table.to_frame[k]
        fx, gx = two_difference(o[0], c[0])
        fy, gy = two_difference(o[1], c[1])
        fz, gz = two_difference(o[2], c[2])
        px, _ = advance(fx, gx, t, d[0])
        py, _ = advance(fy, gy, t, d[1])
        pz, _ = advance(fz, gz, t, d[2])
        px, py, pz = px * to_frame, py * to_frame, pz * to_frame
        x = e[0, 0] * px + e[0, 1] * py + e[0, 2] * pz
        y = e[1, 0] * px + e[1, 1] * py + e[1, 2] * pz
        z = e[2, 0] * px + e[2, 1] * py + e[2, 2] * pz
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
        z -= g
        nx, ny, nz = 2.0 * rate * x * s / size, 2.0 * rate * y * s / size, -s / size
        for j in range(3):
            out.position[i, j] = c[j] + (x * e[0, j] + y * e[1, j] + z * e[2, j]) / to_frame
            out.normal[i, j] = nx * e[0, j] + ny * e[1, j] + nz * e[2, j]
        turn = np.arctan2(y, x) / (2.0 * np.pi)
        turn -= np.floor(turn)
        out.u[i] = turn if turn < 1.0 else 0.0
        v = min(rho / rim, 1.0)
        out.v[i] = v if s > 0.0 else 1.0 - v
        out.patch_id[i] = 0
