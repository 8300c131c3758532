"""Roots on trimmed surfaces about an axis (spheres, tori, aspheres): on which side of the loops they are.

In the frame of the surface u is the angle of (x, y) in whole turns, and S_v lies in the plane of the
axis and the point: ``out`` from the axis and ``up`` along it. Lengths are those of the frame.
"""

import numpy as np

from hybrid_rt.intersection.kernels.search.frame import share_of_turn
from hybrid_rt.intersection.kernels.search.trims import (
    decide,
    may_be_kept,
    meets_pole,
    sure_side,
)
from meshing.kernels.jit import inlined, inner
from meshing.kernels.trims import CROSSED, INSIDE

TURN = 2.0 * np.pi
# Contacts within the band are as long as the root of the band times the radius, and a factor.
LONG = 4.0


@inlined
def rough_share(y, x):
    """Return the angle of (x, y) in whole turns, 0 to 1, within 2e-6.

    Abramowitz and Stegun, "Handbook of Mathematical Functions", 1964, 4.4.47.
    """
    wide, high = abs(x), abs(y)
    a = min(wide, high) / max(wide, high, 1e-300)
    s = a * a
    p = -0.3302995 + s * (0.1801410 + s * (-0.0851330 + s * 0.0208351))
    turn = a * (0.9998660 + s * p) / TURN
    if high > wide:
        turn = 0.25 - turn
    if x < 0.0:
        turn = 0.5 - turn
    return 1.0 - turn if y < 0.0 else turn


@inlined
def side_about_axis(trim, k, x, y, u, v, out, up, dx, dy, dz, band):
    """Decide about a root on surface k; without loops (None) it is a hit.

    ``x``, ``y``, ``u``, ``v``: where it is across the axis, and its parameters.
    ``out``, ``up``: S_v there.
    ``dx``, ``dy``, ``dz``: the ray in the frame, of any length.
    Returns is_hit, is_within, edge: as `decide` does.
    """
    if trim is None:
        return True, False, 0.0
    rho = np.sqrt(x * x + y * y)
    ex, ey = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
    along, square = TURN * rho, out * out + up * up
    rise = up * (ex * dx + ey * dy) - out * dz
    room = rise * rise / max(square * (dx * dx + dy * dy + dz * dz), 1e-300)
    per_u, per_v = 1.0 / max(along * along, 1e-300), 1.0 / max(square, 1e-300)
    side = sure_side(trim, k, u, v, per_u, per_v, band, room)
    if side != CROSSED:
        return side == INSIDE, False, 0.0
    is_hit, is_within, edge = decide(
        trim, k, u, v, -along * ey, along * ex, 0.0, out * ex, out * ey, up, dx, dy, dz, band
    )
    if not is_within:
        is_within = meets_pole(trim, k, u, v, rho, np.sqrt(square), np.sqrt(room), band)
    return is_hit, is_within, edge


@inner
def touches_kept(trim, k, x, y, v, speed, reach):
    """Tell whether surface k within ``reach`` of a point may be inside the loops; |S_v| is ``speed``."""
    if trim is None:
        return True
    along = TURN * np.sqrt(x * x + y * y)
    hu, hv = reach / max(along, 1e-300), reach / max(speed, 1e-300)
    return may_be_kept(trim, k, share_of_turn(y, x), v, min(hu, 1.0), min(hv, 1.0))
