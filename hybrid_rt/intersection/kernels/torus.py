"""Rays against tori, each first hit proven to be the first.

A point at distance rho from the axis and height z is D = |(rho - R, z)| away from the circle in
the middle of the tube, so its distance from the torus is f = D - r. That says for every t how far
the ray would have to be moved to touch the torus there: what is decided within rounding shows by
itself. No quartic is formed, whose coefficients would cancel (Hanrahan, "Ray tracing
algebraic surfaces", SIGGRAPH 1983, forms it).

Along a ray with unit direction, q = D^2 = |x|^2 + R^2 - 2 R rho is a parabola less 2 R times a
hyperbola:

    q' / 2 = s + x0.d - R rho',   q'' / 2 = 1 - R rho'',   rho'' = E / rho^3

with E = (x dy - y dx)^2, taken across the axis. So q is concave where rho^3 < R E, in one interval
around the point nearest the axis, and convex before and behind it: at most two minima with a
maximum between them. Tangents at two points bound a convex q from below (a
concave one from above): where that bound keeps away from r^2, nothing is met. Where it does not,
Newton's iteration on q' goes on to the extremum itself, whose f tells hit, miss or TANGENT. Between
two extrema f runs one way and has one root, found by Newton's iteration in a bracket; f a little
before and behind it, beyond its rounding, proves how far off it can be.

Rounding, with everything within 1 of the frame's origin (u = 2^-53). The point of the ray nearest
the torus' origin is found in two parts and then rounded (u), turned into the torus' frame, whose
rows are unit and at right angles to 4 u, by dot products of three terms (3 u a coordinate), and so is
the direction; s times it is added (2 u). All this moves points of the ray by less than 14 u (|x0| +
|s|). Then rho, rho - R, D and f round by 3 u rho + 3 u D + u (R + r). With |x0|, |s| <= 1 and R + r <=
1 the sum stays below 40 u at the surface: `ROUNDING` bounds the error of f there. Shifts of the ray
that are the same for all s do not change the shape of q; what is left of the error of q' is
proportional to |s|, |x0.d| and |R rho'|.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import advance, two_difference
from hybrid_rt.intersection.kernels.search.frame import enter_frame
from hybrid_rt.intersection.kernels.search.nearest import offer
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from meshing.kernels.jit import hot_kernel, inlined, inner

# Error of f near the surface, see above.
ROUNDING = 48.0 * UNIT_ROUNDOFF
# Rays that pass the ball and the slab around a torus by more than this, and the band, miss it.
MARGIN = 2.0**-30
# The origin of s is moved to the point nearest the axis unless that is farther away than this.
NEAR_AXIS = 2.5
# Steps toward an extremum or a root: Newton needs five, grazing rays more.
MOST_STEPS = 60
# f does not get nearer to zero than a few roundings of its own.
SMALL = 6.0 * UNIT_ROUNDOFF

# What is known of the extremum of f between two sections.
OUTSIDE, INSIDE, NEAR_OUTSIDE, NEAR_INSIDE = range(4)


class TorusTable(NamedTuple):
    """Tori, each with a frame in which R + r is from 1/2 to 1; row k is object ``object_id[k]``."""

    origin: Any  # (k, 3) world
    size: Any  # (k,) world: R + r
    frame: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    to_frame: Any  # (k,) powers of two
    major: Any  # (k,) in the frame
    minor: Any  # (k,)
    orientation: Any  # (k,): 1 normals outward, -1 inward
    object_id: Any  # (k,) int32


def torus_table(tori, object_id):
    """Return the table of a list of tori."""
    size = np.array([torus.major_radius + torus.minor_radius for torus in tori])
    to_frame = 2.0 ** -np.ceil(np.log2(size))
    return TorusTable(
        origin=np.array([torus.origin for torus in tori]),
        size=size,
        frame=np.array([np.stack([t.radial, t.binormal, t.axis]) for t in tori]),
        to_frame=to_frame,
        major=np.array([torus.major_radius for torus in tori]) * to_frame,
        minor=np.array([torus.minor_radius for torus in tori]) * to_frame,
        orientation=np.array([float(torus.orientation) for torus in tori]),
        object_id=object_id,
    )


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

    Returns
    -------
    known : OUTSIDE or INSIDE where f keeps away from zero by the band: of a minimum OUTSIDE says
        that nothing is met in [a, b], of a maximum INSIDE does; else what f is at the extremum
    s : a place where f is as ``known`` says (of the two above: where the search ended)
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
def bound_of_root(line, s, near):
    """Return how far from s the exact root can be: f has left zero before and behind by then.

    ``near``: s is one of two roots that may be none; then both are within the bound.
    """
    _, slope, away, f = look(line, s)
    wrong = abs(f) + ROUNDING
    width = 2.0 * wrong * away / max(abs(slope), 1e-300)
    # Where the ray grazes curvature, not slope, ends the contact.
    width = max(min(width, np.sqrt(8.0 * wrong * away)), 4.0 * UNIT_ROUNDOFF)
    while width < 4.0:
        _, _, _, before = look(line, s - width)
        _, _, _, behind = look(line, s + width)
        if min(abs(before), abs(behind)) > ROUNDING and (near or (before > 0.0) != (behind > 0.0)):
            break
        width *= 2.0
    return width


@inner
def offer_torus(i, k, table, rays, best):
    """Offer the roots of ray i with torus k, one after the other, until one is taken."""
    o, d, c, to_frame = rays.origin[i], rays.direction[i], table.origin[k], table.to_frame[k]
    major, minor = table.major[k], table.minor[k]
    dx, dy, dz = d[0], d[1], d[2]
    dd = dx * dx + dy * dy + dz * dz
    hx, hy, hz, lx, ly, lz, t_of_zero = enter_frame(
        o[0], o[1], o[2], dx, dy, dz, c[0], c[1], c[2], to_frame
    )
    # --- does the ray meet the ball around the torus, and when?
    away = np.sqrt((o[0] - c[0]) ** 2 + (o[1] - c[1]) ** 2 + (o[2] - c[2]) ** 2) * to_frame
    band = TANGENT_BAND * max(away, 2.0 * (major + minor))
    reach = major + minor + 2.0 * band + MARGIN
    step = -(hx * dx + hy * dy + hz * dz) / dd
    x, y, z = hx + step * dx, hy + step * dy, hz + step * dz
    half = reach * reach - (x * x + y * y + z * z)
    if half <= 0.0:
        return
    length = np.sqrt(dd)
    half, per_t, to_world = np.sqrt(half), 1.0 / length, 1.0 / to_frame
    t_of_zero += step
    if (t_of_zero + half * per_t) * to_world <= rays.t_min[i]:
        return
    if (t_of_zero - half * per_t) * to_world > best.t[i]:
        return
    # --- the ray in the frame of the torus, from its point nearest the middle
    hx, _ = advance(hx, lx, step, dx)
    hy, _ = advance(hy, ly, step, dy)
    hz, _ = advance(hz, lz, step, dz)
    dx, dy, dz = dx * per_t, dy * per_t, dz * per_t
    e = table.frame[k]
    x = e[0, 0] * hx + e[0, 1] * hy + e[0, 2] * hz
    y = e[1, 0] * hx + e[1, 1] * hy + e[1, 2] * hz
    z = e[2, 0] * hx + e[2, 1] * hy + e[2, 2] * hz
    vx = e[0, 0] * dx + e[0, 1] * dy + e[0, 2] * dz
    vy = e[1, 0] * dx + e[1, 1] * dy + e[1, 2] * dz
    vz = e[2, 0] * dx + e[2, 1] * dy + e[2, 2] * dz
    # --- within the slab of the tube; f is positive at both ends
    lo, hi = -half, half
    thick = minor + 2.0 * band + MARGIN
    if vz != 0.0:
        a, b = (-thick - z) / vz, (thick - z) / vz
        lo, hi = max(lo, min(a, b)), min(hi, max(a, b))
    elif abs(z) >= thick:
        return
    if lo >= hi:
        return
    # --- from the point nearest the axis, unless the ray runs along that
    across, turn, area = vx * vx + vy * vy, x * vx + y * vy, x * vy - y * vx
    along, spread = turn + z * vz, area * area
    if abs(turn) <= NEAR_AXIS * across and across > 0.0:
        step = -turn / across
        x, y, z = x + step * vx, y + step * vy, z + step * vz
        lo, hi, t_of_zero = lo - step, hi - step, t_of_zero + step * per_t
        turn, along, spread = 0.0, z * vz, across * (x * x + y * y)
    line = Line(x, y, z, vx, vy, vz, across, turn, along, spread, major, minor)
    # --- where q is concave; where rho is less than half of R - r there is nothing to meet
    bends, hollow = np.cbrt(major * spread), 0.5 * (major - minor)
    ring = max(bends, hollow)
    square = across * ring * ring - spread
    first = second = hi
    if square > 0.0:
        root = np.sqrt(square)
        if turn == 0.0:
            first, second = -root / across, root / across
        else:
            q = -(turn + (root if turn > 0.0 else -root))
            a, b = q / across, (x * x + y * y - ring * ring) / q
            first, second = min(a, b), max(a, b)
        first, second = min(max(first, lo), hi), min(max(second, lo), hi)
    is_hollow = bends < hollow and first < second
    _, slope_lo, _, _ = look(line, lo)
    _, slope_first, _, _ = look(line, first)
    _, slope_second, _, _ = look(line, second)
    _, slope_hi, _, _ = look(line, hi)
    if slope_first < 0.0 <= slope_second and not is_hollow:
        # Flat to rounding between both: as good as convex everywhere.
        first, second, slope_first, slope_second = hi, hi, slope_hi, slope_hi
    # --- from extremum to extremum: where f changes its sign there is a root between
    before, was_inside, was_near = lo, False, False
    for place in range(4):
        known, s = OUTSIDE, hi
        if place == 0:
            if not slope_lo < 0.0 <= slope_first:
                continue
            known, s = find_extremum(line, lo, first, 1.0, band)
        elif place == 1:
            if is_hollow:
                known = OUTSIDE if hollow > band + ROUNDING else NEAR_OUTSIDE
                s = 0.5 * (first + second)
            elif slope_first >= 0.0 > slope_second:
                known, s = find_extremum(line, first, second, -1.0, band)
            else:
                continue
        elif place == 2:
            if not slope_second < 0.0 <= slope_hi or second == hi:
                continue
            known, s = find_extremum(line, second, hi, 1.0, band)
        is_inside, is_near = known in (INSIDE, NEAR_INSIDE), known in (NEAR_OUTSIDE, NEAR_INSIDE)
        if is_inside == was_inside:
            t = (t_of_zero + s * per_t) * to_world
            if is_near and t > rays.t_min[i]:
                best.doubt[i] = min(best.doubt[i], t)
        else:
            start = guess_root(line, s, -1.0) if is_inside else guess_root(line, before, 1.0)
            s_root = find_root(line, before, s, 1.0 if is_inside else -1.0, start)
            t = (t_of_zero + s_root * per_t) * to_world
            if t > best.t[i]:
                return
            if t > rays.t_min[i]:
                near = is_near or was_near
                bound = bound_of_root(line, s_root, near) * per_t
                bound += 4.0 * UNIT_ROUNDOFF * (abs(t_of_zero) + abs(s_root * per_t))
                _, slope, away, _ = look(line, s_root)
                if offer(
                    i, t, bound * to_world, abs(slope) / away * length, near, table.object_id[k],
                    0, 0.0, 0.0, rays.t_min, rays.known, best,
                ):  # fmt: skip
                    return
        before, was_inside, was_near = s, is_inside, is_near


@hot_kernel
def trace_tori(table, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on all tori."""
    origin, direction, center, size = rays.origin, rays.direction, table.origin, table.size
    for i in range(origin.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        dd = dx * dx + dy * dy + dz * dz
        for k in range(size.shape[0]):
            if any_hit and best.object_id[i] >= 0:
                break
            # Most rays clearly pass the ball around a torus: they are not worth a call.
            x, y, z = (
                origin[i, 0] - center[k, 0],
                origin[i, 1] - center[k, 1],
                origin[i, 2] - center[k, 2],
            )
            away, along = x * x + y * y + z * z, x * dx + y * dy + z * dz
            reach = (1.0 + MARGIN) * size[k] + 4.0 * TANGENT_BAND * np.sqrt(away)
            if away - along * along / dd <= reach * reach + 16.0 * UNIT_ROUNDOFF * away:
                offer_torus(i, k, table, rays, best)


@hot_kernel
def finish_tori(table, rays, best, row_of, out):
    """Describe the hits on tori; ``row_of`` (objects,) is the object's row here or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or row_of[best.object_id[i]] < 0:
            continue
        k = row_of[best.object_id[i]]
        o, d, c, e, t = (
            rays.origin[i],
            rays.direction[i],
            table.origin[k],
            table.frame[k],
            best.t[i],
        )
        to_frame, major, minor = table.to_frame[k], table.major[k], table.minor[k]
        fx, gx = two_difference(o[0], c[0])
        fy, gy = two_difference(o[1], c[1])
        fz, gz = two_difference(o[2], c[2])
        px, _ = advance(fx, gx, t, d[0])
        py, _ = advance(fy, gy, t, d[1])
        pz, _ = advance(fz, gz, t, d[2])
        px, py, pz = px * to_frame, py * to_frame, pz * to_frame
        x = e[0, 0] * px + e[0, 1] * py + e[0, 2] * pz
        y = e[1, 0] * px + e[1, 1] * py + e[1, 2] * pz
        z = e[2, 0] * px + e[2, 1] * py + e[2, 2] * pz
        rho = np.sqrt(x * x + y * y)
        beside = rho - major
        away = np.sqrt(beside * beside + z * z)
        # Along the ring's radius, and the normal: along that and along the axis.
        x, y = x / rho, y / rho
        n, m = beside / away, z / away
        s = table.orientation[k]
        ring = (major + minor * n) / to_frame
        lift = minor * m / to_frame
        for j in range(3):
            radius = x * e[0, j] + y * e[1, j]
            out.position[i, j] = c[j] + (ring * radius + lift * e[2, j])
            out.normal[i, j] = s * (n * radius + m * e[2, j])
        turn = np.arctan2(y, x) / (2.0 * np.pi)
        turn -= np.floor(turn)
        out.u[i] = turn if turn < 1.0 else 0.0
        turn = np.arctan2(s * m, n) / (2.0 * np.pi)
        turn -= np.floor(turn)
        out.v[i] = turn if turn < 1.0 else 0.0
        out.patch_id[i] = 0
        out.residual[i] = abs(away - minor) / to_frame
