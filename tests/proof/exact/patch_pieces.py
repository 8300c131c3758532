"""Pieces of a patch as a ray sees it: whole-number coefficients, restricted, halved and grown.

See `proof.exact.patches`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray

# Whole-number matrices of flint.
Matrix = Any


class Piece(NamedTuple):
    """Coefficients of f beside those of g, and the piece's place: u from a / 2^m on, and so on."""

    both: Matrix
    a: int
    m: int
    b: int
    n: int


@lru_cache(maxsize=256)
def _halves(degree: int) -> tuple[Matrix, Matrix]:
    """Return 2^n times the matrices that restrict Bernstein coefficients to either half."""
    n = degree
    lower = [
        [math.comb(i, k) << (n - i) if k <= i else 0 for k in range(n + 1)] for i in range(n + 1)
    ]
    upper = [row[::-1] for row in lower[::-1]]
    return flint.fmpz_mat(lower), flint.fmpz_mat(upper)


@lru_cache(maxsize=64)
def grown(degree: int) -> Matrix:
    """Return 8^n times the matrix that takes coefficients from [0, 1] to [-1/8, 9/8]."""
    n = degree
    rows = []
    for i in range(n + 1):
        # Blossom at n - i times -1/8 and i times 9/8: products of (1 - x, x), in eighths.
        weights = [1]
        for k in range(n):
            near, far = (9, -1) if k < n - i else (-1, 9)
            weights = [
                (weights[j] * near if j < len(weights) else 0) + (weights[j - 1] * far if j else 0)
                for j in range(len(weights) + 1)
            ]
        rows.append(weights)
    return flint.fmpz_mat(rows)


@lru_cache(maxsize=64)
def differences(degree: int) -> Matrix:
    """Return the matrix that takes coefficients to the differences of neighbours."""
    rows = [[0] * (degree + 1) for _ in range(degree)]
    for i, row in enumerate(rows):
        row[i], row[i + 1] = -1, 1
    return flint.fmpz_mat(rows)


@lru_cache(maxsize=4096)
def _part(degree: int, a: int, m: int) -> Matrix:
    """Return 2^(m n) times the matrix that restricts coefficients to a / 2^m .. (a + 1) / 2^m."""
    if m == 0:
        return flint.fmpz_mat([[int(r == c) for c in range(degree + 1)] for r in range(degree + 1)])
    return _halves(degree)[a & 1] * _part(degree, a >> 1, m - 1)


def restricted(piece: Piece, a: int, i: int, b: int, j: int) -> Piece:
    """Return a part of a piece: u from a / 2^i to (a + 1) / 2^i of it, and so on."""
    mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
    both = _part(mu, a, i) * piece.both if i else piece.both
    if j:
        both = both * _part_across(nv, b, j)
    return Piece(both, (piece.a << i) + a, piece.m + i, (piece.b << j) + b, piece.n + j)


def _twice(matrix: Matrix) -> Matrix:
    """Return the matrix for both blocks of a `Piece`, side by side, transposed."""
    n = matrix.nrows()
    wide = [[0] * (2 * n) for _ in range(2 * n)]
    for r in range(n):
        for c in range(n):
            wide[c][r] = wide[n + c][n + r] = int(matrix[r, c])
    return flint.fmpz_mat(wide)


@lru_cache(maxsize=4096)
def _part_across(degree: int, a: int, m: int) -> Matrix:
    return _twice(_part(degree, a, m))


@lru_cache(maxsize=64)
def grown_across(degree: int) -> Matrix:
    """As `grown`, for both blocks of a `Piece` and along v."""
    return _twice(grown(degree))


def halved(piece: Piece) -> list[Piece]:
    """Halve the side of a piece that is longer as the ray sees it."""
    mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
    along = [
        sum(max(sum(map(abs, line)) for line in (d * m if c == 0 else (d * m.transpose())).transpose().tolist())
            for m in split_in_two(piece.both))
        if degree else 0
        for c, degree in enumerate((mu, nv))
        for d in (differences(degree),)
    ]  # fmt: skip
    if nv == 0 or along[0] >= along[1]:
        return [restricted(piece, k, 1, 0, 0) for k in (0, 1)]
    return [restricted(piece, 0, 0, k, 1) for k in (0, 1)]


def split_in_two(both: Matrix) -> tuple[Matrix, Matrix]:
    """Return the matrices of f and of g."""
    first, second = _columns_of_one(both.ncols() // 2)
    return both * first, both * second


@lru_cache(maxsize=64)
def _columns_of_one(n: int) -> tuple[Matrix, Matrix]:
    """Return the matrices that choose the first n of 2 n columns, and the last n."""
    one, zero = [[int(i == j) for j in range(n)] for i in range(n)], [[0] * n] * n
    return flint.fmpz_mat(one + zero), flint.fmpz_mat(zero + one)


def mean_jacobian(a: Matrix, b: Matrix) -> tuple[Any, Any, Any, Any]:
    """Return f_u, f_v, g_u, g_v at their means, times (m + 1) (n + 1)."""
    m, n = a.nrows(), a.ncols()
    rows, columns = _ends_and_sums(m), _ends_and_sums(n).transpose()
    out = []
    for matrix in (a, b):
        sums = rows * matrix * columns
        out += [sums[0, 1] * m, sums[1, 0] * n]
    return out[0], out[1], out[2], out[3]


@lru_cache(maxsize=64)
def _ends_and_sums(n: int) -> Matrix:
    """Return the rows that take n numbers to the last less the first, and to their sum."""
    ends = [0] * n
    ends[0] -= 1
    ends[-1] += 1
    return flint.fmpz_mat([ends, [1] * n])


def in_floats(both: Matrix) -> tuple[FloatArray, FloatArray]:
    """Return the coefficients of f and of g in one scale, each rounded to 2^-52 of its largest."""
    tables = [(m, max(abs(x) for x in m.entries())) for m in split_in_two(both)]
    shift = max(int(max(most for _, most in tables)).bit_length() - 1000, 0)
    f, g = (
        np.array([[float(x >> shift) for x in row] for row in m.tolist()]) for m, _ in tables
    )  # fmt: skip
    return f, g


def is_beside(both: Matrix) -> bool:
    """Tell whether the ray passes by the piece's hull, or by the box along its longer tangent."""
    a, b = split_in_two(both)
    if _one_sign(a.entries()) or _one_sign(b.entries()):
        return True
    fu, fv, gu, gv = mean_jacobian(a, b)
    x, y = (fu, gu) if fu * fu + gu * gu >= fv * fv + gv * gv else (fv, gv)
    # Thirty bits of the direction are enough; whatever it is, the test is exact.
    shift = max(max(abs(x), abs(y)).bit_length() - 30, 0)
    x, y = x >> shift, y >> shift
    if x == 0 and y == 0:
        return False
    return _one_sign((x * b - y * a).entries()) or _one_sign((x * a + y * b).entries())


def _one_sign(numbers: list[Any]) -> bool:
    return all(x > 0 for x in numbers) or all(x < 0 for x in numbers)
