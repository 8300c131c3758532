"""What exact surfaces return, and the arithmetic they share (needs python-flint).

A float is a rational number; so are the figures of surfaces and rays, and what is computed from
them here is rational, or a ball of arbitrary precision that holds the true number (Johansson 2017,
"Arb: efficient arbitrary-precision midpoint-radius interval arithmetic"). Balls are narrowed until
a question is settled: no answer depends on a tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray

# Numbers of flint, which has no types: rationals, balls, polynomials.
Rational = Any
Ball = Any
Polynomial = Any
RationalVector = Sequence[Rational]

# Bits at which balls begin; doubled while a question is open, up to the last.
FIRST_BITS, LAST_BITS = 192, 1 << 14
# t of a crossing is known to this part of max(|t|, 1 / |d|, |o|): some thirty bits beyond float64.
NARROW = 2.0**-84
# Hulls keep so far from a ray, in parts of their largest number, that rounding does not count.
CLEAR = 1e-9

POINT, ALONG, OPEN, EITHER = "point", "along", "open", "either"


@dataclass(frozen=True)
class Crossing:
    """One crossing of a ray with a surface.

    ``t``: holds the exact t, in lengths of the ray's direction.
    ``u``, ``v``: parameters, rounded.
    ``cosine``: |n.d| / |d|, rounded; 0 where the normal is lost.
    ``kind``: "point"; "either" of a point that may count or not, as at the end of a gap; "along" where the
    ray lies in the surface from ``t`` to ``t_end``; "open" where exact arithmetic cannot say what lies
    between ``t`` and ``t_end``.
    ``to_edge``: how far the ray would have to be moved for the crossing to leave its patch, to first order;
    0 where a parametrisation is singular. Scene units.
    """

    t: Ball
    patch_id: int
    u: float
    v: float
    cosine: float
    kind: str = POINT
    t_end: Ball | None = None
    to_edge: float = 0.0


Crosser = Callable[[RationalVector, RationalVector], list[Crossing]]
"""All crossings of one ray, of any t: from a rational origin and direction."""


def rational(x: float) -> Rational:
    """Return a float as the fraction that it is."""
    return flint.fmpq(*float(x).as_integer_ratio())


def inside(x: float) -> Rational:
    """Return a parameter as a fraction from 0 to 1: beyond its border a surface does not go on."""
    return rational(min(max(x, 0.0), 1.0))


def rationals(values: Any) -> list[Rational]:
    """Return floats as fractions."""
    return [rational(x) for x in values]


@contextmanager
def bits(number: int) -> Iterator[None]:
    """Work with balls of so many bits."""
    before, flint.ctx.prec = flint.ctx.prec, number
    try:
        yield
    finally:
        flint.ctx.prec = before


def precisions() -> Iterator[int]:
    """Return the bits to try, one after the other."""
    number = FIRST_BITS
    while number <= LAST_BITS:
        yield number
        number *= 2


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    """Return the dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Return the cross product."""
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def norm(a: Iterable[float]) -> float:
    """Return the length of a vector of floats."""
    return math.hypot(*a)


def bernstein_form(points: Sequence[Rational]) -> Polynomial:
    """Return the polynomial of some Bernstein coefficients."""
    n = len(points) - 1
    s = flint.fmpq_poly([0, 1])
    powers, others = [flint.fmpq_poly([1])], [flint.fmpq_poly([1])]
    for _ in range(n):
        powers.append(powers[-1] * s)
        others.append(others[-1] * (1 - s))
    total = flint.fmpq_poly([0])
    for k, point in enumerate(points):
        total += math.comb(n, k) * point * powers[k] * others[n - k]
    return total


def value(polynomial: Polynomial, x: Ball) -> Ball:
    """Return a ball that holds a rational polynomial's values at a ball."""
    return flint.arb_poly(polynomial)(x)


def roots_from_0_to_1(polynomial: Polynomial, number: int) -> list[Ball]:
    """Return the distinct real roots in [0, 1] of a polynomial, not 0, as balls of so many bits.

    Ends that are roots are found exactly and divided out. Then the others are apart from both ends,
    and narrower balls tell on which side they are.
    """
    found = []
    rest = polynomial.numer()
    for end, factor in ((0, flint.fmpz_poly([0, 1])), (1, flint.fmpz_poly([-1, 1]))):
        is_root = False
        while rest(end) == 0:
            rest, is_root = rest // factor, True
        if is_root:
            found.append(flint.arb(end))
    if rest.degree() < 1 or _changes_of_sign(rest) == 0:
        return found
    for try_bits in precisions():
        if try_bits < number:
            continue
        with bits(try_bits):
            balls = [root.real for root, _ in rest.complex_roots() if root.imag == 0]
            inside = [x for x in balls if not (x < 0 or x > 1)]
            if all(x > 0 and x < 1 for x in inside):
                return found + inside
    raise ArithmeticError("roots that cannot be told from 0 or 1")


def _changes_of_sign(polynomial: Polynomial) -> int:
    """Return Descartes' bound on the number of roots between 0 and 1."""
    mirrored = flint.fmpz_poly(polynomial.coeffs()[::-1])
    signs = [c > 0 for c in mirrored(flint.fmpz_poly([1, 1])).coeffs() if c != 0]
    return sum(a != b for a, b in pairwise(signs))


def is_narrow(ball: Ball, scale: float) -> bool:
    """Tell whether a ball's radius is below `NARROW` of its middle or of a scale."""
    return bool(ball.is_finite()) and float(ball.rad()) <= NARROW * max(
        abs(float(ball.mid())), scale
    )


def ball_of(x: Rational) -> Ball:
    """Return a narrow ball around a fraction."""
    with bits(512):
        return flint.arb(x)


def cosine_of(normal: RationalVector, d: RationalVector) -> float:
    """Return |n.d| / (|n| |d|), rounded."""
    square = dot(normal, normal) * dot(d, d)
    with bits(128):
        return float(abs(flint.arb(dot(normal, d))) / flint.arb(square).sqrt())


def on_curve(points: Sequence[RationalVector], x: Rational) -> list[Rational]:
    """Return the point of a Bezier curve, exactly."""
    n = len(points) - 1
    y = 1 - x
    total = [flint.fmpq(0) for _ in points[0]]
    for k, point in enumerate(points):
        weight = math.comb(n, k) * x**k * y ** (n - k)
        total = [a + weight * b for a, b in zip(total, point, strict=True)]
    return total


def near(hulls: FloatArray, o: RationalVector, d: RationalVector) -> list[int]:
    """Return which of the hulls of points (n, m, 3) a ray may meet, by float64 far beyond rounding."""
    origin, way = (np.array([float(x) for x in vector]) for vector in (o, d))
    k = int(np.abs(way).argmax())
    away = hulls - origin
    margin = CLEAR * (np.abs(hulls).max(axis=(1, 2)) + np.abs(origin).max()) * abs(way[k])
    is_near = np.ones(len(hulls), np.bool_)
    for c in ((k + 1) % 3, (k + 2) % 3):
        f = way[k] * away[:, :, c] - way[c] * away[:, :, k]
        is_near &= (f.min(axis=1) <= margin) & (f.max(axis=1) >= -margin)
    found: list[int] = np.flatnonzero(is_near).tolist()
    return found


def turns(y: Ball, x: Ball) -> Ball:
    """Return the angle of (x, y) in whole turns, from -1/2 to 1/2."""
    return flint.acb(x, y).arg() / (2 * flint.arb.pi())


def along_frame(frame: Any, centre: RationalVector, point: Sequence[Ball]) -> list[Ball]:
    """Return the coordinates of a point about a centre along the rows of a frame, (3, 3) floats."""
    away = [p - c for p, c in zip(point, centre, strict=True)]
    return [dot(rationals(row), away) for row in frame]


def share(turn: Ball) -> float:
    """Return an angle in whole turns as a number from 0 to 1, rounded."""
    middle = float(turn.mid())
    return middle if middle >= 0.0 else float((turn + 1).mid())


def distance(a: Sequence[Any], b: Sequence[Any]) -> float:
    """Return the distance of two points, rounded."""
    return norm([float(x - y) for x, y in zip(a, b, strict=True)])
