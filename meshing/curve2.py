"""Curves in the parameter plane: rational Bezier arcs, and where their coordinates turn.

An arc is cut where x or y stops growing or falling: at the zeros of x'w - x w', which is a polynomial
in Bernstein form (Sederberg and Wang, "Rational hodographs", CAGD 4, 1987). Its zeros are isolated by
sign variations in integers, so none is overlooked.
"""

from fractions import Fraction
from itertools import pairwise
from math import comb, lcm

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import FloatArray, as_floats, freeze, number, shown, whole
from meshing.double_double import exact_sum, pair_of, times
from meshing.double_double import over as quotient
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.kernels.trims import points_of_arc
from meshing.knots import as_knots, combined, split
from meshing.nets import check_weights

# Curves may leave the unit square, by a whole turn where the surface closes on itself.
LOWEST, HIGHEST = -1.0, 2.0
# Zeros are isolated to 2**-48. Between one and its cut the coordinate turns back by the square of
# that times the second derivative: below rounding.
HALVINGS = 48


class Curve2:
    """A rational Bezier arc in the parameter plane (u, v) of a surface.

    Parameters
    ----------
    control : (n + 1, 2) array
        Points (u, v), degree n from 1 to 30, each number from -1 to 2.
    weights : (n + 1,) array, optional
        Positive, the smallest at least 1e-6 of the largest; only their ratios matter. Default: all
        1.
    gap_share : float
        Part of the gap of a `TrimmedSurface` that counts at this curve, from 0 to 1.

    Attributes
    ----------
    control : (n + 1, 2) float64, read-only
    weights : (n + 1,) float64, read-only, or None if all are equal
    gap_share

    Raises
    ------
    ValueError, TypeError
        For a wrong shape or degree, NaN or infinity, numbers outside [-1, 2], an arc shrunk to a
        point, and weights that are not positive or too far apart.
    """

    def __init__(
        self, control: ArrayLike, weights: ArrayLike | None = None, gap_share: float = 1.0
    ) -> None:
        points = as_floats(control, "Curve2 control")
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"Curve2 control has shape {points.shape}: pass (n + 1, 2)")
        if not 1 <= len(points) - 1 <= MAX_DEGREE:
            raise ValueError(f"Curve2 control has degree {len(points) - 1}: pass 1 to {MAX_DEGREE}")
        outside = ~((points >= LOWEST) & (points <= HIGHEST)).all(axis=1)
        if outside.any():
            i = int(outside.argmax())
            raise ValueError(
                f"Curve2 control point {i} is {points[i].tolist()}: pass finite numbers from "
                f"{LOWEST:g} to {HIGHEST:g}, the surface is over the unit square"
            )
        if (points == points[0]).all():
            raise ValueError(f"Curve2 control is the point {points[0].tolist()}: leave the arc out")
        # -0.0 becomes 0.0.
        self.control: FloatArray = freeze(points + 0.0)
        self.weights: FloatArray | None = None
        if weights is not None:
            array = _as_weights(weights, "Curve2 weights", len(points))
            if (array != array[0]).any():
                self.weights = freeze(array.copy())
        self.gap_share = number(gap_share, "Curve2 gap_share", at_least=0.0, up_to=1.0)

    @property
    def degree(self) -> int:
        """Degree of the arc."""
        return len(self.control) - 1

    def __repr__(self) -> str:
        """Name degree and ends."""
        ends = f"{self.control[0].tolist()} to {self.control[-1].tolist()}"
        kind = "rational, " if self.weights is not None else ""
        return f"Curve2({kind}degree {self.degree}, {ends})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle control points and weights; loading checks them again."""
        weights = None if self.weights is None else np.array(self.weights)
        return type(self), (np.array(self.control), weights, self.gap_share)

    def point(self, s: ArrayLike) -> FloatArray:
        """Return points of the arc, (n, 2) float64, at parameters s (n,) from 0 to 1."""
        at = np.atleast_1d(as_floats(s, "Curve2 s")).ravel()
        out = np.empty((len(at), 2))
        points_of_arc(self.homogeneous(), at, out)
        return out

    def homogeneous(self) -> FloatArray:
        """Return (n + 1, 3) float64: w u, w v and w, the largest w in [1/2, 1)."""
        w = np.ones(len(self.control)) if self.weights is None else self.weights
        w = np.ldexp(w, -int(np.frexp(w.max())[1]))[:, None]
        return np.concatenate([w * self.control, w], axis=1)

    def cuts(self) -> list[float]:
        """Return the parameters between which both coordinates are monotone, 0 and 1 included."""
        if self.degree == 1:
            return [0.0, 1.0]
        found = {0.0, 1.0}
        for axis in range(2):
            found |= _turns(_slopes(self.control[:, axis], self.weights))
        return sorted(found)


def _as_weights(weights: ArrayLike, what: str, n: int) -> FloatArray:
    array = as_floats(weights, what)
    if array.shape != (n,):
        raise ValueError(f"{what} has shape {array.shape} for {n} points: pass one each")
    check_weights(array, what)
    return array


def bspline(
    control: ArrayLike,
    knots: ArrayLike,
    degree: int,
    weights: ArrayLike | None = None,
    *,
    low: ArrayLike = (0.0, 0.0),
    high: ArrayLike = (1.0, 1.0),
) -> list[Curve2]:
    """Return a B-spline curve, rational with weights, as the arcs that it consists of.

    CAD files give the edges of a face so, in the parameters of its surface. Several such curves,
    one after the other, make a loop.

    Parameters
    ----------
    control : (p, 2) array
        Control points.
    knots : (p + degree + 1,) array
        Ascending, each as often as it counts. The curve runs from ``knots[degree]`` to ``knots[p]``.
    degree : int
        From 1 to 30.
    weights : (p,) array, optional
        Positive; the smallest at least 1e-6 of the largest.
    low, high : (2,) array
        Where the parameters of the surface begin and end; they are mapped to [0, 1]. For a
        `NurbsSurface` these are ``knots_u[degree_u]`` and ``knots_u[p]``, and the same of v.

    Returns
    -------
    list of Curve2
        One arc for each span between knots that is not empty, of control points that are the floats
        next to the true ones. Spans on which the curve stays in one
        point (degree + 1 equal control points) are left out. An arc is rational only where the
        weights that count on its span differ.

    Raises
    ------
    ValueError, TypeError
        For shapes that do not match, knots that descend or repeat more than degree + 1 times, an
        empty domain, a curve that is one point, and arcs that `Curve2` refuses.
    """
    points = as_floats(control, "bspline control")
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"bspline control has shape {points.shape}: pass (p, 2)")
    for i in np.flatnonzero(~np.isfinite(points).all(axis=1))[:1]:
        raise ValueError(f"bspline control point {i} is {points[i].tolist()}: pass finite numbers")
    degree = whole(degree, "bspline degree", at_least=1, up_to=MAX_DEGREE)
    vector = as_knots(knots, "bspline knots", degree, "bspline control", len(points))
    begin, end = as_floats(low, "bspline low"), as_floats(high, "bspline high")
    is_pair = begin.shape == (2,) and end.shape == (2,)
    if not (is_pair and np.isfinite([begin, end]).all() and (begin < end).all()):
        raise ValueError(
            f"bspline low is {shown(begin.tolist())} and high {shown(end.tolist())}: pass (u, v) each, "
            "finite, the first below the second"
        )
    w = np.ones(len(points))
    if weights is not None:
        w = _as_weights(weights, "bspline weights", len(points))
    mapped = quotient(exact_sum(points, -begin), exact_sum(end, -begin))
    over = mapped[0]
    parts = split(vector, degree)
    if (w == w[0]).all():
        # Weights that are sums of equal ones would differ by rounding.
        fine, heavy = combined(parts.rows, mapped)[0], None
    else:
        weighted = combined(parts.rows, times(mapped, pair_of(w[:, None])))
        by = combined(parts.rows, pair_of(w[:, None]))
        fine, heavy = quotient(weighted, by)[0], by[0][:, 0]
    pieces = [slice(k, k + degree + 1) for k in parts.first_row]
    # Which control points count on each span.
    counts = [
        np.unique(
            (parts.rows.first[piece, None] + np.arange(degree + 1))[
                parts.rows.coefficients[0][piece] != 0.0
            ]
        )
        for piece in pieces
    ]
    for piece, used in zip(pieces, counts, strict=True):
        # To the bit, for the neighbours that begin or end there.
        if (over[used] == over[used][0]).all():
            fine[piece] = over[used][0]
    arcs = [
        Curve2(fine[piece], None if heavy is None or np.ptp(w[used]) == 0.0 else heavy[piece])
        for piece, used in zip(pieces, counts, strict=True)
        if (fine[piece] != fine[piece][0]).any()
    ]
    if not arcs:
        raise ValueError(
            f"bspline control leaves the point {fine[0].tolist()} on all spans: leave the curve out"
        )
    return arcs


def circle(center: ArrayLike, radius: float | tuple[float, float]) -> list[Curve2]:
    """Return a circle, or an ellipse with its axes along u and v, as a loop of four arcs.

    Parameters
    ----------
    center : (2,) array
        In (u, v).
    radius : float, or two floats
        One radius, or one along u and one along v.

    Returns
    -------
    list of Curve2
        The four arcs, counterclockwise.

    Raises
    ------
    ValueError, TypeError
        As for `Curve2`, and for a radius that is not positive.
    """
    middle = as_floats(center, "circle center")
    sides = as_floats(radius, "circle radius")
    if middle.shape != (2,) or sides.shape not in ((), (1,), (2,)) or not (sides > 0.0).all():
        raise ValueError(
            f"circle has center {shown(center)} and radius {shown(radius)}: pass two numbers, and a "
            "positive radius, or one along u and one along v"
        )
    corners = np.array(
        [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    )
    points = middle + corners * sides
    weights = (1.0, np.sqrt(0.5), 1.0)
    return [Curve2(points[k : k + 3], weights) for k in range(0, 8, 2)]


def polygon(corners: ArrayLike) -> list[Curve2]:
    """Return a closed polygon as a loop of straight lines.

    Parameters
    ----------
    corners : (k, 2) array
        In (u, v), at least three. The last one is joined to the first.

    Returns
    -------
    list of Curve2
        The k sides, in order.

    Raises
    ------
    ValueError, TypeError
        As for `Curve2`, for fewer than three corners, and if the last one repeats the first.
    """
    points = as_floats(corners, "polygon corners")
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise ValueError(f"polygon corners has shape {points.shape}: pass (k, 2), k at least 3")
    if (points[-1] == points[0]).all():
        raise ValueError(
            f"polygon: the last corner, {points[-1].tolist()}, repeats the first: leave it out, as it is "
            "joined to the first anyway"
        )
    around = np.concatenate([points, points[:1]])
    return [Curve2(around[k : k + 2]) for k in range(len(points))]


def _slopes(x: FloatArray, weights: FloatArray | None) -> list[int]:
    """Return x'w - x w' in Bernstein form, times a positive number: integers."""
    n = len(x) - 1
    values = [Fraction(number) for number in x.tolist()]
    if weights is None:
        exact = [b - a for a, b in pairwise(values)]
    else:
        w = [Fraction(number) for number in weights.tolist()]
        exact = []
        for k in range(2 * n - 1):
            total = Fraction(0)
            for i in range(max(0, k - n + 1), k // 2 + 1):
                j = k - i + 1
                total += (j - i) * comb(n, i) * comb(n, j) * w[i] * w[j] * (values[j] - values[i])
            exact.append(total / comb(2 * n - 2, k))
    common = lcm(*(number.denominator for number in exact))
    return [int(number * common) for number in exact]


def _turns(coefficients: list[int]) -> set[float]:
    """Return the parameters inside (0, 1) at which a polynomial changes its sign, cut to 2**-48."""
    turns: set[float] = set()
    # Numerator and depth of an interval, and the polynomial on it.
    stack = [(0, 0, coefficients)]
    while stack:
        place, depth, row = stack.pop()
        if _variations(row) == 0:
            continue
        if depth == HALVINGS:
            turns.add(float(Fraction(2 * place + 1, 1 << (depth + 1))))
            continue
        left, right = _halves(row)
        if left[-1] == 0:  # a zero of its own in the middle
            turns.add(float(Fraction(2 * place + 1, 1 << (depth + 1))))
        stack.append((2 * place, depth + 1, left))
        stack.append((2 * place + 1, depth + 1, right))
    return turns


def _variations(row: list[int]) -> int:
    """Count the changes of sign."""
    signs = [number > 0 for number in row if number != 0]
    return sum(a != b for a, b in pairwise(signs))


def _halves(row: list[int]) -> tuple[list[int], list[int]]:
    """Return a polynomial on both halves of its interval, each times the same power of two."""
    n = len(row) - 1
    left, right = [row[0] << n], [row[-1] << n]
    for step in range(1, n + 1):
        row = [a + b for a, b in pairwise(row)]
        left.append(row[0] << (n - step))
        right.append(row[-1] << (n - step))
    return left, right[::-1]
