"""Bivariate nets in Bernstein form, row by row, with high and low parts: halves, values, slopes."""

import math

from meshing.kernels.jit import inner
from proof.filters.kernels.balls import GROW, ROUNDING
from proof.judges.kernels.double_double import add, interpolate


@inner
def halve_net(high, low, other_high, other_low, begin, stride, n):
    """Halve one row of a net: the left half into the other, the right one in place."""
    for level in range(n):
        other_high[begin + level * stride], other_low[begin + level * stride] = (
            high[begin], low[begin],
        )  # fmt: skip
        for k in range(n - level):
            a, b = begin + k * stride, begin + (k + 1) * stride
            h, e = add(high[a], low[a], high[b], low[b])
            high[a], low[a] = 0.5 * h, 0.5 * e
    other_high[begin + n * stride], other_low[begin + n * stride] = high[begin], low[begin]


@inner
def bounds(high, count):
    """Return the least and the most of the coefficients."""
    low, top = high[0], high[0]
    for c in range(1, count):
        low, top = min(low, high[c]), max(top, high[c])
    return low, top


@inner
def rough(row, m, n, u, v, work):
    """Return the value and both derivatives of a net at (u, v), in float64."""
    width = n + 1
    for i in range(m + 1):
        for j in range(width):
            work[0, j] = row[i * width + j]
        for level in range(n - 1):
            for j in range(n - level):
                work[0, j] += v * (work[0, j + 1] - work[0, j])
        slope = work[0, 1] - work[0, 0]
        work[1, i], work[2, i] = work[0, 0] + v * slope, n * slope
    for level in range(m - 1):
        for i in range(m - level):
            work[1, i] += u * (work[1, i + 1] - work[1, i])
            work[2, i] += u * (work[2, i + 1] - work[2, i])
    along = work[1, 1] - work[1, 0]
    return work[1, 0] + u * along, m * along, work[2, 0] + u * (work[2, 1] - work[2, 0])


@inner
def value(high, low, m, n, u, v, radius, work):
    """Return the ball of a net's value at a point given by pairs."""
    width, scale = n + 1, 0.0
    for i in range(m + 1):
        for j in range(width):
            work[0, j], work[1, j] = high[i * width + j], low[i * width + j]
            scale = max(scale, abs(work[0, j]))
        for level in range(n):
            for j in range(n - level):
                work[0, j], work[1, j] = interpolate(
                    work[0, j], work[1, j], work[0, j + 1], work[1, j + 1], v[0], v[1]
                )
        work[2, i], work[3, i] = work[0, 0], work[1, 0]
    for level in range(m):
        for i in range(m - level):
            work[2, i], work[3, i] = interpolate(
                work[2, i], work[3, i], work[2, i + 1], work[3, i + 1], u[0], u[1]
            )
    return work[2, 0], work[3, 0], (radius + (4.0 * (m + n) + 1.0) * ROUNDING * scale) * GROW


@inner
def slopes(row, m, n, radius):
    """Return the least and the most of both derivatives of a net: along u, then along v."""
    width, scale = n + 1, 0.0
    u0, u1, v0, v1 = math.inf, -math.inf, math.inf, -math.inf
    for i in range(m + 1):
        for j in range(width):
            scale = max(scale, abs(row[i * width + j]))
            if i < m:
                step = row[(i + 1) * width + j] - row[i * width + j]
                u0, u1 = min(u0, step), max(u1, step)
            if j < n:
                step = row[i * width + j + 1] - row[i * width + j]
                v0, v1 = min(v0, step), max(v1, step)
    slack = (2.0 * radius + 2.0**-51 * scale) * GROW
    return m * (u0 - slack), m * (u1 + slack), n * (v0 - slack), n * (v1 + slack)
