"""The search of one piece of profile on one sheet of the ray, by bisection.

Pieces that may hold more than one root are halved; they are rejected by their boxes and by a box
along their chord. The half that the ray reaches first is taken first.
"""

import numpy as np

from hybrid_rt.intersection.kernels.revolution.loops import is_inside_loops, may_be_kept_near
from hybrid_rt.intersection.kernels.revolution.outlines import note_doubt, pass_end
from hybrid_rt.intersection.kernels.revolution.profile import (
    R0,
    R1,
    S0,
    S1,
    Z0,
    Z1,
    measure_piece,
    profile,
    restrict_profile,
    summed_degree,
)
from hybrid_rt.intersection.kernels.revolution.sheets import (
    BAND,
    HEIGHT,
    IN_PART,
    LENGTH,
    RISE,
    SHIFT,
    SLOP,
    TO_WORLD,
    distance,
    sheet_interval,
)
from hybrid_rt.intersection.kernels.revolution.solve import (
    approach_profile,
    approach_ray,
    at_most_one,
    gap_between,
    is_in_part,
    rounding,
    solve_single,
)
from hybrid_rt.intersection.kernels.revolution.straight import solve_straight
from hybrid_rt.intersection.kernels.search.counters import (
    CELLS,
    GIVEN_UP,
    MOST_PIECES,
    PIECES,
    SLOW,
)
from hybrid_rt.intersection.kernels.search.frame import CUT_SLACK
from hybrid_rt.intersection.kernels.search.nearest import is_passed, offer
from hybrid_rt.intersection.kernels.search.tolerances import (
    CLEAR_CROSSING,
    DEPTH,
    FLATTEST,
    MAX_PIECES,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner


@inlined
def compare_along_chord(net, degree, ray, after, t0, t1):
    """Compare a piece of profile, ``net``, and the ray in [t0, t1] by their distances to its chord.

    Returns ``apart`` width of an empty strip along the chord between them; not positive: there is
    none.
    ``thick`` width of the wider one across the chord; inf where there is no chord, or no end of t.
    ``cz``, ``cr`` the chord.
    """
    cz, cr = net[degree, 0] - net[0, 0], net[degree, 1] - net[0, 1]
    chord = np.hypot(cz, cr)
    if not (chord > 0.0 and t0 > -np.inf and t1 < np.inf):
        return 0.0, np.inf, cz, cr
    mz, mr = -cr / chord, cz / chord
    n0 = n1 = 0.0
    for k in range(1, degree):
        d = mz * (net[k, 0] - net[0, 0]) + mr * (net[k, 1] - net[0, 1])
        n0, n1 = min(n0, d), max(n1, d)
    rho0, rate0 = distance(ray, t0, after)
    rho1, rate1 = distance(ray, t1, after)
    g0 = mz * (ray[HEIGHT] + t0 * ray[RISE] - net[0, 0]) + mr * (rho0 - net[0, 1])
    g1 = mz * (ray[HEIGHT] + t1 * ray[RISE] - net[0, 0]) + mr * (rho1 - net[0, 1])
    rate0, rate1 = mz * ray[RISE] + mr * rate0, mz * ray[RISE] + mr * rate1
    low, high = min(g0, g1), max(g0, g1)
    # Between the ends the ray bends by no more than its end tangents say.
    turn = rate1 - rate0
    if rate0 * rate1 < 0.0 and turn != 0.0:
        bend = (g0 * rate1 - g1 * rate0 + rate0 * rate1 * (t1 - t0)) / turn
        low, high = min(low, bend), max(high, bend)
    return max(low - n1, n0 - high), max(n1 - n0, high - low), cz, cr


@inlined
def sine_of_crossing(control, start, degree, ray, after, s, t):
    """Return |n.d| of the surface at s and the ray at t."""
    zs, rs = profile(control, start, degree, s)[2:4]
    if zs == 0.0 and rs == 0.0:
        # A resting point of the profile: its direction a little further in.
        zs, rs = profile(control, start, degree, s * (1.0 - 2e-6) + 1e-6)[2:4]
    rate = distance(ray, t, after)[1]
    return abs(rs * ray[RISE] - zs * rate) / max(np.hypot(zs, rs), 1e-300)


@inlined
def solve_piece(i, segment, piece, ray, after, t_lo, t_cut, rays, best, work, counters):
    """Settle one piece on one sheet: offer its first root, or know that there is none."""
    control, start, degree, outlines, end = segment[:5]
    band, slop = ray[BAND], ray[SLOP]
    t0, t1 = sheet_interval(piece[Z0], piece[Z1], max(piece[R0], 0.0), piece[R1], ray, after, band)
    if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
        return
    counters[CELLS] += 1
    a, b = piece[S0], piece[S1]
    for k in range(2):
        if outlines & (1 << k) != 0 and (a == 0.0 if k == 0 else b == 1.0):
            is_passed, t = pass_end(end[k], ray, after)
            if is_passed and may_be_kept_near(segment.trim, segment, ray, t, float(k), 0.0):
                note_doubt(i, t, ray, rays, best)
    is_straight = degree == 1 and control[start, 2] == 0.0
    if is_straight and solve_straight(i, segment, t0, t1, ray, after, rays, best, counters):
        return
    if at_most_one(piece, ray, after, slop):
        settled, _ = solve_single(i, segment, piece, t0, t1, ray, after, rays, best, counters)
        if settled:
            return
    halve_piece(i, segment, a, b, t0, ray, after, t_lo, t_cut, rays, best, work, counters)


@inner(outlined=True)
def halve_piece(i, segment, a, b, begins, ray, after, t_lo, t_cut, rays, best, work, counters):
    """Settle the piece of profile from a to b by halves, the nearest first."""
    control, start, degree, _, _, size, object_id, row, trim = segment
    t_min, known = rays.t_min, rays.known
    net, stack, scratch = work.net, work.stack, work.piece
    band, slop = ray[BAND], ray[SLOP]
    counters[SLOW] += 1
    fold = 4.0 * np.sqrt(slop * max(size, slop))
    length, shift, to_world = ray[LENGTH], ray[SHIFT], ray[TO_WORLD]
    stack[0, 0], stack[0, 1] = a, b
    top, pieces = 1, 0
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        pieces += 1
        measure_piece(control, start, degree, a, b, net, scratch)
        t0, t1 = sheet_interval(
            scratch[Z0], scratch[Z1], max(scratch[R0], 0.0), scratch[R1], ray, after, band
        )
        if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
            continue
        # --- the strip along the chord: profile and ray on either side of it?
        restrict_profile(control, start, degree, a, b, net)
        apart, thick, cz, cr = compare_along_chord(net, degree, ray, after, t0, t1)
        if apart > band:
            continue
        extent = max(scratch[Z1] - scratch[Z0], scratch[R1] - scratch[R0])
        # --- what is so far apart that rounding cannot make a root of it, but a shift by the band may
        tight0, tight1 = sheet_interval(
            scratch[Z0], scratch[Z1], max(scratch[R0], 0.0), scratch[R1], ray, after, slop
        )
        is_near_miss = not tight0 <= tight1
        if not is_near_miss:
            apart, tight, _, _ = compare_along_chord(net, degree, ray, after, tight0, tight1)
            is_near_miss = apart > slop
        if not is_near_miss:
            t0, t1, thick = tight0, tight1, tight
        elif thick < 0.25 * band or extent <= 0.5 * band:
            if not at_most_one(scratch, ray, after, band):
                s, t = 0.5 * (a + b), min(max(0.5 * (t0 + t1), t0), t1)
                near = approach_profile(control, start, degree, ray, after, s, t)
                gap = gap_between(control, start, degree, ray, after, s, near)
                if (extent > 0.5 * band or gap <= 1.25 * band) and may_be_kept_near(
                    trim, segment, ray, t, s, 0.5 * (b - a)
                ):
                    note_doubt(i, t, ray, rays, best)
            continue
        middle = min(max(0.5 * (t0 + t1), t0), t1)
        reach = (t1 - t0) * length
        is_point = extent <= 4.0 * slop
        if not is_near_miss and (is_point or thick < 2.0 * slop):
            slope = sine_of_crossing(control, start, degree, ray, after, 0.5 * (a + b), middle)
            slope /= length
            is_flat = slope < CLEAR_CROSSING
            if (is_point or is_flat) and (
                (extent < fold and reach < fold) or (is_point and not is_flat)
            ):
                slope = max(slope, FLATTEST)
                s, near = approach_ray(control, start, degree, ray, after, a, b, t0, t1)
                _, error = rounding(summed_degree(control, start, degree), size, ray, near)
                t_bound = 0.5 * reach + 2.0 * error / slope + abs(near - middle) * length
                t_world = (near + shift) * to_world
                # Far away the rounding of t counts.
                t_bound = t_bound / length * to_world + 4.0 * UNIT_ROUNDOFF * abs(t_world)
                slope *= length
                if (
                    t_world + t_bound > t_min[i]
                    and not is_passed(i, t_world, t_bound, slope, object_id, known)
                    and (ray[IN_PART] == 0.0 or is_in_part(i, near, slope, ray, rays, best))
                ):
                    is_kept, edge = is_inside_loops(
                        i, s, near, slope, trim, segment, ray, rays, best
                    )
                    if not is_kept:
                        if may_be_kept_near(trim, segment, ray, near, s, 0.5 * (b - a)):
                            note_doubt(i, near, ray, rays, best)
                        continue
                    t_bound += edge
                    offer(
                        i, t_world, t_bound, slope, is_flat, object_id, row, t_bound, s, t_min,
                        known, best,
                    )  # fmt: skip
                    if t_world > t_min[i]:
                        t_cut = min(t_cut, t0)
                continue
            if is_flat:
                if may_be_kept_near(trim, segment, ray, middle, 0.5 * (a + b), 0.5 * (b - a)):
                    note_doubt(i, middle, ray, rays, best)
                continue
        if t0 > -np.inf and t1 < np.inf and at_most_one(scratch, ray, after, slop):
            settled, t = solve_single(i, segment, scratch, t0, t1, ray, after, rays, best, counters)
            if settled:
                t_cut = min(t_cut, t + CUT_SLACK * (1.0 + abs(t)))
                continue
        if top + 2 > DEPTH - 1 or pieces >= MAX_PIECES:
            counters[GIVEN_UP] += 1
            # None of the pieces that wait has been looked at: any may be nearer than this one.
            best.doubt[i] = min(best.doubt[i], (begins + shift) * to_world)
            break
        m = 0.5 * (a + b)
        # The half that the ray reaches first goes on top.
        forward = cz * ray[RISE] + cr * distance(ray, middle, after)[1]
        if forward >= 0.0:
            stack[top, 0], stack[top, 1] = m, b
            stack[top + 1, 0], stack[top + 1, 1] = a, m
        else:
            stack[top, 0], stack[top, 1] = a, m
            stack[top + 1, 0], stack[top + 1, 1] = m, b
        top += 2
    counters[PIECES] += pieces
    counters[MOST_PIECES] = max(counters[MOST_PIECES], pieces)
