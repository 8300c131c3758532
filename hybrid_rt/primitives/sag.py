"""The sag of an even asphere: its value, its slope, and proven bounds of both.

    z(w) = c w / (1 + sqrt(1 - (1 + k) c^2 w)) + sum of a_2i w^i,   w = r^2, c = 1 / radius

(ISO 10110-12, Eq. for surfaces of rotation of even order). It is analytic in w wherever the square
root is, so w is the variable throughout: nothing special happens at the vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ldexp
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray

# Equal steps of w in which bounds are kept.
N_ZONES = 64
# Bounds are widened by this part of their terms: far more than the terms' rounding.
WIDER = 1e-12
UNIT_ROUNDOFF = 2.0**-53


class Zones(NamedTuple):
    """Proven bounds of a sag z(w) in equal steps of w, from 0 to the square of the largest radius.

    Attributes
    ----------
    z, slope, bend : (N_ZONES, 2) float64
        Lowest and highest z, dz / dw and d^2 z / dw^2.
    noise : (N_ZONES,) float64
        What rounding makes of z in float64, as a distance from the surface, in units of 2^-53.
    """

    z: FloatArray
    slope: FloatArray
    bend: FloatArray
    noise: FloatArray


@dataclass(frozen=True)
class Sag:
    """The sag of an even asphere.

    Attributes
    ----------
    curvature : float
        1 / radius at the vertex, 0 for a plane base.
    conic : float
        The conic constant k: -e^2 of a conic of eccentricity e.
    coefficients : (n,) float64, read-only
        a_2, a_4, ... a_2n.
    w_max : float
        Square of the largest radius.
    """

    curvature: float
    conic: float
    coefficients: FloatArray
    w_max: float

    @property
    def under_root(self) -> float:
        """What the factor of w under the square root is: (1 + k) c^2."""
        return (1.0 + self.conic) * self.curvature**2

    def at(self, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return z, dz / dw and d^2 z / dw^2 at w, each of its shape."""
        c, kappa = self.curvature, self.under_root
        root = np.sqrt(1.0 - kappa * w)
        z, slope, bend = c * w / (1.0 + root), 0.5 * c / root, 0.25 * c * kappa / root**3
        rest = slope_of_rest = half_bend = np.zeros_like(w)
        for a in self.coefficients[::-1]:
            half_bend = half_bend * w + slope_of_rest
            slope_of_rest = slope_of_rest * w + rest
            rest = rest * w + a
        return (
            z + rest * w,
            slope + (rest + slope_of_rest * w),
            bend + 2.0 * (slope_of_rest + half_bend * w),
        )

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

    def zones(self) -> Zones:
        """Bound the sag and its derivatives by Taylor's formula on each step of w."""
        edge = self.w_max * np.arange(N_ZONES + 1) / N_ZONES
        low, high = edge[:-1], edge[1:]
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        # The conic's part: value and derivatives run one way, so the ends bound them.
        conic = Sag(self.curvature, self.conic, np.zeros(0), self.w_max)
        at_ends = np.stack(conic.at(edge))
        total = np.stack([
            np.minimum(at_ends[:, :-1], at_ends[:, 1:]), np.maximum(at_ends[:, :-1], at_ends[:, 1:])
        ])  # fmt: skip
        size = np.abs(total).max(axis=0)
        # The polynomial: what is left of second order is bounded by the sum of its terms' sizes.
        rest = np.concatenate([[0.0], self.coefficients])
        sizes = np.abs(rest)
        for k in range(3):
            value, first = (
                np.polynomial.polynomial.polyval(middle, p) for p in (rest, _rate(rest))
            )
            second = np.polynomial.polynomial.polyval(high, _rate(_rate(sizes)))
            reach = half * np.abs(first) + 0.5 * half**2 * second
            total[:, k] += np.stack([value - reach, value + reach])
            size[k] += np.polynomial.polynomial.polyval(high, sizes)
            rest, sizes = _rate(rest), _rate(sizes)
        total += WIDER * np.stack([-size, size])
        z, slope, bend = (total[:, k].T for k in range(3))
        return Zones(z, slope, bend, self._noise(low, high, slope))

    def _noise(self, low: FloatArray, high: FloatArray, slope: FloatArray) -> FloatArray:
        """Bound the rounding of z over the length of its gradient; see docs/rounding_aspheres.md."""
        kappa = self.under_root
        root = np.sqrt(1.0 - kappa * high)
        base = np.abs(self.curvature) * high / (1.0 + root)
        noise = base * (6.0 + 3.0 * np.abs(kappa) * high / (root * (1.0 + root)))
        for i, a in enumerate(np.abs(self.coefficients), start=1):
            noise = noise + (2 * i + 1) * a * high**i
        flattest = np.where(slope[:, 0] * slope[:, 1] > 0.0, np.abs(slope).min(axis=1), 0.0)
        quotient: FloatArray = noise / np.sqrt(1.0 + 4.0 * low * flattest**2)
        return quotient


def _rate(polynomial: FloatArray) -> FloatArray:
    """Return the derivative of a polynomial given by its coefficients, lowest first."""
    if len(polynomial) < 2:
        return np.zeros(1)
    rate: FloatArray = polynomial[1:] * np.arange(1, len(polynomial))
    return rate
