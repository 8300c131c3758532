"""Bernstein sums of two parameters in fractions: values, derivatives, power form, edges divided out."""

from __future__ import annotations

import math
from typing import Any

import flint

from hybrid_rt.verify.exact.crossings import (
    Rational,
)
from hybrid_rt.verify.exact.patch_pieces import Matrix


def values_at(matrix: Matrix, u: Rational, v: Rational) -> tuple[Rational, Rational, Rational]:
    """Return a Bernstein sum and its two derivatives at a point, exactly."""
    return sums_at(matrix.tolist(), u, v)


def sums_at(table: list[list[Any]], u: Rational, v: Rational) -> tuple[Any, Any, Any]:
    """As `values_at`, of a list of rows."""
    bu, du = _basis(len(table) - 1, u)
    bv, dv = _basis(len(table[0]) - 1, v)
    zero = flint.fmpq(0)
    rows = [sum((w * x for w, x in zip(bv, row, strict=True)), zero) for row in table]
    slopes = [sum((w * x for w, x in zip(dv, row, strict=True)), zero) for row in table]
    return (
        sum((w * x for w, x in zip(bu, rows, strict=True)), zero),
        sum((w * x for w, x in zip(du, rows, strict=True)), zero),
        sum((w * x for w, x in zip(bu, slopes, strict=True)), zero),
    )


def _basis(n: int, x: Rational) -> tuple[list[Rational], list[Rational]]:
    """Return the Bernstein polynomials at a point, and their derivatives."""
    x = flint.fmpq(x)
    y = 1 - x
    xs, ys = [flint.fmpq(1)], [flint.fmpq(1)]
    for _ in range(n):
        xs.append(xs[-1] * x)
        ys.append(ys[-1] * y)
    values = [math.comb(n, i) * xs[i] * ys[n - i] for i in range(n + 1)]
    lower = [math.comb(n - 1, i) * xs[i] * ys[n - 1 - i] for i in range(n)]
    slopes = [n * ((lower[i - 1] if i else 0) - (lower[i] if i < n else 0)) for i in range(n + 1)]
    return values, slopes


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
