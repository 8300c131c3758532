"""Roots on trimmed aspheres."""

import numpy as np

from hybrid_rt.intersection.kernels.asphere.sag import look
from hybrid_rt.intersection.kernels.search.axial_trims import LONG, side_about_axis, touches_kept
from hybrid_rt.intersection.kernels.search.frame import share_of_turn
from hybrid_rt.intersection.kernels.search.nearest import doubt
from meshing.kernels.jit import inlined, inner


@inlined
def side_of_root(trim, k, line, s, table, band):
    """Decide about a root at s on asphere k, see `side_about_axis`; return its u and v as well."""
    if trim is None:
        return True, False, 0.0, 0.0, 0.0
    x, y = line.x + s * line.vx, line.y + s * line.vy
    rho, rim = np.sqrt(x * x + y * y), table.rim[k, 0]
    rate = look(line, table.coefficient, k, s)[3]
    u, v, out = share_of_turn(y, x), min(rho / rim, 1.0), rim
    if table.orientation[k] < 0.0:
        v, out = 1.0 - v, -rim
    is_hit, is_within, edge = side_about_axis(
        trim, k, x, y, u, v, out, 2.0 * rho * rate * out, line.vx, line.vy, line.vz, band
    )
    return is_hit, is_within, edge, u, v


@inner
def grazes_kept(trim, k, line, s, table, band):
    """Tell whether the asphere where a ray grazes it, or its rim, around s may be inside the loops."""
    if trim is None:
        return True
    x, y, rim = line.x + s * line.vx, line.y + s * line.vy, table.rim[k, 0]
    v = min(np.sqrt(x * x + y * y) / rim, 1.0)
    if table.orientation[k] < 0.0:
        v = 1.0 - v
    return touches_kept(trim, k, x, y, v, rim, LONG * np.sqrt(band))


@inner
def doubt_kept(i, k, line, s, t, band, table, rays, best):
    """Note that the asphere passes within the band of ray i at s, if it may be inside the loops there."""
    if grazes_kept(table.trim, k, line, s, table, band):
        doubt(i, t, band / table.to_frame[k], rays.t_min, rays.known, best)
