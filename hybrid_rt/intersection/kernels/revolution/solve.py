"""One root of a piece of profile and a sheet of the ray: that it is alone, where it is, its offer.

The two meet where Z(s) = z(t) and R(s) = rho(t): two equations that stay well behaved for rays along,
across and through the axis alike, where an elimination of t would lose its digits.

Two meetings of a piece with one sheet would make the determinant R' dz - Z' rho' vanish somewhere on
their mean slopes, so where its interval keeps away from zero there is at most one, and one converged
Newton solve in the piece (grown by 15 %) settles it. The rounding analysis is in
docs/rounding_turned.md.
"""

import numpy as np

from hybrid_rt.intersection.kernels.revolution.loops import is_inside_loops
from hybrid_rt.intersection.kernels.revolution.outlines import keep_doubt
from hybrid_rt.intersection.kernels.revolution.profile import (
    BEND,
    DR0,
    DR1,
    DZ0,
    DZ1,
    END_KIND,
    END_TANGENT,
    GR0,
    GR1,
    GROWTH,
    GZ0,
    GZ1,
    S0,
    S1,
    profile,
    speed_degree,
    summed_degree,
)
from hybrid_rt.intersection.kernels.revolution.sheets import (
    ACROSS,
    AWAY,
    BAND,
    BASE,
    HEIGHT,
    IN_PART,
    LENGTH,
    RISE,
    SHIFT,
    SLOP,
    TO_WORLD,
    bend_of_ray,
    distance,
    sheet_interval,
    shift_to_end,
    toward_circle,
    way_on_sheet,
)
from hybrid_rt.intersection.kernels.search.counters import NEWTONS, STEPS
from hybrid_rt.intersection.kernels.search.frame import CUT_SLACK
from hybrid_rt.intersection.kernels.search.nearest import is_known, is_passed, offer
from hybrid_rt.intersection.kernels.search.tolerances import (
    APPROACHES,
    BORDER_SLACK,
    MAX_STEPS,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner

# The determinant must clear zero by this part of its largest term.
CLEAR = 1e-9
# A step of s times the degree, of which the third power is below rounding.
SMALL_STEP = 6e-6
# A root may be this far outside the range of t of the piece that offers it.
CUT_AIR = 0.25 * CUT_SLACK


@inner
def is_transversal(piece, ray, lo, hi):
    """Tell whether R' dz - Z' rate keeps away from zero, rate from lo to hi, in the grown piece."""
    a, b = piece[DZ0] * lo, piece[DZ0] * hi
    c, d = piece[DZ1] * lo, piece[DZ1] * hi
    e, f = piece[DR0] * ray[RISE], piece[DR1] * ray[RISE]
    low = min(e, f) - max(a, b, c, d)
    high = max(e, f) - min(a, b, c, d)
    clear = CLEAR * max(abs(a), abs(b), abs(c), abs(d), abs(e), abs(f))
    return low > clear or high < -clear


@inner
def rates_in(piece, ray, after, slack):
    """Return the range of rho' where this sheet of the ray is in the grown piece; empty: lo > hi."""
    t0, t1 = sheet_interval(
        piece[GZ0], piece[GZ1], max(piece[GR0], 0.0), piece[GR1], ray, after, slack
    )
    if not t0 <= t1:
        return 1.0, 0.0
    lo = -ray[ACROSS] if t0 == -np.inf else distance(ray, t0, after)[1]
    hi = ray[ACROSS] if t1 == np.inf else distance(ray, t1, after)[1]
    # rho' grows with t; next to the axis it is +-across but for the last bit, and may seem to fall.
    return min(lo, hi), max(lo, hi)


@inner
def at_most_one(piece, ray, after, slack):
    """Tell whether the grown piece meets this sheet of the ray at most once."""
    lo, hi = rates_in(piece, ray, after, slack)
    return lo > hi or is_transversal(piece, ray, lo, hi)


@inner
def meet(control, start, degree, ray, after, s, t, noise):
    """Newton for Z(s) = z(t), R(s) = rho(t): ok, s, t, steps, |n.d|, gain of s.

    Both equations hold to ``noise`` at the end: they did before the step, or what the step has
    neglected is less. That is the curvature of both curves; beside the axis the ray's is
    1 / h, so a step that is small beside the piece may still be a long one.
    """
    across, dz = ray[ACROSS], ray[RISE]
    slope = gain = 0.0
    for step in range(1, MAX_STEPS + 1):
        z, r, zs, rs, zz, rr = profile(control, start, degree, s)
        rho, rate = distance(ray, t, after)
        f, g = z - (ray[HEIGHT] + t * dz), r - rho
        det = rs * dz - zs * rate
        if det == 0.0:
            return False, s, t, step, slope, gain
        ds = (f * rate - g * dz) / det
        dt = (rs * f - zs * g) / det
        # Nearly in the tangent plane rounding becomes a long step, which would leave the surface.
        is_root = abs(f) + abs(g) <= noise
        if not is_root:
            s += ds
            t += dt
        turn = abs(dt) * bend_of_ray(ray, rho)
        neglected = 0.5 * (ds * ds * (abs(zz) + abs(rr)) + abs(dt) * turn)
        # Third derivatives are bounded by degree cubed, and by 3 / rho of the second.
        is_last = (
            neglected <= noise
            and abs(ds) * degree <= SMALL_STEP
            and abs(dt) * across <= 0.125 * rho
            and abs(zs) * turn + abs(ds) * (abs(rr * dz) + abs(zz) * across) <= 0.0625 * abs(det)
            and (
                control[start, 2] == 0.0
                or abs(ds) * speed_degree(control, start, degree) <= SMALL_STEP
            )
        )
        if is_root or is_last:
            slope = abs(det) / np.sqrt(zs * zs + rs * rs)
            gain = (abs(rate) + abs(dz)) / abs(det)
            return True, s, t, step, slope, gain
        if not -1.0 <= s <= 2.0:
            return False, s, t, step, slope, gain
    return False, s, t, MAX_STEPS, slope, gain


@inner
def rounding(degree, size, ray, t):
    """Bound what rounding makes of both equations near a root: see docs/rounding_turned.md.

    Returns ``noise`` of evaluating them for the ray as it is held, the same for every piece.
    ``error`` of all: twice the noise, as they are only solved up to that, and that of the ray
    itself.
    """
    way = abs(t) * ray[LENGTH]
    along = abs(t + ray[BASE]) * ray[LENGTH]
    noise = UNIT_ROUNDOFF * ((3.0 * degree + 10.0) * size + 4.0 * way)
    held = UNIT_ROUNDOFF * (8.0 * size + 18.0 * ray[AWAY] + 8.0 * along)
    return noise, 2.0 * noise + held


@inner
def slope_within(control, start, degree, ray, after, s, t, slope, error):
    """Return the least |n.d| that a ray may have that rounding has moved from this one.

    Beside the axis the normal turns by the shift over rho. At a tip it may turn all the way: what
    counts is then the angle between ray and cone. It is the slope at the flattest meridian of a ray
    that points into the cone; any other meets the cone, if at all, within the shift over it.
    """
    rho, _ = distance(ray, t, after)
    moved = error * (1.0 + ray[LENGTH] / slope)
    if rho >= 16.0 * moved:
        return slope
    _, _, zs, rs, _, _ = profile(control, start, degree, s)
    if zs == 0.0 and rs == 0.0:
        return slope
    speed = np.sqrt(zs * zs + rs * rs)
    zs, rs = abs(zs) / speed, abs(rs) / speed
    turned = slope - zs * ray[ACROSS] * min(2.0, 2.0 * moved / max(rho, 1e-300))
    from_cone = abs(rs * abs(ray[RISE]) - zs * ray[ACROSS])
    return max(turned, min(from_cone, slope), UNIT_ROUNDOFF * ray[LENGTH])


@inner
def approach_profile(control, start, degree, ray, after, s, t):
    """Return the t at which the ray is nearest to the circle of s, from a t close to it."""
    z, r, _, _, _, _ = profile(control, start, degree, s)
    for _ in range(APPROACHES):
        t += toward_circle(z, r, ray, after, t)
    return t


@inner
def approach_ray(control, start, degree, ray, after, a, b, t0, t1):
    """Return s in [a, b] and t in [t0, t1] where a piece of profile and the ray are nearest."""
    s, t = 0.5 * (a + b), 0.5 * (t0 + t1)
    for _ in range(APPROACHES):
        t = min(max(approach_profile(control, start, degree, ray, after, s, t), t0), t1)
        z, r, zs, rs, _, _ = profile(control, start, degree, s)
        run = zs * zs + rs * rs
        if run > 0.0:
            rho, _ = distance(ray, t, after)
            s += ((ray[HEIGHT] + t * ray[RISE] - z) * zs + (rho - r) * rs) / run
            s = min(max(s, a), b)
    t = approach_profile(control, start, degree, ray, after, s, t)
    return s, min(max(t, t0), t1)


@inner
def gap_between(control, start, degree, ray, after, s, t):
    """Return the distance between the circle of s and the ray at t."""
    z, r, _, _, _, _ = profile(control, start, degree, s)
    rho, _ = distance(ray, t, after)
    f, g = z - (ray[HEIGHT] + t * ray[RISE]), r - rho
    return np.sqrt(f * f + g * g)


@inner
def offer_meeting(i, s, t, slope, gain, noise, error, segment, ray, after, rays, best):
    """Offer a converged root if it lies on its segment.

    Returns ``settled`` whether this says all of the root; not so where it is beyond an end and the
    end far off.
    ``offered`` whether it may be a hit.
    """
    control, start, degree, end = segment.control, segment.start, segment.degree, segment.end
    shift, to_world, t_min, known = ray[SHIFT], ray[TO_WORLD], rays.t_min, rays.known
    band = 2.0 * noise * gain + 4.0 * UNIT_ROUNDOFF
    if not -band <= s <= 1.0 + band:
        return True, False
    flat = slope_within(control, start, degree, ray, after, s, t, slope, error)
    # A quarter for the curvature that the slope leaves out.
    t_bound = (1.25 * error / flat + 4.0 * UNIT_ROUNDOFF * abs(t + shift)) * to_world
    k = 1 if s > 0.5 else 0
    is_at_end = not band < s < 1.0 - band
    if not 0.0 <= s <= 1.0:
        s = min(max(s, 0.0), 1.0)
        near = approach_profile(control, start, degree, ray, after, s, t)
        if not abs(near - t) <= CUT_AIR:
            return False, False
        if gap_between(control, start, degree, ray, after, s, near) > error:
            # A flat ray that passes the end: it meets the neighbour or nothing.
            keep_doubt(i, near, ray, rays, best)
            return True, False
        t_bound += abs(near - t) * to_world
        t = near
    t_world = (t + shift) * to_world
    is_ahead = t_world + t_bound > t_min[i]
    if not is_ahead or is_passed(i, t_world, t_bound, slope, segment.object_id, known):
        return True, False
    beyond = 0.0
    if is_at_end and end[k, END_KIND] == BEND:
        # The exact root may be beyond, on the segment that goes on there, and so flatly that only
        # the surface's size limits how far: a disc has no curvature that would end the contact.
        rate = distance(ray, t, after)[1]
        other = end[k, END_TANGENT + 3] * rate - end[k, END_TANGENT + 4] * ray[RISE]
        beyond = 1.25 * error / max(abs(other), UNIT_ROUNDOFF * ray[LENGTH])
        beyond = min(beyond, 4.0 * segment.size / ray[LENGTH]) * to_world
    if ray[IN_PART] != 0.0 and not is_in_part(i, t, slope, ray, rays, best):
        return True, False
    is_kept, edge = is_inside_loops(i, s, t, slope, segment.trim, segment, ray, rays, best)
    if not is_kept:
        return True, False
    t_bound += edge
    # Of roots at the same t the one with the lower bound is taken, whichever was found first. What a flat
    # neighbour adds does not make a root one of the points that the caller has named, but leaves it open: as
    # far from these as a band moves a touch.
    near = np.sqrt(ray[BAND] * segment.size) / ray[LENGTH] * to_world
    is_open = is_known(i, t_world, t_bound + min(beyond, near), slope, known)
    is_taken = offer(
        i, t_world, t_bound, slope, is_open, segment.object_id, segment.row, t_bound + beyond, s,
        t_min, known, best,
    )  # fmt: skip
    if is_taken:
        best.t_bound[i] = t_bound + beyond
    return True, t_world > t_min[i]


@inner
def is_in_part(i, t, slope, ray, rays, best):
    """Tell whether a root is in the part of the turn; what the band decides is noted as a doubt."""
    to_end = shift_to_end(ray, t, slope)
    if to_end >= 0.0:
        return True
    if to_end >= -ray[BAND]:
        keep_doubt(i, t, ray, rays, best)
    return False


@inlined
def solve_single(i, segment, piece, t0, t1, ray, after, rays, best, counters):
    """Newton in a piece that a sheet meets at most once in [t0, t1]: offer its root if there is one.

    Returns ``settled`` whether the iteration ended near enough to say what there is.
    ``t`` of the root that was offered; else inf.
    """
    control, start, degree = segment.control, segment.start, segment.degree
    counters[NEWTONS] += 1
    a, b = piece[S0], piece[S1]
    t = 0.5 * (t0 + t1)
    noise, error = rounding(summed_degree(control, start, degree), segment.size, ray, t)
    ok, s, t, steps, slope, gain = meet(control, start, degree, ray, after, 0.5 * (a + b), t, noise)
    counters[STEPS] += steps
    if not (ok and a - GROWTH * (b - a) <= s <= b + GROWTH * (b - a)):
        return False, np.inf
    beyond = -way_on_sheet(ray, t, after)
    if beyond > 0.0:
        # A root on the other sheet: the only one as far as here if no rate between can make two. If
        # rounding can have moved it there, both sheets offer it.
        lo, hi = rates_in(piece, ray, after, ray[SLOP])
        rate = distance(ray, t, after)[1]
        if not is_transversal(piece, ray, min(lo, rate), max(hi, rate)):
            return False, np.inf
        if beyond > 2.0 * noise * (1.0 + ray[ACROSS] / slope):
            return True, np.inf
    slack = BORDER_SLACK * (b - a) + 2.0 * noise * gain
    if not a - slack <= s <= b + slack:
        return True, np.inf
    # What is cut by its t must not have offered more than is cut: else the order would matter.
    if not t0 - CUT_AIR <= t <= t1 + CUT_AIR:
        return False, np.inf
    settled, offered = offer_meeting(
        i, s, t, slope, gain, noise, error, segment, ray, after, rays, best
    )
    return settled, (t if offered else np.inf)
