"""All roots of rays on Bezier patches, by plain bisection that ends in double-double.

A patch, projected along the ray, is halved across its longer extent in space; of a rational one it
is the net of (w P, w) that is halved. A piece is dropped when its control points lie to one side of
the ray by more than the band within which rounding may decide; that is asked along two directions,
one of them across the piece's longer tangent, so that pieces beside a silhouette are dropped early.
Pieces of about 1e-9 of the patch start Newton's iteration in double-double. A root near a
silhouette, an edge or a singular point, and a piece without a root, are certain only if the surface
is also met by eight rays around this one.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import inner, kernel
from proof.judges.kernels.bezier import patch_point
from proof.judges.kernels.double_double import (
    advance,
    dot,
    multiply,
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
from proof.judges.kernels.patch_bisection import (
    MOST_REJECTED,
    PIECE,
    bisect,
    normal_frame,
    project,
)

NEWTON_STEPS = 40
# Near a fold that the ray misses Newton wanders: it is let go once the residual has grown this often.
MOST_RISES = 3
# Beside an approach already noted only one piece in this many starts Newton again: a fold's pieces
# come by the hundred, and any of them leads to its roots.
STRIDE = 8
# Rounding of a projected net and its halves, relative to the patch's radius: with weights too, as
# sums of positive terms and their quotients have few roundings each.
ROUNDING = 8.0 * 2.0**-52


class Nets(NamedTuple):
    """Patches of one object; weights are 1 where there are none."""

    control: Any  # (total, 3) float64
    weight: Any  # (total,) float64
    points: Any  # (total, 3) or, with weights, (total, 4) float64, see `bezier.patch_point`
    rest: Any  # the same
    starts: Any  # (k + 1,) int64
    degrees: Any  # (k, 2) int64
    centre: Any  # (k, 3) float64, a ball around each patch
    radius: Any  # (k,) float64
    middle: Any  # (3,) float64, of the object
    size: float  # its diameter
    object_id: int


class Scratch(NamedTuple):
    """Working memory of one thread."""

    nets: Any  # (depth, 4 x largest net) float64
    plain: Any  # (3 x largest net,) float64; without weights (0,)
    spans: Any  # (depth, 4) float64: u and v of the pieces on the stack
    leaves: Any  # (MOST_LEAVES, 6) float64: u, v, half widths, lowest and highest t
    one: Any  # (1, 6) float64: the same for one
    rejected: Any  # (MOST_REJECTED, 2) float64: u and v of roots beyond an edge
    rows: Any  # (31, 4) float64
    high: Any  # (31,) float64
    low: Any  # (31,) float64
    out: Any  # (4, 7) float64
    frame: Any  # (3, 3) float64: two normals of the ray, and its direction
    point: Any  # (3, 2) float64: double-double point of the ray near the patch


@inner
def _newton(nets, p, o, d, u, v, scale, scratch):
    """Solve S(u, v) = o + t d from a start; return found, u, v, t; partials in ``scratch.out``."""
    m, n = nets.degrees[p, 0], nets.degrees[p, 1]
    out = scratch.out
    # (S - o) x d = 0 in the two components that divide by the largest of d.
    k = 0
    if abs(d[1]) > abs(d[k]):
        k = 1
    if abs(d[2]) > abs(d[k]):
        k = 2
    i, j = (k + 1) % 3, (k + 2) % 3
    uh, ul, vh, vl = u, 0.0, v, 0.0
    settled = False
    before, rises = np.inf, 0
    for _ in range(NEWTON_STEPS):
        patch_point(
            nets.points, nets.rest, nets.starts[p], m, n, uh, ul, vh, vl,
            scratch.rows, scratch.high, scratch.low, out,
        )  # fmt: skip
        ih, il = subtract(out[i, 0], out[i, 1], o[i], 0.0)
        jh, jl = subtract(out[j, 0], out[j, 1], o[j], 0.0)
        kh, kl = subtract(out[k, 0], out[k, 1], o[k], 0.0)
        if settled:
            dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
            th, _ = dot(ih, il, jh, jl, kh, kl, d[i], 0.0, d[j], 0.0, d[k], 0.0)
            th /= dd
            # The residual of a float64 division, so that t is good to its last bit.
            rh, rl = advance(0.0, th, d[k])
            rh, rl = subtract(kh, kl, rh, rl)
            return True, uh, vh, th + rh / d[k]
        ah, al = multiply(ih, il, d[k], 0.0)
        bh, bl = multiply(kh, kl, d[i], 0.0)
        f, _ = subtract(ah, al, bh, bl)
        ah, al = multiply(jh, jl, d[k], 0.0)
        bh, bl = multiply(kh, kl, d[j], 0.0)
        g, _ = subtract(ah, al, bh, bl)
        now = abs(f) + abs(g)
        if now > before:
            rises += 1
            if rises > MOST_RISES:
                return False, u, v, 0.0
        before = now
        fu = out[i, 2] * d[k] - out[k, 2] * d[i]
        fv = out[i, 3] * d[k] - out[k, 3] * d[i]
        gu = out[j, 2] * d[k] - out[k, 2] * d[j]
        gv = out[j, 3] * d[k] - out[k, 3] * d[j]
        det = fu * gv - fv * gu
        if det == 0.0:
            return False, u, v, 0.0
        du = (fv * g - gv * f) / det
        dv = (gu * f - fu * g) / det
        if not abs(du) + abs(dv) < 1.0:
            return False, u, v, 0.0
        uh, e = two_sum(uh, du)
        ul += e
        uh, ul = two_sum(uh, ul)
        vh, e = two_sum(vh, dv)
        vl += e
        vh, vl = two_sum(vh, vl)
        if not (-0.5 < uh < 1.5 and -0.5 < vh < 1.5):
            return False, u, v, 0.0
        step = 0.0
        for axis in range(3):
            step += abs(out[axis, 2] * du) + abs(out[axis, 3] * dv)
        settled = step <= 2.0**-60 * scale
    return False, u, v, 0.0


@inner
def _slopes(out, d, length):
    """At the point in ``out``: |cos|, curvature along the ray, unit distances per u and per v.

    The last two say how far a step in u (or in v) moves the point away from the ray, at right
    angles to the line of constant u (of constant v): the distance of the ray from an edge.
    """
    nx = out[1, 2] * out[2, 3] - out[2, 2] * out[1, 3]
    ny = out[2, 2] * out[0, 3] - out[0, 2] * out[2, 3]
    nz = out[0, 2] * out[1, 3] - out[1, 2] * out[0, 3]
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if size == 0.0:
        return 0.0, np.inf, 0.0, 0.0
    x, y, z = d[0] / length, d[1] / length, d[2] / length
    along = nx * x + ny * y + nz * z
    uu, uv, vv, ud, vd = 0.0, 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        uu += out[axis, 2] * out[axis, 2]
        uv += out[axis, 2] * out[axis, 3]
        vv += out[axis, 3] * out[axis, 3]
        ud += out[axis, 2] * d[axis] / length
        vd += out[axis, 3] * d[axis] / length
    a = (vv * ud - uv * vd) / (size * size)
    b = (uu * vd - uv * ud) / (size * size)
    bend = 0.0
    for axis in range(3):
        second = out[axis, 4] * a * a + 2.0 * out[axis, 5] * a * b + out[axis, 6] * b * b
        bend += second * (nx if axis == 0 else ny if axis == 1 else nz)
    side_u = math.sqrt(max(vv - vd * vd, 0.0))
    side_v = math.sqrt(max(uu - ud * ud, 0.0))
    per_u = abs(along) / side_u if side_u > 0.0 else 0.0
    per_v = abs(along) / side_v if side_v > 0.0 else 0.0
    return abs(along) / size, abs(bend) / size, per_u, per_v


@inner
def _near(nets, p, x, y, z, frame, reach):
    """Whether the ray through a point comes within ``reach`` of a patch's ball; and where."""
    ax, ay, az = nets.centre[p, 0] - x, nets.centre[p, 1] - y, nets.centre[p, 2] - z
    along = ax * frame[2, 0] + ay * frame[2, 1] + az * frame[2, 2]
    first = ax * frame[0, 0] + ay * frame[0, 1] + az * frame[0, 2]
    second = ax * frame[1, 0] + ay * frame[1, 1] + az * frame[1, 2]
    return math.sqrt(first * first + second * second) <= nets.radius[p] + reach, along


@inner
def _is_covered(nets, o, d, t, length, band, window, scratch):
    """Whether rays all around this one, just beyond the band, meet the surface near t too.

    Returns that, the mean t of these meetings, and a cosine: the band over how far t varies.
    """
    frame, point = scratch.frame, scratch.point
    total, least, most = 0.0, np.inf, -np.inf
    for cosine, sine in AROUND:
        is_met = False
        for axis in range(3):
            side = (cosine * frame[0, axis] + sine * frame[1, axis]) * (SHIFT * band)
            h, e = advance(o[axis], t, d[axis])
            h, f = two_sum(h, side)
            point[axis, 0], point[axis, 1] = two_sum(h, e + f)
        for p in range(nets.radius.size):
            x, y, z = point[0, 0], point[1, 0], point[2, 0]
            is_near, along = _near(nets, p, x, y, z, frame, band)
            if not is_near or abs(along) > nets.radius[p] + window:
                continue
            m, n = nets.degrees[p, 0], nets.degrees[p, 1]
            project(
                nets.control, nets.weight, nets.starts[p], (m + 1) * (n + 1), frame, point,
                scratch.nets[0],
            )  # fmt: skip
            found = bisect(
                scratch.nets, scratch.plain, scratch.spans, m, n, ROUNDING * nets.radius[p],
                band / 16.0, -window, window, scratch.one,
            )  # fmt: skip
            if found == 1:
                is_met = True
                there = 0.5 * (scratch.one[0, 4] + scratch.one[0, 5])
                total += there
                least = min(least, there)
                most = max(most, there)
                break
        if not is_met:
            return False, t, 0.0
    slope = (most - least) / band
    return True, t + total / (len(AROUND) * length), 1.0 / math.sqrt(1.0 + slope * slope)


@inner
def window_of(band, size, cosine):
    """Length of ray within which a root moved by the band is looked for."""
    return min(1e-3 * size + band, 8.0 * band / max(cosine, 1e-12) + 4.0 * math.sqrt(band * size))


@inner
def _patch_roots(nets, p, ray, o, d, length, t_start, band, scratch, events):
    """Note all events of one ray on one patch."""
    frame, point = scratch.frame, scratch.point
    is_near, along = _near(nets, p, o[0], o[1], o[2], frame, band + 1e-9 * nets.size)
    scale = band / BAND
    radius = nets.radius[p]
    lowest = t_start * length - along
    if not is_near or lowest > radius + band + 1e-12 * scale:
        return
    shift = along / length
    for axis in range(3):
        point[axis, 0], point[axis, 1] = advance(o[axis], shift, d[axis])
    m, n = nets.degrees[p, 0], nets.degrees[p, 1]
    project(
        nets.control, nets.weight, nets.starts[p], (m + 1) * (n + 1), frame, point, scratch.nets[0]
    )
    slop = band + ROUNDING * radius
    smallest = max(PIECE * radius, 2.0 * slop)
    begin = lowest - 1e-3 * nets.size
    leaves, rejected = scratch.leaves, scratch.rejected
    n_leaves = bisect(
        scratch.nets, scratch.plain, scratch.spans, m, n, slop, smallest, begin, np.inf, leaves
    )
    if n_leaves < 0:
        note(events, ray, t_start, nets.object_id, p, 0.5, 0.5, 0.0, band, UNDECIDED, 0)
        return
    first = min(events.count[0], events.t.size)
    n_rejected = 0
    for leaf in range(n_leaves):
        u, v = leaves[leaf, 0], leaves[leaf, 1]
        wide_u, wide_v = 4.0 * leaves[leaf, 2], 4.0 * leaves[leaf, 3]
        # Next to a root that is known already?
        is_old = False
        for k in range(first, min(events.count[0], events.t.size)):
            if abs(events.u[k] - u) <= wide_u and abs(events.v[k] - v) <= wide_v:
                is_old = True
                break
        for k in range(n_rejected):
            if abs(rejected[k, 0] - u) <= wide_u and abs(rejected[k, 1] - v) <= wide_v:
                is_old = True
                break
        if is_old:
            continue
        t_leaf = shift + 0.5 * (leaves[leaf, 4] + leaves[leaf, 5]) / length
        reach = 4.0 * math.sqrt(band * nets.size) + 8.0 * smallest
        for k in range(first, min(events.count[0], events.t.size)):
            is_such = events.kind[k] == DOUBTFUL and leaf % STRIDE != 0
            if is_such and abs(events.t[k] - t_leaf) * length <= reach:
                is_old = True
                break
        if is_old:
            continue
        found, a, b, t = _newton(nets, p, o, d, u, v, scale, scratch)
        is_root = False
        cosine, bend, per_u, per_v = 0.0, np.inf, 0.0, 0.0
        if found:
            cosine, bend, per_u, per_v = _slopes(scratch.out, d, length)
            reach = 4.0 * slop / max(cosine, 1e-300) + 8.0 * smallest
            is_root = abs(t - t_leaf) * length <= reach
        if is_root:
            for k in range(first, min(events.count[0], events.t.size)):
                same = abs(events.u[k] - a) <= wide_u and abs(events.v[k] - b) <= wide_v
                if same and abs(events.t[k] - t) * length <= 2.0 * slop / max(cosine, 1e-300):
                    is_old = True
                    break
            if is_old:
                continue
            inside = min(min(a, 1.0 - a) * per_u, min(b, 1.0 - b) * per_v)
            is_in = min(a, 1.0 - a, b, 1.0 - b) >= 0.0
            if not is_in and inside < -SHIFT * band:
                if n_rejected < MOST_REJECTED:
                    rejected[n_rejected, 0] = a
                    rejected[n_rejected, 1] = b
                    n_rejected += 1
                continue
            is_edge = inside <= SHIFT * band
            is_clean = cosine * cosine > 2.0 * SHIFT * band * bend
            if is_clean and not is_edge:
                note(events, ray, t, nets.object_id, p, a, b, cosine, band, ROOT, 0)
                continue
        else:
            a, b, t, cosine, is_edge = u, v, t_leaf, 0.0, True
            # One approach is noted once, however many pieces it has.
            for k in range(first, min(events.count[0], events.t.size)):
                reach = 4.0 * math.sqrt(band * nets.size) + 8.0 * smallest
                is_such = events.kind[k] == DOUBTFUL or events.at_edge[k] == 1
                if is_such and abs(events.t[k] - t) * length <= reach:
                    is_old = True
                    break
            if is_old:
                continue
        # A short stretch first: a long one may reach the far side of a thin body.
        for assumed in (1.0, cosine):
            window = window_of(band, nets.size, assumed)
            covered, mean, slope = _is_covered(nets, o, d, t, length, band, window, scratch)
            if covered:
                break
        if not is_root:
            t, cosine = mean, slope if covered else 1e-3
        elif covered and is_edge:
            # On which side of the edge it is met is open, and so is t, as far as the two sides go.
            cosine = min(cosine, slope)
        a, b = min(max(a, 0.0), 1.0), min(max(b, 0.0), 1.0)
        kind = DOUBTFUL
        if covered:
            kind = ROOT if is_root else COVERED
        note(events, ray, t, nets.object_id, p, a, b, cosine, band, kind, 1 if is_edge else 0)


@kernel
def patch_events(nets, first_ray, origins, directions, t_min, scratch, events):
    """Note the events of rays with the patches of one object."""
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        normal_frame(d[0] / length, d[1] / length, d[2] / length, scratch.frame)
        away = 0.0
        for axis in range(3):
            away += (o[axis] - nets.middle[axis]) ** 2
        band = BAND * max(math.sqrt(away), nets.size)
        for p in range(nets.radius.size):
            _patch_roots(nets, p, first_ray + i, o, d, length, t_min[i], band, scratch, events)
