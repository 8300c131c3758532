"""A ray in the frame of an asphere: how far it is above the sag, where, and what loops leave of that.

Extremum and roots of g, how far off a root can be, passages of the rim; roots on trimmed aspheres.
"""

from typing import NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.axial_trims import LONG, side_about_axis, touches_kept
from hybrid_rt.intersection.kernels.search.frame import share_of_turn
from hybrid_rt.intersection.kernels.search.nearest import doubt
from hybrid_rt.intersection.kernels.search.tolerances import APPROACHES, UNIT_ROUNDOFF
from meshing.kernels.jit import inlined, inner

# Steps toward an extremum or a root: Newton needs five, grazing rays more.
MOST_STEPS = 60
# g does not get nearer to zero than a few roundings of its own.
SMALL = 4.0 * UNIT_ROUNDOFF
# Beyond the rim the root goes on until this is left under it.
LEAST_UNDER_ROOT = 2.0**-12


class Line(NamedTuple):
    """A ray in the frame of an asphere: x + s v, |v| = 1; and the conic that it meets."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    across: float  # vx^2 + vy^2
    turn: float  # x vx + y vy
    curvature: float
    under_root: float


@inner
def look(line, coefficient, k, s):
    """Return g, g', g'' and F at s; ``coefficient`` is that of `AsphereTable`."""
    x, y = line.x + s * line.vx, line.y + s * line.vy
    w = x * x + y * y
    root = np.sqrt(max(1.0 - line.under_root * w, LEAST_UNDER_ROOT))
    rate = 0.5 * line.curvature / root
    bend = 0.5 * rate * line.under_root / (root * root)
    a = b = e = 0.0
    q = w - coefficient[k, 0]
    for j in range(coefficient.shape[1] - 1, 1, -1):
        e = e * q + b
        b = b * q + a
        a = a * q + coefficient[k, j]
    sag = line.curvature * w / (1.0 + root) + (coefficient[k, 1] + a * q)
    rate += a + b * q
    bend += 2.0 * (b + e * q)
    turn = 2.0 * (x * line.vx + y * line.vy)
    g = (line.z + s * line.vz) - sag
    return g, line.vz - rate * turn, -(bend * turn * turn + 2.0 * rate * line.across), rate


@inlined
def gradient(line, s, rate):
    """Return the length of the gradient of z - sag(w), where dsag / dw is ``rate``."""
    x, y = line.x + s * line.vx, line.y + s * line.vy
    return np.sqrt(1.0 + 4.0 * (x * x + y * y) * rate * rate)


@inner
def find_extremum(line, coefficient, k, a, b, sign, clear):
    """Return where g, of which sign g is convex with its minimum in [a, b], has its extremum.

    The search ends early where sign g is below -clear, or its tangents show that it stays above it.
    """
    ga, slope_a, _, _ = look(line, coefficient, k, a)
    gb, slope_b, _, _ = look(line, coefficient, k, b)
    s = 0.5 * (a + b)
    for _ in range(MOST_STEPS):
        # --- where both tangents meet: below their value there sign g does not go
        if slope_a != slope_b:
            s = (gb - ga + slope_a * a - slope_b * b) / (slope_a - slope_b)
        if not a < s < b:
            s = 0.5 * (a + b)
        elif sign * (ga + slope_a * (s - a)) > clear:
            return s
        # --- Newton's step is better once it is short
        step = b - a
        for _ in range(2):
            g, slope, bend, _ = look(line, coefficient, k, s)
            if sign * g < -clear:
                return s
            if sign * slope < 0.0:
                a, ga, slope_a = s, g, slope
            else:
                b, gb, slope_b = s, g, slope
            if not sign * bend > 0.0:
                break
            step = -slope / bend
            if abs(slope * step) <= SMALL or not a < s + step < b:
                break
            s += step
        if abs(slope) * min(b - a, 4.0 * abs(step)) <= SMALL or b - a <= 4.0 * UNIT_ROUNDOFF:
            break
    return s


@inner
def find_root(line, coefficient, k, a, b, ga, gb):
    """Return the root of g in [a, b], at whose ends it has different signs."""
    s = a - ga * (b - a) / (gb - ga)
    if not a < s < b:
        s = 0.5 * (a + b)
    before = b - a
    for _ in range(MOST_STEPS):
        g, slope, _, rate = look(line, coefficient, k, s)
        if abs(g) <= SMALL * gradient(line, s, rate):
            break
        if (g > 0.0) == (ga > 0.0):
            a = s
        else:
            b = s
        step = 0.5 * (a + b) - s
        if slope != 0.0:
            newton = -g / slope
            if a < s + newton < b and abs(newton) <= 0.5 * before:
                step = newton
        s += step
        before = abs(step)
        if before <= UNIT_ROUNDOFF * abs(s):
            break
    return s


@inner
def bound_of_root(line, coefficient, k, s, noise, bend, near):
    """Return how far from s the exact root can be: g has left zero before and behind by then.

    ``near``: s is one of two roots that may be none; then both are within the bound.
    """
    g, slope, _, rate = look(line, coefficient, k, s)
    wrong = noise * gradient(line, s, rate)
    steep = abs(slope)
    # Over so short a way the slope does not change by more than a fifth.
    if steep * steep >= 4.0 * bend * (wrong + abs(g)) and not near:
        return 1.25 * (wrong + abs(g)) / steep
    width = 2.0 * (wrong + abs(g)) / max(steep, 1e-300)
    # Where the ray grazes curvature, not slope, ends the contact.
    width = max(min(width, np.sqrt(8.0 * wrong / max(bend, 1e-300))), 4.0 * UNIT_ROUNDOFF)
    while width < 4.0:
        before, _, _, _ = look(line, coefficient, k, s - width)
        behind, _, _, _ = look(line, coefficient, k, s + width)
        if min(abs(before), abs(behind)) > wrong and (near or (before > 0.0) != (behind > 0.0)):
            break
        width *= 2.0
    return width


@inner
def is_grazing(line, coefficient, k, s, band, bend):
    """Tell whether a shift of the ray by the band may take the root at s away.

    It may not where g goes beyond what the band can change on both sides of s.
    """
    _, slope, _, rate = look(line, coefficient, k, s)
    clear, steep = band * gradient(line, s, rate), abs(slope)
    if steep * steep >= 4.0 * bend * clear:
        return False
    # On a parabola g is largest in front of its other root; there it holds out this far just so.
    width = 2.0 * clear / max(steep, 1e-300)
    before, _, _, _ = look(line, coefficient, k, s - width)
    behind, _, _, _ = look(line, coefficient, k, s + width)
    return not (min(abs(before), abs(behind)) >= clear and (before > 0.0) != (behind > 0.0))


@inner
def pass_rim(line, radius, height, s, band):
    """Return the s next to one at which the ray passes the rim within the band; inf: it does not."""
    for _ in range(APPROACHES):
        x, y = line.x + s * line.vx, line.y + s * line.vy
        rho = np.sqrt(x * x + y * y)
        if rho == 0.0:
            return np.inf
        up, out, rate = (
            line.z + s * line.vz - height,
            rho - radius,
            (x * line.vx + y * line.vy) / rho,
        )
        if up * up + out * out <= band * band:
            return s
        s -= (up * line.vz + out * rate) / max(line.vz * line.vz + rate * rate, 1e-300)
    x, y = line.x + s * line.vx, line.y + s * line.vy
    up, out = line.z + s * line.vz - height, np.sqrt(x * x + y * y) - radius
    return s if up * up + out * out <= band * band else np.inf


@inlined
def side_of_root(trim, k, line, s, table, band):
    """Decide about a root at s on asphere k, see `side_about_axis`; return its u and v as well."""
    if trim is None:
        return True, False, 0.0, 0.0, 0.0
    x, y = line.x + s * line.vx, line.y + s * line.vy
    rho, rim = np.sqrt(x * x + y * y), table.rim[k, 0]
    rate = look(line, table.coefficient, k, s)[3]
    u, v, out = share_of_turn(y, x), min(rho / rim, 1.0), rim
    if table.orientation[k] < 0.0:
        v, out = 1.0 - v, -rim
    is_hit, is_within, edge = side_about_axis(
        trim, k, x, y, u, v, out, 2.0 * rho * rate * out, line.vx, line.vy, line.vz, band
    )
    return is_hit, is_within, edge, u, v


@inner
def grazes_kept(trim, k, line, s, table, band):
    """Tell whether the asphere where a ray grazes it, or its rim, around s may be inside the loops."""
    if trim is None:
        return True
    x, y, rim = line.x + s * line.vx, line.y + s * line.vy, table.rim[k, 0]
    v = min(np.sqrt(x * x + y * y) / rim, 1.0)
    if table.orientation[k] < 0.0:
        v = 1.0 - v
    return touches_kept(trim, k, x, y, v, rim, LONG * np.sqrt(band))


@inner
def doubt_kept(i, k, line, s, t, band, table, rays, best):
    """Note that the asphere passes within the band of ray i at s, if it may be inside the loops there."""
    if grazes_kept(table.trim, k, line, s, table, band):
        doubt(i, t, band / table.to_frame[k], rays.t_min, rays.known, best)
