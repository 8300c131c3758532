"""Points, partials and normals of surfaces of revolution with a Bezier profile.

S(u, v) = origin + Z(v) axis + R(v) (cos 2 pi u radial + sin 2 pi u binormal). A profile segment is
a run of rows (axial position, radius) in a flat array; ``frame`` holds origin, axis, radial and
binormal as rows. Curves are evaluated as in `meshing.kernels.bernstein`.

Rational profiles have rows (w z, w r, w): with N = (w z, w r) and the sum w of weights the profile is
C = N / w, so C' = (N' - w' C) / w and C'' = (N'' - 2 w' C' - w'' C) / w. Functions that take both
kinds have an argument ``rational``: None for polynomials, which the compiler knows, else True.
"""

import math

from meshing.kernels.bernstein import BINOMIAL, DIFFERENCE, NUDGES, VANISHING
from meshing.kernels.jit import inner, kernel


@inner
def _sums(profile, start, degree, v, order, rational):
    """Return the derivative of order 0..2 of the columns of one segment; w is 0 for polynomials."""
    n = degree - order
    if n < 0:
        return 0.0, 0.0, 0.0
    is_low = v <= 0.5
    base = 1.0 - v if is_low else v
    ratio = (v if is_low else 1.0 - v) / base
    z, r, w = 0.0, 0.0, 0.0
    for step in range(n + 1):
        j = n - step if is_low else step
        dz, dr, dw = 0.0, 0.0, 0.0
        for b in range(order + 1):
            dz += DIFFERENCE[order, b] * profile[start + j + b, 0]
            dr += DIFFERENCE[order, b] * profile[start + j + b, 1]
            if rational is not None:
                dw += DIFFERENCE[order, b] * profile[start + j + b, 2]
        z = z * ratio + BINOMIAL[n, j] * dz
        r = r * ratio + BINOMIAL[n, j] * dr
        if rational is not None:
            w = w * ratio + BINOMIAL[n, j] * dw
    scale = 1.0
    for _ in range(n):
        scale *= base
    for b in range(order):
        scale *= degree - b
    return scale * z, scale * r, scale * w


@inner
def curve_derivative(profile, start, degree, v, order, rational):
    """Return the derivative of order 0..2 of one segment: axial and radial component."""
    if rational is None:
        z, r, _ = _sums(profile, start, degree, v, order, rational)
        return z, r
    z, r, w = _sums(profile, start, degree, v, 0, rational)
    z, r = z / w, r / w
    if order == 0:
        return z, r
    z1, r1, w1 = _sums(profile, start, degree, v, 1, rational)
    z1, r1 = (z1 - w1 * z) / w, (r1 - w1 * r) / w
    if order == 1:
        return z1, r1
    z2, r2, w2 = _sums(profile, start, degree, v, 2, rational)
    return (z2 - 2.0 * w1 * z1 - w2 * z) / w, (r2 - 2.0 * w1 * r1 - w2 * r) / w


@inner
def turn(u):
    """Cosine and sine of 2 pi u, exact at whole quarters of a turn."""
    quarter = math.floor(4.0 * u + 0.5)
    angle = 2.0 * math.pi * (u - 0.25 * quarter)
    c, s = math.cos(angle), math.sin(angle)
    k = int(quarter) % 4
    if k == 1:
        return -s, c
    if k == 2:
        return -c, -s
    if k == 3:
        return s, -c
    return c, s


@inner
def lathe_normal(profile, start, degree, v, rational):
    """Return the unit normal in the meridian plane (axial, radial part), and whether S_u x S_v vanishes.

    It is (-R', Z') at length one. On the axis the normals of all meridians meet: it points along
    the axis there, away from the inside of the segment.
    """
    length = 0.0
    largest_radius = 0.0
    for j in range(degree + 1):
        z, r = _control_point(profile, start + j, rational)
        largest_radius = max(largest_radius, abs(r))
        if j < degree:
            next_z, next_r = _control_point(profile, start + j + 1, rational)
            length = max(length, degree * math.hypot(next_z - z, next_r - r))
    inward = 1.0 if v <= 0.5 else -1.0
    _, r = curve_derivative(profile, start, degree, v, 0, rational)
    if not abs(r) > VANISHING * largest_radius:
        return -inward, 0.0, True
    for h in NUDGES:
        dz, dr = curve_derivative(profile, start, degree, v + inward * h, 1, rational)
        size = math.hypot(dz, dr)
        if size > VANISHING * length:
            return -dr / size, dz / size, h > 0.0
        if h == 0.0:
            dz, dr = curve_derivative(profile, start, degree, v, 2, rational)
            size = math.hypot(dz, dr)
            # Near its cusp the tangent is the second derivative times the way in.
            if size > 2.0**-26 * length:
                return -inward * dr / size, inward * dz / size, True
    return 0.0, 1.0, True


@inner
def _control_point(profile, k, rational):
    """Return axial position and radius of one Bezier point."""
    if rational is None:
        return profile[k, 0], profile[k, 1]
    return profile[k, 0] / profile[k, 2], profile[k, 1] / profile[k, 2]


@kernel(allocates=True)
def evaluate_lathe(profile, starts, frame, segment_id, u, v, order_u, order_v, rational, out):
    """Write one partial derivative per row into ``out`` (n, 3); u in whole turns."""
    for i in range(u.size):
        p = segment_id[i]
        degree = starts[p + 1] - starts[p] - 1
        z, r = curve_derivative(profile, starts[p], degree, v[i], order_v, rational)
        c, s = turn(u[i])
        if order_u == 1:
            c, s = -2.0 * math.pi * s, 2.0 * math.pi * c
        elif order_u == 2:
            c, s = -4.0 * math.pi * math.pi * c, -4.0 * math.pi * math.pi * s
        if order_u > 0:
            z = 0.0
        for axis in range(3):
            value = z * frame[1, axis] + r * (c * frame[2, axis] + s * frame[3, axis])
            out[i, axis] = value + frame[0, axis] if order_u + order_v == 0 else value


@kernel(allocates=True)
def normals_of_lathe(profile, starts, frame, segment_id, u, v, rational, out, is_degenerate):
    """Write one unit normal per row into ``out`` (n, 3), and where S_u x S_v vanishes."""
    for i in range(u.size):
        p = segment_id[i]
        degree = starts[p + 1] - starts[p] - 1
        a, r, flag = lathe_normal(profile, starts[p], degree, v[i], rational)
        c, s = turn(u[i])
        for axis in range(3):
            out[i, axis] = a * frame[1, axis] + r * (c * frame[2, axis] + s * frame[3, axis])
        is_degenerate[i] = flag
