"""First hits on surfaces of revolution, each proven to be the first.

In the half-plane of axial position z and distance rho from the axis the ray is the curve
(z(t), rho(t)), of which rho is convex in t, and the surface is its profile (Z(s), R(s)). The two
meet where Z(s) = z(t) and R(s) = rho(t): two equations that stay well behaved for rays along,
across and through the axis alike, where an elimination of t would lose its digits. The ray is
taken in two sheets, before and after the point nearest the axis.

Across the axis the ray is a straight line at distance h from it: rho = hypot(h, w), where w grows
with t and vanishes at the nearest point. h and w are found once for a ray and an object. What
rounding does to them is a shift of the whole ray; after that rho and its rate are right to a few
units of *their own* last place, however near the axis. All pieces and sheets so meet one and the
same ray, and beside a tip or a pole nothing is lost that the ray's own rounding has not lost.
(rho from x(t) and y(t) would be off by the rounding of coordinates, and its rate by that over rho.)

The proof is that of patches: two meetings of a piece of profile with one sheet would make the
determinant R' dz - Z' rho' vanish somewhere on their mean slopes, so where its interval keeps away
from zero there is at most one, and one converged Newton solve in the piece (grown by 15 %) settles
it. Other pieces are halved; they are rejected by their boxes and by a box along their chord.

A decision hangs by less than the TANGENT band where the ray passes within it of a silhouette, of a
rim, or of a circle where the profile bends (a tip is where it meets its mirror image) so that both
sides of it lie on one side of the ray. `finish_revolutions` asks this of hits; what was rejected so
is a doubt. The rounding analysis is in docs/rounding_turned.md.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.solve import (
    MAX_STEPS,
    NORMAL_DEGENERATE,
    TANGENT_BAND,
    UNIT_ROUNDOFF,
)
from hybrid_rt.intersection.kernels.patch.subdivide import (
    APPROACHES,
    BORDER_SLACK,
    CELLS,
    CHANGED,
    CLEAR_CROSSING,
    FLATTEST,
    GIVEN_UP,
    MAX_PIECES,
    MOST_PIECES,
    NEWTONS,
    PIECES,
    SLOW,
    STEPS,
)
from hybrid_rt.intersection.kernels.search.coarse import parameters_at
from hybrid_rt.intersection.kernels.search.frame import CUT_SLACK, begin_of, end_of, enter_frame
from hybrid_rt.intersection.kernels.search.nearest import is_known, offer
from meshing.kernels.jit import hot_kernel, inlined, inner, kernel

GROWTH = 0.15
DEPTH = 128
# The determinant must clear zero by this part of its largest term.
CLEAR = 1e-9
# Both sheets reach beyond the point nearest the axis by this part of the distance there, so that
# a root at that point is on both.
OVERLAP = 2.0**-10
# A step of s times the degree, of which the third power is below rounding.
SMALL_STEP = 6e-6
# A root may be this far outside the range of t of the piece that offers it.
CUT_AIR = 0.25 * CUT_SLACK
# Squares of directions below this are zero: over a few sizes they move nothing.
SMALLEST = 1e-200
# From an origin that `enter_frame` has brought near, all of an object is this near: sqrt 3 + 1.
FARTHEST_BASE = 3.0
# A side of a bend this nearly along the ray is neither before nor behind it.
FLUSH = 1e-14
# This many bands from a tip what counts is the cone there, farther away the curvature at the hit.
BESIDE_TIP = 64.0
# Farther than this (in frame units) from a hit no end of its segment is asked about.
BESIDE_END = 1e-4

# Columns of a ray in the frame of an axis: its height and its way along the direction across the
# axis at t = 0, and how both grow with t; its distance beside the axis, without and with a sign;
# t = 0 itself, in lengths of the direction from the origin; lengths of direction and origin; that
# direction across; half the width in which decisions are TANGENT; rounding of one evaluation.
(
    HEIGHT, RISE, ACROSS, WAY, BESIDE, BASE, LENGTH, AWAY, COSINE, SINE, SIDE, BAND, SLOP,
) = range(13)  # fmt: skip
RAY = 13

# Columns of the end of a segment: what it is, its height and radius, then for each side that the
# profile goes on to: unit tangent (z, r) away from the end, and curvature.
END_KIND, END_Z, END_R, END_TANGENT = range(4)
END = 9
RIM, TIP, BEND = 0.0, 1.0, 2.0

# Columns of a piece: z and r of the piece, then of the grown piece, then Z' and R' of that.
Z0, Z1, R0, R1, GZ0, GZ1, GR0, GR1, DZ0, DZ1, DR0, DR1, S0, S1 = range(14)
PIECE = 14


class RevolutionTable(NamedTuple):
    """Profiles of all objects, each in a frame of its own about a point on its axis."""

    middle: Any  # (k, 3) world, on the axis but for its rounding
    aside: Any  # (k, 3): the point of the axis that is meant, from `middle`, frame axes and units
    to_frame: Any  # (k,) powers of two
    turn: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    size: Any  # (k,): radius of a ball about `middle`, frame units
    roundings: Any  # (k,): of a profile's point, in units of `UNIT_ROUNDOFF`
    first_segment: Any  # (k + 1,) int64
    object_id: Any  # (k,) int32
    control: Any  # (total, 2): (z, r) about the middle, frame units
    start: Any  # (segments,) int64
    degree: Any  # (segments,) int64
    segment_id: Any  # (segments,) int32, number within its object
    outlines: Any  # (segments,) int64: bit 0 at s = 0, bit 1 at s = 1: rims, tips and bends
    end: Any  # (segments, 2, END)
    first_piece: Any  # (segments + 1,) int64
    span: Any  # (segments, 4): z and r of the segment
    whole: Any  # (k, 3): lowest and highest z, largest r of the object
    piece: Any  # (pieces, PIECE)


class RevolutionScratch(NamedTuple):
    """What one thread needs while it traces; contents mean nothing between calls."""

    net: Any  # (w, 2), w - 1 the highest degree
    stack: Any  # (DEPTH, 2)
    piece: Any  # (PIECE,)
    ray: Any  # (RAY,)


@inner
def restrict_profile(control, start, degree, a, b, out):
    """Write the net of the profile between parameters a and b (b > 0) to ``out``."""
    for i in range(degree + 1):
        out[i, 0], out[i, 1] = control[start + i, 0], control[start + i, 1]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            for c in range(2):
                out[i, c] = (1.0 - b) * out[i - 1, c] + b * out[i, c]
    x = a / b
    for level in range(1, degree + 1):
        for i in range(degree - level + 1):
            for c in range(2):
                out[i, c] = (1.0 - x) * out[i, c] + x * out[i + 1, c]


@inner
def profile(control, start, degree, s):
    """Return Z, R, Z', R', Z'', R'' (Bernstein sums, weights built up from both ends)."""
    z = r = dz = dr = ez = er = 0.0
    q = 1.0 - s
    if degree == 3:  # the usual one, written out
        w0, w1, w2, w3 = q * q * q, 3.0 * q * q * s, 3.0 * q * s * s, s * s * s
        d0, d1, d2, e0, e1 = 3.0 * q * q, 6.0 * q * s, 3.0 * s * s, 6.0 * q, 6.0 * s
        a, b, c, d = (
            control[start, 0], control[start + 1, 0], control[start + 2, 0], control[start + 3, 0],
        )  # fmt: skip
        z = w0 * a + w1 * b + w2 * c + w3 * d
        dz = d0 * (b - a) + d1 * (c - b) + d2 * (d - c)
        ez = e0 * ((c - b) - (b - a)) + e1 * ((d - c) - (c - b))
        a, b, c, d = (
            control[start, 1], control[start + 1, 1], control[start + 2, 1], control[start + 3, 1],
        )  # fmt: skip
        r = w0 * a + w1 * b + w2 * c + w3 * d
        dr = d0 * (b - a) + d1 * (c - b) + d2 * (d - c)
        er = e0 * ((c - b) - (b - a)) + e1 * ((d - c) - (c - b))
        return z, r, dz, dr, ez, er
    for i in range(degree + 1):
        w = binomial(degree, i) * power(s, i) * power(q, degree - i)
        z += w * control[start + i, 0]
        r += w * control[start + i, 1]
    for i in range(degree):
        w = degree * binomial(degree - 1, i) * power(s, i) * power(q, degree - 1 - i)
        dz += w * (control[start + i + 1, 0] - control[start + i, 0])
        dr += w * (control[start + i + 1, 1] - control[start + i, 1])
    for i in range(degree - 1):
        w = degree * (degree - 1) * binomial(degree - 2, i)
        w *= power(s, i) * power(q, degree - 2 - i)
        k = start + i
        ez += w * (control[k + 2, 0] - 2.0 * control[k + 1, 0] + control[k, 0])
        er += w * (control[k + 2, 1] - 2.0 * control[k + 1, 1] + control[k, 1])
    return z, r, dz, dr, ez, er


@inner
def binomial(n, k):
    """Binomial coefficients, exact in float64 up to n = 30 and beyond."""
    value = 1.0
    for j in range(min(k, n - k)):
        value = value * (n - j) / (j + 1)
    return value


@inner
def power(x, n):
    """x**n by repeated products."""
    value = 1.0
    for _ in range(n):
        value *= x
    return value


@inner
def measure_piece(control, start, degree, a, b, net, piece):
    """Fill a piece's ranges (see the columns) for s in [a, b].

    They hold whatever root the piece may offer: up to `BORDER_SLACK` beyond its ends.
    """
    piece[S0], piece[S1] = a, b
    for grown in range(2):
        w = (GROWTH if grown == 1 else 2.0 * BORDER_SLACK) * (b - a)
        restrict_profile(control, start, degree, a - w, b + w, net)
        for c in range(2):
            column = (GZ0 if grown == 1 else Z0) + 2 * c
            piece[column], piece[column + 1] = net[0, c], net[0, c]
            for i in range(1, degree + 1):
                piece[column] = min(piece[column], net[i, c])
                piece[column + 1] = max(piece[column + 1], net[i, c])
    scale = degree / ((1.0 + 2.0 * GROWTH) * (b - a))
    for c in range(2):
        column = DZ0 if c == 0 else DR0
        piece[column], piece[column + 1] = np.inf, -np.inf
        for i in range(degree):
            slope = scale * (net[i + 1, c] - net[i, c])
            piece[column] = min(piece[column], slope)
            piece[column + 1] = max(piece[column + 1], slope)


@kernel
def measure_pieces(control, start, degree, first_piece, span, piece):
    """Fill the pieces of all segments, and the segments' own ranges."""
    net = np.empty((degree.max() + 1, 2))
    for k in range(start.shape[0]):
        n = first_piece[k + 1] - first_piece[k]
        span[k, 0] = span[k, 2] = np.inf
        span[k, 1] = span[k, 3] = -np.inf
        for j in range(n):
            p = piece[first_piece[k] + j]
            measure_piece(control, start[k], degree[k], j / n, (j + 1) / n, net, p)
            span[k, 0], span[k, 1] = min(span[k, 0], p[Z0]), max(span[k, 1], p[Z1])
            span[k, 2], span[k, 3] = min(span[k, 2], p[R0]), max(span[k, 3], p[R1])


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
        )
        if is_root or is_last:
            slope = abs(det) / np.sqrt(zs * zs + rs * rs)
            gain = (abs(rate) + abs(dz)) / abs(det)
            return True, s, t, step, slope, gain
        if not -1.0 <= s <= 2.0:
            return False, s, t, step, slope, gain
    return False, s, t, MAX_STEPS, slope, gain


@inner
def approach_profile(control, start, degree, ray, after, s, t):
    """Return the t at which the ray is nearest to the circle of s, from a t close to it."""
    z, r, _, _, _, _ = profile(control, start, degree, s)
    for _ in range(APPROACHES):
        t += toward_circle(z, r, ray, after, t)
    return t


@inner
def toward_circle(z, r, ray, after, t):
    """Return the step of t towards the point of the ray nearest to a circle about the axis."""
    rho, rate = distance(ray, t, after)
    run = ray[RISE] * ray[RISE] + rate * rate
    if run == 0.0:
        return 0.0
    return ((z - (ray[HEIGHT] + t * ray[RISE])) * ray[RISE] + (r - rho) * rate) / run


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
def rounding(degree, size, ray, t):
    """Bound what rounding makes of both equations near a root: see docs/rounding_turned.md.

    Returns
    -------
    noise : of evaluating them for the ray as it is held, the same for every piece
    error : of all: twice the noise, as they are only solved up to that, and that of the ray itself
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
    counts is then the flattest meridian, if the ray points into the cone at all.
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
    return max(turned, rs * abs(ray[RISE]) - zs * ray[ACROSS], 0.125 * slope)


@inner
def offer_meeting(
    i, s, t, slope, gain, noise, error, control, start, degree, end, ray, after, shift, to_world,
    object_id, segment, t_min, known, best,
):  # fmt: skip
    """Offer a converged root if it lies on its segment.

    Returns
    -------
    settled : whether this says all of the root; not so where it is beyond an end and the end far off
    offered : whether it may be a hit
    """
    band = 2.0 * noise * gain + 4.0 * UNIT_ROUNDOFF
    if not -band <= s <= 1.0 + band:
        return True, False
    flat = slope_within(control, start, degree, ray, after, s, t, slope, error)
    # A quarter for the curvature that the slope leaves out.
    t_bound = (1.25 * error / flat + 4.0 * UNIT_ROUNDOFF * abs(t + shift)) * to_world
    if not 0.0 <= s <= 1.0:
        s = min(max(s, 0.0), 1.0)
        near = approach_profile(control, start, degree, ray, after, s, t)
        if not abs(near - t) <= CUT_AIR:
            return False, False
        t_bound += abs(near - t) * to_world
        t = near
        k = 1 if s == 1.0 else 0
        if end[k, END_KIND] == BEND:
            # The exact root may be beyond, on the segment that goes on there.
            rate = distance(ray, t, after)[1]
            other = end[k, END_TANGENT + 3] * rate - end[k, END_TANGENT + 4] * ray[RISE]
            t_bound += 1.25 * error / max(abs(other), FLATTEST * ray[LENGTH]) * to_world
    t_world = (t + shift) * to_world
    if not t_world > t_min[i] or is_known(i, t_world, t_bound, slope, known):
        return True, False
    # Of roots at the same t the one with the lower bound is taken, whichever was found first.
    offer(i, t_world, t_bound, slope, False, object_id, segment, t_bound, s, t_min, known, best)
    return True, True


@inner
def doubt(i, t, shift, to_world, ray, t_min, known, best):
    """Note that something within the TANGENT band of ray i was passed by at t."""
    t = (t + shift) * to_world
    if not (t > t_min[i] and t < best.doubt[i]):
        return
    # A point of departure is in nobody's way, nor is a target.
    near = 4.0 * ray[BAND] / ray[LENGTH] * to_world
    if not is_known(i, t, near, ray[LENGTH], known):
        best.doubt[i] = t


@inner
def pass_end(end, ray, after):
    """Tell whether a ray passes a singular circle within the TANGENT band, and where.

    And so that the circle is an outline: a rim; or the profile goes on to one side only, as seen
    along the ray. A tip goes on as its mirror image. Within the band of grazing a side counts as
    either.

    Returns
    -------
    is_outline : bool
    t : of the ray's point nearest to the circle, on this sheet
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


@inlined
def solve_single(
    i, segment, piece, t0, t1, ray, after, control, start, degree, end, size, shift, to_world,
    object_id, t_min, known, best, counters,
):  # fmt: skip
    """Newton in a piece that a sheet meets at most once in [t0, t1]: offer its root if there is one.

    Returns
    -------
    settled : whether the iteration ended near enough to say what there is
    t : of the root that was offered; else inf
    """
    counters[NEWTONS] += 1
    a, b = piece[S0], piece[S1]
    t = 0.5 * (t0 + t1)
    noise, error = rounding(degree, size, ray, t)
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
        i, s, t, slope, gain, noise, error, control, start, degree, end, ray, after, shift, to_world,
        object_id, segment, t_min, known, best,
    )  # fmt: skip
    return settled, (t if offered else np.inf)


@inlined
def compare_along_chord(net, degree, ray, after, t0, t1):
    """Compare a piece of profile, ``net``, and the ray in [t0, t1] by their distances to its chord.

    Returns
    -------
    apart : width of an empty strip along the chord between them; not positive: there is none
    thick : width of the wider one across the chord; inf where there is no chord, or no end of t
    cz, cr : the chord
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
def solve_piece(
    i, segment, piece, ray, after, t_lo, t_cut, control, start, degree, outlines, end, size, shift,
    to_world, object_id, t_min, known, best, net, stack, scratch, counters,
):  # fmt: skip
    """Settle one piece on one sheet: offer its first root, or know that there is none."""
    band, slop = ray[BAND], ray[SLOP]
    t0, t1 = sheet_interval(piece[Z0], piece[Z1], max(piece[R0], 0.0), piece[R1], ray, after, band)
    if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
        return
    counters[CELLS] += 1
    a, b = piece[S0], piece[S1]
    for k in range(2):
        if outlines & (1 << k) != 0 and (a == 0.0 if k == 0 else b == 1.0):
            is_passed, t = pass_end(end[k], ray, after)
            if is_passed:
                doubt(i, t, shift, to_world, ray, t_min, known, best)
    if at_most_one(piece, ray, after, slop):
        settled, _ = solve_single(
            i, segment, piece, t0, t1, ray, after, control, start, degree, end, size, shift,
            to_world, object_id, t_min, known, best, counters,
        )  # fmt: skip
        if settled:
            return
    # --- halve, nearest first
    counters[SLOW] += 1
    fold = 4.0 * np.sqrt(slop * max(size, slop))
    length = ray[LENGTH]
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
                if extent > 0.5 * band or gap <= 1.25 * band:
                    doubt(i, t, shift, to_world, ray, t_min, known, best)
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
                _, error = rounding(degree, size, ray, near)
                t_bound = 0.5 * reach + 2.0 * error / slope + abs(near - middle) * length
                t_bound = t_bound / length * to_world
                t_world = (near + shift) * to_world
                slope *= length
                if t_world > t_min[i] and not is_known(i, t_world, t_bound, slope, known):
                    offer(
                        i, t_world, t_bound, slope, is_flat, object_id, segment, t_bound, s, t_min,
                        known, best,
                    )  # fmt: skip
                    t_cut = min(t_cut, t0)
                continue
            if is_flat:
                doubt(i, middle, shift, to_world, ray, t_min, known, best)
                continue
        if t0 > -np.inf and t1 < np.inf and at_most_one(scratch, ray, after, slop):
            settled, t = solve_single(
                i, segment, scratch, t0, t1, ray, after, control, start, degree, end, size, shift,
                to_world, object_id, t_min, known, best, counters,
            )  # fmt: skip
            if settled:
                t_cut = min(t_cut, t + CUT_SLACK * (1.0 + abs(t)))
                continue
        if top + 2 > DEPTH - 1 or pieces >= MAX_PIECES:
            counters[GIVEN_UP] += 1
            best.doubt[i] = min(best.doubt[i], (t0 + shift) * to_world)
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


@inlined
def enter_axis_frame(
    k, ox, oy, oz, dx, dy, dz, middle, to_frame, turn, aside, size, roundings, ray
):
    """Fill ``ray`` for one object; return by how much t was advanced, in frame units.

    Its t begins where it is nearest to the axis, unless that is beyond everything.
    """
    hx, hy, hz, lx, ly, lz, shift = enter_frame(
        ox, oy, oz, dx, dy, dz, middle[k, 0], middle[k, 1], middle[k, 2], to_frame
    )
    e = turn[k]
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
    ray[SLOP] = roundings * UNIT_ROUNDOFF * max(size, away)
    return shift + base


@inlined
def solve_segment(
    i, seg, object_id, done, is_guess, ray, t_lo, z_low, z_high, size, to_frame, shift, table,
    t_min, known, best, work, counters,
):  # fmt: skip
    """Settle the pieces of one segment: only piece ``done`` where it is the guess, else the others.

    ``z_low`` to ``z_high``: where the ray is near the object, see `height_range`.
    """
    span, piece, first_piece = table.span, table.piece, table.first_piece
    nearest = ray[BESIDE] - ray[BAND]
    for sheet in range(2):
        after = sheet == 1
        t0, t1 = sheet_interval(
            span[seg, 0], span[seg, 1], max(span[seg, 2], 0.0), span[seg, 3], ray, after, ray[BAND]
        )
        t_cut = end_of(best.t[i], to_frame, shift)
        if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
            continue
        for p in range(first_piece[seg], first_piece[seg + 1]):
            if (p == done) != is_guess:
                continue
            if piece[p, Z0] > z_high or piece[p, Z1] < z_low or piece[p, R1] < nearest:
                continue
            solve_piece(
                i, seg, piece[p], ray, after, t_lo, t_cut, table.control, table.start[seg],
                table.degree[seg], table.outlines[seg], table.end[seg], size, shift,
                1.0 / to_frame, object_id, t_min, known, best, work.net, work.stack, work.piece,
                counters,
            )  # fmt: skip
            t_cut = end_of(best.t[i], to_frame, shift)


@hot_kernel
def trace_revolutions(table, rays, guess, best, any_hit, work, counters):
    """Lower ``best`` to the first hits; ``guess`` names a piece to begin with, -1 for none."""
    origin, direction, t_min, known = rays.origin, rays.direction, rays.t_min, rays.known
    middle, axes, to_frames, sizes = table.middle, table.turn, table.to_frame, table.size
    first_segment, first_piece, span = table.first_segment, table.first_piece, table.span
    whole, object_id, ray = table.whole, table.object_id, work.ray
    aside, roundings = table.aside, table.roundings
    for i in range(origin.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        done = -1
        t_guess = best.t[i]
        for turn in range(2):
            is_guess = turn == 0
            if is_guess:
                if guess.shape[0] == 0 or guess[i] < 0:
                    continue
                done = guess[i]
            for k in range(object_id.shape[0]):
                first, last = first_segment[k], first_segment[k + 1]
                if is_guess and not (first_piece[first] <= done < first_piece[last]):
                    continue
                to_frame, size = to_frames[k], sizes[k]
                shift = enter_axis_frame(
                    k,
                    ox,
                    oy,
                    oz,
                    dx,
                    dy,
                    dz,
                    middle,
                    to_frame,
                    axes,
                    aside,
                    size,
                    roundings[k],
                    ray,
                )
                t_lo = begin_of(t_min[i], to_frame, shift)
                t_cut = end_of(best.t[i], to_frame, shift)
                z_low, z_high = height_range(
                    whole[k, 0], whole[k, 1], whole[k, 2], ray, t_lo, t_cut, ray[BAND]
                )
                if z_low > z_high:
                    continue
                nearest = ray[BESIDE] - ray[BAND]
                for seg in range(first, last):
                    if is_guess and not (first_piece[seg] <= done < first_piece[seg + 1]):
                        continue
                    if span[seg, 0] > z_high or span[seg, 1] < z_low or span[seg, 3] < nearest:
                        continue
                    solve_segment(
                        i, seg, object_id[k], done, is_guess, ray, t_lo, z_low, z_high, size,
                        to_frame, shift, table, t_min, known, best, work, counters,
                    )  # fmt: skip
                    if any_hit and best.object_id[i] >= 0:
                        break
                if any_hit and best.object_id[i] >= 0:
                    break
            if is_guess:
                t_guess = best.t[i]
                if any_hit and best.object_id[i] >= 0:
                    break
        if guess.shape[0] > 0 and best.t[i] < t_guess:
            counters[CHANGED] += 1


@hot_kernel
def guess_pieces(hits, triangles, row_of, table, guess):
    """Turn coarse hits into pieces (-1: no hit, or on no surface of revolution)."""
    for i in range(hits.face.shape[0]):
        f = hits.face[i]
        guess[i] = -1
        if f < 0 or row_of[triangles.object_id[f]] < 0:
            continue
        k = row_of[triangles.object_id[f]]
        for seg in range(table.first_segment[k], table.first_segment[k + 1]):
            if table.segment_id[seg] == triangles.piece[f]:
                _, s = parameters_at(triangles, f, hits.u[i], hits.v[i])
                n = table.first_piece[seg + 1] - table.first_piece[seg]
                guess[i] = table.first_piece[seg] + min(max(int(s * n), 0), n - 1)


@hot_kernel
def refine_revolutions(table, hits, triangles, row_of, rows, rays, best, ray, accepted):
    """Newton from coarse hits, with no proof of anything (accuracy "refined")."""
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        k = row_of[triangles.object_id[f]]
        if k < 0:
            continue
        o, d = rays.origin[i], rays.direction[i]
        shift = enter_axis_frame(
            k, o[0], o[1], o[2], d[0], d[1], d[2], table.middle, table.to_frame[k], table.turn,
            table.aside, table.size[k], table.roundings[k], ray,
        )  # fmt: skip
        for seg in range(table.first_segment[k], table.first_segment[k + 1]):
            if table.segment_id[seg] != triangles.piece[f]:
                continue
            _, s = parameters_at(triangles, f, hits.u[j], hits.v[j])
            begin = hits.t[j] * table.to_frame[k] - shift
            degree = table.degree[seg]
            noise, error = rounding(degree, table.size[k], ray, begin)
            after = ray[WAY] + begin * ray[ACROSS] >= 0.0
            ok, s, root, _, slope, gain = meet(
                table.control, table.start[seg], degree, ray, after, s, begin, noise
            )
            if ok and offer_meeting(
                i, s, root, slope, gain, noise, error, table.control, table.start[seg], degree,
                table.end[seg], ray, after, shift, 1.0 / table.to_frame[k], table.object_id[k], seg,
                rays.t_min, rays.known, best,
            )[1]:  # fmt: skip
                accepted[j] = True


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
        if abs(z - end[k, END_Z]) + abs(r - end[k, END_R]) > BESIDE_END * size + 4.0 * band:
            continue
        is_passed, near = pass_end(end[k], ray, ray[WAY] + t * ray[ACROSS] >= 0.0)
        if is_passed and abs(near - t) * max(slope, FLATTEST) <= 8.0 * band:
            return True
    return False


@hot_kernel
def finish_revolutions(table, rays, best, row_of, ray, out):
    """Describe the hits on surfaces of revolution; ``row_of`` (objects,): row here, or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k, seg, s = row_of[best.object_id[i]], best.primitive[i], best.b[i]
        to_frame, e = table.to_frame[k], table.turn[k]
        control, start, degree = table.control, table.start[seg], table.degree[seg]
        o, d = rays.origin[i], rays.direction[i]
        shift = enter_axis_frame(
            k, o[0], o[1], o[2], d[0], d[1], d[2], table.middle, to_frame, table.turn,
            table.aside, table.size[k], table.roundings[k], ray,
        )  # fmt: skip
        t = best.t[i] * to_frame - shift
        z, r, zs, rs, zz, rr = profile(control, start, degree, s)
        w, side = ray[WAY] + t * ray[ACROSS], ray[SIDE]
        rho, rate = distance(ray, t, w >= 0.0)
        ex, ey = 1.0, 0.0
        if rho > 0.0:
            ex = (w * ray[COSINE] - side * ray[SINE]) / rho
            ey = (w * ray[SINE] + side * ray[COSINE]) / rho
        if zs * zs + rs * rs <= 1e-28 * table.size[k] * table.size[k]:
            # A resting point of the profile: its direction a little further in.
            inside = s * (1.0 - 2e-6) + 1e-6
            _, _, zs, rs, _, _ = profile(control, start, degree, inside)
            out.flags[i] = NORMAL_DEGENERATE
        speed = np.hypot(zs, rs)
        zs, rs = zs / speed, rs / speed
        nr, nz = zs, -rs
        bend = nr * bend_of_ray(ray, rho)
        bend -= (zs * rr - rs * zz) / (speed * speed) * (zs * ray[RISE] + rs * rate) ** 2
        if is_outline(table.end[seg], table.size[k], ray, z, r, t, nr, nz, bend):
            best.tangent[i] = 1
        if r <= 4.0 * UNIT_ROUNDOFF * table.size[k]:
            # On the axis: the normal of a tip is the axis; a smooth pole has no other.
            if abs(zs) > 1e-6:
                out.flags[i] = NORMAL_DEGENERATE
            if rs != 0.0:
                nr, nz = 0.0, (-1.0 if rs > 0.0 else 1.0)
        px, py = max(r, 0.0) * ex, max(r, 0.0) * ey
        gap = np.sqrt((max(r, 0.0) - rho) ** 2 + (z - ray[HEIGHT] - t * ray[RISE]) ** 2)
        px, py, z = px + table.aside[k, 0], py + table.aside[k, 1], z + table.aside[k, 2]
        for c in range(3):
            local = px * e[0, c] + py * e[1, c] + z * e[2, c]
            out.position[i, c] = table.middle[k, c] + local / to_frame
            out.normal[i, c] = nr * (ex * e[0, c] + ey * e[1, c]) + nz * e[2, c]
        turn = np.arctan2(ey, ex) / (2.0 * np.pi)
        turn -= np.floor(turn)
        out.u[i], out.v[i] = (turn if turn < 1.0 else 0.0), s
        out.patch_id[i] = table.segment_id[seg]
        out.residual[i] = gap / to_frame
