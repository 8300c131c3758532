"""Polynomials in x and y as Bezier patches."""

from fractions import Fraction
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import as_floats, shown
from meshing.double_double import Pair
from meshing.kernels.bernstein import MAX_DEGREE

NAME = "BezierPatches.from_polynomial"


def net_of_polynomial(coefficients: ArrayLike, x: ArrayLike, y: ArrayLike) -> Pair:
    """Return the control net of z = sum of coefficients[i, j] x^i y^j over a rectangle.

    It is computed in fractions: each number is the float next to the true one, with what is left of that.
    """
    c = as_floats(coefficients, f"{NAME} coefficients")
    if c.ndim != 2 or not all(1 <= count <= MAX_DEGREE + 1 for count in c.shape):
        raise ValueError(
            f"{NAME} coefficients has shape {c.shape}: pass (m + 1, n + 1), with m and n up to "
            f"{MAX_DEGREE}"
        )
    for i, j in np.argwhere(~np.isfinite(c))[:1]:
        raise ValueError(f"{NAME} coefficients[{i}, {j}] is {c[i, j]}: pass finite numbers")
    # A patch is at least of degree 1.
    m, n = (max(count - 1, 1) for count in c.shape)
    exact = np.full((m + 1, n + 1), Fraction(0))
    exact[: c.shape[0], : c.shape[1]] = [[Fraction(number) for number in row] for row in c.tolist()]
    (x0, x1), (y0, y1) = _interval(x, "x"), _interval(y, "y")
    z = _bernstein_matrix(m, x0, x1) @ exact @ _bernstein_matrix(n, y0, y1).T
    net = np.empty((m + 1, n + 1, 3), dtype=object)
    net[..., 0] = np.array([x0 + (x1 - x0) * k / m for k in range(m + 1)])[:, None]
    net[..., 1] = [y0 + (y1 - y0) * k / n for k in range(n + 1)]
    net[..., 2] = z
    try:
        rounded = np.vectorize(float)(net)
    except OverflowError:
        raise ValueError(f"{NAME} leaves the range of floats: pass smaller numbers") from None
    return rounded, np.vectorize(float)(net - np.vectorize(Fraction)(rounded))


def _interval(values: ArrayLike, name: str) -> tuple[Fraction, Fraction]:
    ends = as_floats(values, f"{NAME} {name}")
    if not (ends.shape == (2,) and np.isfinite(ends).all() and ends[0] < ends[1]):
        raise ValueError(
            f"{NAME} {name} is {shown(ends.tolist())}: pass two finite numbers, the first below the "
            "second"
        )
    return Fraction(float(ends[0])), Fraction(float(ends[1]))


def _bernstein_matrix(degree: int, begin: Fraction, end: Fraction) -> np.ndarray:
    """Return, in column i, the Bernstein coefficients of t^i on an interval.

    Number k is the blossom of t^i at k times ``end`` and degree - k times ``begin``: the elementary
    symmetric polynomial of order i of these numbers over comb(degree, i).
    """
    matrix = np.full((degree + 1, degree + 1), Fraction(0))
    for k in range(degree + 1):
        symmetric = [Fraction(1)] + [Fraction(0)] * degree
        for number in [end] * k + [begin] * (degree - k):
            for i in range(degree, 0, -1):
                symmetric[i] += number * symmetric[i - 1]
        matrix[k] = [e / comb(degree, i) for i, e in enumerate(symmetric)]
    return matrix
