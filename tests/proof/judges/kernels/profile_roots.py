"""All roots of rays on surfaces of revolution, by plain bisection that ends in double-double.

In the half-plane of (axial position, radius) the surface is its profile and the ray a hyperbola:
z(t) = a + t c, rho(t) = |(x, y) + t (p, q)|, which is convex. A pair of a piece of profile and a
piece of ray is dropped when the two stay apart by more than the band along z, along rho, or across
the longer of their chords; else the longer is halved. Small pairs start Newton's iteration in
double-double for Z(s) = z(t), R(s) = rho(t). What is certain is decided as for patches: by eight
rays around.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import inner, kernel
from proof.judges.kernels.bezier import curve_point, load
from proof.judges.kernels.double_double import (
    add,
    advance,
    divide,
    dot,
    multiply,
    root,
    subtract,
    two_sum,
)
from proof.judges.kernels.events import (
    AROUND,
    BAND,
    COVERED,
    DOUBTFUL,
    ROOT,
    SHIFT,
    UNDECIDED,
    note,
)
from proof.judges.kernels.patch_bisection import PIECE, normal_frame
from proof.judges.kernels.patch_roots import NEWTON_STEPS, ROUNDING, window_of
from proof.judges.kernels.profile_bisection import bisect_profile


class Profile(NamedTuple):
    """One surface of revolution."""

    control: Any  # (total, 2) float64: axial position, radius
    weight: Any  # (total,) float64, 1 where there are none
    points: Any  # (total, 2) or, with weights, (total, 3) float64, see `bezier.patch_point`
    rest: Any  # the same
    starts: Any  # (k + 1,) int64
    numbers: Any  # (k,) int32: segment of the surface
    frame: Any  # (3, 3) float64: axis, radial, binormal
    origin: Any  # (3,) float64
    middle: Any  # (3,) float64: a point of the axis, amid the surface
    radius: float  # of a ball about it
    size: float  # diameter of the surface
    object_id: int


class ProfileScratch(NamedTuple):
    """Working memory of one thread."""

    nets: Any  # (depth, 3 x 31) float64: w Z, then w R, then w
    plain: Any  # (2 x 31,) float64: Z, then R; without weights (0,)
    spans: Any  # (depth, 4) float64: s and t of the pairs on the stack
    leaves: Any  # (MOST_LEAVES, 4) float64: s, t, half widths
    one: Any  # (1, 4) float64
    high: Any  # (31,) float64
    low: Any  # (31,) float64
    frame: Any  # (3, 3) float64: two normals of the ray, and its direction
    point: Any  # (3, 2) float64: double-double point of the ray, world frame
    local: Any  # (6, 2) float64: the same in the frame of the axis, and the unit direction
    line: Any  # (6,) float64: (z, x, y) of that point and of the unit direction
    out: Any  # (8,) float64: Z', R', Z'', R'', rho', rho, x, y


@inner
def _enter(profile, d, length, scratch):
    """Take the ray at ``scratch.point`` into the frame of the axis."""
    point, local, line, frame = scratch.point, scratch.local, scratch.line, profile.frame
    ah, al = subtract(point[0, 0], point[0, 1], profile.origin[0], 0.0)
    bh, bl = subtract(point[1, 0], point[1, 1], profile.origin[1], 0.0)
    ch, cl = subtract(point[2, 0], point[2, 1], profile.origin[2], 0.0)
    for k in range(3):
        x, y, z = frame[k, 0], frame[k, 1], frame[k, 2]
        local[k, 0], local[k, 1] = dot(ah, al, bh, bl, ch, cl, x, 0.0, y, 0.0, z, 0.0)
        h, e = dot(d[0], 0.0, d[1], 0.0, d[2], 0.0, x, 0.0, y, 0.0, z, 0.0)
        local[3 + k, 0], local[3 + k, 1] = divide(h, e, length, 0.0)
        line[k] = local[k, 0]
        line[3 + k] = local[3 + k, 0]


@inner
def _load(profile, p, net):
    start = profile.starts[p]
    n = profile.starts[p + 1] - start - 1
    for k in range(n + 1):
        w = profile.weight[start + k]
        net[k] = w * profile.control[start + k, 0]
        net[n + 1 + k] = w * profile.control[start + k, 1]
        net[2 * n + 2 + k] = w
    return n


@inner
def _profile_point(profile, start, n, sh, sl, high, low):
    """Return Z and R in double-double, and their first and second derivatives in float64."""
    load(profile.points, profile.rest, start, n, 0, high, low)
    zh, zl, dz, ddz = curve_point(n, sh, sl, high, low)
    load(profile.points, profile.rest, start, n, 1, high, low)
    rh, rl, dr, ddr = curve_point(n, sh, sl, high, low)
    if profile.points.shape[1] == 3:
        load(profile.points, profile.rest, start, n, 2, high, low)
        wh, wl, dw, ddw = curve_point(n, sh, sl, high, low)
        zh, zl = divide(zh, zl, wh, wl)
        rh, rl = divide(rh, rl, wh, wl)
        dz, dr = (dz - dw * zh) / wh, (dr - dw * rh) / wh
        ddz, ddr = (ddz - 2.0 * dw * dz - ddw * zh) / wh, (ddr - 2.0 * dw * dr - ddw * rh) / wh
    return zh, zl, dz, ddz, rh, rl, dr, ddr


@inner
def _newton(profile, p, s, t, scale, scratch):
    """Solve Z(s) = z(t), R(s) = rho(t), t as a length from ``scratch.point``."""
    start = profile.starts[p]
    n = profile.starts[p + 1] - start - 1
    local, line, out, high, low = (
        scratch.local, scratch.line, scratch.out, scratch.high, scratch.low,
    )  # fmt: skip
    sh, sl, th, tl = s, 0.0, t, 0.0
    settled = False
    for _ in range(NEWTON_STEPS):
        zh, zl, dz, ddz, rh, rl, dr, ddr = _profile_point(profile, start, n, sh, sl, high, low)
        ah, al = multiply(th, tl, local[3, 0], local[3, 1])
        ah, al = add(ah, al, local[0, 0], local[0, 1])
        xh, xl = multiply(th, tl, local[4, 0], local[4, 1])
        xh, xl = add(xh, xl, local[1, 0], local[1, 1])
        yh, yl = multiply(th, tl, local[5, 0], local[5, 1])
        yh, yl = add(yh, yl, local[2, 0], local[2, 1])
        bh, bl = multiply(xh, xl, xh, xl)
        ch, cl = multiply(yh, yl, yh, yl)
        bh, bl = add(bh, bl, ch, cl)
        bh, bl = root(bh, bl)
        slope = (xh * line[4] + yh * line[5]) / bh if bh > 0.0 else 0.0
        out[0], out[1], out[2], out[3], out[4], out[5] = dz, dr, ddz, ddr, slope, bh
        out[6], out[7] = xh, yh
        if settled:
            return True, sh, th
        f, _ = subtract(zh, zl, ah, al)
        g, _ = subtract(rh, rl, bh, bl)
        det = -dz * slope + dr * line[3]
        if det == 0.0:
            return False, s, t
        ds = (f * slope - g * line[3]) / det
        dt = (dr * f - dz * g) / det
        if not abs(ds) < 1.0:
            return False, s, t
        sh, e = two_sum(sh, ds)
        sl += e
        sh, sl = two_sum(sh, sl)
        th, e = two_sum(th, dt)
        tl += e
        th, tl = two_sum(th, tl)
        if not -0.5 < sh < 1.5:
            return False, s, t
        settled = (abs(dz) + abs(dr)) * abs(ds) + abs(dt) <= 2.0**-60 * scale
    return False, s, t


@inner
def _is_covered(profile, o, d, t, length, band, window, scratch):
    """Whether rays all around this one meet the surface near t too (see `patch_roots`)."""
    frame, point = scratch.frame, scratch.point
    total, least, most = 0.0, np.inf, -np.inf
    is_covered = True
    for cosine, sine in AROUND:
        for axis in range(3):
            side = (cosine * frame[0, axis] + sine * frame[1, axis]) * (SHIFT * band)
            h, e = advance(o[axis], t, d[axis])
            h, f = two_sum(h, side)
            point[axis, 0], point[axis, 1] = two_sum(h, e + f)
        _enter(profile, d, length, scratch)
        is_met = False
        for p in range(profile.starts.size - 1):
            n = _load(profile, p, scratch.nets[0])
            found = bisect_profile(
                scratch.nets, scratch.plain, scratch.spans, n, scratch.line, -window, window,
                ROUNDING * profile.size, band / 16.0, scratch.one,
            )  # fmt: skip
            if found == 1:
                there = scratch.one[0, 1]
                is_met = True
                total += there
                least, most = min(least, there), max(most, there)
                break
        if not is_met:
            is_covered = False
            break
    if not is_covered:
        return False, t, 0.0
    slope = (most - least) / band
    return True, t + total / (len(AROUND) * length), 1.0 / math.sqrt(1.0 + slope * slope)


@inner
def _start_ray(profile, o, d, length, shift, scratch):
    for axis in range(3):
        scratch.point[axis, 0], scratch.point[axis, 1] = advance(o[axis], shift, d[axis])
    _enter(profile, d, length, scratch)


@inner
def _azimuth(x, y):
    turn = math.atan2(y, x) / (2.0 * math.pi)
    return turn + 1.0 if turn < 0.0 else turn


@inner
def _profile_roots(profile, ray, o, d, length, t_start, band, scratch, events):
    """Note all events of one ray on one surface of revolution."""
    frame = scratch.frame
    along, first_side, second_side = 0.0, 0.0, 0.0
    for axis in range(3):
        away = profile.middle[axis] - o[axis]
        along += away * frame[2, axis]
        first_side += away * frame[0, axis]
        second_side += away * frame[1, axis]
    size, radius, scale = profile.size, profile.radius, band / BAND
    slack = band + 1e-9 * size
    lowest = max(t_start * length - along - 1e-3 * size, -radius - slack)
    side = math.sqrt(first_side * first_side + second_side * second_side)
    if side > radius + slack or lowest > radius + slack:
        return
    shift = along / length
    slop = band + ROUNDING * size
    smallest = max(PIECE * size, 2.0 * slop)
    first = min(events.count[0], events.t.size)
    for p in range(profile.starts.size - 1):
        _start_ray(profile, o, d, length, shift, scratch)
        n = _load(profile, p, scratch.nets[0])
        line, leaves = scratch.line, scratch.leaves
        n_leaves = bisect_profile(
            scratch.nets, scratch.plain, scratch.spans, n, line, lowest, radius + slack, slop,
            smallest, leaves,
        )  # fmt: skip
        if n_leaves < 0:
            note(
                events, ray, t_start, profile.object_id, profile.numbers[p], 0.0, 0.5, 0.0, band,
                UNDECIDED, 0,
            )  # fmt: skip
            continue
        own = min(events.count[0], events.t.size)
        for leaf in range(n_leaves):
            s, t = leaves[leaf, 0], leaves[leaf, 1]
            wide, long = 4.0 * leaves[leaf, 2], 4.0 * leaves[leaf, 3]
            is_old = False
            for k in range(own, min(events.count[0], events.t.size)):
                gap = abs((events.t[k] - shift) * length - t)
                if gap <= long and abs(events.v[k] - s) <= wide:
                    is_old = True
                    break
            if is_old:
                continue
            _start_ray(profile, o, d, length, shift, scratch)
            found, a, b = _newton(profile, p, s, t, scale, scratch)
            dz, dr, ddz, ddr = scratch.out[0], scratch.out[1], scratch.out[2], scratch.out[3]
            slope, rho = scratch.out[4], scratch.out[5]
            u = _azimuth(scratch.out[6], scratch.out[7])  # of a root
            cosine, is_root, is_edge = 0.0, False, True
            speed = math.sqrt(dz * dz + dr * dr)
            if found and speed > 0.0:
                det = abs(dz * slope - dr * line[3])
                cosine = min(det / speed, 1.0)
                is_root = abs(b - t) <= 4.0 * slop / max(cosine, 1e-300) + 8.0 * smallest
            if is_root:
                for k in range(own, min(events.count[0], events.t.size)):
                    gap = abs((events.t[k] - shift) * length - b)
                    same = abs(events.v[k] - a) <= wide
                    if same and gap <= 2.0 * slop / max(cosine, 1e-300):
                        is_old = True
                        break
                if is_old:
                    continue
                # Curvature along the ray of the distance between the two curves.
                pace = (line[3] * dz + slope * dr) / (speed * speed)
                turn = line[4] * line[4] + line[5] * line[5] - slope * slope
                lift = max(turn, 0.0) / rho if rho > 0.0 else np.inf
                bend = abs((-dr * ddz + dz * ddr) * pace * pace - dz * lift) / speed
                run = math.sqrt(line[3] * line[3] + slope * slope)
                per_s = det / run if run > 0.0 else 0.0
                inside = min(a, 1.0 - a) * per_s
                if min(a, 1.0 - a) < 0.0 and inside < -SHIFT * band:
                    continue
                is_edge = inside <= SHIFT * band
                # At the axis rho(t) has a kink, and slope means nothing.
                is_edge = is_edge or rho <= 4.0 * SHIFT * band
                if cosine * cosine > 2.0 * SHIFT * band * bend and not is_edge:
                    there = shift + b / length
                    note(
                        events, ray, there, profile.object_id, profile.numbers[p], u, a, cosine,
                        band, ROOT, 0,
                    )  # fmt: skip
                    continue
            else:
                a, b, cosine = s, t, 0.0
                for k in range(first, min(events.count[0], events.t.size)):
                    reach = 4.0 * math.sqrt(band * size) + 8.0 * smallest
                    is_such = events.kind[k] == DOUBTFUL or events.at_edge[k] == 1
                    if is_such and abs((events.t[k] - shift) * length - b) <= reach:
                        is_old = True
                        break
                if is_old:
                    continue
            there = shift + b / length
            for assumed in (1.0, cosine):  # see `patch_roots`
                window = window_of(band, size, assumed)
                covered, mean, steep = _is_covered(
                    profile, o, d, there, length, band, window, scratch
                )
                if covered:
                    break
            if not is_root:
                there, cosine = mean, steep if covered else 1e-3
                _start_ray(profile, o, d, length, shift, scratch)
                b = (there - shift) * length
                u = _azimuth(line[1] + b * line[4], line[2] + b * line[5])
            elif covered and is_edge:
                cosine = min(cosine, steep)
            kind = DOUBTFUL
            if covered:
                kind = ROOT if is_root else COVERED
            a = min(max(a, 0.0), 1.0)
            note(
                events, ray, there, profile.object_id, profile.numbers[p], u, a, cosine, band, kind,
                1 if is_edge else 0,
            )  # fmt: skip


@kernel
def profile_events(profile, first_ray, origins, directions, t_min, scratch, events):
    """Note the events of rays with one surface of revolution."""
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        normal_frame(d[0] / length, d[1] / length, d[2] / length, scratch.frame)
        away = 0.0
        for axis in range(3):
            away += (o[axis] - profile.middle[axis]) ** 2
        band = BAND * max(math.sqrt(away), profile.size)
        _profile_roots(profile, first_ray + i, o, d, length, t_min[i], band, scratch, events)
