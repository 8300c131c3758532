"""Knots of B-splines, and the Bezier pieces that splines consist of."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import FloatArray, as_floats, freeze, shown
from meshing.double_double import Pair, add, exact_sum, over, pair_of, times

# Spans shorter than this part of the domain are no pieces of their own, where the neighbour goes on as
# they do: files write knots with a dozen digits.
SHORT_SPAN = 1e-12


class Rows(NamedTuple):
    """Bezier points as affine combinations of the control points of a spline.

    Row r is the sum of coefficients (r, i) times control points ``first[r]`` + i, i from 0 to the
    degree.
    """

    coefficients: Pair  # (rows, degree + 1) each
    first: NDArray[np.int64]  # (rows,)


class Splitting(NamedTuple):
    """The Bezier pieces of a spline.

    Pieces that join share a row. A span that is too short for a piece is covered by the polynomial of
    a neighbour, whose points there are ``neighbour``; the span's own are ``own``.
    """

    rows: Rows
    first_row: list[int]  # of each piece, which has degree + 1
    spans: list[tuple[float, float]]  # where each begins and ends in the domain, mapped to [0, 1]
    neighbour: Rows
    own: Rows
    short: list[int]  # for each row of these the knot at which the span begins


def as_knots(
    values: ArrayLike, what: str, degree: int, control: str, n_points: int, along: str = ""
) -> FloatArray:
    """Return ascending knots; each that is a rounding below the one before becomes that one.

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
    down = np.flatnonzero(np.diff(given) < -SHORT_SPAN * abs(high - low))
    if down.size:
        i = int(down[0])
        raise ValueError(f"{what} descends from {given[i]:g} to {given[i + 1]:g} at {i}: sort them")
    if not high > low:
        raise ValueError(
            f"{what} leaves an empty domain, {low:g} to {high:g}: pass different knots"
        )
    knots = np.maximum.accumulate(given)
    distinct, count = np.unique(knots, return_counts=True)
    inside = (distinct >= knots[degree]) & (distinct <= knots[n_points])
    if (count[inside] > degree + 1).any():
        worst = int(np.where(inside, count, 0).argmax())
        raise ValueError(
            f"{what} holds {distinct[worst]:g} {count[worst]} times: pass a knot at most "
            f"{degree + 1} times for degree {degree}"
        )
    return freeze(knots)


def split(knots: FloatArray, degree: int, least: float = 0.0) -> Splitting:
    """Return the Bezier pieces of a spline, one for each span between different knots.

    ``least`` is the part of the domain below which a span is no piece of its own. Points are blossoms
    at the knots of a piece (de Boor's algorithm with a parameter of its own at each level).
    """
    knots = np.ldexp(knots, -math.frexp(float(np.abs(knots).max()))[1])
    p = len(knots) - degree - 1
    low, high = knots[degree], knots[p]
    breaks = {float(x) for x in knots if np.count_nonzero(knots == x) > degree}
    pieces: list[tuple[int, float, float]] = []  # number of the span, begin, end
    short: list[tuple[int, int, float, float]] = []  # the piece that covers it, and the same
    waiting: list[tuple[int, float, float]] = []  # for the next piece
    for k in range(degree, p):
        a, b = float(knots[k]), float(knots[k + 1])
        if a == b:
            continue
        if b - a > least * (high - low):
            short += [(len(pieces), *span) for span in waiting]
            pieces.append((k, waiting[0][1] if waiting else a, b))
            waiting = []
        elif pieces and not waiting and a not in breaks:
            short.append((len(pieces) - 1, k, a, b))
            pieces[-1] = (*pieces[-1][:2], b)
        else:
            waiting.append((k, a, b))
    if waiting:  # at the end, beyond a break
        short += [(len(pieces) - 1, *span) for span in waiting]
        pieces[-1] = (*pieces[-1][:2], waiting[-1][2])
    first: list[int] = []
    wanted: list[tuple[int, list[float]]] = []
    for k, a, b in pieces:
        shares = bool(first) and a not in breaks
        first.append(len(wanted) - 1 if shares else len(wanted))
        wanted += _ends(degree, k, a, b)[1 if shares else 0 :]
    spans = [
        (float((a - low) / (high - low)), float((b - low) / (high - low))) for _, a, b in pieces
    ]
    of_neighbour = [one for n, _, a, b in short for one in _ends(degree, pieces[n][0], a, b)]
    of_own = [one for _, k, a, b in short for one in _ends(degree, k, a, b)]
    return Splitting(
        _blossoms(knots, degree, wanted), first, spans, _blossoms(knots, degree, of_neighbour),
        _blossoms(knots, degree, of_own), [k for k, _ in of_own],
    )  # fmt: skip


def lengthened(
    net: FloatArray, knots: FloatArray, degree: int, low: float, high: float
) -> tuple[FloatArray, FloatArray]:
    """Return control points (n, ...) and knots of a spline whose domain reaches from ``low`` to ``high`` at least.

    Beyond its ends the polynomials of the first and the last span go on.
    """
    n = len(net)
    begin, end = knots[degree], knots[n]
    longer, net = knots.copy(), net.copy()
    if low < begin:
        longer[knots <= begin] = low
    if high > end:
        longer[knots >= end] = high
    spans = np.searchsorted(knots, begin, "right") - 1, np.searchsorted(knots, end, "left") - 1
    # A point is the blossom at its knots, of any span that they reach.
    rows = [i for i in range(n) if (longer != knots)[i + 1 : i + degree + 1].any()]
    wanted = [
        (int(spans[int(longer[i + degree] > end)]), longer[i + 1 : i + degree + 1].tolist())
        for i in rows
    ]
    net[rows] = combined(_blossoms(knots, degree, wanted), pair_of(net))[0]
    return net, longer


def _ends(degree: int, k: int, a: float, b: float) -> list[tuple[int, list[float]]]:
    """Return what the Bezier points of span k between a and b are blossoms at."""
    return [(k, [b] * j + [a] * (degree - j)) for j in range(degree + 1)]


def _blossoms(knots: FloatArray, degree: int, wanted: list[tuple[int, list[float]]]) -> Rows:
    """Return blossoms of the polynomials of spans, each at ``degree`` arguments."""
    span = np.array([k for k, _ in wanted], np.int64)
    arguments = np.array([at for _, at in wanted]).reshape(-1, degree)
    n = degree + 1
    high, low = np.zeros((n, len(wanted), n)), np.zeros((n, len(wanted), n))
    high[np.arange(n), :, np.arange(n)] = 1.0
    for level in range(1, n if wanted else 0):
        x = arguments[:, level - 1]
        i = np.arange(level, n)[:, None]
        begin, end = knots[span - degree + i], knots[span + i + 1 - level]
        at = np.broadcast_to(x, end.shape)
        # Shares of the points i and i - 1, on an axis before those of i and of rows.
        ways = exact_sum(np.stack([at, end]), -np.stack([begin, at]))
        share = over(ways, exact_sum(end, -begin))
        upper, lower = ((share[0][k, ..., None], share[1][k, ..., None]) for k in (0, 1))
        high[level:], low[level:] = add(
            times(lower, (high[level - 1 : -1], low[level - 1 : -1])),
            times(upper, (high[level:], low[level:])),
        )
    return Rows((high[degree], low[degree]), span - degree)


def combined(rows: Rows, points: Pair) -> Pair:
    """Return the points of rows; ``points`` (p, ...) are the control points."""
    (high, low), first = rows
    shape = (-1, *(1,) * (points[0].ndim - 1))
    total = pair_of(np.zeros((len(first), *points[0].shape[1:])))
    for i in range(high.shape[1]):
        at = first + i
        coefficient = high[:, i].reshape(shape), low[:, i].reshape(shape)
        total = add(total, times(coefficient, (points[0][at], points[1][at])))
    return total
