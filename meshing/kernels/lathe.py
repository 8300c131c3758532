"""Points, partials and normals of surfaces of revolution with a Bezier profile.

S(u, v) = origin + Z(v) axis + R(v) (cos 2 pi u radial + sin 2 pi u binormal). A profile segment is
a run of rows (axial position, radius) in a flat array; ``frame`` holds origin, axis, radial and
binormal as rows. Curves are evaluated as in `meshing.kernels.bernstein`.
"""

import math

from meshing.kernels.bernstein import BINOMIAL, DIFFERENCE, NUDGES, VANISHING
from meshing.kernels.jit import inner, kernel


@inner
def curve_derivative(profile, start, degree, v, order):
    """Return the derivative of order 0..2 of one segment: axial and radial component."""
    n = degree - order
    if n < 0:
        return 0.0, 0.0
    is_low = v <= 0.5
    base = 1.0 - v if is_low else v
    ratio = (v if is_low else 1.0 - v) / base
    z, r = 0.0, 0.0
    for step in range(n + 1):
        j = n - step if is_low else step
        dz, dr = 0.0, 0.0
        for b in range(order + 1):
            dz += DIFFERENCE[order, b] * profile[start + j + b, 0]
            dr += DIFFERENCE[order, b] * profile[start + j + b, 1]
        z = z * ratio + BINOMIAL[n, j] * dz
        r = r * ratio + BINOMIAL[n, j] * dr
    scale = 1.0
    for _ in range(n):
        scale *= base
    for b in range(order):
        scale *= degree - b
    return scale * z, scale * r


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
def lathe_normal(profile, start, degree, v):
    """Return the unit normal in the meridian plane (axial, radial part), and whether S_u x S_v vanishes.

    It is (-R', Z') at length one. On the axis the normals of all meridians meet: it points along
    the axis there, away from the inside of the segment.
    """
    length = 0.0
    largest_radius = 0.0
    for j in range(degree + 1):
        largest_radius = max(largest_radius, abs(profile[start + j, 1]))
        if j < degree:
            dz = profile[start + j + 1, 0] - profile[start + j, 0]
            dr = profile[start + j + 1, 1] - profile[start + j, 1]
            length = max(length, degree * math.hypot(dz, dr))
    inward = 1.0 if v <= 0.5 else -1.0
    _, r = curve_derivative(profile, start, degree, v, 0)
    if not abs(r) > VANISHING * largest_radius:
        return -inward, 0.0, True
    for h in NUDGES:
        dz, dr = curve_derivative(profile, start, degree, v + inward * h, 1)
        size = math.hypot(dz, dr)
        if size > VANISHING * length:
            return -dr / size, dz / size, h > 0.0
        if h == 0.0:
            dz, dr = curve_derivative(profile, start, degree, v, 2)
            size = math.hypot(dz, dr)
            # Near its cusp the tangent is the second derivative times the way in.
            if size > 2.0**-26 * length:
                return -inward * dr / size, inward * dz / size, True
    return 0.0, 1.0, True


@kernel
def evaluate_lathe(profile, starts, frame, segment_id, u, v, order_u, order_v, out):
    """Write one partial derivative per row into ``out`` (n, 3)."""
    for i in range(u.size):
        p = segment_id[i]
        z, r = curve_derivative(profile, starts[p], starts[p + 1] - starts[p] - 1, v[i], order_v)
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


@kernel
def normals_of_lathe(profile, starts, frame, segment_id, u, v, out, is_degenerate):
    """Write one unit normal per row into ``out`` (n, 3), and where S_u x S_v vanishes."""
    for i in range(u.size):
        p = segment_id[i]
        a, r, flag = lathe_normal(profile, starts[p], starts[p + 1] - starts[p] - 1, v[i])
        c, s = turn(u[i])
        for axis in range(3):
            out[i, axis] = a * frame[1, axis] + r * (c * frame[2, axis] + s * frame[3, axis])
        is_degenerate[i] = flag
