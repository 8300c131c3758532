"""The profile of a surface of revolution: its table, its value, and the ranges of its pieces.

In the half-plane of axial position z and distance rho from the axis the surface is the curve
(Z(s), R(s)), a few Bezier segments. Each is cut into pieces, whose boxes and slopes are known before
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


@inlined
def segment_of(table, k, row):
    """Return one row of a table as a `Segment`, of object k."""
    return Segment(
        table.control, table.start[row], table.degree[row], table.outlines[row], table.end[row],
        table.size[k], table.object_id[k], row,
    )  # fmt: skip


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
