"""Knots of B-splines, and the Bezier pieces that splines consist of."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import FloatArray, as_floats, freeze, shown

# Knots closer than this part of the domain are one: files write them with a dozen digits.
SAME_KNOT = 1e-12


def as_knots(
    values: ArrayLike, what: str, degree: int, control: str, n_points: int, along: str = ""
) -> FloatArray:
    """Return ascending knots; those closer than `SAME_KNOT` are made equal.

    ``what`` and ``control`` are the names of knots and control points in messages, ``along`` says
    which of the latter are meant: " along u".
    """
    given = as_floats(values, what)
    if given.shape != (n_points + degree + 1,):
        raise ValueError(
            f"{what} has shape {given.shape}: pass {n_points + degree + 1} knots, for {n_points} "
            f"control points{along} and degree {degree}"
        )
    if n_points <= degree:
        raise ValueError(
            f"{control} has {n_points} points{along}: pass at least {degree + 1} "
            f"for degree {degree}"
        )
    if not np.isfinite(given).all():
        raise ValueError(f"{what} is {shown(given.tolist())}: pass finite numbers")
    low, high = given[degree], given[n_points]
    down = np.flatnonzero(np.diff(given) < -SAME_KNOT * abs(high - low))
    if down.size:
        i = int(down[0])
        raise ValueError(f"{what} descends from {given[i]:g} to {given[i + 1]:g} at {i}: sort them")
    if not high > low:
        raise ValueError(
            f"{what} leaves an empty domain, {low:g} to {high:g}: pass different knots"
        )
    knots = given.copy()
    for i in range(1, len(knots)):
        if knots[i] - knots[i - 1] <= SAME_KNOT * (high - low):
            knots[i] = knots[i - 1]
    distinct, count = np.unique(knots, return_counts=True)
    inside = (distinct >= knots[degree]) & (distinct <= knots[n_points])
    if (count[inside] > degree + 1).any():
        worst = int(np.where(inside, count, 0).argmax())
        raise ValueError(
            f"{what} holds {distinct[worst]:g} {count[worst]} times: pass a knot at most "
            f"{degree + 1} times for degree {degree}"
        )
    return freeze(knots)


def bezier_matrix(
    knots: FloatArray, degree: int
) -> tuple[FloatArray, tuple[list[int], list[tuple[float, float]]]]:
    """Return the matrix from B-spline to Bezier points, and where the pieces are.

    Each piece is the blossom at its two knots (de Boor's algorithm with a parameter of its own at
    each level): only convex combinations. Neighbours share a row unless the spline breaks there.

    Returns
    -------
    matrix : (rows, p) float64
    first : list of int
        The first row of each piece, which has degree + 1.
    spans : list of (float, float)
        Where each begins and ends in the domain, mapped to [0, 1].
    """
    p = len(knots) - degree - 1
    low, high = knots[degree], knots[p]
    rows: list[FloatArray] = []
    first: list[int] = []
    spans: list[tuple[float, float]] = []
    for k in range(degree, p):
        a, b = knots[k], knots[k + 1]
        if a == b:
            continue
        shares = bool(first) and np.count_nonzero(knots == a) <= degree
        first.append(len(rows) - 1 if shares else len(rows))
        spans.append((float((a - low) / (high - low)), float((b - low) / (high - low))))
        for j in range(1 if shares else 0, degree + 1):
            points = np.zeros((degree + 1, p))
            points[np.arange(degree + 1), k - degree + np.arange(degree + 1)] = 1.0
            for level in range(1, degree + 1):
                x = b if level <= j else a
                for i in range(degree, level - 1, -1):
                    at = k - degree + i
                    begin, end = knots[at], knots[at + degree + 1 - level]
                    share = (x - begin) / (end - begin)
                    points[i] = (1.0 - share) * points[i - 1] + share * points[i]
            rows.append(points[degree])
    return np.array(rows), (first, spans)


def combined(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return matrix times points, term by term: equal sums get equal bits."""
    out = np.zeros((len(matrix), *points.shape[1:]))
    for k in range(matrix.shape[1]):
        out += matrix[:, k].reshape(-1, *(1,) * (points.ndim - 1)) * points[k]
    return out
