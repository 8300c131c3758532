"""Multiple-precision arithmetic shared by the judges (needs mpmath)."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import comb

import mpmath

from hybrid_rt.core.records import FloatArray
from proof.judges.surface_judge import Number, Vector

DIGITS = 60
# Newton's steps double the digits, from 16 or, where a ray nearly touches, from 8 or fewer; at a
# pole, where the radius is a double root, each gains a bit.
MOST_STEPS = 300
# A pole itself has no first derivative to go by: this far beside it along the profile there is one.
ASIDE = mpmath.mpf(2) ** -40
# A last step below this part of the root leaves fewer than its square.
SMALL = mpmath.mpf(10) ** -40


def numbers(values: Sequence[float] | FloatArray) -> Vector:
    """Convert floats exactly to multiple-precision numbers."""
    return [mpmath.mpf(float(x)) for x in values]


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """Return the dot product."""
    return mpmath.fdot(a, b)


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def solved(columns: list[Vector], right: Vector) -> Vector | None:
    """Solve three equations by Cramer's rule; None if the columns lie in a plane."""
    a, b, c = columns
    across = cross(b, c)
    determinant = dot(a, across)
    if determinant == 0:
        return None
    return [
        dot(right, across) / determinant,
        dot(a, cross(right, c)) / determinant,
        dot(a, cross(b, right)) / determinant,
    ]


def on_plane(at: Vector, normal: Vector, o: Vector, d: Vector) -> Number:
    """Return the t at which a ray meets a plane; nan if it never does."""
    slope = dot(normal, d)
    gap = [a - b for a, b in zip(at, o, strict=True)]
    return dot(normal, gap) / slope if slope != 0 else mpmath.nan


def curve(points: list[Vector], x: Number) -> tuple[Vector, Vector]:
    """Return point and derivative of a Bezier curve, each coordinate for itself."""
    n = len(points) - 1
    y = 1 - x
    powers_x, powers_y = [mpmath.mpf(1)], [mpmath.mpf(1)]
    for _ in range(n):
        powers_x.append(powers_x[-1] * x)
        powers_y.append(powers_y[-1] * y)
    weights = [comb(n, k) * powers_x[k] * powers_y[n - k] for k in range(n + 1)]
    slopes = [n * comb(n - 1, k) * powers_x[k] * powers_y[n - 1 - k] for k in range(n)]
    columns = list(zip(*points, strict=True))
    point = [dot(weights, column) for column in columns]
    steps = [[b - a for a, b in pairwise(column)] for column in columns]
    return point, [dot(slopes, step) for step in steps]
