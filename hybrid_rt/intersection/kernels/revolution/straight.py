"""Roots on a straight segment of profile: at most one on either side of one point of the ray.

Where rho(t) - (a + b t) vanishes the ray meets the cone of the segment; a + b t is the radius of the
cone at the ray's height. rho is convex, so the difference falls up to the point where rho' = b, and
grows from there on. If it is not negative there by much, no cutting of the segment would help
to tell a touch from a miss: that is left to `subdivide`. Otherwise one Newton solve on either side,
from the root of a quadratic equation, says all of the segment.
"""

import numpy as np

from hybrid_rt.intersection.kernels.revolution.profile import profile
from hybrid_rt.intersection.kernels.revolution.sheets import (
    ACROSS,
    BAND,
    BESIDE,
    HEIGHT,
    RISE,
    WAY,
    distance,
    way_on_sheet,
)
from hybrid_rt.intersection.kernels.revolution.solve import (
    CUT_AIR,
    meet,
    offer_meeting,
    rounding,
)
from hybrid_rt.intersection.kernels.search.counters import NEWTONS, STEPS
from hybrid_rt.intersection.kernels.search.tolerances import BORDER_SLACK
from meshing.kernels.jit import inlined, inner

# Rays nearer to the axis than this part of the size, or this steep along it, and segments so flat across
# it are left to `subdivide`: sine, cosine.
NEAR_AXIS, STEEP, FLAT = 1e-3, 1e-3, 1e-2
# So far, at least, b / across is from 1, where one of the roots goes to infinity.
FROM_PARALLEL = 1e-3
# By so much of the size the ray passes below the cone, at least, where it is followed on both sides.
DEEP = 1e-5
# Roots of the quadratic equation are off by less, in t times 1 + |t|.
GUESS_SLACK = 2.0**-22

CLEAR_MISS, UNKNOWN, FOUND = 0, 1, 2


@inner
def guess_roots(z0, r0, zs, rs, size, ray):
    """Return what there is, the t that parts the roots (or -inf), and the roots before and after it.

    ``z0``, ``r0``, ``zs``, ``rs``: beginning and direction of the segment. A root that does not exist is
    inf. `CLEAR_MISS`: the ray is away from the whole cone by more than the band.
    """
    across, dz, h, way = ray[ACROSS], ray[RISE], ray[BESIDE], ray[WAY]
    if not (h > NEAR_AXIS * size and abs(zs) > FLAT * abs(rs) and across > STEEP * abs(dz)):
        return UNKNOWN, 0.0, 0.0, 0.0
    per_height = rs / zs
    b = per_height * dz
    a = r0 + per_height * (ray[HEIGHT] - z0)
    m = b / across
    below_one = (1.0 - m) * (1.0 + m)
    if abs(below_one) < FROM_PARALLEL:
        return UNKNOWN, 0.0, 0.0, 0.0
    square = across * across * below_one
    if below_one < 0.0:
        # From where a + b t vanishes: w0 = way there, and (w0 + across t)^2 + h^2 = b^2 t^2 with b t > 0.
        t0 = -a / b
        p = (way + across * t0) * across
        root = np.sqrt(p * p - square * (h * h + (way + across * t0) ** 2))
        # Two roots of unlike sign, as their product is negative.
        t = (-p - root) / square if b > 0.0 else (-p + root) / square
        return FOUND, -np.inf, np.inf, t0 + t
    rho = h / np.sqrt(below_one)
    t_least = (rho * m - way) / across
    gap = rho - (a + b * t_least)
    if gap * abs(zs) > ray[BAND] * np.hypot(zs, rs):
        return CLEAR_MISS, 0.0, 0.0, 0.0
    if gap > -DEEP * size:
        return UNKNOWN, 0.0, 0.0, 0.0
    # With r the cone's radius there: (rho')^2 = rho^2 + 2 rho b t + across^2 t^2 = (r + b t)^2.
    p = gap * b
    root = np.sqrt(p * p - square * gap * (2.0 * rho - gap))
    return FOUND, t_least, t_least + (-p - root) / square, t_least + (-p + root) / square


@inlined
def solve_straight(i, segment, t0, t1, ray, after, rays, best, counters):
    """Offer all roots of a straight segment on one sheet; tell whether this says all of it.

    ``t0`` to ``t1``: where this sheet of the ray is near the segment.
    """
    control, start, size = segment.control, segment.start, segment.size
    z0, r0, zs, rs, _, _ = profile(control, start, 1, 0.0)
    found, t_least, before, behind = guess_roots(z0, r0, zs, rs, size, ray)
    if found != FOUND:
        return found == CLEAR_MISS
    for side in range(2):
        guess = before if side == 0 else behind
        slack = GUESS_SLACK * (1.0 + abs(guess))
        if guess == np.inf or guess < t0 - slack or guess > t1 + slack:
            continue
        # Roots of the other sheet are offered there.
        if way_on_sheet(ray, guess, after) < -slack * ray[ACROSS]:
            continue
        counters[NEWTONS] += 1
        noise, error = rounding(1, size, ray, guess)
        if abs(zs) > abs(rs):
            s = (ray[HEIGHT] + guess * ray[RISE] - z0) / zs
        else:
            s = (distance(ray, guess, after)[0] - r0) / rs
        ok, s, t, steps, slope, gain = meet(control, start, 1, ray, after, s, guess, noise)
        counters[STEPS] += steps
        if not ok or abs(t - guess) > slack or (t < t_least) != (side == 0):
            return False
        border = BORDER_SLACK + 2.0 * noise * gain
        if not -border <= s <= 1.0 + border:
            continue
        if not t0 - CUT_AIR <= t <= t1 + CUT_AIR:
            return False
        settled, _ = offer_meeting(
            i, s, t, slope, gain, noise, error, segment, ray, after, rays, best
        )
        if not settled:
            return False
    return True
