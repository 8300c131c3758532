"""Compensated arithmetic against exact fractions."""

from fractions import Fraction

import numpy as np
import pytest

from hybrid_rt.core.kernels.compensated import product, two_difference
from hybrid_rt.core.kernels.sphere_points import power_of_point


@pytest.fixture(scope="module")
def pairs():
    rng = np.random.default_rng(3)
    sizes = 10.0 ** rng.uniform(-70, 70, (2, 2000))
    return (rng.normal(size=(2, 2000)) * sizes).T.tolist()


# Both ways, compiled to one instruction and in Python, must give the same bits.
@pytest.mark.parametrize("way", [product, product.py_func], ids=["compiled", "Python"])
def test_a_product_and_its_error_are_exact(pairs, way):
    for a, b in pairs:
        high, low = way(a, b)
        assert high == a * b
        assert Fraction(high) + Fraction(low) == Fraction(a) * Fraction(b)


def test_a_difference_and_its_error_are_exact(pairs):
    for a, b in pairs:
        high, low = two_difference(a, b)
        assert high == a - b
        assert Fraction(high) + Fraction(low) == Fraction(a) - Fraction(b)


def test_the_power_of_a_point_beside_a_sphere():
    """|f|^2 - r^2 keeps 2^-100 of r^2 where float64 alone keeps nothing."""
    rng = np.random.default_rng(4)
    for f in rng.normal(size=(500, 3)).tolist():
        r = float(np.linalg.norm(f)) * (1 + float(rng.integers(-3, 4)) * 2.0**-52)
        exact = sum(Fraction(x) ** 2 for x in f) - Fraction(r) ** 2
        found = power_of_point(*f, 0.0, 0.0, 0.0, r)
        # One rounding of the result itself, and what double-double loses.
        assert abs(Fraction(found) - exact) <= abs(exact) * 2**-52 + Fraction(r) ** 2 / 2**98
