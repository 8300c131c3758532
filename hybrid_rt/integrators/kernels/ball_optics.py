"""Ways of light from a point to another by way of a ball: reflected outside, or refracted twice.

Such a way lies in the plane of both points and the centre, so one number describes it. A ray is
reflected at the outside by one way at most, and goes through a ball of glass by up to three.

A pencil of rays widens differently in that plane and across it. Both widths follow from Coddington's
equations for a single ray (Born and Wolf, "Principles of optics", section 4.6), and their product is
the cross-section of the pencil over its solid angle.

The radius of the ball is one: lengths are over the radius.
"""

import math

from meshing.kernels.jit import inner

# Bisection halves the bracket, Newton iteration squares its error: this many steps are not reached.
MOST_STEPS = 100
# Of the number that describes a way. Newton steps differ by some roundings in the end.
CLOSE = 1e-14
# How well the place is known that parts two ways. Both are on a caustic there, where they carry nothing.
NEAR_LEAST = 1e-7


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
def turn(b, ior, eye, lamp):
    """Return by how far a ray is turned about the centre of a unit ball, less half a turn.

    ``b`` is its distance from the centre outside the ball, the sine of the angle of incidence;
    the ray goes from distance ``eye`` to distance ``lamp``, which may be inf.
    """
    return 2.0 * math.asin(b) - 2.0 * math.asin(b / ior) - math.asin(b / eye) - math.asin(b / lamp)


@inner
def turn_slope(b, ior, eye, lamp):
    """Return the derivative of `turn` by b; inf at 1."""
    q = b * b
    if q >= 1.0:
        return math.inf
    return (
        2.0 / math.sqrt(1.0 - q)
        - 2.0 / math.sqrt(ior * ior - q)
        - 1.0 / math.sqrt(eye * eye - q)
        - 1.0 / math.sqrt(lamp * lamp - q)
    )


@inner
def least_turn(ior, eye, lamp):
    """Return the distance b at which `turn` is least; 0 where it grows from the centre on.

    For indices above 1 its slope is either positive everywhere, or negative up to one place and
    positive from there on: where it is positive at 0, so is the second derivative, which has one
    change of sign at most, from below.
    """
    if turn_slope(0.0, ior, eye, lamp) >= 0.0:
        return 0.0
    low, high = 0.0, 1.0
    while high - low > NEAR_LEAST:
        middle = 0.5 * (low + high)
        if turn_slope(middle, ior, eye, lamp) < 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@inner
def crossing_between(low, high, at_low, at_high, asked, ior, eye, lamp):
    """Return b in [low, high], where `turn` is monotonic, at which it is ``asked``; nan: nowhere.

    ``at_low`` and ``at_high`` are its values at the ends.
    """
    at_low, at_high = at_low - asked, at_high - asked
    if at_low * at_high > 0.0 or low >= high:
        return math.nan
    at = low - at_low * (high - low) / (at_high - at_low) if at_low != at_high else low
    for _ in range(MOST_STEPS):
        excess = turn(at, ior, eye, lamp) - asked
        if (excess > 0.0) == (at_high > 0.0):
            high = at
        else:
            low = at
        slope = turn_slope(at, ior, eye, lamp)
        step = at - excess / slope if slope != 0.0 else low
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - at) <= CLOSE:
            return step
        at = step
    return at


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
def section_of_crossed(before, after, cos_i, cos_t, ior):
    """Return the cross-section over the solid angle of a pencil that crosses a unit ball of glass.

    Parameters
    ----------
    before, after : float
        Lengths of the ray to the ball and from it. If the second is inf, the result is the solid
        angle at the end over that at the beginning.
    cos_i, cos_t : float
        Cosines of the angles outside and inside.
    ior : float
    """
    chord = 2.0 * cos_t
    # In the plane: the width of the pencil, its angle, and the part of the circle that it covers.
    arc = before / cos_i
    angle = (1.0 + arc) * cos_i / (ior * cos_t) - arc
    arc = (arc * cos_t + chord * angle) / cos_t
    angle = (angle - arc) * (ior * cos_t / cos_i) + arc
    within = angle
    if after < math.inf:
        within = arc * cos_i + after * angle
    # Across it.
    bend = ior * cos_t - cos_i
    angle = (1.0 - before * bend) / ior
    width = before + chord * angle
    across = ior * angle - width * bend
    if after < math.inf:
        across = width + after * across
    return abs(within * across)
