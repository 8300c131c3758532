"""Compensated arithmetic: results as unevaluated sums of two float64."""

from typing import Any

from numba import types
from numba.extending import intrinsic, overload

from meshing.kernels.jit import inlined

_SPLITTER = 134217729.0  # 2**27 + 1


@inlined
def two_difference(a, b):
    """Return a - b rounded, and its rounding error (Knuth 1969)."""
    s = a - b
    z = s - a
    return s, (a - (s - z)) - (b + z)


def _lost(a, b, p):
    """Return a b - p, where p is a b rounded (Dekker 1971)."""
    c = _SPLITTER * a
    ah = c - (c - a)
    al = a - ah
    c = _SPLITTER * b
    bh = c - (c - b)
    bl = b - bh
    return ((ah * bh - p) + ah * bl + al * bh) + al * bl


@intrinsic
def _multiply_add(context: Any, a: Any, b: Any, c: Any) -> Any:
    """Compute a b + c with one rounding: an instruction, or a function of the C library."""
    del context, a, b, c

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        del context, signature
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


@overload(_lost)
def _lost_in_kernels(a, b, p):
    """Compile `_lost`: the rounding error of a product is a float64, so both have the same bits."""
    del a, b, p
    return lambda a, b, p: _multiply_add(a, b, -p)  # type: ignore[call-arg]


@inlined
def product(a, b):
    """Return a b rounded, and its rounding error."""
    p = a * b
    return p, _lost(a, b, p)


@inlined
def advance(high, low, t, d):
    """Return (high + low) + t d as an unevaluated sum of two numbers (Dekker 1971)."""
    p, e = product(t, d)
    s = high + p
    z = s - high
    low = low + ((high - (s - z)) + (p - z)) + e
    r = s + low
    return r, low - (r - s)
