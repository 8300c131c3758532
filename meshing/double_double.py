"""Numbers as unevaluated sums of two floats: about 106 bits, for what is computed once.

A pair (high, low) stands for high + low, with |low| at most half an ulp of high. Errors of sums and
products are a few 2**-104 of the largest term (Dekker, "A floating-point technique for extending the
available precision", 1971). Arguments are arrays of any shape that broadcast.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from meshing.checks import FloatArray

Pair: TypeAlias = tuple[FloatArray, FloatArray]

# Leaves the first 26 bits of a float, so that products of parts are exact. Unlike a product with
# 2**27 + 1 it cannot overflow.
_UPPER_HALF = np.int64(-1 << 27)


def exact_sum(a: FloatArray, b: FloatArray) -> Pair:
    """Return a + b without error."""
    total = np.asarray(a + b)
    part = total - a
    return total, (a - (total - part)) + (b - part)


def exact_product(a: FloatArray, b: FloatArray) -> Pair:
    """Return a b without error, but for the last bit of the lower number and underflow."""
    product = np.asarray(a * b)
    (ah, al), (bh, bl) = _halves(a), _halves(b)
    return product, ((ah * bh - product) + ah * bl + al * bh) + al * bl


def _halves(a: FloatArray) -> Pair:
    whole = np.ascontiguousarray(a, dtype=np.float64).reshape(np.shape(a))
    high = (whole.view(np.int64) & _UPPER_HALF).view(np.float64)
    return high, whole - high


def pair_of(a: FloatArray) -> Pair:
    """Return floats as pairs."""
    return a, np.zeros_like(a)


def add(x: Pair, y: Pair) -> Pair:
    """Return x + y."""
    high, low = exact_sum(x[0], y[0])
    return _normal(high, low + (x[1] + y[1]))


def times(x: Pair, y: Pair) -> Pair:
    """Return x y."""
    high, low = exact_product(x[0], y[0])
    return _normal(high, low + (x[0] * y[1] + x[1] * y[0]))


def over(x: Pair, y: Pair) -> Pair:
    """Return x / y."""
    high = np.asarray(x[0] / y[0])
    left = add(x, times((-high, np.zeros_like(high)), y))
    return _normal(high, left[0] / y[0])


def _normal(high: FloatArray, low: FloatArray) -> Pair:
    total = np.asarray(high + low)
    return total, low - (total - high)


def unit_of(vector: Pair) -> tuple[Pair, Pair]:
    """Return the unit vector (3,) along a vector of ordinary size, and its length."""
    x, y, z = (times((h, low), (h, low)) for h, low in zip(*vector, strict=True))
    square = add(add(x, y), z)
    root = pair_of(np.sqrt(square[0]))
    # One step of Newton's iteration doubles the digits.
    left = add(square, times((-root[0], -root[1]), root))
    length = add(root, pair_of(0.5 * left[0] / root[0]))
    return over(vector, length), length


def affine_image(linear: FloatArray, shift: FloatArray, points: Pair) -> Pair:
    """Return ``linear`` times points (..., 3), plus ``shift``; equal points get equal images."""
    images = []
    for row, s in zip(linear, shift, strict=True):
        total = pair_of(np.full(points[0].shape[:-1], s))
        for axis in range(3):
            coordinate = (points[0][..., axis], points[1][..., axis])
            total = add(total, times(pair_of(np.asarray(row[axis])), coordinate))
        images.append(total)
    return np.stack([h for h, _ in images], -1), np.stack([low for _, low in images], -1)
