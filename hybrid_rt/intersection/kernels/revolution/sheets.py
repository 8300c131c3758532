"""A ray about an axis: one curve (z(t), rho(t)), taken in two sheets.

Across the axis the ray is a straight line at distance h from it: rho = hypot(h, w), where w grows
with t and vanishes at the nearest point, where one sheet ends and the other begins. rho is convex
in t. h and w are found once for a ray and an object. What rounding does to them is a shift of the
whole ray; after that rho and its rate are right to a few units of *their own* last place, however
near the axis. All pieces and sheets so meet one and the same ray, and beside a tip or a pole nothing
is lost that the ray's own rounding has not lost. (rho from x(t) and y(t) would be off by the rounding
of coordinates, and its rate by that over rho.)
"""

import numpy as np

from hybrid_rt.intersection.kernels.revolution.profile import (
    HALF_COSINE,
    HALF_SINE,
    IS_PART,
    MIDDLE_X,
    MIDDLE_Y,
)
from hybrid_rt.intersection.kernels.search.frame import enter_frame
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from meshing.kernels.jit import inlined, inner

# Both sheets reach beyond the point nearest the axis by this part of the distance there, so that
# a root at that point is on both.
OVERLAP = 2.0**-10
# Squares of directions below this are zero: over a few sizes they move nothing.
SMALLEST = 1e-200
# From an origin that `enter_frame` has brought near, all of an object is this near: sqrt 3 + 1.
FARTHEST_BASE = 3.0

# Columns of a ray in the frame of an axis: its height and its way along the direction across the
# axis at t = 0, and how both grow with t; its distance beside the axis, without and with a sign;
# t = 0 itself, in lengths of the direction from the origin; lengths of direction and origin; that
# direction across; half the width in which decisions are TANGENT; rounding of one evaluation; and
# what brings t back: the caller's t is (t + SHIFT) TO_WORLD; and the part of the turn that there is, see
# `profile.PART`.
(
    HEIGHT, RISE, ACROSS, WAY, BESIDE, BASE, LENGTH, AWAY, COSINE, SINE, SIDE, BAND, SLOP, SHIFT,
    TO_WORLD, IN_PART, PART_X, PART_Y, PART_COSINE, PART_SINE,
) = range(20)  # fmt: skip
RAY = 20


@inlined
def enter_axis_frame(k, table, ox, oy, oz, dx, dy, dz, ray):
    """Fill ``ray`` for one object; return by how much t was advanced, in frame units.

    Its t begins where it is nearest to the axis, unless that is beyond everything.
    """
    middle, aside, to_frame, size = table.middle, table.aside, table.to_frame[k], table.size[k]
    hx, hy, hz, lx, ly, lz, shift = enter_frame(
        ox, oy, oz, dx, dy, dz, middle[k, 0], middle[k, 1], middle[k, 2], to_frame
    )
    e = table.turn[k]
    x = (e[0, 0] * hx + e[0, 1] * hy + e[0, 2] * hz) + (e[0, 0] * lx + e[0, 1] * ly + e[0, 2] * lz)
    y = (e[1, 0] * hx + e[1, 1] * hy + e[1, 2] * hz) + (e[1, 0] * lx + e[1, 1] * ly + e[1, 2] * lz)
    z = (e[2, 0] * hx + e[2, 1] * hy + e[2, 2] * hz) + (e[2, 0] * lx + e[2, 1] * ly + e[2, 2] * lz)
    x, y, z = x - aside[k, 0], y - aside[k, 1], z - aside[k, 2]
    vx = e[0, 0] * dx + e[0, 1] * dy + e[0, 2] * dz
    vy = e[1, 0] * dx + e[1, 1] * dy + e[1, 2] * dz
    vz = e[2, 0] * dx + e[2, 1] * dy + e[2, 2] * dz
    away = np.sqrt(x * x + y * y + z * z)
    square = vx * vx + vy * vy
    length = np.sqrt(square + vz * vz)
    # Parallel to the axis the whole ray is after the point nearest to it: no way is negative.
    across, base, w = 0.0, 0.0, abs(x)
    cosine, sine = (1.0 if x >= 0.0 else -1.0), 0.0
    if square > SMALLEST:
        across = np.sqrt(square)
        cosine, sine = vx / across, vy / across
        w = x * cosine + y * sine
        base = -w / across
        if abs(base) * length <= FARTHEST_BASE:
            w = 0.0
        else:
            base = (FARTHEST_BASE if base > 0.0 else -FARTHEST_BASE) / length
            w += base * across
    side = y * cosine - x * sine
    ray[HEIGHT], ray[RISE], ray[ACROSS], ray[WAY] = z + base * vz, vz, across, w
    ray[BESIDE], ray[SIDE] = abs(side), side
    ray[BASE], ray[LENGTH], ray[AWAY], ray[COSINE], ray[SINE] = base, length, away, cosine, sine
    # The band is that of the origin before it was advanced; beyond the object nothing is left to
    # doubt.
    ray[BAND] = min(TANGENT_BAND * max(away + abs(shift) * length, 2.0 * size), 2.0 * size)
    ray[SLOP] = table.roundings[k] * UNIT_ROUNDOFF * max(size, away)
    ray[SHIFT], ray[TO_WORLD] = shift + base, 1.0 / to_frame
    part = table.part
    ray[IN_PART] = part[k, IS_PART]
    if ray[IN_PART] != 0.0:
        ray[PART_X], ray[PART_Y] = part[k, MIDDLE_X], part[k, MIDDLE_Y]
        ray[PART_COSINE], ray[PART_SINE] = part[k, HALF_COSINE], part[k, HALF_SINE]
    return shift + base


@inner
def sheet_interval(z0, z1, r0, r1, ray, after, slack):
    """Where z(t) is in [z0, z1] and rho(t) in [r0, r1] on one sheet, ``slack`` around; empty: t0 > t1.

    Both sheets hold the point nearest the axis and a little beyond it.
    """
    pz, dz, across, w, h = ray[HEIGHT], ray[RISE], ray[ACROSS], ray[WAY], ray[BESIDE]
    t0, t1 = -np.inf, np.inf
    if dz == 0.0:
        if pz < z0 - slack or pz > z1 + slack:
            return 1.0, 0.0
    else:
        a, b = (z0 - slack - pz) / dz, (z1 + slack - pz) / dz
        t0, t1 = min(a, b), max(a, b)
    if h > r1 + slack:
        return 1.0, 0.0
    if across == 0.0:
        rho = np.sqrt(h * h + w * w)
        if rho < r0 - slack or rho > r1 + slack or not after:
            return 1.0, 0.0
        return t0, t1
    far = np.sqrt((r1 + slack - h) * (r1 + slack + h)) + slack
    near = -OVERLAP * h - slack
    if r0 - slack > h:
        near = np.sqrt((r0 - slack - h) * (r0 - slack + h)) - slack
    if after:
        return max(t0, (near - w) / across), min(t1, (far - w) / across)
    return max(t0, (-far - w) / across), min(t1, (-near - w) / across)


@inner
def height_range(z0, z1, r1, ray, t_lo, t_hi, slack):
    """Return the range of z in which the ray is within a cylinder; where it never is: low > high."""
    dz, across, h = ray[RISE], ray[ACROSS], ray[BESIDE]
    if h > r1 + slack:
        return 1.0, 0.0
    if across > 0.0:
        far = np.sqrt((r1 + slack - h) * (r1 + slack + h)) + slack
        t_lo = max(t_lo, (-far - ray[WAY]) / across)
        t_hi = min(t_hi, (far - ray[WAY]) / across)
    if t_lo > t_hi:
        return 1.0, 0.0
    low, high = z0, z1
    if dz != 0.0:
        a, b = ray[HEIGHT] + t_lo * dz, ray[HEIGHT] + t_hi * dz
        low, high = max(low, min(a, b)), min(high, max(a, b))
    elif ray[HEIGHT] < z0 - slack or ray[HEIGHT] > z1 + slack:
        return 1.0, 0.0
    else:
        low = high = ray[HEIGHT]
    # One product and one sum more than `sheet_interval`, of numbers up to z1 and |o|.
    return low - 2.0 * slack, high + 2.0 * slack


@inner
def distance(ray, t, after):
    """rho(t) and its derivative; at the axis itself by the sheet."""
    w, h = ray[WAY] + t * ray[ACROSS], ray[BESIDE]
    rho = np.sqrt(h * h + w * w)
    if rho == 0.0:
        return 0.0, (ray[ACROSS] if after else -ray[ACROSS])
    return rho, ray[ACROSS] * (w / rho)


@inner
def bend_of_ray(ray, rho):
    """Return the second derivative of rho(t)."""
    if rho == 0.0:
        return 0.0
    x = ray[ACROSS] * (ray[BESIDE] / rho)
    return x * x / rho


@inner
def way_on_sheet(ray, t, after):
    """Return how far t is from the end of a sheet, across the axis; negative: on the other one."""
    w = ray[WAY] + t * ray[ACROSS]
    return w if after else -w


@inner
def toward_circle(z, r, ray, after, t):
    """Return the step of t towards the point of the ray nearest to a circle about the axis."""
    rho, rate = distance(ray, t, after)
    run = ray[RISE] * ray[RISE] + rate * rate
    if run == 0.0:
        return 0.0
    return ((z - (ray[HEIGHT] + t * ray[RISE])) * ray[RISE] + (r - rho) * rate) / run


@inner
def within_part(ray, t):
    """Return how far within the part of the turn a point of the ray is; below zero: beyond its ends.

    With the angle a between the point and the middle of the part, and half the part's angle b, that is
    rho sin(b - a), and all of rho where b - a is more than a quarter turn.
    """
    w = ray[WAY] + t * ray[ACROSS]
    x, y = w * ray[COSINE] - ray[SIDE] * ray[SINE], w * ray[SINE] + ray[SIDE] * ray[COSINE]
    along = x * ray[PART_X] + y * ray[PART_Y]
    aside = abs(x * ray[PART_Y] - y * ray[PART_X])
    if along * ray[PART_COSINE] + aside * ray[PART_SINE] > 0.0:
        return along * ray[PART_SINE] - aside * ray[PART_COSINE]
    # More than a quarter turn from either end, which is within only where the part is a half or more.
    rho = np.sqrt(x * x + y * y)
    return rho if ray[PART_COSINE] < 0.0 or (ray[PART_COSINE] == 0.0 and along > 0.0) else -rho


@inner
def shift_to_end(ray, t, slope):
    """Return how far a ray must be moved for its hit at t to leave the part, below zero: to enter it.

    The end is a meridian, to first order its tangent; ``slope`` is |n.d|, and with the way around the
    axis makes the sine of the angle between ray and meridian.
    """
    rho, _ = distance(ray, t, True)
    around = ray[ACROSS] * ray[BESIDE] / max(rho, 1e-300)
    return within_part(ray, t) * (slope / np.sqrt(max(slope * slope + around * around, 1e-300)))
