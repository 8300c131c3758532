"""Where a shift of the ray by the TANGENT band may make or lose a hit.

A decision hangs by less than the band where the ray passes within it of a silhouette, of a rim, or
of a circle where the profile bends (a tip is where it meets its mirror image) so that both sides of
it lie on one side of the ray. `is_outline` asks this of hits; what was rejected so is a doubt.
"""

import numpy as np

from hybrid_rt.intersection.kernels.revolution.profile import (
    END_KIND,
    END_R,
    END_TANGENT,
    END_Z,
    RIM,
    TIP,
)
from hybrid_rt.intersection.kernels.revolution.sheets import (
    ACROSS,
    BAND,
    BESIDE,
    HEIGHT,
    IN_PART,
    LENGTH,
    RISE,
    SHIFT,
    SIDE,
    TO_WORLD,
    WAY,
    bend_of_ray,
    distance,
    toward_circle,
    way_on_sheet,
    within_part,
)
from hybrid_rt.intersection.kernels.search.nearest import is_known
from hybrid_rt.intersection.kernels.search.tolerances import APPROACHES
from meshing.kernels.jit import inner

# A side of a bend this nearly along the ray is neither before nor behind it.
FLUSH = 1e-14
# This many bands from a tip what counts is the cone there, farther away the curvature at the hit.
BESIDE_TIP = 64.0
# Farther than this (in frame units) from a hit no end of its segment is asked about.
BESIDE_END = 1e-4


@inner
def note_doubt(i, t, ray, rays, best):
    """Note that something within the TANGENT band of ray i was passed by at t.

    Beyond the ends of a part of the turn there is nothing. What the band can bring about there is a
    contact as long as the root of the band, and as far as the ray goes around the axis.
    """
    if ray[IN_PART] != 0.0:
        rho, _ = distance(ray, t, True)
        around = ray[ACROSS] * ray[BESIDE] / (max(rho, 1e-300) * ray[LENGTH])
        if within_part(ray, t) < -4.0 * (ray[BAND] + min(np.sqrt(ray[BAND]), around)):
            return
    keep_doubt(i, t, ray, rays, best)


@inner
def keep_doubt(i, t, ray, rays, best):
    """Note that the band decides something at t, if that is where a hit may be."""
    t = (t + ray[SHIFT]) * ray[TO_WORLD]
    if not (t > rays.t_min[i] and t < best.doubt[i]):
        return
    # A point of departure is in nobody's way, nor is a target.
    near = 4.0 * ray[BAND] / ray[LENGTH] * ray[TO_WORLD]
    if not is_known(i, t, near, ray[LENGTH], rays.known):
        best.doubt[i] = t


@inner
def pass_end(end, ray, after):
    """Tell whether a ray passes a singular circle within the TANGENT band, and where.

    And so that the circle is an outline: a rim; or the profile goes on to one side only, as seen
    along the ray. A tip goes on as its mirror image. Within the band of grazing a side counts as
    either.

    Returns ``is_outline``.
    ``t`` of the ray's point nearest to the circle, on this sheet.
    """
    z, r, band = end[END_Z], end[END_R], ray[BAND]
    dz, across, h, length = ray[RISE], ray[ACROSS], ray[BESIDE], ray[LENGTH]
    if r == 0.0:
        w = ray[WAY]
        t = ((z - ray[HEIGHT]) * dz - w * across) / (length * length)
        w += t * across
        f = ray[HEIGHT] + t * dz - z
        gap = np.sqrt(f * f + w * w + h * h)
        rate, bend = across, 0.0
    else:
        w = np.sqrt((r - h) * (r + h)) if h < r else 0.0
        rate = across * (w / r)
        way = (w if after else -w) - ray[WAY]
        t = (z - ray[HEIGHT]) / dz if abs(dz) > rate else way / across
        for _ in range(APPROACHES):
            t += toward_circle(z, r, ray, after, t)
        rho, rate = distance(ray, t, after)
        f, g = ray[HEIGHT] + t * dz - z, rho - r
        gap = np.sqrt(f * f + g * g)
        if gap > band and abs(h - r) <= band and across > 0.0:
            # Along the circle the steps do not converge: rho' vanishes there.
            beside = -ray[WAY] / across
            f, g = ray[HEIGHT] + beside * dz - z, h - r
            if f * f + g * g < gap * gap:
                t, gap = beside, np.sqrt(f * f + g * g)
                rho, rate = distance(ray, t, after)
        bend = bend_of_ray(ray, rho)
    if not gap <= band or way_on_sheet(ray, t, after) < -2.0 * band:
        return False, t
    if end[END_KIND] == RIM:
        return True, t
    sides = 0.0
    for k in range(2):
        tz, tr, curve = (
            end[END_TANGENT + 3 * k],
            end[END_TANGENT + 3 * k + 1],
            end[END_TANGENT + 3 * k + 2],
        )
        side, along = tz * rate - tr * dz, tz * dz + tr * rate
        depth = abs(tz * bend - curve * along * along)
        if side * side <= 2.0 * depth * band or abs(side) <= FLUSH * length:
            return True, t
        sides += np.sign(side)
    return sides != 0.0, t


@inner
def depth_in_cone(end, ray, t, from_tip):
    """Return how deep a ray runs in the cone that touches the profile at a tip; inf: to no end.

    Two planes through the tip touch the cone and hold the ray's direction: seen along the ray they
    are its outline. Where there is none, nor any within twice this distance from the tip, the
    ray enters a cone that it does not leave.
    """
    tz, tr, curve = end[END_TANGENT], end[END_TANGENT + 1], abs(end[END_TANGENT + 2])
    steep, wide = abs(tr * ray[RISE]), abs(tz * ray[ACROSS])
    if steep - wide > (2.0 * curve * from_tip + np.sqrt(2.0 * curve * ray[BAND])) * ray[LENGTH]:
        return np.inf
    if not steep < wide:
        return 0.0
    cosine = tr * ray[RISE] / (tz * ray[ACROSS])
    sine = np.sqrt((1.0 - cosine) * (1.0 + cosine))
    up = tr * (ray[HEIGHT] + t * ray[RISE] - end[END_Z])
    way = tz * (ray[WAY] + t * ray[ACROSS]) * cosine - up
    beside = tz * ray[SIDE] * sine
    return min(abs(way - beside), abs(way + beside))


@inner
def is_outline(end, size, ray, z, r, t, nr, nz, bend):
    """Tell whether a shift of the ray by the TANGENT band may take a hit away.

    The hit is at height z and radius r. ``bend`` is the surface's curvature along the ray there: the
    ray runs under the outline by slope^2 / (2 bend). ``end`` (2, END) are the ends of the segment.
    """
    rho, rate = distance(ray, t, True)
    slope, band = abs(nr * rate + nz * ray[RISE]), ray[BAND]
    is_under = slope * slope < 2.0 * abs(bend) * band and rho > 0.0
    for k in range(2):
        if end[k, END_KIND] == TIP:
            from_tip = abs(z - end[k, END_Z]) + r
            if is_under or from_tip <= BESIDE_TIP * band:
                depth = depth_in_cone(end[k], ray, t, from_tip)
                if depth == np.inf or from_tip <= BESIDE_TIP * band:
                    is_under = depth < band
    if is_under:
        return True
    for k in range(2):
        # The band moves a root by band / slope, were the surface flat.
        apart = abs(z - end[k, END_Z]) + abs(r - end[k, END_R])
        is_far = apart * slope > 16.0 * band * ray[LENGTH]
        if is_far and apart > BESIDE_END * size + 4.0 * band:
            continue
        # The end may be passed on the other sheet, if the hit is where one becomes the other.
        for sheet in range(2):
            is_passed, near = pass_end(end[k], ray, sheet == 1)
            if is_passed and abs(near - t) * slope <= 8.0 * band:
                return True
    return False
