"""Compensated arithmetic: results as unevaluated sums of two float64."""

from meshing.kernels.jit import inlined

SPLITTER = 134217729.0  # 2**27 + 1


@inlined
def two_difference(a, b):
    """Return a - b rounded, and its rounding error (Knuth 1969)."""
    s = a - b
    z = s - a
    return s, (a - (s - z)) - (b + z)


@inlined
def product(a, b):
    """Return a b rounded, and its rounding error (Dekker 1971)."""
    p = a * b
    c = SPLITTER * a
    ah = c - (c - a)
    al = a - ah
    c = SPLITTER * b
    bh = c - (c - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@inlined
def advance(high, low, t, d):
    """Return (high + low) + t d as an unevaluated sum of two numbers (Dekker 1971)."""
    p, e = product(t, d)
    s = high + p
    z = s - high
    low = low + ((high - (s - z)) + (p - z)) + e
    r = s + low
    return r, low - (r - s)
