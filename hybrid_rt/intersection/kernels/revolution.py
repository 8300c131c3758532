"""First hits on surfaces of revolution, each proven to be the first.

In the half-plane of axial position z and distance rho from the axis the ray is the curve
(z(t), rho(t)), of which rho is convex in t, and the surface is its profile (Z(s), R(s)). The two
meet where Z(s) = z(t) and R(s) = rho(t): two equations that stay well behaved for rays along,
across and through the axis alike, where an elimination of t would lose its digits. The ray is
taken in two sheets, before and after the point nearest the axis.

The proof is that of patches: two meetings of a piece of profile with one sheet would make the
determinant R' dz - Z' rho' vanish somewhere on their mean slopes, so where its interval keeps away
from zero there is at most one, and one converged Newton solve in the piece (grown by 15 %) settles
it. Other pieces are halved; they are rejected by their boxes and by a box along their chord.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.solve import (
    GRAZING,
    LAST_STEP,
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
from hybrid_rt.intersection.kernels.search.frame import begin_of, end_of, enter_frame
from hybrid_rt.intersection.kernels.search.nearest import is_known, offer
from meshing.kernels.jit import hot_kernel, inlined, inner, kernel

GROWTH = 0.15
DEPTH = 128
# The determinant must clear zero by this part of its largest term.
CLEAR = 1e-9

# Columns of a piece: z and r of the piece, then of the grown piece, then Z' and R' of that.
Z0, Z1, R0, R1, GZ0, GZ1, GR0, GR1, DZ0, DZ1, DR0, DR1, S0, S1 = range(14)
PIECE = 14


class RevolutionTable(NamedTuple):
    """Profiles of all objects, each in a frame of its own about a point on its axis."""

    middle: Any  # (k, 3) world, on the axis
    to_frame: Any  # (k,) powers of two
    turn: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    size: Any  # (k,): radius of a ball about `middle`, frame units
    first_segment: Any  # (k + 1,) int64
    object_id: Any  # (k,) int32
    control: Any  # (total, 2): (z, r) about the middle, frame units
    start: Any  # (segments,) int64
    degree: Any  # (segments,) int64
    segment_id: Any  # (segments,) int32, number within its object
    open_ends: Any  # (segments,) int64: bit 0 at s = 0, bit 1 at s = 1
    first_piece: Any  # (segments + 1,) int64
    span: Any  # (segments, 4): z and r of the segment
    whole: Any  # (k, 3): lowest and highest z, largest r of the object
    piece: Any  # (pieces, PIECE)


class RevolutionScratch(NamedTuple):
    """What one thread needs while it traces; contents mean nothing between calls."""

    net: Any  # (w, 2), w - 1 the highest degree
    stack: Any  # (DEPTH, 2)
    piece: Any  # (PIECE,)
    ray: Any  # (9,)


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
    """Fill a piece's ranges (see the columns) for s in [a, b]."""
    piece[S0], piece[S1] = a, b
    for grown in range(2):
        w = GROWTH * (b - a) * grown
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
def sheet_interval(z0, z1, r0, r1, ray, after, slop):
    """Where z(t) is in [z0, z1] and rho(t) in [r0, r1] on one sheet; empty: t0 > t1.

    ``ray`` is (x, y, z, dx, dy, dz, |d across|, t nearest the axis, distance there).
    """
    pz, dz, across, t_axis, h = ray[2], ray[5], ray[6], ray[7], ray[8]
    t0, t1 = -np.inf, np.inf
    if dz == 0.0:
        if pz < z0 - slop or pz > z1 + slop:
            return 1.0, 0.0
    else:
        a, b = (z0 - slop - pz) / dz, (z1 + slop - pz) / dz
        t0, t1 = min(a, b), max(a, b)
    if h > r1 + slop:
        return 1.0, 0.0
    if across == 0.0:
        if h < r0 - slop or not after:
            return 1.0, 0.0
        return t0, t1
    far = np.sqrt((r1 + slop - h) * (r1 + slop + h)) / across
    near = 0.0
    if r0 - slop > h:
        near = np.sqrt((r0 - slop - h) * (r0 - slop + h)) / across
    air = slop / across
    if after:
        return max(t0, t_axis + near - air), min(t1, t_axis + far + air)
    return max(t0, t_axis - far - air), min(t1, t_axis - near + air)


@inner
def height_range(z0, z1, r1, ray, t_lo, t_hi, slop):
    """Return the range of z in which the ray is within a cylinder; where it never is: low > high."""
    dz, across, t_axis, h = ray[5], ray[6], ray[7], ray[8]
    if h > r1 + slop:
        return 1.0, 0.0
    if across > 0.0:
        far = (np.sqrt((r1 + slop - h) * (r1 + slop + h)) + slop) / across
        t_lo, t_hi = max(t_lo, t_axis - far), min(t_hi, t_axis + far)
    if t_lo > t_hi:
        return 1.0, 0.0
    low, high = z0, z1
    if dz != 0.0:
        a, b = ray[2] + t_lo * dz, ray[2] + t_hi * dz
        low, high = max(low, min(a, b)), min(high, max(a, b))
    elif ray[2] < z0 - slop or ray[2] > z1 + slop:
        return 1.0, 0.0
    else:
        low = high = ray[2]
    # One product and one sum more than `sheet_interval`, of numbers up to z1 and |o|.
    return low - 2.0 * slop, high + 2.0 * slop


@inner
def distance(ray, t, after):
    """rho(t) and its derivative, evaluated at the point itself; at the axis by the sheet."""
    x, y = ray[0] + t * ray[3], ray[1] + t * ray[4]
    rho = np.hypot(x, y)
    if rho == 0.0:
        return 0.0, (ray[6] if after else -ray[6])
    return rho, (x * ray[3] + y * ray[4]) / rho


@inner
def at_most_one(piece, ray, after, slop):
    """Tell whether the grown piece meets this sheet of the ray at most once."""
    t0, t1 = sheet_interval(
        piece[GZ0], piece[GZ1], max(piece[GR0], 0.0), piece[GR1], ray, after, slop
    )
    if not t0 <= t1:
        return True
    lo = -ray[6] if t0 == -np.inf else distance(ray, t0, after)[1]
    hi = ray[6] if t1 == np.inf else distance(ray, t1, after)[1]
    lo, hi = max(lo, 0.0 if after else -ray[6]), min(hi, ray[6] if after else 0.0)
    if lo > hi:
        lo, hi = min(lo, hi), max(lo, hi)
    a, b = piece[DZ0] * lo, piece[DZ0] * hi
    c, d = piece[DZ1] * lo, piece[DZ1] * hi
    e, f = piece[DR0] * ray[5], piece[DR1] * ray[5]
    low = min(e, f) - max(a, b, c, d)
    high = max(e, f) - min(a, b, c, d)
    clear = CLEAR * max(abs(a), abs(b), abs(c), abs(d), abs(e), abs(f))
    return low > clear or high < -clear


@inner
def meet(control, start, degree, ray, after, s, t, side, error):
    """Newton for Z(s) = z(t), R(s) = rho(t): ok, s, t, steps, |n.d|, gain of s."""
    slope = gain = 0.0
    for step in range(1, MAX_STEPS + 1):
        z, r, zs, rs, _, _ = profile(control, start, degree, s)
        rho, rho_t = distance(ray, t, after)
        f, g = z - (ray[2] + t * ray[5]), r - rho
        det = rs * ray[5] - zs * rho_t
        if det == 0.0:
            return False, s, t, step, slope, gain
        ds = (f * rho_t - g * ray[5]) / det
        dt = (rs * f - zs * g) / det
        gain = (abs(rho_t) + abs(ray[5])) / abs(det)
        # Nearly in the tangent plane rounding becomes a long step, which would leave the surface.
        is_root = abs(f) + abs(g) <= error
        if not is_root:
            s += ds
            t += dt
        # Across the axis s hardly moves while t does, and along a disc the other way round.
        speed = abs(zs) + abs(rs)
        if is_root or (abs(ds) <= LAST_STEP * side and abs(dt) <= LAST_STEP * side * speed):
            slope = abs(det) / np.sqrt(zs * zs + rs * rs)
            return True, s, t, step, slope, gain
        if not -1.0 <= s <= 2.0:
            return False, s, t, step, slope, gain
    return False, s, t, MAX_STEPS, slope, gain


@inner
def approach_profile(control, start, degree, ray, after, s, t):
    """Return the t at which the ray is nearest to the circle of s, from a t close to it."""
    z, r, _, _, _, _ = profile(control, start, degree, s)
    for _ in range(APPROACHES):
        rho, rho_t = distance(ray, t, after)
        run = ray[5] * ray[5] + rho_t * rho_t
        if run == 0.0:
            break
        t += ((z - (ray[2] + t * ray[5])) * ray[5] + (r - rho) * rho_t) / run
    return t


@inner
def approach_ray(control, start, degree, ray, after, a, b, t0, t1):
    """Return s in [a, b] and t where a piece of profile and the ray in [t0, t1] are nearest."""
    s, t = 0.5 * (a + b), 0.5 * (t0 + t1)
    for _ in range(APPROACHES):
        t = min(max(approach_profile(control, start, degree, ray, after, s, t), t0), t1)
        z, r, zs, rs, _, _ = profile(control, start, degree, s)
        run = zs * zs + rs * rs
        if run > 0.0:
            rho, _ = distance(ray, t, after)
            s += ((ray[2] + t * ray[5] - z) * zs + (rho - r) * rs) / run
            s = min(max(s, a), b)
    return s, approach_profile(control, start, degree, ray, after, s, t)


@inner
def offer_meeting(
    i, s, t, slope, gain, error, scale, ends, control, start, degree, ray, after, shift, to_world,
    object_id, segment, t_min, known, best,
):  # fmt: skip
    """Offer a converged root if it lies on its segment; tell whether it may be a hit."""
    band = error * gain + 4.0 * UNIT_ROUNDOFF
    t_world = (t + shift) * to_world
    t_bound = (2.0 * error / slope + 4.0 * UNIT_ROUNDOFF * abs(t + shift)) * to_world
    near = max(band, TANGENT_BAND * scale * gain)
    tangent = ((ends & 1) != 0 and abs(s) <= near) or ((ends & 2) != 0 and abs(1.0 - s) <= near)
    if not -band <= s <= 1.0 + band:
        if tangent and t_world > t_min[i]:
            best.doubt[i] = min(best.doubt[i], t_world)
        return False
    if not t_world > t_min[i] or is_known(i, t_world, t_bound, slope, known):
        return False
    if not 0.0 <= s <= 1.0:
        s = min(max(s, 0.0), 1.0)
        t = approach_profile(control, start, degree, ray, after, s, t)
        t_world = (t + shift) * to_world
    offer(i, t_world, t_bound, slope, tangent, object_id, segment, 0.0, s, t_min, known, best)
    return True


@inner
def rounding(degree, size, ray, t):
    """Bound the rounding of both equations near a root, and the scale of the TANGENT band."""
    away = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
    along = abs(t) * np.sqrt(ray[3] * ray[3] + ray[4] * ray[4] + ray[5] * ray[5])
    # Bernstein sums 3 n + 6; turning the ray into the frame 5 for o and for t d; hypot 2.
    return UNIT_ROUNDOFF * ((3.0 * degree + 8.0) * size + 8.0 * (away + along)), max(
        away, 2.0 * size
    )


@inlined
def solve_single(
    i, segment, a, b, t0, t1, ray, after, control, start, degree, ends, size, shift,
    to_world, object_id, t_min, known, best, slop, counters,
):  # fmt: skip
    """Newton in a piece [a, b] that a sheet meets at most once: offer its root if there is one.

    Returns
    -------
    settled : whether the iteration ended near enough to say what there is
    t : of the root that was offered; else inf
    """
    counters[NEWTONS] += 1
    t = 0.5 * (t0 + t1)
    error, scale = rounding(degree, size, ray, t)
    ok, s, t, steps, slope, gain = meet(
        control, start, degree, ray, after, 0.5 * (a + b), t, b - a, error
    )
    counters[STEPS] += steps
    on_sheet = (t >= ray[7]) == after or abs(t - ray[7]) * ray[6] <= slop
    if not (ok and on_sheet and a - GROWTH * (b - a) <= s <= b + GROWTH * (b - a)):
        return False, np.inf
    slack = BORDER_SLACK * (b - a) + error * gain
    if a - slack <= s <= b + slack and offer_meeting(
        i, s, t, slope, gain, error, scale, ends, control, start, degree, ray, after,
        shift, to_world, object_id, segment, t_min, known, best,
    ):  # fmt: skip
        return True, t
    return True, np.inf


@inlined
def compare_along_chord(net, degree, ray, after, t0, t1, slop):
    """Compare a piece of profile, ``net``, and the ray in [t0, t1] by their distances to its chord.

    Returns
    -------
    is_apart : whether they lie on either side of a line along the chord
    thick : width of the wider one across the chord; inf where there is no chord, or no end of t
    cz, cr : the chord
    """
    cz, cr = net[degree, 0] - net[0, 0], net[degree, 1] - net[0, 1]
    chord = np.hypot(cz, cr)
    if not (chord > 0.0 and t0 > -np.inf and t1 < np.inf):
        return False, np.inf, cz, cr
    mz, mr = -cr / chord, cz / chord
    n0 = n1 = 0.0
    for k in range(1, degree):
        d = mz * (net[k, 0] - net[0, 0]) + mr * (net[k, 1] - net[0, 1])
        n0, n1 = min(n0, d), max(n1, d)
    rho0, rate0 = distance(ray, t0, after)
    rho1, rate1 = distance(ray, t1, after)
    g0 = mz * (ray[2] + t0 * ray[5] - net[0, 0]) + mr * (rho0 - net[0, 1])
    g1 = mz * (ray[2] + t1 * ray[5] - net[0, 0]) + mr * (rho1 - net[0, 1])
    rate0, rate1 = mz * ray[5] + mr * rate0, mz * ray[5] + mr * rate1
    low, high = min(g0, g1), max(g0, g1)
    # Between the ends the ray bends by no more than its end tangents say.
    turn = rate1 - rate0
    if rate0 * rate1 < 0.0 and turn != 0.0:
        bend = (g0 * rate1 - g1 * rate0 + rate0 * rate1 * (t1 - t0)) / turn
        low, high = min(low, bend), max(high, bend)
    return low > n1 + slop or high < n0 - slop, max(n1 - n0, high - low), cz, cr


@inlined
def sine_of_crossing(control, start, degree, ray, after, s, t):
    """Return |n.d| of the surface at s and the ray at t."""
    zs, rs = profile(control, start, degree, s)[2:4]
    if zs == 0.0 and rs == 0.0:
        # A resting point of the profile: its direction a little further in.
        zs, rs = profile(control, start, degree, s * (1.0 - 2e-6) + 1e-6)[2:4]
    rate = distance(ray, t, after)[1]
    return abs(rs * ray[5] - zs * rate) / max(np.hypot(zs, rs), 1e-300)


@inlined
def solve_piece(
    i, segment, piece, ray, after, t_lo, t_cut, control, start, degree, ends, size, shift,
    to_world, object_id, t_min, known, best, slop, net, stack, scratch, counters,
):  # fmt: skip
    """Settle one piece on one sheet: offer its first root, or know that there is none."""
    t0, t1 = sheet_interval(piece[Z0], piece[Z1], max(piece[R0], 0.0), piece[R1], ray, after, slop)
    if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
        return
    counters[CELLS] += 1
    a, b = piece[S0], piece[S1]
    if at_most_one(piece, ray, after, slop):
        settled, _ = solve_single(
            i, segment, a, b, t0, t1, ray, after, control, start, degree, ends, size, shift,
            to_world, object_id, t_min, known, best, slop, counters,
        )  # fmt: skip
        if settled:
            return
    # --- halve, nearest first
    counters[SLOW] += 1
    fold = 4.0 * np.sqrt(slop * max(size, slop))
    length = np.sqrt(ray[3] * ray[3] + ray[4] * ray[4] + ray[5] * ray[5])
    stack[0, 0], stack[0, 1] = a, b
    top, pieces = 1, 0
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        pieces += 1
        measure_piece(control, start, degree, a, b, net, scratch)
        t0, t1 = sheet_interval(
            scratch[Z0], scratch[Z1], max(scratch[R0], 0.0), scratch[R1], ray, after, slop
        )
        if not t0 <= t1 or t1 < t_lo or t0 > t_cut:
            continue
        # --- the strip along the chord: profile and ray on either side of it?
        restrict_profile(control, start, degree, a, b, net)
        is_apart, thick, cz, cr = compare_along_chord(net, degree, ray, after, t0, t1, slop)
        if is_apart:
            continue
        extent = max(scratch[Z1] - scratch[Z0], scratch[R1] - scratch[R0])
        reach = (t1 - t0) * length
        is_point = extent <= 4.0 * slop
        if is_point or thick < 2.0 * slop:
            t = min(max(0.5 * (t0 + t1), t0), t1)
            slope = sine_of_crossing(control, start, degree, ray, after, 0.5 * (a + b), t) / length
            is_flat = slope < CLEAR_CROSSING
            t_world = (t + shift) * to_world
            if (is_point or is_flat) and (
                (extent < fold and reach < fold) or (is_point and not is_flat)
            ):
                slope = max(slope, FLATTEST)
                s, near = approach_ray(control, start, degree, ray, after, a, b, t0, t1)
                t_bound = 0.5 * reach + 4.0 * slop / slope + abs(near - t) * length
                t_bound = t_bound / length * to_world
                t_world = (near + shift) * to_world
                slope *= length
                if t_world > t_min[i] and not is_known(i, t_world, t_bound, slope, known):
                    offer(
                        i, t_world, t_bound, slope, is_flat, object_id, segment,
                        0.0, s, t_min, known, best,
                    )  # fmt: skip
                    t_cut = min(t_cut, t0)
                continue
            if is_flat:
                if t_world > t_min[i]:
                    best.doubt[i] = min(best.doubt[i], t_world)
                continue
        if t0 > -np.inf and t1 < np.inf and at_most_one(scratch, ray, after, slop):
            settled, t = solve_single(
                i, segment, a, b, t0, t1, ray, after, control, start, degree, ends, size, shift,
                to_world, object_id, t_min, known, best, slop, counters,
            )  # fmt: skip
            if settled:
                t_cut = min(t_cut, t)
                continue
        if top + 2 > DEPTH - 1 or pieces >= MAX_PIECES:
            counters[GIVEN_UP] += 1
            best.doubt[i] = min(best.doubt[i], (t0 + shift) * to_world)
            break
        m = 0.5 * (a + b)
        # The half that the ray reaches first goes on top.
        forward = cz * ray[5] + cr * (distance(ray, min(max(0.5 * (t0 + t1), t0), t1), after)[1])
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
def enter_axis_frame(k, ox, oy, oz, dx, dy, dz, middle, to_frame, turn, ray):
    """Fill ``ray`` for one object; return by how much t was advanced, in frame units."""
    hx, hy, hz, lx, ly, lz, shift = enter_frame(
        ox, oy, oz, dx, dy, dz, middle[k, 0], middle[k, 1], middle[k, 2], to_frame
    )
    for c in range(3):
        e0, e1, e2 = turn[k, c, 0], turn[k, c, 1], turn[k, c, 2]
        ray[c] = (e0 * hx + e1 * hy + e2 * hz) + (e0 * lx + e1 * ly + e2 * lz)
        ray[3 + c] = e0 * dx + e1 * dy + e2 * dz
    square = ray[3] * ray[3] + ray[4] * ray[4]
    ray[6] = np.sqrt(square)
    if square > 0.0:
        ray[7] = -(ray[0] * ray[3] + ray[1] * ray[4]) / square
        ray[8] = abs(ray[0] * ray[4] - ray[1] * ray[3]) / ray[6]
    else:
        ray[6], ray[7], ray[8] = 0.0, 0.0, np.hypot(ray[0], ray[1])
    return shift


@inlined
def solve_segment(
    i, seg, object_id, done, is_guess, ray, t_lo, z_low, z_high, slop, size, to_frame, shift, table,
    t_min, known, best, work, counters,
):  # fmt: skip
    """Settle the pieces of one segment: only piece ``done`` where it is the guess, else the others.

    ``z_low`` to ``z_high``: where the ray is near the object, see `height_range`.
    """
    span, piece, first_piece = table.span, table.piece, table.first_piece
    nearest = ray[8] - slop
    for sheet in range(2):
        after = sheet == 1
        t0, t1 = sheet_interval(
            span[seg, 0], span[seg, 1], max(span[seg, 2], 0.0), span[seg, 3], ray, after, slop
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
                table.degree[seg], table.open_ends[seg], size, shift, 1.0 / to_frame,
                object_id, t_min, known, best, slop, work.net, work.stack, work.piece, counters,
            )  # fmt: skip
            t_cut = end_of(best.t[i], to_frame, shift)


@hot_kernel
def trace_revolutions(table, rays, guess, best, any_hit, work, counters):
    """Lower ``best`` to the first hits; ``guess`` names a piece to begin with, -1 for none."""
    origin, direction, t_min, known = rays.origin, rays.direction, rays.t_min, rays.known
    middle, axes, to_frames, sizes = table.middle, table.turn, table.to_frame, table.size
    first_segment, first_piece, span = table.first_segment, table.first_piece, table.span
    whole, object_id, ray = table.whole, table.object_id, work.ray
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
                shift = enter_axis_frame(k, ox, oy, oz, dx, dy, dz, middle, to_frame, axes, ray)
                slop = (
                    16.0
                    * UNIT_ROUNDOFF
                    * max(size, np.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]))
                )
                t_lo = begin_of(t_min[i], to_frame, shift)
                t_cut = end_of(best.t[i], to_frame, shift)
                z_low, z_high = height_range(
                    whole[k, 0], whole[k, 1], whole[k, 2], ray, t_lo, t_cut, slop
                )
                if z_low > z_high:
                    continue
                nearest = ray[8] - slop
                for seg in range(first, last):
                    if is_guess and not (first_piece[seg] <= done < first_piece[seg + 1]):
                        continue
                    if span[seg, 0] > z_high or span[seg, 1] < z_low or span[seg, 3] < nearest:
                        continue
                    solve_segment(
                        i, seg, object_id[k], done, is_guess, ray, t_lo, z_low, z_high, slop, size,
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
            k, o[0], o[1], o[2], d[0], d[1], d[2], table.middle, table.to_frame[k], table.turn, ray
        )
        for seg in range(table.first_segment[k], table.first_segment[k + 1]):
            if table.segment_id[seg] != triangles.piece[f]:
                continue
            _, s = parameters_at(triangles, f, hits.u[j], hits.v[j])
            begin = hits.t[j] * table.to_frame[k] - shift
            degree = table.degree[seg]
            error, scale = rounding(degree, table.size[k], ray, begin)
            ok, s, root, _, slope, gain = meet(
                table.control, table.start[seg], degree, ray, begin >= ray[7], s, begin, 1.0, error
            )
            if ok and offer_meeting(
                i, s, root, slope, gain, error, scale, table.open_ends[seg], table.control,
                table.start[seg], degree, ray, begin >= ray[7], shift, 1.0 / table.to_frame[k],
                table.object_id[k], seg, rays.t_min, rays.known, best,
            ):  # fmt: skip
                accepted[j] = True


@hot_kernel
def finish_revolutions(table, rays, best, row_of, ray, out):
    """Describe the hits on surfaces of revolution; ``row_of`` (objects,): row here, or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k, seg, s = row_of[best.object_id[i]], best.primitive[i], best.b[i]
        to_frame, e = table.to_frame[k], table.turn[k]
        o, d = rays.origin[i], rays.direction[i]
        shift = enter_axis_frame(
            k, o[0], o[1], o[2], d[0], d[1], d[2], table.middle, to_frame, table.turn, ray
        )
        t = best.t[i] * to_frame - shift
        z, r, zs, rs, zz, rr = profile(table.control, table.start[seg], table.degree[seg], s)
        x, y = ray[0] + t * ray[3], ray[1] + t * ray[4]
        rho = np.hypot(x, y)
        ex, ey = (x / rho, y / rho) if rho > 0.0 else (1.0, 0.0)
        if zs * zs + rs * rs <= 1e-28 * table.size[k] * table.size[k]:
            # A resting point of the profile: its direction a little further in.
            inside = s * (1.0 - 2e-6) + 1e-6
            _, _, zs, rs, _, _ = profile(table.control, table.start[seg], table.degree[seg], inside)
            out.flags[i] = NORMAL_DEGENERATE
        speed = np.hypot(zs, rs)
        zs, rs = zs / speed, rs / speed
        nr, nz = zs, -rs
        if r <= 4.0 * UNIT_ROUNDOFF * table.size[k]:
            # On the axis: the normal of a tip is the axis; a smooth pole has no other.
            if abs(zs) > 1e-6:
                out.flags[i] = NORMAL_DEGENERATE
            if rs != 0.0:
                nr, nz = 0.0, (-1.0 if rs > 0.0 else 1.0)
        px, py = max(r, 0.0) * ex, max(r, 0.0) * ey
        gap = np.sqrt((px - x) ** 2 + (py - y) ** 2 + (z - ray[2] - t * ray[5]) ** 2)
        for c in range(3):
            local = px * e[0, c] + py * e[1, c] + z * e[2, c]
            out.position[i, c] = table.middle[k, c] + local / to_frame
            out.normal[i, c] = nr * (ex * e[0, c] + ey * e[1, c]) + nz * e[2, c]
        turn = np.arctan2(ey, ex) / (2.0 * np.pi)
        turn -= np.floor(turn)
        out.u[i], out.v[i] = (turn if turn < 1.0 else 0.0), s
        out.patch_id[i] = table.segment_id[seg]
        out.residual[i] = gap / to_frame
        # --- grazing: how deep does the ray run under the silhouette?
        rate = distance(ray, t, t >= ray[7])[1]
        slope = nr * rate + nz * ray[5]
        if abs(slope) > GRAZING or rho == 0.0:
            continue
        bend = nr * (ray[6] * ray[6] - rate * rate) / rho
        bend -= (zs * rr - rs * zz) / (speed * speed) * (zs * ray[5] + rs * rate) ** 2
        _, scale = rounding(table.degree[seg], table.size[k], ray, t)
        if slope * slope < 2.0 * abs(bend) * TANGENT_BAND * scale:
            best.tangent[i] = 1
