"""Roots on trimmed surfaces of revolution: their angle, and the side of the loops that they are on."""

import numpy as np

from hybrid_rt.core.kernels.arctangent import angle_of
from hybrid_rt.intersection.kernels.revolution.outlines import keep_doubt
from hybrid_rt.intersection.kernels.revolution.profile import (
    END_NEXT,
    END_NEXT_SIDE,
    END_NEXT_SPEED,
    END_TANGENT,
    profile,
)
from hybrid_rt.intersection.kernels.revolution.sheets import (
    ACROSS,
    BAND,
    BESIDE,
    COSINE,
    LENGTH,
    RISE,
    SIDE,
    SINE,
    TO_WORLD,
    WAY,
    distance,
)
from hybrid_rt.intersection.kernels.search.trims import (
    decide,
    may_be_kept,
    meets_pole,
    sure_side,
)
from meshing.kernels.jit import inner
from meshing.kernels.trims import INSIDE, OUTSIDE

TURN = 2.0 * np.pi
# Parameters of an end of a segment are open by so much.
AT_END = 2.0**-40
# Columns of `Trim.scale` of turned surfaces.
BEGIN, SHARE = 0, 1


@inner
def turn_within(turn, begin, share):
    """Return an angle in whole turns, counted from where the surface begins; 0 to ``share``."""
    turn -= np.floor(turn) + begin
    turn -= np.floor(turn)
    if share < 1.0:
        # Rounding may have put it beyond either end.
        return min(turn, share) if turn <= 0.5 + 0.5 * share else 0.0
    return turn if turn < 1.0 else 0.0


@inner
def turn_of(trim, k, ray, t):
    """Return the angle of the ray at t on the surface of row k, see `turn_within`."""
    w, side = ray[WAY] + t * ray[ACROSS], ray[SIDE]
    x, y = w * ray[COSINE] - side * ray[SINE], w * ray[SINE] + side * ray[COSINE]
    return turn_within(angle_of(y, x) / TURN, trim.scale[k, BEGIN], trim.scale[k, SHARE])


@inner
def is_inside_loops(i, s, t, slope, trim, segment, ray, rays, best):
    """Tell whether a root on a trimmed surface is a hit; note a doubt if the band decides it is none.

    ``slope`` is |n.d| there.
    Returns ``is_kept``.
    ``edge``: what the gap of an edge adds to the bound of t, as the caller counts it.
    """
    if trim is None:  # an argument of its own: numba leaves the rest out where it is
        return True, 0.0
    k = segment.row
    turn = turn_of(trim, k, ray, t)
    _, r, zs, rs, _, _ = profile(segment.control, segment.start, segment.degree, s)
    along, square = TURN * max(r, 0.0), max(zs * zs + rs * rs, 1e-300)
    room = (slope * along / ray[LENGTH]) ** 2
    side = sure_side(trim, k, turn, s, 1.0, along * along / square, ray[BAND], room)
    if side == OUTSIDE:
        return False, 0.0
    if side == INSIDE:
        return True, 0.0
    is_hit, is_within, edge = side_by_curves(trim, k, segment.end, turn, s, along, zs, rs, ray, t)
    if is_within and not is_hit:
        keep_doubt(i, t, ray, rays, best)
    return is_hit, edge * ray[TO_WORLD] / ray[LENGTH]


@inner
def side_by_curves(trim, k, end, turn, s, along, zs, rs, ray, t):
    """Decide about a root near the curves, see `decide`; ``along`` is what a whole turn takes there.

    Within the band of an end, the segment that goes on there is asked as well: seen along the ray its
    curves may be nearer, or farther, than those of this segment say.
    """
    band, dz = ray[BAND], ray[RISE]
    rho, rate = distance(ray, t, ray[WAY] + t * ray[ACROSS] >= 0.0)
    around = ray[ACROSS] * ray[SIDE] / rho if rho > 0.0 else 0.0
    is_hit, is_within, edge = decide(
        trim, k, turn, s, 0.0, along, 0.0, rs, 0.0, zs, rate, -around, dz, band
    )
    side = 1 if s > 0.5 else 0
    beyond = np.int64(end[side, END_NEXT])
    if beyond >= 0 and abs(s - side) * abs(rs * dz - zs * rate) <= band * ray[LENGTH]:
        at = end[side, END_NEXT_SIDE]
        speed = end[side, END_NEXT_SPEED] * (1.0 - 2.0 * at)
        tz, tr = speed * end[side, END_TANGENT + 3], speed * end[side, END_TANGENT + 4]
        _, is_near, _ = decide(
            trim, beyond, turn, at, 0.0, along, 0.0, tr, 0.0, tz, rate, -around, dz, band
        )
        is_within |= is_near
    if not is_within:
        speed = np.sqrt(zs * zs + rs * rs)
        slope = abs(rs * dz - zs * rate) / max(speed * ray[LENGTH], 1e-300)
        is_within = meets_pole(trim, k, turn, s, along / TURN, speed, slope, band)
    return is_hit, is_within, edge


@inner
def may_be_kept_near(trim, segment, ray, t, s, hs):
    """Tell whether the surface within hs of s may be inside the loops where the ray is at t.

    A contact within the band is as long as the root of the band: so far around the axis is asked.
    """
    if trim is None:
        return True
    k = segment.row
    rho, _ = distance(ray, t, True)
    around = ray[ACROSS] * ray[BESIDE] / (max(rho, 1e-300) * ray[LENGTH])
    long = 4.0 * (ray[BAND] + min(np.sqrt(ray[BAND]), around))
    hu = min(long / (TURN * max(rho, 1e-300)), 1.0)
    return may_be_kept(trim, k, turn_of(trim, k, ray, t), s, hu, hs + AT_END)
