"""On which side of loops of rational Bezier arcs a point is: winding numbers, in integers.

The curve is pulled tight: an arc whose control points all lie on one side of a line through the point,
parallel to an axis, may be replaced by its chord without passing the point, since the arc is within
the hull of its control points. Any other arc is halved. What is left is a polygon; the quarter planes
that its corners are in, seen from the point, add up to four times the winding number. No root, no
monotone piece and no rounding occurs, so nothing is shared with `meshing.kernels.trims`.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import pairwise, product
from math import lcm
from typing import Any

from meshing.curve2 import Curve2

# An arc that still has the point in its hull after so many halvings passes it closer than 2**-300.
DEEPEST = 300


class ExactLoops:
    """Winding numbers of loops, exactly.

    ``loops`` are closed: each curve begins where the one before ends.
    ``closes``: whether loops count once for every whole turn by which u can be moved, and v.
    """

    def __init__(
        self, loops: Iterable[Iterable[Curve2]], closes: tuple[bool, bool] = (False, False)
    ) -> None:
        self._arcs = [
            (curve.control[:, 0].tolist(), curve.control[:, 1].tolist(), _weights(curve))
            for loop in loops
            for curve in loop
        ]
        turns = [range(-2, 3) if closed else range(1) for closed in closes]
        self._turns = list(product(*turns))

    def is_inside(self, u: Any, v: Any) -> bool | None:
        """Tell whether the loops go around a point an odd number of times; None: it is on a curve.

        ``u``, ``v``: taken as they are.
        """
        total = 0
        for turn, rise in self._turns:
            quarters = 0
            x, y = (Fraction(u) + turn if turn else u), (Fraction(v) + rise if rise else v)
            for arc in self._arcs:
                found = _quarters(arc, x, y)
                if found is None:
                    return None
                quarters += found
            assert quarters % 4 == 0
            total += quarters // 4
        return total % 2 == 1


def _weights(curve: Curve2) -> list[float]:
    return [1.0] * len(curve.control) if curve.weights is None else curve.weights.tolist()


def _quarters(arc: tuple[list[float], list[float], list[float]], u: Any, v: Any) -> int | None:
    """Return by how many quarter planes an arc goes around a point, counterclockwise."""
    xs, ys, ws = arc
    sides_u, sides_v = _sides(xs, u), _sides(ys, v)
    if _is_beside(sides_u) or _is_beside(sides_v):
        return _step((sides_u[0], sides_v[0]), (sides_u[-1], sides_v[-1]))
    at_u, at_v = Fraction(u), Fraction(v)
    exact = [
        (Fraction(w) * (Fraction(x) - at_u), Fraction(w) * (Fraction(y) - at_v))
        for x, y, w in zip(xs, ys, ws, strict=True)
    ]
    common = lcm(*(number.denominator for pair in exact for number in pair))
    whole = [[int(pair[k] * common) for pair in exact] for k in (0, 1)]
    total, stack = 0, [(whole[0], whole[1], 0)]
    while stack:
        x, y, depth = stack.pop()
        if _is_beside(x) or _is_beside(y):
            total += _step((x[0], y[0]), (x[-1], y[-1]))
            continue
        if depth == DEEPEST or (x[0] == y[0] == 0) or (x[-1] == y[-1] == 0):
            return None
        (x0, x1), (y0, y1) = _halves(x), _halves(y)
        stack += [(x0, y0, depth + 1), (x1, y1, depth + 1)]
    return total


def _sides(numbers: list[float], other: Any) -> list[int]:
    """Return the signs of the differences of floats from a number, exactly.

    A float above the nearest float of a number is above the number: fractions, which are slow, are
    compared with that one float only.
    """
    near = float(other)
    limits = [near if x != near else other for x in numbers]
    return [int(x > limit) - int(x < limit) for x, limit in zip(numbers, limits, strict=True)]


def _is_beside(numbers: list[int]) -> bool:
    """Tell whether all numbers are above zero, or all below."""
    return min(numbers) > 0 or max(numbers) < 0


def _step(one: tuple[Any, Any], other: tuple[Any, Any]) -> int:
    """Return the quarter planes from one point to another on the same side of an axis: -1, 0, 1."""
    return (_quarter(*other) - _quarter(*one) + 1) % 4 - 1


def _quarter(x: Any, y: Any) -> int:
    """Return which quarter plane a point other than the origin is in; each has one of its sides."""
    if x > 0 and y >= 0:
        return 0
    if x <= 0 and y > 0:
        return 1
    return 2 if x < 0 else 3


def _halves(row: list[int]) -> tuple[list[int], list[int]]:
    """Return the two halves of a polynomial in Bernstein form, both times 2**n."""
    n = len(row) - 1
    left, right = [row[0] << n], [row[-1] << n]
    for step in range(1, n + 1):
        row = [a + b for a, b in pairwise(row)]
        left.append(row[0] << (n - step))
        right.append(row[-1] << (n - step))
    return left, right[::-1]
