"""Roots on trimmed tori."""

import numpy as np

from hybrid_rt.intersection.kernels.search.axial_trims import (
    LONG,
    TURN,
    side_about_axis,
    touches_kept,
)
from hybrid_rt.intersection.kernels.search.frame import share_of_turn
from meshing.kernels.jit import inlined, inner


@inlined
def side_of_root(trim, k, line, s, orientation, band):
    """Decide about a root at s on torus k, see `side_about_axis`; return its u and v as well."""
    if trim is None:
        return True, False, 0.0, 0.0, 0.0
    x, y, z = line.x + s * line.vx, line.y + s * line.vy, line.z + s * line.vz
    beside = np.sqrt(x * x + y * y) - line.major
    u, v, turn = share_of_turn(y, x), share_of_turn(orientation * z, beside), TURN * orientation
    is_hit, is_within, edge = side_about_axis(
        trim, k, x, y, u, v, -turn * z, turn * beside, line.vx, line.vy, line.vz, band
    )
    return is_hit, is_within, edge, u, v


@inner
def grazes_kept(trim, k, line, s, orientation, band):
    """Tell whether the torus where a ray grazes it, around s, may be inside the loops."""
    if trim is None:
        return True
    x, y, z = line.x + s * line.vx, line.y + s * line.vy, line.z + s * line.vz
    v = share_of_turn(orientation * z, np.sqrt(x * x + y * y) - line.major)
    reach = LONG * np.sqrt(band)
    return touches_kept(trim, k, x, y, v, TURN * line.minor, reach)
