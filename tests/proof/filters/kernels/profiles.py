"""Profiles of surfaces of revolution, and the polynomial of a ray and a piece of one."""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner
from proof.filters.kernels.balls import ROUNDING, dot3, minus, plus, times
from proof.filters.kernels.bernstein import halve


class Turned(NamedTuple):
    """One surface of revolution."""

    control: Any  # (total, 2) float64: axial position, radius
    starts: Any  # (k + 1,) int64
    weights: Any  # (total, 31, 2) float64: C(n, i) C(n, j) / C(2n, i + j), twice that if i < j
    duals: Any  # (3, 3, 2) float64: inverse of (axis, radial, binormal), double-double
    origin: Any  # (3,) float64
    centre: Any  # (3,) float64: of the ball
    radius: float  # of a ball about it that holds the surface
    middle: Any  # (3,) float64: of the box
    size: float  # diameter of the box


class TurnedScratch(NamedTuple):
    """Working memory of one thread."""

    nets: Any  # (DEPTH + 3, 2, MOST_DEGREE + 1) float64
    radii: Any  # (DEPTH + 1,) float64
    spans: Any  # (DEPTH + 1, 2) float64
    roots: Any  # (ROOM, 6) float64
    unsure: Any  # (ROOM, 2) float64
    factors: Any  # (3, 31, 3) float64
    local: Any  # (4, 31) float64: high and low parts of Z - a0 and of R
    spare: Any  # (4, 31) float64
    pieces: Any  # (32, 3) float64: begin, width, and how often F was built
    line: Any  # (6, 3) float64: a0, x0, y0, a1, x1, y1
    away: Any  # (3, 3) float64
    crossings: Any  # (MOST_CROSSINGS, CROSSING) float64


@inner
def row(table, k):
    """Return a row of three numbers as a ball."""
    return table[k, 0], table[k, 1], table[k, 2]


@inner
def enter(surface, d, scratch):
    """Take the ray into coordinates along the frame."""
    line, away = scratch.line, scratch.away
    for k in range(3):
        x = surface.duals[k, 0, 0], surface.duals[k, 0, 1], 2.0**-104
        y = surface.duals[k, 1, 0], surface.duals[k, 1, 1], 2.0**-104
        z = surface.duals[k, 2, 0], surface.duals[k, 2, 1], 2.0**-104
        a, b, c = row(away, 0), row(away, 1), row(away, 2)
        line[k, 0], line[k, 1], line[k, 2] = dot3(a, b, c, x, y, z)
        line[3 + k, 0], line[3 + k, 1], line[3 + k, 2] = dot3(
            (d[0], 0.0, 0.0), (d[1], 0.0, 0.0), (d[2], 0.0, 0.0), x, y, z
        )


@inner
def load(surface, p, n, begin, width, scratch):
    """Write Z - a0 and R of a piece of a segment, and return the radii of their coefficients."""
    start, local, spare = surface.starts[p], scratch.local, scratch.spare
    a0 = row(scratch.line, 0)
    z_radius, r_radius = 0.0, 0.0
    for k in range(n + 1):
        h, e, r = minus((surface.control[start + k, 0], 0.0, 0.0), a0)
        local[0, k], local[1, k] = h, e
        local[2, k], local[3, k] = surface.control[start + k, 1], 0.0
        z_radius = max(z_radius, r)
    low, wide = 0.0, 1.0
    while wide > width:
        wide *= 0.5
        z_radius = halve(local[0], local[1], spare[0], spare[1], n, z_radius)
        r_radius = halve(local[2], local[3], spare[2], spare[3], n, r_radius)
        if begin >= low + wide:
            low += wide
            continue
        for c in range(4):
            for k in range(n + 1):
                local[c, k] = spare[c, k]
    return z_radius, r_radius


@inner
def build(n, p, z_radius, r_radius, surface, scratch):
    """Write F of the piece, and return the radius of its coefficients."""
    line, factors, local = scratch.line, scratch.factors, scratch.local
    start = surface.starts[p]
    a1 = row(line, 3)
    across_x, across_y = times(a1, row(line, 1)), times(a1, row(line, 2))
    for k in range(n + 1):
        h = local[0, k], local[1, k], z_radius
        r = local[2, k], local[3, k], r_radius
        factors[0, k, 0], factors[0, k, 1], factors[0, k, 2] = plus(
            across_x, times(h, row(line, 4))
        )
        factors[1, k, 0], factors[1, k, 1], factors[1, k, 2] = plus(
            across_y, times(h, row(line, 5))
        )
        factors[2, k, 0], factors[2, k, 1], factors[2, k, 2] = times(a1, r)
    widest = 0.0
    for m in range(2 * n + 1):
        total = (0.0, 0.0, 0.0)
        for i in range(max(0, m - n), m // 2 + 1):
            j = m - i
            term = minus(
                plus(
                    times(row(factors[0], i), row(factors[0], j)),
                    times(row(factors[1], i), row(factors[1], j)),
                ),
                times(row(factors[2], i), row(factors[2], j)),
            )
            w = surface.weights[start + i, j]
            total = plus(total, times(term, (w[0], w[1], 2.0 * ROUNDING)))
        scratch.nets[0, 0, m], scratch.nets[0, 1, m] = total[0], total[1]
        widest = max(widest, total[2])
    return widest


@inner
def is_clear(surface, begin, n, reach, scratch):
    """Whether a ray passes by the box of a segment in (a, rho), in float64 with a margin."""
    line = scratch.line
    least, greatest, most_r = math.inf, -math.inf, 0.0
    for k in range(n + 1):
        height = surface.control[begin + k, 0] - line[0, 0]
        least, greatest = min(least, height), max(greatest, height)
        most_r = max(most_r, abs(surface.control[begin + k, 1]))
    margin = 1e-9 * surface.radius
    a1, low, high = line[3, 0], -reach, reach
    if abs(a1) * reach > margin:
        s, e = (least - margin) / a1, (greatest + margin) / a1
        low, high = max(low, min(s, e)), min(high, max(s, e))
        if low > high:
            return True
    elif least > 2.0 * margin or greatest < -2.0 * margin:
        return True
    a = line[4, 0] * line[4, 0] + line[5, 0] * line[5, 0]
    b = line[1, 0] * line[4, 0] + line[2, 0] * line[5, 0]
    t = min(max(-b / a, low), high) if a > 0.0 else low
    x, y = line[1, 0] + t * line[4, 0], line[2, 0] + t * line[5, 0]
    return x * x + y * y > (most_r + margin) ** 2
