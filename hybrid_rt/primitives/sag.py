"""The sag of an even asphere: its value, its slope, and proven bounds of both.

    z(w) = c w / (1 + sqrt(1 - (1 + k) c^2 w)) + sum of a_2i w^i,   w = r^2, c = 1 / radius

(ISO 10110-12, Eq. for surfaces of rotation of even order). It is analytic in w wherever the square
root is, so w is the variable throughout: nothing special happens at the vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from math import comb, ldexp
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray

# Equal steps of w in which bounds are kept: a power of two.
N_ZONES = 64
# Bounds are widened by this part of their terms: more than the roundings of a sum (17), of the factors
# in it (16 for each of 10 halvings) and of powers of w (32).
WIDER = 512 * 2.0**-53
UNIT_ROUNDOFF = 2.0**-53
# Sums of terms up to here do not overflow; larger ones are refused for their slope.
LARGEST = 1e200
# Rounding of the sag, in units of 2^-53 of the surface's size, that the usual band covers.
COMMON_NOISE = 64.0


class Zones(NamedTuple):
    """Proven bounds of a sag z(w) in n equal steps of w, from 0 to the square of the largest radius."""

    z: FloatArray  # (n, 2), lowest and highest
    slope: FloatArray  # (n, 2), of dz / dw
    bend: FloatArray  # (n, 2), of d^2 z / dw^2
    noise: FloatArray  # (n,), rounding of z as a distance from the surface, in units of 2^-53
    slope_noise: FloatArray  # (n,), that of dz / dw, in the same units

    def steepest(self, rim: float) -> float:
        """Return a bound of |dz / dr| within a radius."""
        rings = rim * np.sqrt(np.arange(1, len(self.slope) + 1) / len(self.slope))
        return float((2.0 * rings * np.abs(self.slope).max(axis=1)).max())


@dataclass(frozen=True)
class Sag:
    """The sag of an even asphere."""

    curvature: float  # 1 / radius at the vertex, 0 for a plane base
    conic: float  # the conic constant k: -e^2 of a conic of eccentricity e
    coefficients: FloatArray  # (n,), a_2, a_4, ... a_2n
    w_max: float  # square of the largest radius

    @property
    def under_root(self) -> float:
        """What the factor of w under the square root is: (1 + k) c^2."""
        return (1.0 + self.conic) * self.curvature**2

    def at(self, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return z, dz / dw and d^2 z / dw^2 at w, each of its shape."""
        c, kappa = self.curvature, self.under_root
        root = np.sqrt(1.0 - kappa * w)
        z, slope, bend = c * w / (1.0 + root), 0.5 * c / root, 0.25 * c * kappa / root**3
        centre, (constant, *coefficients) = self.expansion
        y = w - centre
        rest = slope_of_rest = half_bend = np.zeros_like(w)
        for a in coefficients[::-1]:
            half_bend = half_bend * y + slope_of_rest
            slope_of_rest = slope_of_rest * y + rest
            rest = rest * y + a
        return (
            z + (constant + rest * y),
            slope + (rest + slope_of_rest * y),
            bend + 2.0 * (slope_of_rest + half_bend * y),
        )

    @cached_property
    def expansion(self) -> tuple[float, FloatArray]:
        """Return c and b_0, b_1, ... b_n: the polynomial is the sum of b_i (w - c)^i.

        c is 0, and b_i are the coefficients as given. But terms that cancel on [0, w_max] cancel far less
        about its middle: where rounding would move the surface by more than `COMMON_NOISE`, c is there, and
        b_i are rounded from exact sums.
        """
        given = np.concatenate([[0.0], self.coefficients])
        i = np.arange(len(given))
        terms = ((2 * i + 1) * np.abs(given) * self.w_max**i).sum()
        if terms <= COMMON_NOISE * np.sqrt(self.w_max) or terms > LARGEST:
            return 0.0, given
        centre = 0.5 * self.w_max
        exact = [Fraction(a) for a in given.tolist()]
        for k in range(len(exact) - 1):  # Horner's scheme, repeated
            for j in range(len(exact) - 2, k - 1, -1):
                exact[j] += Fraction(centre) * exact[j + 1]
        return centre, np.array([float(b) for b in exact])

    def scaled(self, exponent: int) -> Sag:
        """Return the sag in units of 2^-exponent, without rounding."""
        powers = [1 - 2 * (i + 1) for i in range(len(self.coefficients))]
        return Sag(
            ldexp(self.curvature, -exponent),
            self.conic,
            np.array([
                ldexp(a, exponent * p) for a, p in zip(self.coefficients, powers, strict=True)
            ]),
            ldexp(self.w_max, 2 * exponent),
        )  # fmt: skip

    def zones(self, n: int = N_ZONES) -> Zones:
        """Bound the sag and its derivatives on each of n equal steps of w; n is a power of two."""
        edge = self.w_max * np.arange(n + 1) / n
        low, high = edge[:-1], edge[1:]
        # The conic's part: value and derivatives run one way, so the ends bound them.
        conic = Sag(self.curvature, self.conic, np.zeros(0), self.w_max)
        at_ends = np.stack(conic.at(edge))
        total = np.stack([
            np.minimum(at_ends[:, :-1], at_ends[:, 1:]), np.maximum(at_ends[:, :-1], at_ends[:, 1:])
        ])  # fmt: skip
        size = np.abs(total).max(axis=0)
        # The polynomial: between the least and the largest of its Bernstein coefficients on a step.
        rest = np.concatenate([[0.0], self.coefficients])
        for k in range(3):
            terms = rest * self.w_max ** np.arange(len(rest))
            factors = _bernstein_factors(len(rest) - 1, n)
            values, sizes = factors @ terms, factors @ np.abs(terms)
            total[:, k] += np.stack([values.min(axis=1), values.max(axis=1)])
            size[k] += sizes.max(axis=1)
            rest = _rate(rest)
        total += WIDER * np.stack([-size, size])
        z, slope, bend = (total[:, k].T for k in range(3))
        return Zones(z, slope, bend, *self._noise(low, high, slope))

    def _noise(
        self, low: FloatArray, high: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Bound the rounding of z over the length of its gradient, and of dz / dw: docs/rounding_aspheres.md."""
        kappa = np.abs(self.under_root)
        square = 1.0 - self.under_root * high
        root = np.sqrt(square)
        base = np.abs(self.curvature) * high / (1.0 + root)
        noise = base * (6.0 + 3.0 * kappa * high / (root * (1.0 + root)))
        rate = 0.5 * np.abs(self.curvature) / np.minimum(root, 1.0)
        slope_noise = rate * (5.0 + 3.0 * kappa * high / square)
        centre, coefficients = self.expansion
        # w - c, and the coefficients about c, are rounded as well.
        y, more = np.maximum(np.abs(low - centre), np.abs(high - centre)), float(centre != 0.0)
        noise = noise + 2.0 * more * np.abs(coefficients[0])
        for i, a in enumerate(np.abs(coefficients[1:]), start=1):
            noise = noise + (2 * i + 1 + (i + 1) * more) * a * y**i
            slope_noise = slope_noise + i * (4 * i + 2 + 2 * i * more) * a * y ** (i - 1)
        flattest = np.where(slope[:, 0] * slope[:, 1] > 0.0, np.abs(slope).min(axis=1), 0.0)
        return noise / np.sqrt(1.0 + 4.0 * low * flattest**2), slope_noise


@lru_cache(maxsize=64)
def _bernstein_factors(degree: int, n: int) -> FloatArray:
    """Return with what factors x^i enters Bernstein coefficient k on each of n parts of [0, 1].

    (n, degree + 1, degree + 1) float64, by part, k and i. Halving takes means of factors, none of which
    is negative: so their roundings do not cancel.
    """
    k = range(degree + 1)
    whole = np.array([[comb(j, i) / comb(degree, i) for i in k] for j in k])
    parts = whole[None]
    while len(parts) < n:
        # De Casteljau: the first and the last row of each step belong to the two halves.
        rows, lower, upper = parts, [parts[:, 0]], [parts[:, -1]]
        for _ in range(degree):
            rows = 0.5 * (rows[:, :-1] + rows[:, 1:])
            lower.append(rows[:, 0])
            upper.append(rows[:, -1])
        halves = np.stack([np.stack(lower, axis=1), np.stack(upper[::-1], axis=1)], axis=1)
        parts = halves.reshape(-1, degree + 1, degree + 1)
    parts.flags.writeable = False
    return parts


def _rate(polynomial: FloatArray) -> FloatArray:
    """Return the derivative of a polynomial given by its coefficients, lowest first."""
    if len(polynomial) < 2:
        return np.zeros(1)
    return polynomial[1:] * np.arange(1, len(polynomial))
