"""Ball arithmetic in double-double: (h, l, e) holds all numbers within e of h + l.

The radius e is a float64. Every operation adds its own rounding, at most 7 u^2 of the result for
products and 3 u^2 for sums (Joldes, Muller, Popescu 2017, "Tight and rigorous error bounds for
basic building blocks of double-word arithmetic"), taken as 2^-102; four times that for quotients. A comparison that a ball does
not settle, or that holds a NaN, is false both ways.
"""

import math

from meshing.kernels.jit import inner
from proof.kernels.double_double import (
    add,
    divide,
    multiply,
    root,
    two_product,
    two_sum,
)

# Rounding of one operation, relative: more than 7 u^2 = 2^-103.
ROUNDING = 2.0**-102
# Radii are computed in float64: a few roundings each.
GROW = 1.0 + 2.0**-40
# What products lose that are too small to be split.
TINY = 2.0**-1000


@inner
def difference(a, b):
    """Return a - b of two float64, exactly."""
    h, e = two_sum(a, -b)
    return h, e, 0.0


@inner
def product(a, b):
    """Return a b of two float64, exactly up to underflow."""
    h, e = two_product(a, b)
    return h, e, TINY


@inner
def plus(a, b):
    """Add two balls."""
    h, e = add(a[0], a[1], b[0], b[1])
    return h, e, (a[2] + b[2] + ROUNDING * abs(h)) * GROW


@inner
def minus(a, b):
    """Subtract two balls."""
    h, e = add(a[0], a[1], -b[0], -b[1])
    return h, e, (a[2] + b[2] + ROUNDING * abs(h)) * GROW


@inner
def times(a, b):
    """Multiply two balls."""
    h, e = multiply(a[0], a[1], b[0], b[1])
    radius = abs(a[0]) * b[2] + abs(b[0]) * a[2] + a[2] * b[2]
    return h, e, (radius + ROUNDING * abs(h) + TINY) * GROW


@inner
def over(a, b):
    """Divide two balls; the radius is infinite if the divisor may be 0."""
    least = abs(b[0]) / GROW - b[2]
    if not least > 0.0:
        return 0.0, 0.0, math.inf
    h, e = divide(a[0], a[1], b[0], b[1])
    return h, e, ((a[2] + abs(h) * b[2]) / least + 4.0 * ROUNDING * abs(h) + TINY) * GROW


@inner
def square_root(a):
    """Return the root of a ball that is positive; else the radius is infinite."""
    least = a[0] / GROW - a[2]
    if not least > 0.0:
        return 0.0, 0.0, math.inf
    h, e = root(a[0], a[1])
    # |sqrt(a + x) - sqrt(a)| <= |x| / sqrt(a), and less than twice that over sqrt(least).
    return h, e, (a[2] / math.sqrt(least) + 64.0 * ROUNDING * h) * GROW


@inner
def scaled(a, power):
    """Multiply a ball by a power of two."""
    return a[0] * power, a[1] * power, a[2] * abs(power)


@inner
def sign(a):
    """Return 1 or -1 if all numbers of a ball have this sign; else 0."""
    if a[0] > a[2] * GROW:
        return 1
    if a[0] < -a[2] * GROW:
        return -1
    return 0


@inner
def dot3(a, b, c, x, y, z):
    """Return (a, b, c) . (x, y, z)."""
    return plus(plus(times(a, x), times(b, y)), times(c, z))
