"""Certain crossings of rays with Bezier patches: two bivariate polynomials, bisected in balls.

With k the largest component of d and i, j the others, the ray meets S(u, v) where

    A = d_k (S_i - o_i) - d_i (S_k - o_k) = 0,    B = d_k (S_j - o_j) - d_j (S_k - o_k) = 0,

without a division and without vectors across d, so that the exact ray is meant. For rational patches
both are times the denominator W > 0, and so is the height S_k - o_k until t is asked. A piece holds no
root if a combination of A and B has coefficients of one sign. After multiplication by an approximate
inverse of the Jacobian a piece whose rows of derivatives are dominated by the diagonal holds at most
one; Miranda's theorem on a small square around an approximate root says that it is there, or the
derivatives that it is not. What is left when rounding is reached is unsure.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel
from proof.filters.kernels.balls import (
    GROW,
    ROUNDING,
    minus,
    over,
    times,
)
from proof.filters.kernels.bernstein import LOST
from proof.filters.kernels.first import exact, finish, note, nothing, start
from proof.filters.kernels.nets import bounds, halve_net, rough, slopes, value
from proof.kernels.double_double import add, multiply, two_product

# Pieces of a patch that are narrower are left; pieces of one patch; the deepest stack.
SMALLEST, MOST_PIECES, DEPTH = 2.0**-50, 3000, 104
NEWTON_STEPS = 8
# float64 combinations of coefficients are right to this part of their terms.
ROUGH = 2.0**-50


class Patches(NamedTuple):
    """All patches of one surface."""

    points: Any  # (total, 3, 2) float64: from the origin, double-double
    weights: Any  # (total,) float64
    is_rational: bool  # or all weights are 1
    starts: Any  # (k + 1,) int64
    degrees: Any  # (k, 2) int64: in u and v
    balls: Any  # (k, 4) float64: centre from the origin and radius
    origin: Any  # (3,) float64: the middle of everything
    radius: float  # of a ball about the origin that holds everything
    size: float


class PatchScratch(NamedTuple):
    """Working memory of one thread."""

    nets: Any  # (DEPTH + 1, 4, most) float64: A and B, high and low parts
    spans: Any  # (DEPTH + 1, 4) float64: begin and width in u, then in v
    radii: Any  # (DEPTH + 1,) float64
    height: Any  # (2, most) float64: S_k - o_k, high and low parts
    weight: Any  # (2, most) float64: W, and zeros
    work: Any  # (4, most) float64
    turned: Any  # (4, most) float64: nets after multiplication
    values: Any  # (12,) float64
    away: Any  # (3, 3) float64
    crossings: Any  # (MOST_CROSSINGS, CROSSING) float64


@inner
def _project(surface, p, d, k, scratch):
    """Write A, B and the height of a patch; return the radii of both."""
    i, j = (k + 1) % 3, (k + 2) % 3
    begin, end = surface.starts[p], surface.starts[p + 1]
    away, net, height = scratch.away, scratch.nets[0], scratch.height
    radius, far = 0.0, 0.0
    for c in range(end - begin):
        point = surface.points[begin + c]
        x = minus((point[i, 0], point[i, 1], 0.0), (away[i, 0], away[i, 1], away[i, 2]))
        y = minus((point[j, 0], point[j, 1], 0.0), (away[j, 0], away[j, 1], away[j, 2]))
        z = minus((point[k, 0], point[k, 1], 0.0), (away[k, 0], away[k, 1], away[k, 2]))
        a = minus(times(exact(d[k]), x), times(exact(d[i]), z))
        b = minus(times(exact(d[k]), y), times(exact(d[j]), z))
        scratch.weight[0, c], scratch.weight[1, c] = surface.weights[begin + c], 0.0
        if surface.is_rational:
            w = exact(surface.weights[begin + c])
            a, b, z = times(w, a), times(w, b), times(w, z)
        net[0, c], net[1, c], net[2, c], net[3, c] = a[0], a[1], b[0], b[1]
        height[0, c], height[1, c] = z[0], z[1]
        radius, far = max(radius, a[2], b[2]), max(far, z[2])
    return radius, far


@inner
def _one_sided(net, count, radius, p, q):
    """Whether p A + q B has coefficients of one certain sign."""
    low, top, terms = math.inf, -math.inf, 0.0
    for c in range(count):
        a, b = p * net[0, c], q * net[2, c]
        low, top, terms = min(low, a + b), max(top, a + b), max(terms, abs(a) + abs(b))
    wide = (abs(p) + abs(q)) * radius * GROW
    margin = wide + ROUGH * terms
    if low > margin or top < -margin:
        return True
    if low < -wide and top > wide and (low < -margin or top > margin):
        return False
    if low > -2.0 * margin or top < 2.0 * margin:
        # Too near for float64.
        low, top = math.inf, -math.inf
        for c in range(count):
            ah, al = multiply(net[0, c], net[1, c], p, 0.0)
            bh, bl = multiply(net[2, c], net[3, c], q, 0.0)
            h, _ = add(ah, al, bh, bl)
            low, top = min(low, h), max(top, h)
        wide = (wide + 4.0 * ROUNDING * terms) * GROW
        return low > wide or top < -wide
    return False


@inner
def _mean_slopes(net, m, n, values):
    """Write the mean derivatives A_u, A_v, B_u, B_v of a piece."""
    for side in range(2):
        row = net[2 * side]
        along, across = 0.0, 0.0
        for j in range(n + 1):
            along += row[m * (n + 1) + j] - row[j]
        for i in range(m + 1):
            across += row[i * (n + 1) + n] - row[i * (n + 1)]
        values[2 * side], values[2 * side + 1] = along / (n + 1), across / (m + 1)


@inner
def _turn(net, count, radius, inverse, turned):
    """Multiply A and B by a matrix; return the radii."""
    scale = 0.0
    for c in range(count):
        scale = max(scale, abs(net[0, c]), abs(net[2, c]))
        for side in range(2):
            ah, al = multiply(net[0, c], net[1, c], inverse[2 * side], 0.0)
            bh, bl = multiply(net[2, c], net[3, c], inverse[2 * side + 1], 0.0)
            turned[2 * side, c], turned[2 * side + 1, c] = add(ah, al, bh, bl)
    first = (abs(inverse[0]) + abs(inverse[1])) * (radius + 4.0 * ROUNDING * scale) * GROW
    second = (abs(inverse[2]) + abs(inverse[3])) * (radius + 4.0 * ROUNDING * scale) * GROW
    return first, second


NO_ROOT, ROOT, HALVE = 0, 1, 2


@inner
def _settle(net, m, n, radius, scratch):
    """Decide a piece: no root, one root (written to values), or neither."""
    values, work, turned = scratch.values, scratch.work, scratch.turned
    count = (m + 1) * (n + 1)
    _mean_slopes(net, m, n, values)
    # Along the images of both sides, and across the whole.
    if _one_sided(net, count, radius, -values[2], values[0]):
        return NO_ROOT
    if _one_sided(net, count, radius, -values[3], values[1]):
        return NO_ROOT
    _, a_u, a_v = rough(net[0], m, n, 0.5, 0.5, work)
    _, b_u, b_v = rough(net[2], m, n, 0.5, 0.5, work)
    determinant = a_u * b_v - a_v * b_u
    if determinant == 0.0:
        return HALVE
    inverse = (
        b_v / determinant, -a_v / determinant, -b_u / determinant, a_u / determinant,
    )  # fmt: skip
    first, second = _turn(net, count, radius, inverse, turned)
    uu0, _, uv0, uv1 = slopes(turned[0], m, n, first)
    vu0, vu1, vv0, _ = slopes(turned[2], m, n, second)
    b1, b2 = max(-uv0, uv1) * GROW, max(-vu0, vu1) * GROW
    if not (uu0 > b1 and vv0 > b2):
        return HALVE
    u, v = 0.5, 0.5
    for _ in range(NEWTON_STEPS):
        f, f_u, f_v = rough(turned[0], m, n, u, v, work)
        g, g_u, g_v = rough(turned[2], m, n, u, v, work)
        det = f_u * g_v - f_v * g_u
        if not abs(det) > 0.0:
            return HALVE
        du, dv = (f * g_v - g * f_v) / det, (g * f_u - f * g_u) / det
        before_u, before_v = u, v
        u, v = min(max(u - du, 0.0), 1.0), min(max(v - dv, 0.0), 1.0)
        if abs(u - before_u) + abs(v - before_v) <= 2.0**-44:
            break
    if u in (0.0, 1.0) or v in (0.0, 1.0):
        return _outside(turned, m, n, u, v, first, second, uu0, b1, b2, vv0, work)
    ul, vl = 0.0, 0.0
    least = min(uu0 - b1, vv0 - b2)
    wide = math.inf
    for step in range(3):
        f = value(turned[0], turned[1], m, n, (u, ul), (v, vl), first, work)
        g = value(turned[2], turned[3], m, n, (u, ul), (v, vl), second, work)
        most_of = max(abs(f[0]) + f[2], abs(g[0]) + g[2])
        wide = most_of / least * GROW * GROW + 2.0**-104
        if step == 2 or (abs(f[0]) <= 2.0 * f[2] and abs(g[0]) <= 2.0 * g[2]):
            break
        _, f_u, f_v = rough(turned[0], m, n, u, v, work)
        _, g_u, g_v = rough(turned[2], m, n, u, v, work)
        det = f_u * g_v - f_v * g_u
        u, ul = add(u, ul, -(f[0] * g_v - g[0] * f_v) / det, 0.0)
        v, vl = add(v, vl, -(g[0] * f_u - f[0] * g_u) / det, 0.0)
    top = 1.0 - 2.0**-50
    if u > wide and v > wide and u + wide < top and v + wide < top:
        values[0], values[1], values[2], values[3], values[4] = u, ul, v, vl, wide
        return ROOT
    return HALVE


@inner
def _outside(turned, m, n, u, v, first, second, uu0, b1, b2, vv0, work):
    """Decide by the derivatives that a root is beyond the border, from its nearest point."""
    f = value(turned[0], turned[1], m, n, (u, 0.0), (v, 0.0), first, work)
    g = value(turned[2], turned[3], m, n, (u, 0.0), (v, 0.0), second, work)
    # f < 0 at u = 1 and f > 0 at u = 0 push away; v may make up for it only so far.
    f_push = -f[0] if u == 1.0 else (f[0] if u == 0.0 else -math.inf)
    g_push = -g[0] if v == 1.0 else (g[0] if v == 0.0 else -math.inf)
    f_least, g_least = f_push / GROW - f[2], g_push / GROW - g[2]
    f_most, g_most = (abs(f[0]) + f[2]) * GROW, (abs(g[0]) + g[2]) * GROW
    if f_least > 0.0 and f_least > b1 * g_most / vv0 * GROW:
        return NO_ROOT
    if g_least > 0.0 and g_least > b2 * f_most / uu0 * GROW:
        return NO_ROOT
    return HALVE


@inner
def _note_root(surface, p, m, n, span, radius, k, d, length, scratch, count):
    """Note the crossing at the root in values."""
    values, height, work = scratch.values, scratch.height, scratch.work
    h, e = two_product(values[0], span[1])
    u = add(h, e + values[1] * span[1], span[0], 0.0)
    h, e = two_product(values[2], span[3])
    v = add(h, e + values[3] * span[3], span[2], 0.0)
    error_u = (values[4] * span[1] + 2.0**-100) * GROW
    error_v = (values[4] * span[3] + 2.0**-100) * GROW
    z = value(height[0], height[1], m, n, u, v, radius, work)
    u0, u1, v0, v1 = slopes(height[0], m, n, radius)
    wide = max(-u0, u1) * error_u + max(-v0, v1) * error_v
    z = (z[0], z[1], (z[2] + wide) * GROW)
    w, w_u, w_v = 1.0, 0.0, 0.0
    if surface.is_rational:
        weight = scratch.weight
        q = value(weight[0], weight[1], m, n, u, v, 0.0, work)
        u0, u1, v0, v1 = slopes(weight[0], m, n, 0.0)
        wide = max(-u0, u1) * error_u + max(-v0, v1) * error_v
        z = over(z, (q[0], q[1], (q[2] + wide) * GROW))
        w, w_u, w_v = rough(weight[0], m, n, u[0], v[0], work)
    t = over(z, exact(d[k]))
    # The cosine, in float64.
    begin = surface.starts[p]
    for axis in range(3):
        for c in range((m + 1) * (n + 1)):
            work[3, c] = surface.weights[begin + c] * surface.points[begin + c, axis, 0]
        x, x_u, x_v = rough(work[3], m, n, u[0], v[0], work)
        values[5 + axis], values[8 + axis] = x_u - x / w * w_u, x_v - x / w * w_v
    nx = values[6] * values[10] - values[7] * values[9]
    ny = values[7] * values[8] - values[5] * values[10]
    nz = values[5] * values[9] - values[6] * values[8]
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    slope = abs(nx * d[0] + ny * d[1] + nz * d[2])
    return note(scratch.crossings, count, t, slope / (size * length) if size > 0.0 else -1.0)


@inner
def _patch(surface, p, d, k, length, behind, scratch, count):
    """Note all crossings with one patch; return their number, and from where others may be."""
    m, n = surface.degrees[p, 0], surface.degrees[p, 1]
    total = (m + 1) * (n + 1)
    nets, spans, radii = scratch.nets, scratch.spans, scratch.radii
    radii[0], far = _project(surface, p, d, k, scratch)
    spans[0, 0], spans[0, 1], spans[0, 2], spans[0, 3] = 0.0, 1.0, 0.0, 1.0
    top, n_pieces, from_t = 0, 0, math.inf
    while top >= 0:
        n_pieces += 1
        net, span, radius = nets[top], spans[top], radii[top]
        a0, a1 = bounds(net[0], total)
        b0, b1 = bounds(net[2], total)
        limit = radius * GROW
        if a0 > limit or a1 < -limit or b0 > limit or b1 < -limit:
            top -= 1
            continue
        found = _settle(net, m, n, radius, scratch)
        if found == NO_ROOT:
            top -= 1
            continue
        if found == ROOT:
            count = _note_root(surface, p, m, n, span, far, k, d, length, scratch, count)
            top -= 1
            continue
        is_lost = max(-a0, a1, -b0, b1) <= LOST * radius
        is_small = min(span[1], span[3]) <= SMALLEST
        if is_lost or is_small or n_pieces >= MOST_PIECES or top + 1 >= spans.shape[0]:
            low, high = _height_range(m, n, span, far, d[k], scratch)
            if not high < behind:
                from_t = min(from_t, low)
            top -= 1
            continue
        # The longer side, as the ray sees it.
        along, across, width = 0.0, 0.0, n + 1
        for c in range(total):
            if c + width < total:
                along = max(
                    along, abs(net[0, c + width] - net[0, c]), abs(net[2, c + width] - net[2, c])
                )
            if c % width < n:
                across = max(across, abs(net[0, c + 1] - net[0, c]), abs(net[2, c + 1] - net[2, c]))
        scale = max(-a0, a1, -b0, b1)
        other = nets[top + 1]
        for c in range(4):
            spans[top + 1, c] = span[c]
        if m * along >= n * across:
            for side in (0, 2):
                for j in range(width):
                    halve_net(net[side], net[side + 1], other[side], other[side + 1], j, width, m)
            span[1] *= 0.5
            spans[top + 1, 1] = span[1]
            span[0] += span[1]
            steps = m
        else:
            for side in (0, 2):
                for i in range(m + 1):
                    halve_net(
                        net[side], net[side + 1], other[side], other[side + 1], i * width, 1, n
                    )
            span[3] *= 0.5
            spans[top + 1, 3] = span[3]
            span[2] += span[3]
            steps = n
        radii[top] = (radius + steps * ROUNDING * scale) * GROW
        radii[top + 1] = radii[top]
        top += 1
    return count, from_t


@inner
def _height_range(m, n, span, far, slope, scratch):
    """Return bounds of t on a piece, in float64 with a margin.

    The slope of Z / W is at most (|Z_u| + |Z / W| |W_u|) / W.
    """
    height, weight = scratch.height[0], scratch.weight[0]
    u, v = span[0] + 0.5 * span[1], span[2] + 0.5 * span[3]
    z, _, _ = rough(height, m, n, u, v, scratch.work)
    w, _, _ = rough(weight, m, n, u, v, scratch.work)
    least, most = math.inf, 0.0
    for c in range((m + 1) * (n + 1)):
        least, most = min(least, weight[c]), max(most, abs(height[c]) / weight[c])
    u0, u1, v0, v1 = slopes(height, m, n, far)
    p0, p1, q0, q1 = slopes(weight, m, n, 0.0)
    wide = 0.5 * (max(-u0, u1) + most * max(-p0, p1)) * span[1]
    wide += 0.5 * (max(-v0, v1) + most * max(-q0, q1)) * span[3]
    wide = wide / least + 2.0**-44 * most
    a, b = (z / w - wide) / slope, (z / w + wide) / slope
    return min(a, b), max(a, b)


@inner
def _ray(surface, o, d, leaves, hit_t, scratch, out):
    away = scratch.away
    shift, length, reach = start(o, d, surface.origin, surface.origin, surface.radius, leaves, away)
    if reach < 0.0:
        nothing(out)
        return
    k = 0
    for axis in range(1, 3):
        if abs(d[axis]) > abs(d[k]):
            k = axis
    behind = -math.inf if leaves else -shift - 2.0**-50 * abs(shift)
    count, from_t = 0, math.inf
    for p in range(surface.balls.shape[0]):
        radius = surface.balls[p, 3]
        wx = surface.balls[p, 0] - away[0, 0]
        wy = surface.balls[p, 1] - away[1, 0]
        wz = surface.balls[p, 2] - away[2, 0]
        cx, cy, cz = wy * d[2] - wz * d[1], wz * d[0] - wx * d[2], wx * d[1] - wy * d[0]
        limit = (radius * 1.000001 + 1e-12 * surface.radius) * length
        if cx * cx + cy * cy + cz * cz > limit * limit:
            continue
        ahead = (wx * d[0] + wy * d[1] + wz * d[2]) / length + radius + 1e-9 * surface.radius
        if ahead < behind * length:
            continue
        count, begins = _patch(surface, p, d, k, length, behind, scratch, count)
        from_t = min(from_t, begins)
    from_t = shift + from_t - 2.0**-50 * abs(shift)
    finish(
        scratch.crossings, count, shift, o, length, surface.origin, surface.size, leaves, hit_t,
        from_t, out,
    )  # fmt: skip


@kernel
def first_on_patches(surface, origins, directions, leaves, hit_t, scratch, out):
    """Say of each ray what is certain of its first crossing; see `turned.first_on_turned`."""
    for i in range(origins.shape[0]):
        _ray(surface, origins[i], directions[i], leaves[i], hit_t[i], scratch, out[i])
