"""Certain crossings of rays with a torus: the quartic in t, in Bernstein form.

With x = w + t d from the centre, F(t) = (|x|^2 + R^2 - r^2)^2 - 4 R^2 (|x|^2 - (x.a)^2 / |a|^2), on
the stretch of the ray within a ball around the torus.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel
from proof.filters.kernels.balls import (
    GROW,
    minus,
    over,
    plus,
    product,
    scaled,
    times,
)
from proof.filters.kernels.bernstein import solve
from proof.filters.kernels.first import (
    exact,
    finish,
    note,
    nothing,
    square_of,
    start,
)

SMALLEST = 2.0**-44


class Ring(NamedTuple):
    """One torus."""

    centre: Any  # (3,) float64
    axis: Any  # (3,) float64
    major: float
    minor: float
    size: float


class TorusScratch(NamedTuple):
    """Working memory of one thread."""

    nets: Any  # (DEPTH + 3, 2, 5) float64
    radii: Any  # (DEPTH + 1,) float64
    spans: Any  # (DEPTH + 1, 2) float64
    roots: Any  # (ROOM, 6) float64
    unsure: Any  # (ROOM, 2) float64
    away: Any  # (3, 3) float64
    crossings: Any  # (MOST_CROSSINGS, CROSSING) float64


@inner
def _cosine(surface, away, d, t, length):
    """Return |n.d| / |d| at t, in float64."""
    height = 0.0
    for k in range(3):
        height += (away[k, 0] + t * d[k]) * surface.axis[k]
    rho = 0.0
    for k in range(3):
        across = away[k, 0] + t * d[k] - height * surface.axis[k]
        rho += across * across
    rho = math.sqrt(rho)
    square, slope = 0.0, 0.0
    for k in range(3):
        across = away[k, 0] + t * d[k] - height * surface.axis[k]
        n = (1.0 - surface.major / rho) * across + height * surface.axis[k]
        square += n * n
        slope += n * d[k]
    return abs(slope) / (math.sqrt(square) * length) if square > 0.0 else -1.0


@inner
def _squared(p):
    """Return the Bernstein coefficients of the square of a quadratic."""
    a, b, c = p
    return (
        times(a, a),
        times(a, b),
        over(plus(scaled(times(b, b), 2.0), times(a, c)), (3.0, 0.0, 0.0)),
        times(b, c),
        times(c, c),
    )


@inner
def _ray(surface, o, d, leaves, hit_t, scratch, out):
    away = scratch.away
    ball = surface.major + surface.minor
    shift, length, reach = start(o, d, surface.centre, surface.centre, ball, leaves, away)
    if reach < 0.0:
        nothing(out)
        return
    # |x|^2 and x.a on (-reach, reach).
    span = exact(reach)
    a, b, c = square_of(d), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    h0, h1, axis_square = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), square_of(surface.axis)
    for k in range(3):
        x = away[k, 0], away[k, 1], away[k, 2]
        b = plus(b, times(x, exact(d[k])))
        c = plus(c, times(x, x))
        h0 = plus(h0, times(x, exact(surface.axis[k])))
        h1 = plus(h1, product(d[k], surface.axis[k]))
    a, b, h1 = times(a, times(span, span)), times(b, span), times(h1, span)
    b2 = scaled(b, 2.0)
    square = (plus(minus(a, b2), c), minus(c, a), plus(plus(a, b2), c))
    low, high = minus(h0, h1), plus(h0, h1)
    # (x.a)^2 / |a|^2, and the distance from the axis squared.
    across = (
        minus(square[0], over(times(low, low), axis_square)),
        minus(square[1], over(times(low, high), axis_square)),
        minus(square[2], over(times(high, high), axis_square)),
    )
    major_square = product(surface.major, surface.major)
    rest = minus(major_square, product(surface.minor, surface.minor))
    whole = _squared((plus(square[0], rest), plus(square[1], rest), plus(square[2], rest)))
    four = scaled(major_square, 4.0)
    # A quadratic raised by two degrees.
    p, q, r = times(four, across[0]), times(four, across[1]), times(four, across[2])
    half = scaled(plus(p, q), 0.5)
    other = scaled(plus(q, r), 0.5)
    third = over(plus(plus(p, scaled(q, 4.0)), r), (6.0, 0.0, 0.0))
    parts = p, half, third, other, r
    widest = 0.0
    for k in range(5):
        total = minus(whole[k], parts[k])
        scratch.nets[0, 0, k], scratch.nets[0, 1, k] = total[0], total[1]
        widest = max(widest, total[2])
    n_roots, n_unsure = solve(
        scratch.nets, 4, widest, scratch.roots, scratch.unsure, SMALLEST, scratch.radii,
        scratch.spans,
    )  # fmt: skip
    from_t, count = math.inf, 0
    if n_unsure < 0:
        from_t = -math.inf
    for k in range(n_unsure):
        low_t = reach * (2.0 * scratch.unsure[k, 0] - 1.0)
        high_t = low_t + 2.0 * reach * scratch.unsure[k, 1]
        slack = 2.0**-48 * (abs(shift) + reach)
        if leaves or not shift + high_t < -slack:
            from_t = min(from_t, shift + low_t - slack)
    for k in range(n_roots):
        s = scratch.roots[k, 0], scratch.roots[k, 1], scratch.roots[k, 2] * GROW
        t = times(span, minus(scaled(s, 2.0), (1.0, 0.0, 0.0)))
        count = note(scratch.crossings, count, t, _cosine(surface, away, d, t[0], length))
    finish(
        scratch.crossings, count, shift, o, length, surface.centre, surface.size, leaves, hit_t,
        from_t, out,
    )  # fmt: skip


@kernel
def first_on_torus(surface, origins, directions, leaves, hit_t, scratch, out):
    """Say of each ray what is certain of its first crossing; see `turned.first_on_turned`."""
    for i in range(origins.shape[0]):
        _ray(surface, origins[i], directions[i], leaves[i], hit_t[i], scratch, out[i])
