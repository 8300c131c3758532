"""Vectors of fractions: what float64 numbers are, and what is computed of them, without rounding."""

from fractions import Fraction

import numpy as np


def exact(vector):
    return [Fraction(number) for number in np.asarray(vector).tolist()]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a, b):
    return [a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2] for k in range(3)]
