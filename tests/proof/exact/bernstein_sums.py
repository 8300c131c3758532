"""Bernstein sums of two parameters in fractions: values, derivatives, power form, edges divided out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import flint

from proof.exact.crossings import (
    Rational,
)
from proof.exact.patch_pieces import Matrix


def values_at(
    matrices: Sequence[Matrix], u: Rational, v: Rational
) -> list[tuple[Rational, Rational, Rational]]:
    """Return Bernstein sums of one shape and their two derivatives at a point, exactly.

    Of whole numbers, times powers of the denominators of u and v: the sums are two products of
    matrices.
    """
    m, n = matrices[0].nrows() - 1, matrices[0].ncols() - 1
    along_u = flint.fmpz_mat(_basis(m, u))
    along_v = flint.fmpz_mat(_basis(n, v)).transpose()
    every = u.q**m * v.q**n
    per_u, per_v = u.q ** max(m - 1, 0) * v.q**n, u.q**m * v.q ** max(n - 1, 0)
    out = []
    for matrix in matrices:
        sums = along_u * matrix * along_v
        out.append(
            (
                flint.fmpq(sums[0, 0], every),
                flint.fmpq(sums[1, 0], per_u),
                flint.fmpq(sums[0, 1], per_v),
            )
        )
    return out


def _basis(n: int, x: Rational) -> list[list[Any]]:
    """Return the Bernstein polynomials at p / q times q^n, and their derivatives times q^(n - 1)."""
    p, r = x.p, x.q - x.p
    ps, rs = [flint.fmpz(1)], [flint.fmpz(1)]
    for _ in range(n):
        ps.append(ps[-1] * p)
        rs.append(rs[-1] * r)
    values = [math.comb(n, i) * ps[i] * rs[n - i] for i in range(n + 1)]
    lower = [n * math.comb(n - 1, i) * ps[i] * rs[n - 1 - i] for i in range(n)]
    slopes = [(lower[i - 1] if i else 0) - (lower[i] if i < n else 0) for i in range(n + 1)]
    return [values, slopes]


def without_edge(table: list[list[Any]], end: int, along_u: bool) -> list[list[Any]]:
    """Divide a Bernstein sum by u, 1 - u, v or 1 - v: its edge there is zero."""
    if not along_u:
        rows = without_edge([list(row) for row in zip(*table, strict=True)], end, True)
        return [list(row) for row in zip(*rows, strict=True)]
    n = len(table) - 1
    lcm = math.lcm(*range(1, n + 1))
    if end == 0:
        return [[x * (lcm * n // (i + 1)) for x in table[i + 1]] for i in range(n)]
    return [[x * (lcm * n // (n - i)) for x in table[i]] for i in range(n)]


def power_form(coefficients: list[Any]) -> list[Rational]:
    """Return the power coefficients of a Bernstein sum."""
    n = len(coefficients) - 1
    out = []
    for k in range(n + 1):
        total = flint.fmpq(0)
        for i in range(k + 1):
            total += (-1) ** (k - i) * math.comb(n, k) * math.comb(k, i) * coefficients[i]
        out.append(total)
    return out
