"""Numbers as unevaluated sums of two floats: about 106 bits, for what is computed once.

A pair (high, low) stands for high + low, with |low| at most half an ulp of high. Errors of sums and
products are a few 2**-104 of the largest term (Dekker, "A floating-point technique for extending the
available precision", 1971). Arguments are arrays of any shape that broadcast.
"""

import math
from typing import TypeAlias

import numpy as np

from meshing.checks import FloatArray

Pair: TypeAlias = tuple[FloatArray, FloatArray]

# Points that are transformed at a time, to spare memory.
BLOCK = 1 << 14

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
    high, low = (x.reshape(-1, 1, 3) for x in points)
    image, left = np.empty(points[0].shape), np.empty(points[0].shape)
    for begin in range(0, len(high), BLOCK):
        rows = slice(begin, begin + BLOCK)
        terms = times(pair_of(linear), (high[rows], low[rows]))
        total = pair_of(shift)
        for axis in range(3):
            total = add(total, (terms[0][..., axis], terms[1][..., axis]))
        image.reshape(-1, 3)[rows], left.reshape(-1, 3)[rows] = total
    return image, left


# --- images that are rounded, and how far from the exact ones they may be; 0 if they are exact


def rounded_image(linear: FloatArray, shift: FloatArray, points: Pair) -> tuple[FloatArray, float]:
    """Return ``linear`` times points (..., 3), plus ``shift``, rounded; and what that moves one at most."""
    image, left = affine_image(linear, shift, points)
    return image, _largest(left)


def rounding_of_product(a: float, b: float) -> float:
    """Return by how much the float a * b differs from the product."""
    return abs(float(exact_product(np.asarray(a), np.asarray(b))[1]))


def stretched(linear: FloatArray, distance: float) -> float:
    """Return what becomes of a distance at most."""
    return distance and distance * float(np.linalg.norm(linear, 2)) * (1.0 + 2.0**-40)


def misfit(
    linear: FloatArray,
    scale: float,
    axis: FloatArray | None = None,
    image: FloatArray | None = None,
) -> float:
    """Bound the distance of ``linear`` from some similarity: on |linear x - scale Q x| for unit vectors x.

    Q is orthogonal, and takes the direction of the unit vector ``axis`` to that of ``image``.
    """
    exponent = math.frexp(scale)[1]
    linear, scale = np.ldexp(linear, -exponent), math.ldexp(scale, -exponent)
    # The singular values' squares less scale^2 are the eigenvalues of linear^T linear - scale^2.
    squares = affine_image(linear.T, np.zeros(3), pair_of(linear.T))
    one = times(pair_of(np.asarray(scale)), pair_of(-scale * np.eye(3)))
    off = 0.51 * float(np.linalg.norm(add(squares, one)[0])) / scale
    if axis is not None and image is not None:
        # Q is the nearest orthogonal matrix, and the least rotation that then takes the axis to its image.
        turned = affine_image(linear, np.zeros(3), pair_of(axis))
        gap = add(turned, times(pair_of(np.asarray(-scale)), pair_of(image)))
        off = 2.0 * off + 1.01 * _largest(gap[0])
    return math.ldexp(off, exponent)


def _largest(vectors: FloatArray) -> float:
    """Return the length of the longest of vectors (..., 3), and a little more."""
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0)) * (1.0 + 2.0**-48)
