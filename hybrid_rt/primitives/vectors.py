"""Cross products and unit normals that keep their digits.

A cross product computed as usual loses all digits of its small components where the edges are
nearly parallel; the error of a normal then moves every hit. Products with their rounding error
kept (Dekker 1971) leave a relative error of a few roundings in each component.
"""

from __future__ import annotations

import numpy as np

from meshing.checks import FloatArray, as_floats

# 2**27 + 1 splits a float64 into two halves of 26 bits (Veltkamp 1968).
_SPLITTER = 134217729.0


def _two_product(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    product = a * b
    high_a, high_b = _SPLITTER * a, _SPLITTER * b
    high_a = high_a - (high_a - a)
    high_b = high_b - (high_b - b)
    low_a, low_b = a - high_a, b - high_b
    error = low_a * low_b - (((product - high_a * high_b) - low_a * high_b) - high_a * low_b)
    return product, error


def _difference_of_products(
    a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray
) -> FloatArray:
    ab, ab_error = _two_product(a, b)
    cd, cd_error = _two_product(c, d)
    return (ab - cd) + (ab_error - cd_error)


def accurate_cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of (..., 3) arrays, each component good to 3 roundings."""
    return np.stack(
        [
            _difference_of_products(a[..., j], b[..., k], a[..., k], b[..., j])
            for j, k in ((1, 2), (2, 0), (0, 1))
        ],
        axis=-1,
    )


def unit_or_zero(vectors: FloatArray) -> FloatArray:
    """(..., 3) vectors at length one; the zero vector stays zero.

    Each component is good to 5 roundings. Scaled by a power of two first, so no square overflows.
    """
    largest = np.abs(vectors).max(axis=-1, keepdims=True)
    is_zero = largest == 0.0
    _, exponent = np.frexp(np.where(is_zero, 1.0, largest))
    scaled = np.ldexp(vectors, -exponent)
    x, y, z = scaled[..., 0:1], scaled[..., 1:2], scaled[..., 2:3]
    length = np.sqrt(x * x + y * y + z * z)
    result: FloatArray = scaled / np.where(is_zero, 1.0, length)
    return result


def apply_affine(linear: FloatArray, shift: FloatArray | float, points: FloatArray) -> FloatArray:
    """Map (..., 3) points, term by term: equal points get equal images, in any array."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    image = np.stack([r[0] * x + r[1] * y + r[2] * z for r in linear], axis=-1)
    return as_floats(image + shift, "image")
