"""Settles a piece of a patch: that it holds one root, and which, or that it holds none.

The test is Krawczyk's, see `proof.exact.patches`.
"""

from __future__ import annotations

from typing import Any

import flint

from proof.exact.bernstein_sums import values_at
from proof.exact.crossings import Rational
from proof.exact.patch_pieces import (
    Matrix,
    Piece,
    differences,
    grown,
    grown_across,
    mean_jacobian,
    split_in_two,
)

# Roots are known to so many bits of their piece; within the last few a border counts as met.
ROOT_BITS = 240
BORDER_BITS = 200
# (1 + q) / (1 - q) <= 5/4: a root of the piece is certain to have its ball in the grown piece.
MOST_TURN = flint.fmpq(1, 9)


def settled(piece: Piece) -> list[Any] | None:
    """Return the piece's root as (u, v, radius), none if it has none; None if unsettled."""
    mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
    if mu == 0 or nv == 0:
        return None
    ga, gb = split_in_two(grown(mu) * piece.both * grown_across(nv))
    j00, j01, j10, j11 = mean_jacobian(ga, gb)
    det = j00 * j11 - j01 * j10
    if det == 0:
        return None
    # The rows of F, times det / ((mu + 1) (nv + 1)).
    one, two = j11 * ga - j01 * gb, j00 * gb - j10 * ga
    scale = flint.fmpq((mu + 1) * (nv + 1), abs(det))
    q = max(_turn(one, mu, nv, det, True), _turn(two, mu, nv, det, False))
    if q > MOST_TURN:
        return None
    # In units of the grown piece, 5/4 of the piece; from the middle, 1/2.
    point = flint.fmpq(1, 2), flint.fmpq(1, 2)
    if scale * max(abs(f) for f, _, _ in values_at((one, two), *point)) > (1 + q) * flint.fmpq(
        2, 5
    ):
        return []
    point = _newton(ga, gb, point)
    radius = scale * max(abs(f) for f, _, _ in values_at((one, two), *point)) / (1 - q)
    if not radius < flint.fmpq(1, 1 << 100):
        return None  # Newton has not come near; halves will
    # --- back to the patch
    five = flint.fmpq(5, 4)
    x, y = (five * c - flint.fmpq(1, 8) for c in point)
    slack = five * radius + flint.fmpq(1, 1 << BORDER_BITS)
    if not (-slack <= x <= 1 + slack and -slack <= y <= 1 + slack):
        return []
    u, v = (piece.a + x) / (1 << piece.m), (piece.b + y) / (1 << piece.n)
    return [(u, v, five * radius / (1 << min(piece.m, piece.n)))]


def _newton(a: Matrix, b: Matrix, point: tuple[Rational, Rational]) -> tuple[Rational, Rational]:
    """Take Newton steps in fractions, rounded to ever more bits."""
    u, v = point
    known = 3
    while known < ROOT_BITS:
        known = min(2 * known, ROOT_BITS + 8)
        (f, fu, fv), (g, gu, gv) = values_at((a, b), u, v)
        det = fu * gv - fv * gu
        if det == 0:
            return point
        u = _rounded(u - (f * gv - g * fv) / det, known + 24)
        v = _rounded(v - (g * fu - f * gu) / det, known + 24)
        if not (-4 < u < 5 and -4 < v < 5):
            return point
    return u, v


def _turn(matrix: Matrix, mu: int, nv: int, det: Any, along_u: bool) -> Rational:
    """Return how far the derivatives of one row of F leave the identity, in parts of det."""
    k = (mu + 1) * (nv + 1)
    zero = flint.fmpz(0)
    one, two = (det, zero) if along_u else (zero, det)
    worst_u = _farthest(differences(mu) * matrix, k * mu, one)
    worst_v = _farthest(matrix * differences(nv).transpose(), k * nv, two)
    return flint.fmpq(worst_u + worst_v, abs(det))


def _farthest(matrix: Matrix, factor: int, center: Any) -> Any:
    """Return how far the entries of a matrix, times a factor above 0, are from a number at most."""
    entries = matrix.entries()
    return max(factor * max(entries) - center, center - factor * min(entries))


def _rounded(x: Rational, number: int) -> Rational:
    """Return a fraction rounded to so many bits after the point."""
    return flint.fmpq((x * (1 << number)).floor(), 1 << number)


def distinct(
    roots: list[tuple[Rational, Rational, Rational]],
) -> list[tuple[Rational, Rational, Rational]]:
    """Keep one of the roots that neighbouring pieces share, and those on the patch."""
    slack = flint.fmpq(1, 1 << (BORDER_BITS - 8))
    kept: list[tuple[Rational, Rational, Rational]] = []
    for u, v, radius in roots:
        reach = radius + slack
        if not (-reach <= u <= 1 + reach and -reach <= v <= 1 + reach):
            continue
        if any(abs(u - x) <= reach + r and abs(v - y) <= reach + r for x, y, r in kept):
            continue
        kept.append((u, v, radius))
    return kept
