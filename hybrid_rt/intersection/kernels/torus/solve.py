"""A ray in the frame of a torus: extremum and roots of f, and how far off a root can be.

f, q and the error of f are those of `hybrid_rt.intersection.kernels.torus.trace`.
"""

from typing import NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from meshing.kernels.jit import inlined, inner

# Error of f near the surface.
ROUNDING = 48.0 * UNIT_ROUNDOFF
# Steps toward an extremum or a root: Newton needs five, grazing rays more.
MOST_STEPS = 60
# f does not get nearer to zero than a few roundings of its own.
SMALL = 6.0 * UNIT_ROUNDOFF

# What is known of the extremum of f between two sections.
OUTSIDE, INSIDE, NEAR_OUTSIDE, NEAR_INSIDE = range(4)


class Line(NamedTuple):
    """A ray in the frame of a torus: x + s v, |v| = 1."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    across: float  # vx^2 + vy^2
    turn: float  # x vx + y vy
    along: float  # x.v
    spread: float  # E
    major: float
    minor: float


@inlined
def look(line, s):
    """Return rho, q' / 2, D and f at s."""
    x, y, z = line.x + s * line.vx, line.y + s * line.vy, line.z + s * line.vz
    rho = np.sqrt(x * x + y * y)
    slope = s + line.along - line.major * ((line.turn + line.across * s) / rho)
    beside = rho - line.major
    away = np.sqrt(beside * beside + z * z)
    return rho, slope, away, away - line.minor


@inner
def find_extremum(line, a, b, sign, band):
    """Look for the extremum of q in [a, b], where sign q is convex and q' changes its sign.

    Returns ``known`` OUTSIDE or INSIDE where f keeps away from zero by the band: of a minimum
    OUTSIDE says: that nothing is met in [a, b], of a maximum INSIDE does; else what f is at the
    extremum.
    ``s`` a place where f is as ``known`` says (of the two above: where the search ended).
    """
    r = line.minor
    # In units of q: what f = band is there, always on the safe side.
    clear = (band + ROUNDING) * (2.0 * r + band)
    _, slope_a, away_a, f_a = look(line, a)
    _, slope_b, away_b, f_b = look(line, b)
    q_a, q_b = f_a * (away_a + r), f_b * (away_b + r)
    s, step = a, b - a
    for _ in range(MOST_STEPS):
        # --- where both tangents meet: beyond their value there q does not go
        s = (q_b - q_a + 2.0 * (slope_a * a - slope_b * b)) / (2.0 * (slope_a - slope_b))
        s = min(max(s, a), b)
        bound = q_a + 2.0 * slope_a * (s - a)
        if sign * bound > clear + 4.0 * ROUNDING * (away_a + away_b + 2.0 * r):
            return OUTSIDE if sign > 0.0 else INSIDE, s
        # --- Newton's step is better once it is short
        rho, slope, away, f = look(line, s)
        for _ in range(2):
            if sign * f < -(band + ROUNDING):
                return INSIDE if sign > 0.0 else OUTSIDE, s
            if sign * slope < 0.0:
                a, slope_a, away_a, q_a = s, slope, away, f * (away + r)
            else:
                b, slope_b, away_b, q_b = s, slope, away, f * (away + r)
            bend = 1.0 - line.major * line.spread / (rho * rho * rho)
            if not sign * bend > 0.0:
                break
            step = -slope / bend
            if not a < s + step < b:
                break
            s += step
            rho, slope, away, f = look(line, s)
        width = min(b - a, 4.0 * abs(step))
        if abs(slope) * width <= 0.125 * ROUNDING * away or width <= 4.0 * UNIT_ROUNDOFF:
            break
    _, _, _, f = look(line, s)
    if abs(f) < band:
        return NEAR_INSIDE if f <= 0.0 else NEAR_OUTSIDE, s
    return INSIDE if f <= 0.0 else OUTSIDE, s


@inlined
def guess_root(line, s, side):
    """Return where the parabola that q is like at s has its root before (-1) or behind s (1)."""
    rho, slope, away, f = look(line, s)
    bend = 1.0 - line.major * line.spread / (rho * rho * rho)
    if bend == 0.0:
        return s
    square = slope * slope - bend * f * (away + line.minor)
    return s + (side * np.sqrt(max(square, 0.0)) * (1.0 if bend > 0.0 else -1.0) - slope) / bend


@inner
def find_root(line, a, b, sign, s):
    """Return the root of f in [a, b], where sign f runs from above zero to below it; s: a guess."""
    if not a < s < b:
        s = 0.5 * (a + b)
    before = b - a
    for _ in range(MOST_STEPS):
        _, slope, away, f = look(line, s)
        if abs(f) <= SMALL:
            break
        if sign * f > 0.0:
            a = s
        else:
            b = s
        step = 0.5 * (a + b) - s
        if slope != 0.0:
            newton = -0.5 * f * (away + line.minor) / slope
            if a < s + newton < b and abs(newton) <= 0.5 * before:
                step = newton
        s += step
        before = abs(step)
        if before <= UNIT_ROUNDOFF * abs(s):
            break
    return s


@inner
def bound_of_root(line, s, near, moved):
    """Return how far from s the exact root can be: f has left zero before and behind by then.

    ``near``: s is one of two roots that may be none; then both are within the bound. ``moved``: by how
    much rounding has moved the torus.
    """
    _, slope, away, f = look(line, s)
    rounding = ROUNDING + moved
    wrong = abs(f) + rounding
    width = 2.0 * wrong * away / max(abs(slope), 1e-300)
    # Where the ray grazes curvature, not slope, ends the contact.
    width = max(min(width, np.sqrt(8.0 * wrong * away)), 4.0 * UNIT_ROUNDOFF)
    while width < 4.0:
        _, _, _, before = look(line, s - width)
        _, _, _, behind = look(line, s + width)
        if min(abs(before), abs(behind)) > rounding and (near or (before > 0.0) != (behind > 0.0)):
            break
        width *= 2.0
    return width
