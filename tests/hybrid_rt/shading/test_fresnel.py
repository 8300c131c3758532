import math

import mpmath
import numpy as np
import pytest

from hybrid_rt.shading.kernels.fresnel import (
    fresnel,
    mirror_directions,
    schlick,
    split_at_glass,
)

pytestmark = pytest.mark.interpreted

COSINES = [1.0, 0.9, 0.5, 0.1, 1e-3, 1e-6, 1e-9, 1e-12, 1e-50]
INDICES = [1e-3, 1 / 2.4, 1 / 1.5, 1 - 1e-12, 1.0, 1 + 1e-12, 1.33, 1.5, 2.4, 1000.0]


def exact_reflectance(cos_i, eta):
    """Fresnel's equations in 120 digits, which hold 1 - cos^2 of 1e-50; 1 at total internal reflection."""
    with mpmath.workdps(120):
        c, n = mpmath.mpf(cos_i), mpmath.mpf(eta)
        square = 1 - (1 - c * c) / (n * n)
        if square <= 0:
            return 1.0
        t = mpmath.sqrt(square)
        across, along = (c - n * t) / (c + n * t), (n * c - t) / (n * c + t)
        return float((across**2 + along**2) / 2)


def at_critical_angle(eta):
    return math.sqrt(1 - eta * eta)


@pytest.mark.parametrize("eta", INDICES)
def test_reflectance_is_that_of_fresnels_equations(eta):
    for cos_i in COSINES:
        reflectance, _ = fresnel(cos_i, eta)
        # An amplitude is good to a few roundings of 1; its condition is 1 / eta where eta is small.
        # Where eta is near 1 it is a small difference, and its square is far smaller still.
        assert reflectance == pytest.approx(exact_reflectance(cos_i, eta), rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("eta", [1 / 2.4, 1 / 1.5, 0.2])
@pytest.mark.parametrize("offset", [1e-2, 1e-5, 1e-9, 1e-12, 1e-14])
def test_reflectance_around_the_critical_angle(eta, offset):
    critical = at_critical_angle(eta)
    assert fresnel(critical - offset, eta)[0] == 1.0
    # Near the angle R = 1 - const sqrt(offset): a rounding of cos_i moves it by sqrt(rounding).
    loose = 4 * 2.0**-52 / math.sqrt(offset) * 10
    expected = exact_reflectance(critical + offset, eta)
    assert fresnel(critical + offset, eta)[0] == pytest.approx(expected, abs=loose)


def test_grazing_light_is_all_reflected():
    assert fresnel(0.0, 1.5) == (1.0, 0.0)
    assert fresnel(1e-300, 1.5)[0] == fresnel(1e-300, 1e-3)[0] == 1.0
    assert fresnel(1e-15, 1.5)[0] == pytest.approx(1.0, abs=1e-13)


def test_index_one_reflects_nothing():
    assert all(fresnel(cos_i, 1.0)[0] == 0.0 for cos_i in COSINES)


@pytest.mark.parametrize("eta", [1.0 / 1.5, 1.5])
def test_schlick_agrees_at_normal_incidence_and_at_total_reflection(eta):
    assert schlick(1.0, eta)[0] == pytest.approx(fresnel(1.0, eta)[0], rel=1e-14)
    assert schlick(0.0, eta)[0] == 1.0


def random_units(n, seed):
    x = np.random.default_rng(seed).normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1)[:, None]


def test_mirrored_directions_keep_the_tangent_and_turn_the_normal_part():
    d, n = random_units(100, 1), random_units(100, 2)
    r = np.empty_like(d)
    mirror_directions(d, n, r)
    np.testing.assert_allclose((r * n).sum(1), -(d * n).sum(1), atol=4e-16)
    np.testing.assert_allclose(np.cross(r, n), np.cross(d, n), atol=1e-15)


@pytest.mark.parametrize("ior", [1.5, 1.0, 0.7, 1000.0, 1e-3])
def test_refracted_directions_obey_snell_from_both_sides(ior):
    d, n = random_units(400, 3), random_units(400, 4)
    reflectance, refracted = np.empty(400), np.empty((400, 3))
    entering = (d * n).sum(1) < 0
    eta = np.where(entering, ior, 1 / ior)
    split_at_glass(d, n, eta, np.zeros(400), reflectance, refracted)
    passes = reflectance < 1
    sine_before = np.linalg.norm(np.cross(d, n), axis=1)
    np.testing.assert_array_equal(passes, sine_before < eta)
    sine_beyond = np.linalg.norm(np.cross(refracted, n), axis=1)
    np.testing.assert_allclose((sine_beyond * eta)[passes], sine_before[passes], atol=1e-13 * ior)
    # Same side of the normal line, and the ray goes on through the surface.
    assert (np.sign((refracted * n).sum(1)) == np.sign((d * n).sum(1)))[passes].all()
    assert not refracted[~passes].any()
