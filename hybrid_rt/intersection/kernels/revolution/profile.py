"""The profile of a surface of revolution: its table, its value, and the ranges of its pieces.

In the half-plane of axial position z and distance rho from the axis the surface is the curve
(Z(s), R(s)), a few Bezier segments, some of them rational: sums of w z and w r over that of the weights
w. Each is cut into pieces, whose boxes and slopes are known before
any ray comes; smaller ones are measured on the way.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import BORDER_SLACK
from meshing.kernels.jit import inlined, inner, kernel

# Where a piece grown by this part of its length has at most one root, a root beside the piece itself
# proves that it has none.
GROWTH = 0.15

# Columns of the end of a segment: what it is, its height and radius, then for each side that the
# profile goes on to: unit tangent (z, r) away from the end, and curvature. Then the segment that goes on
# there, -1 for none: its row, its end (0 or 1), and the length of its derivative.
END_KIND, END_Z, END_R, END_TANGENT = range(4)
END_NEXT, END_NEXT_SIDE, END_NEXT_SPEED = 9, 10, 11
END = 12
RIM, TIP, BEND = 0.0, 1.0, 2.0

# Columns of a piece: z and r of the piece, then of the grown piece, then Z' and R' of that.
Z0, Z1, R0, R1, GZ0, GZ1, GR0, GR1, DZ0, DZ1, DR0, DR1, S0, S1 = range(14)
PIECE = 14


# Columns of a part of a turn: whether it is one; the unit vector to its middle, cosine and sine of half
# its angle, where u begins, and the share of u.
IS_PART, MIDDLE_X, MIDDLE_Y, HALF_COSINE, HALF_SINE, BEGIN, SHARE = range(7)
PART = 7


class RevolutionTable(NamedTuple):
    """Profiles of all objects, each in a frame of its own about a point on its axis."""

    middle: Any  # (k, 3) world, on the axis but for its rounding
    aside: Any  # (k, 3): the point of the axis that is meant, from `middle`, frame axes and units
    to_frame: Any  # (k,) powers of two
    turn: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    part: Any  # (k, PART): which part of a whole turn there is
    size: Any  # (k,): radius of a ball about `middle`, frame units
    roundings: Any  # (k,): of a profile's point, in units of `UNIT_ROUNDOFF`
    first_segment: Any  # (k + 1,) int64
    object_id: Any  # (k,) int32
    # (total, 3): (z, r, 0) about the middle, frame units; of a rational segment (w z, w r, w)
    control: Any
    start: Any  # (segments,) int64
    degree: Any  # (segments,) int64
    segment_id: Any  # (segments,) int32, number within its object
    outlines: Any  # (segments,) int64: bit 0 at s = 0, bit 1 at s = 1: rims, tips and bends
    end: Any  # (segments, 2, END)
    first_piece: Any  # (segments + 1,) int64
    span: Any  # (segments, 4): z and r of the segment
    whole: Any  # (k, 3): lowest and highest z, largest r of the object
    piece: Any  # (pieces, PIECE)
    trim: Any  # None: surfaces are whole; else `search.trims.Trim`, a row for each segment


class Segment(NamedTuple):
    """One segment of an object's profile: a row of a `RevolutionTable`."""

    control: Any  # the nets of all segments
    start: Any  # its first control point
    degree: Any
    outlines: Any
    end: Any  # (2, END)
    size: Any  # of the object
    object_id: Any
    row: Any
    trim: Any  # as in the table


@inlined
def segment_of(table, k, row):
    """Return one row of a table as a `Segment`, of object k."""
    return Segment(
        table.control, table.start[row], table.degree[row], table.outlines[row], table.end[row],
        table.size[k], table.object_id[k], row, table.trim,
    )  # fmt: skip


@inlined
def _restrict_columns(control, start, degree, a, b, columns, out):
    """Write the first columns of a net, restricted to [a, b] (b > 0), to ``out``."""
    for i in range(degree + 1):
        for c in range(columns):
            out[i, c] = control[start + i, c]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            for c in range(columns):
                out[i, c] = (1.0 - b) * out[i - 1, c] + b * out[i, c]
    x = a / b
    for level in range(1, degree + 1):
        for i in range(degree - level + 1):
            for c in range(columns):
                out[i, c] = (1.0 - x) * out[i, c] + x * out[i + 1, c]


@inner
def restrict_profile(control, start, degree, a, b, out):
    """Write the net of the profile between parameters a and b (b > 0) to ``out``, weights last."""
    if control[start, 2] != 0.0:
        restrict_rational(control, start, degree, a, b, out)
        return
    _restrict_columns(control, start, degree, a, b, 2, out)


@inner
def restrict_rational(control, start, degree, a, b, out):
    """Write points and weights of a rational profile between a and b (b > 0) to ``out``."""
    _restrict_columns(control, start, degree, a, b, 3, out)
    for i in range(degree + 1):
        out[i, 0] /= out[i, 2]
        out[i, 1] /= out[i, 2]


@inlined
def quotient(z, r, w, dz, dr, dw, ez, er, ew):
    """Return values, first and second derivatives of z / w and r / w."""
    per_w = 1.0 / w
    z, r = z * per_w, r * per_w
    dz, dr = (dz - dw * z) * per_w, (dr - dw * r) * per_w
    ez = (ez - 2.0 * dw * dz - ew * z) * per_w
    er = (er - 2.0 * dw * dr - ew * r) * per_w
    return z, r, dz, dr, ez, er


@inner
def bernstein_sums(control, start, degree, s):
    """Return the columns of a segment at s, then their first derivatives, then the second ones."""
    z = r = w = dz = dr = dw = ez = er = ew = 0.0
    q = 1.0 - s
    for i in range(degree + 1):
        b = binomial(degree, i) * power(s, i) * power(q, degree - i)
        z += b * control[start + i, 0]
        r += b * control[start + i, 1]
        w += b * control[start + i, 2]
    for i in range(degree):
        b = degree * binomial(degree - 1, i) * power(s, i) * power(q, degree - 1 - i)
        dz += b * (control[start + i + 1, 0] - control[start + i, 0])
        dr += b * (control[start + i + 1, 1] - control[start + i, 1])
        dw += b * (control[start + i + 1, 2] - control[start + i, 2])
    for i in range(degree - 1):
        b = degree * (degree - 1) * binomial(degree - 2, i)
        b *= power(s, i) * power(q, degree - 2 - i)
        k = start + i
        ez += b * (control[k + 2, 0] - 2.0 * control[k + 1, 0] + control[k, 0])
        er += b * (control[k + 2, 1] - 2.0 * control[k + 1, 1] + control[k, 1])
        ew += b * (control[k + 2, 2] - 2.0 * control[k + 1, 2] + control[k, 2])
    return z, r, w, dz, dr, dw, ez, er, ew


@inner
def rational_profile(control, start, degree, s):
    """Return what `profile` does, of a rational segment, by the rule of quotients."""
    if degree == 2:  # circles
        q = 1.0 - s
        b0, b1, b2 = q * q, 2.0 * s * q, s * s
        a, b, c = control[start, 0], control[start + 1, 0], control[start + 2, 0]
        z, dz, ez = b0 * a + b1 * b + b2 * c, 2.0 * (q * (b - a) + s * (c - b)), a - 2.0 * b + c
        a, b, c = control[start, 1], control[start + 1, 1], control[start + 2, 1]
        r, dr, er = b0 * a + b1 * b + b2 * c, 2.0 * (q * (b - a) + s * (c - b)), a - 2.0 * b + c
        a, b, c = control[start, 2], control[start + 1, 2], control[start + 2, 2]
        w, dw, ew = b0 * a + b1 * b + b2 * c, 2.0 * (q * (b - a) + s * (c - b)), a - 2.0 * b + c
        return quotient(z, r, w, dz, dr, dw, 2.0 * ez, 2.0 * er, 2.0 * ew)
    return quotient(*bernstein_sums(control, start, degree, s))


@inlined
def summed_degree(control, start, degree):
    """Return the degree that rounding counts: of a quotient of two sums twice as much and more."""
    return degree if control[start, 2] == 0.0 else 2 * degree + 2


@inner
def speed_degree(control, start, degree):
    """Return what bounds derivatives of a rational segment by its powers, as the degree does of others."""
    least = most = control[start, 2]
    for i in range(1, degree + 1):
        least, most = min(least, control[start + i, 2]), max(most, control[start + i, 2])
    return degree * (most / least)


@inner
def profile(control, start, degree, s):
    """Return Z, R, Z', R', Z'', R'' (Bernstein sums, weights built up from both ends)."""
    if control[start, 2] != 0.0:
        return rational_profile(control, start, degree, s)
    q = 1.0 - s
    if degree == 1:  # the usual ones, written out, in the order of the sums below
        a, b, c, d = (
            control[start, 0],
            control[start + 1, 0],
            control[start, 1],
            control[start + 1, 1],
        )
        return 0.0 + q * a + s * b, 0.0 + q * c + s * d, b - a, d - c, 0.0, 0.0
    if degree == 2:
        w0, w1, w2, d0, d1 = q * q, 2.0 * s * q, s * s, 2.0 * q, 2.0 * s
        a, b, c = control[start, 0], control[start + 1, 0], control[start + 2, 0]
        z = 0.0 + w0 * a + w1 * b + w2 * c
        dz, ez = 0.0 + d0 * (b - a) + d1 * (c - b), 2.0 * (c - 2.0 * b + a)
        a, b, c = control[start, 1], control[start + 1, 1], control[start + 2, 1]
        r = 0.0 + w0 * a + w1 * b + w2 * c
        dr, er = 0.0 + d0 * (b - a) + d1 * (c - b), 2.0 * (c - 2.0 * b + a)
        return z, r, dz, dr, ez, er
    if degree == 3:
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
    # Nobody asks for sums of the last column: the compiler leaves them out.
    z, r, _, dz, dr, _, ez, er, _ = bernstein_sums(control, start, degree, s)
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
    if control[start, 2] != 0.0:
        measure_slopes(net, degree, piece)
        return
    scale = degree / ((1.0 + 2.0 * GROWTH) * (b - a))
    for c in range(2):
        column = DZ0 if c == 0 else DR0
        piece[column], piece[column + 1] = np.inf, -np.inf
        for i in range(degree):
            slope = scale * (net[i + 1, c] - net[i, c])
            piece[column] = min(piece[column], slope)
            piece[column + 1] = max(piece[column + 1], slope)


@inner
def measure_slopes(net, degree, piece):
    """Fill the ranges of Z' and R' of a rational piece, times its weights' square: its directions.

    Bezier points of N' w - N w', degree 2n - 2, are sums of differences of points with factors above
    zero (Saito, Wang, Sederberg, "Hodographs and normals of rational curves and surfaces", CAGD 1995).
    Only their directions are asked for.
    """
    piece[DZ0] = piece[DR0] = np.inf
    piece[DZ1] = piece[DR1] = -np.inf
    for k in range(2 * degree - 1):
        z = r = 0.0
        for i in range(max(0, k + 1 - degree), k // 2 + 1):
            j = k - i + 1
            b = (j - i) * binomial(degree, i) * binomial(degree, j) * net[i, 2] * net[j, 2]
            z += b * (net[j, 0] - net[i, 0])
            r += b * (net[j, 1] - net[i, 1])
        b = 1.0 / binomial(2 * degree - 2, k)
        piece[DZ0], piece[DZ1] = min(piece[DZ0], b * z), max(piece[DZ1], b * z)
        piece[DR0], piece[DR1] = min(piece[DR0], b * r), max(piece[DR1], b * r)


@kernel(allocates=True)
def measure_pieces(control, start, degree, first_piece, span, piece):
    """Fill the pieces of all segments, and the segments' own ranges."""
    net = np.empty((degree.max() + 1, 3))
    for k in range(start.shape[0]):
        n = first_piece[k + 1] - first_piece[k]
        span[k, 0] = span[k, 2] = np.inf
        span[k, 1] = span[k, 3] = -np.inf
        for j in range(n):
            p = piece[first_piece[k] + j]
            measure_piece(control, start[k], degree[k], j / n, (j + 1) / n, net, p)
            span[k, 0], span[k, 1] = min(span[k, 0], p[Z0]), max(span[k, 1], p[Z1])
            span[k, 2], span[k, 3] = min(span[k, 2], p[R0]), max(span[k, 3], p[R1])
