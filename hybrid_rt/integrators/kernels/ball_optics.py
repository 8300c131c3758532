"""Ways of light from a point to another by way of a ball: reflected outside, or through it.

Such a way lies in the plane of both points and the centre, so one number describes it. A ray is
reflected at the outside by one way at most, and goes through a ball of glass by up to three. Within
the ball there may be another one about the same centre, the core: the distance of the ray from the
centre times the index stays the same (Born and Wolf, "Principles of optics", section 3.2), so one
number still describes the way.

A pencil of rays widens differently in that plane and across it. The product of both widths is the
cross-section of the pencil over its solid angle. At the outside they follow from Coddington's
equations for a single ray (section 4.6).

The radius of the ball is one: lengths are over the radius.
"""

import math

from meshing.kernels.jit import inlined, inner

# Bisection halves the bracket, Newton iteration squares its error: this many steps are not reached.
MOST_STEPS = 100
# Of the number that describes a way. Newton steps differ by some roundings in the end.
CLOSE = 1e-14
# Of a Newton step, after which the error is about its square.
NEWTON_CLOSE = 1e-9
# How well the place is known that parts two ways. Both are on a caustic there, where they carry nothing.
NEAR_LEAST = 1e-7
# Cells of the number in which the slope of the turn is taken to change its sign once, with a core.
CELLS = 8
# Up to five parts of the number's range in which the turn is monotonic, with two ways each.
MOST_WAYS = 10
SMALLEST = 1e-300


@inner
def place_of_reflection(eye, lamp, between):
    """Return the angle at which the outside of a unit sphere reflects one point to another.

    Both angles are seen from the centre, beginning at the first point. The tangents of the angles of
    incidence of both points grow and fall with the place, so there is one solution where both points
    see the sphere, or none.

    Parameters
    ----------
    eye, lamp : float
        Distances from the centre, above 1; of a lamp at infinity inf.
    between : float
        Angle between the points, in [0, pi].

    Returns
    -------
    float; nan: there is none
    """
    low = max(0.0, between - math.acos(1.0 / lamp))
    high = min(between, math.acos(1.0 / eye))
    if low > high:
        return math.nan
    # Lengths on the lamp's side are over its distance.
    unit = 1.0 / lamp
    at = low + (high - low) * (1.0 - unit) * eye / ((1.0 - unit) * eye + (eye - 1.0))
    for _ in range(MOST_STEPS):
        s, c = math.sin(at), math.cos(at)
        p, q = math.sin(between - at), math.cos(between - at)
        near, far = eye * c - 1.0, q - unit
        excess = eye * s * far - p * near
        if excess > 0.0:
            high = at
        else:
            low = at
        slope = eye * c * far + q * near + 2.0 * eye * s * p
        step = at - excess / slope if slope > 0.0 else low
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - at) <= CLOSE:
            return step
        at = step
    return at


@inner
def turn(b, ior, eye, lamp, core):
    """Return by how far a ray is turned about the centre of a unit ball, less half a turn.

    Parameters
    ----------
    b : float
        Its distance from the centre outside the ball: the sine of the angle of incidence.
    ior : float
        Of the ball.
    eye, lamp : float
        Distances from the centre at which the ray begins and ends; the second may be inf.
    core : tuple of two float
        Radius of a ball within that the ray crosses too, times the index around it, and times its
        own; inf where it crosses none.
    """
    total = 2.0 * math.asin(b) - 2.0 * math.asin(b / ior) - math.asin(b / eye) - math.asin(b / lamp)
    before, within = core
    if before < math.inf:
        total += 2.0 * (math.asin(min(b / before, 1.0)) - math.asin(min(b / within, 1.0)))
    return total


@inlined
def _slope_of_asin(b, scale):
    """Return the derivative of asin(b / scale) by b; huge, not inf, at its end."""
    return 1.0 / math.sqrt(max(scale * scale - b * b, SMALLEST))


@inner
def turn_slope(b, ior, eye, lamp, core):
    """Return the derivative of `turn` by b; huge, or the opposite, where an angle is a right one."""
    slope = (
        2.0 * _slope_of_asin(b, 1.0)
        - 2.0 * _slope_of_asin(b, ior)
        - _slope_of_asin(b, eye)
        - _slope_of_asin(b, lamp)
    )
    before, within = core
    if before < math.inf:
        slope += 2.0 * (_slope_of_asin(b, before) - _slope_of_asin(b, within))
    return slope


@inner
def change_of_slope(low, high, ior, eye, lamp, core):
    """Return the place in [low, high] at which the slope of `turn` changes its sign.

    Its signs at the ends differ.
    """
    is_falling = turn_slope(low, ior, eye, lamp, core) < 0.0
    while high - low > NEAR_LEAST:
        middle = 0.5 * (low + high)
        if (turn_slope(middle, ior, eye, lamp, core) < 0.0) == is_falling:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@inner
def crossing_between(low, high, at_low, at_high, wanted, ior, eye, lamp, core):
    """Return b in [low, high], where `turn` is monotonic, at which it is ``wanted``; nan: nowhere.

    ``at_low`` and ``at_high`` are its values at the ends.
    """
    at_low, at_high = at_low - wanted, at_high - wanted
    if at_low * at_high > 0.0 or low >= high:
        return math.nan
    at = low - at_low * (high - low) / (at_high - at_low) if at_low != at_high else low
    for _ in range(MOST_STEPS):
        excess = turn(at, ior, eye, lamp, core) - wanted
        if (excess > 0.0) == (at_high > 0.0):
            high = at
        else:
            low = at
        slope = turn_slope(at, ior, eye, lamp, core)
        step, close = at - excess / slope if slope != 0.0 else low, NEWTON_CLOSE
        if not low < step < high:
            step, close = 0.5 * (low + high), CLOSE
        if abs(step - at) <= close:
            return step
        at = step
    return at


@inner
def ways_across(first, last, wanted, ior, eye, lamp, core, found):
    """Find all ways through a ball with b in [first, last]; return how many.

    Where `turn` is monotonic, there is one way at most. Its slope is a sum of c / sqrt(s^2 - b^2),
    which changes its sign no more often than the c do, sorted by s: once for glass of one kind,
    where the slope falls below zero, if at all, from b = 0 on; up to four times with a core. Cells
    are taken as small enough to hold one change each.

    Parameters
    ----------
    first, last : float
    wanted : float
        pi less the angle between both ends, seen from the centre.
    ior, eye, lamp, core
        See `turn`.
    found : (MOST_WAYS,) float64, written
        b of each way, negative if it passes the centre on the far side: then it is turned by more
        than half a turn.
    """
    n = 0
    cells = CELLS if core[0] < math.inf else 1
    low, at_low = first, turn(first, ior, eye, lamp, core)
    cell, is_falling = first, turn_slope(first, ior, eye, lamp, core) < 0.0
    for k in range(1, cells + 1):
        # Closer toward the end, where slopes are steepest.
        stop = first + (last - first) * math.sin(0.5 * math.pi * k / cells)
        falls_at_stop = turn_slope(stop, ior, eye, lamp, core) < 0.0
        # Ends of parts in which the turn is monotonic.
        n_ends = 0
        end = stop
        if falls_at_stop != is_falling:
            end = change_of_slope(cell, stop, ior, eye, lamp, core)
            n_ends = 1
        n_ends += k == cells
        for which in range(n_ends):
            high = stop if which == 1 else end
            at_high = turn(high, ior, eye, lamp, core)
            for side in range(2):
                sign = 1.0 - 2.0 * side
                b = crossing_between(
                    low, high, at_low, at_high, -sign * wanted, ior, eye, lamp, core
                )
                if not math.isnan(b) and n < MOST_WAYS:
                    found[n] = sign * b
                    n += 1
            low, at_low = high, at_high
        cell, is_falling = stop, falls_at_stop
    return n


@inner
def section_of_reflected(before, after, cos_i):
    """Return the cross-section over the solid angle of a pencil reflected by a unit sphere.

    ``before`` and ``after`` are the lengths of the ray to the sphere and from it. If the second is
    inf, the result is the solid angle at the end over that at the beginning.
    """
    within, across = 1.0 + 2.0 * before / cos_i, 1.0 + 2.0 * before * cos_i
    if after < math.inf:
        within, across = before + after * within, before + after * across
    return within * across


@inner
def section_of_crossed(b, ior, eye, lamp, core):
    """Return the cross-section over the solid angle of a pencil that crosses a unit ball of glass.

    The plane of the ray holds the centre, so both widths follow from the turn: in the plane from its
    slope, and across it, where all turns about the line from the centre to the beginning, from
    itself.

    Parameters are those of `turn`. If ``lamp`` is inf, the result is the solid angle at the end over
    that at the beginning.
    """
    slope = turn_slope(b, ior, eye, lamp, core)
    within = slope * math.sqrt(max(eye * eye - b * b, 0.0))
    across = eye * (math.sin(turn(b, ior, eye, lamp, core)) / b if b > 0.0 else slope)
    if lamp < math.inf:
        within *= math.sqrt(max(lamp * lamp - b * b, 0.0))
        across *= lamp
    return abs(within * across)
