"""Polynomials as patches, judged by their values in fractions."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest

from meshing import BezierPatches

ULP_HALF = Fraction(1, 2**53)


def bernstein(values, t):
    """Return the polynomial of Bernstein coefficients at t, exactly."""
    n = len(values) - 1
    return sum(comb(n, k) * t**k * (1 - t) ** (n - k) * value for k, value in enumerate(values))


@pytest.mark.parametrize("shape", [(1, 1), (2, 1), (1, 4), (3, 3), (5, 9), (31, 2)])
@pytest.mark.parametrize("x", [(-1.0, 1.0), (0.1, 0.7), (-3.7, 12.9)])
def test_the_net_is_that_of_the_polynomial(shape, x):
    y = (-0.3, 1.1)
    c = np.random.default_rng(sum(shape)).normal(size=shape)
    c /= np.abs(x).max() ** np.arange(shape[0])[:, None]  # terms of any power count
    (net,) = BezierPatches.from_polynomial(c, x, y).patches
    assert net.shape == (*np.maximum(shape, 2), 3)
    largest = Fraction(float(np.abs(net[..., 2]).max()))
    exact = np.vectorize(Fraction, otypes=[object])(net)
    for u, v in ((0, 0), (1, 0), (Fraction(1, 3), Fraction(5, 7)), (Fraction(9, 10), 1)):
        at_x, at_y = (
            Fraction(a) + t * (Fraction(b) - Fraction(a)) for (a, b), t in ((x, u), (y, v))
        )
        wanted = sum(
            Fraction(float(c[i, j])) * at_x**i * at_y**j for i, j in np.ndindex(*shape)
        )  # fmt: skip
        met = [bernstein([bernstein(row, v) for row in exact[..., axis]], u) for axis in range(3)]
        # A mean of control points, each of which is rounded once.
        assert abs(met[2] - wanted) <= ULP_HALF * largest
        for got, true, ends in ((met[0], at_x, x), (met[1], at_y, y)):
            assert abs(got - true) <= ULP_HALF * Fraction(float(np.abs(ends).max()))


def test_the_rectangle_ends_where_it_is_said_to_and_the_normal_is_up():
    surface = BezierPatches.from_polynomial([[0.1, 0.2], [0.3, 0.4]], (0.1, 0.7), (-0.3, 1.1))
    assert surface.bounds[:, :2].tolist() == [[0.1, -0.3], [0.7, 1.1]]
    # z = 0.1 + 0.2 y + 0.3 x + 0.4 x y, in the middle: (-z_x, -z_y, 1).
    slope = np.array([-0.3 - 0.4 * 0.4, -0.2 - 0.4 * 0.4, 1.0])
    np.testing.assert_allclose(
        surface.normal(0.5, 0.5).ravel(), slope / np.linalg.norm(slope), atol=1e-15
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"coefficients": [1.0, 2.0]}, r"coefficients has shape \(2,\): pass \(m \+ 1, n \+ 1\)"),
        ({"coefficients": np.ones((32, 2))}, r"shape \(32, 2\): .* up to 30"),
        ({"coefficients": np.ones((0, 2))}, r"shape \(0, 2\)"),
        ({"coefficients": [[1.0, np.nan]]}, r"coefficients\[0, 1\] is nan: pass finite numbers"),
        ({"x": (1.0, 1.0)}, r"from_polynomial x is \[1.0, 1.0\]: .* the first below the second"),
        ({"y": (0.0, np.inf)}, r"from_polynomial y is \[0.0, inf\]: pass two finite numbers"),
        ({"y": 1.0}, "from_polynomial y is 1.0"),
        ({"coefficients": [[1e300] * 2] * 3, "x": (0.0, 1e300)}, "pass smaller numbers"),
        (
            {"coefficients": [[0.0, 1e30]]},
            r"leaves no area: z reaches 1e\+30 .* 1 x 1: pass smaller",
        ),
    ],
)
def test_what_is_no_polynomial_over_a_rectangle_is_refused(changes, words):
    given = {"coefficients": [[0.0, 1.0], [1.0, 0.0]], "x": (0, 1), "y": (0, 1)} | changes
    with pytest.raises(ValueError, match=words):
        BezierPatches.from_polynomial(**given)
