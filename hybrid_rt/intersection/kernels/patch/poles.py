"""A piece of a patch with a collapsed edge, met by a ray near the point that the edge is.

Beside that point, P, S_u is v times something (the edge being v = 0), so a Jacobian says nothing,
and halving goes on until the pieces are points. But S - P = v G / W with a polynomial G, of which
the control points are B / b (P_ab - P) w_ab, b counting from the edge: a piece is in the cone of
these vectors. Across the ray, with the point at p, that leads to three tests:

- The ray keeps away from the cone: no root.
- It passes P within rounding, and the cone is narrow: it meets the piece there and nowhere else.
- Else a root has p x G = 0 and |p| W + p.G v / |p| = 0. These two polynomials in (u, v) are well
  behaved up to v = 0. If all matrices within the ranges of their partials are regular, there is one
  root at most, and Newton finds it from where the two vanish to first order.
"""

import numpy as np

from meshing.kernels.jit import inner

# Sides of a piece, as bits of a choice: along which parameter the edge runs, and at which end it is.
NO_POLE = -1
# What is known of a piece: nothing; nothing, as its cone is wide; no root; the point P is one, and the only one; no root, but
# the ray is within the band; roots only as near P as a few bands, so as good as one; one root at most.
UNKNOWN, WIDE, EMPTY, POINT, BESIDE, NEAR_POINT, SINGLE = range(7)
NEAR_BANDS = 16.0
# Cosine of half of a cone that leads away from its tip.
NARROW = 0.25
# From here on it is the other way that the piece is too long.
NARROW_ENOUGH = 0.97
# Coordinates across the ray are right to a slop each, cones hence to two.
CONE_SLOPS = 2.0
# Differences of net entries are off by two slops, times the degree, and times B / b of G.
DIFFERENCE_SLOPS = 4.0


@inner
def _is_point(seen, last, is_column, k, slop):
    """Tell whether a row, or column, of a net is a point to within rounding."""
    for c in range(3):
        low, high = np.inf, -np.inf
        for a in range(last + 1):
            x = seen[a, k, c] if is_column else seen[k, a, c]
            low, high = min(low, x), max(high, x)
        if high - low > slop:
            return False
    return True


@inner(outlined=True)
def collapsed_side(seen, degree_u, degree_v, slop):
    """Return the side of a net that is a point: 0, 1 for u = 0, 1; 2, 3 for v; else `NO_POLE`."""
    for side in range(4):
        is_column = side >= 2
        last, other = (degree_u, degree_v) if is_column else (degree_v, degree_u)
        if _is_point(seen, last, is_column, other if side % 2 else 0, slop):
            return side
    return NO_POLE


@inner
def _turn(net, degree_u, degree_v, side, rational, out):
    """Write W (S - P) as seen from a side: ``out[a, b]``, a along it, b away from it; return P."""
    along_u = side >= 2
    last_a, last_b = (degree_u, degree_v) if along_u else (degree_v, degree_u)
    p = q = 0.0
    for b in range(last_b + 1):
        k = last_b - b if side % 2 else b
        for a in range(last_a + 1):
            i, j = (a, k) if along_u else (k, a)
            w = 1.0 if rational is None or not rational else net[i, j, 3]
            x, y = net[i, j, 0], net[i, j, 1]
            if a == 0 and b == 0:
                p, q = x / w, y / w
            out[a, b, 0] = x - w * p if b > 0 else 0.0
            out[a, b, 1] = y - w * q if b > 0 else 0.0
            out[a, b, 2] = w
    return last_a, last_b, p, q


@inner
def _keeps_off(cone, last_a, last_b, x, y, slop):
    """Tell whether all of a cone lies in the half plane towards (x, y), to within rounding."""
    for a in range(last_a + 1):
        for b in range(1, last_b + 1):
            if x * cone[a, b, 0] + y * cone[a, b, 1] < -slop * cone[a, b, 2]:
                return False
    return True


@inner
def _is_single(cone, last_a, last_b, x, y, away, slop):
    """Tell whether p x G and |p| W + p.G v vanish together in one place at most; p: away (x, y)."""
    cu0 = cv0 = ru0 = rv0 = np.inf
    cu1 = cv1 = ru1 = rv1 = -np.inf
    most = 0.0
    for a in range(last_a + 1):
        for b in range(last_b + 1):
            f, g, w = cone[a, b, 0], cone[a, b, 1], cone[a, b, 2]
            most = max(most, w)
            along = away * w + x * f + y * g
            if a < last_a:
                p, q, s = cone[a + 1, b, 0], cone[a + 1, b, 1], cone[a + 1, b, 2]
                step = last_a * (away * s + x * p + y * q - along)
                ru0, ru1 = min(ru0, step), max(ru1, step)
                if b > 0:
                    step = last_a * last_b / b * (x * (q - g) - y * (p - f))
                    cu0, cu1 = min(cu0, step), max(cu1, step)
            if b < last_b:
                p, q, s = cone[a, b + 1, 0], cone[a, b + 1, 1], cone[a, b + 1, 2]
                step = last_b * (away * s + x * p + y * q - along)
                rv0, rv1 = min(rv0, step), max(rv1, step)
                if b > 0:
                    step = x * (q / (b + 1) - g / b) - y * (p / (b + 1) - f / b)
                    step *= last_b * (last_b - 1)
                    cv0, cv1 = min(cv0, step), max(cv1, step)
    if last_b == 1:
        cv0 = cv1 = 0.0
    # Beside the ray the slop of (x, y) turns the cone by slop / away: small beside its widths.
    pad = DIFFERENCE_SLOPS * (last_a + last_b) * last_b * slop * most
    reach = max(abs(cu0), abs(cu1), abs(cv0), abs(cv1)) * CONE_SLOPS * slop / away
    cu, rv = max(cu0, -cu1) - pad - reach, max(rv0, -rv1) - pad
    if not (cu > 0.0 and rv > 0.0):
        return False
    cv, ru = max(abs(cv0), abs(cv1)) + pad + reach, max(abs(ru0), abs(ru1)) + pad
    return cu * rv > cv * ru


@inner
def _start(cone, last_a, last_b, x, y, away):
    """Return where p x G and |p| W + p.G v vanish to first order at the edge; spoils ``cone``."""
    first = x * cone[0, 1, 1] - y * cone[0, 1, 0]
    last = x * cone[last_a, 1, 1] - y * cone[last_a, 1, 0]
    a = 0.5
    if first != last:
        a = min(max(first / (first - last), 0.0), 1.0)
    for level in range(last_a, 0, -1):
        for k in range(level):
            for c in range(2):
                cone[k, 1, c] += a * (cone[k + 1, 1, c] - cone[k, 1, c])
            cone[k, 0, 2] += a * (cone[k + 1, 0, 2] - cone[k, 0, 2])
    rate = -last_b * (x * cone[0, 1, 0] + y * cone[0, 1, 1])
    b = away * cone[0, 0, 2] / rate if rate > 0.0 else 1.0
    return a, min(max(b, 0.0), 1.0)


@inner(outlined=True)
def meet_pole(net, degree_u, degree_v, rational, side, slop, reach, cone):
    """Say what a ray meets of a piece whose side is collapsed.

    ``side``: see `collapsed_side`.
    ``slop``, ``reach``: rounding of a coordinate; how far away pieces matter.
    Returns ``known`` one of the constants above.
    ``a``, ``b`` where to begin Newton's iteration, along the side and away from it, in [0, 1].
    """
    last_a, last_b, p, q = _turn(net, degree_u, degree_v, side, rational, cone)
    away = np.sqrt(p * p + q * q)
    gx = gy = 0.0
    for a in range(last_a + 1):
        for b in range(1, last_b + 1):
            gx += cone[a, b, 0]
            gy += cone[a, b, 1]
    length = np.sqrt(gx * gx + gy * gy)
    if length == 0.0:
        return UNKNOWN, 0.5, 0.5
    gx, gy = gx / length, gy / length
    x, y = (p / away, q / away) if away > 0.0 else (-gx, -gy)
    # --- how far the ray keeps off the cone, which way it leads, and its side next to the ray
    least, nearest, nx, ny = 1.0, -np.inf, gx, gy
    for a in range(last_a + 1):
        for b in range(1, last_b + 1):
            f, g = cone[a, b, 0], cone[a, b, 1]
            size = np.sqrt(f * f + g * g)
            if size <= CONE_SLOPS * slop * cone[a, b, 2]:
                continue
            f, g = f / size, g / size
            least = min(least, f * gx + g * gy)
            toward = -(x * f + y * g)
            if toward > nearest:
                nearest, nx, ny = toward, f, g
    apart = 0.0
    if _keeps_off(cone, last_a, last_b, x, y, slop):
        apart = away
    else:
        nx, ny = -ny, nx
        if nx * gx + ny * gy < 0.0:
            nx, ny = -nx, -ny
        if _keeps_off(cone, last_a, last_b, nx, ny, slop):
            apart = max(nx * p + ny * q, 0.0)
    room = CONE_SLOPS * slop
    if apart > reach + room:
        return EMPTY, 0.5, 0.5
    is_narrow = least > NARROW
    if away <= slop:
        return (POINT if is_narrow else WIDE), 0.5, 0.0
    is_near = away <= NEAR_BANDS * (reach + room)
    if is_narrow and apart > room:
        if away <= reach + room:
            return BESIDE, 0.5, 0.0
        a, b = _start(cone, last_a, last_b, x, y, away)
        return (BESIDE if b < 1.0 else UNKNOWN), a, b
    if is_near and not is_narrow:
        return WIDE, 0.5, 0.5
    if not is_near and not _is_single(cone, last_a, last_b, x, y, away, slop):
        return (WIDE if least < NARROW_ENOUGH else UNKNOWN), 0.5, 0.5
    a, b = _start(cone, last_a, last_b, x, y, away)
    return (NEAR_POINT if is_near else SINGLE), a, b
