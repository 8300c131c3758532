"""Reflection and refraction of arrays: Snell's law itself, total reflection, and what is refused."""

import numpy as np
import pytest

from hybrid_rt import reflect, reflectance, refract


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def some(n=2000, seed=1):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), rng.uniform(1, 2.5, (2, n))


def test_refraction_keeps_n_sine_and_the_plane_of_incidence():
    d, n, (n1, n2) = some()
    out, d, n = refract(3 * d, n, n1, n2), unit(d), unit(n)
    sine = np.linalg.norm(np.cross(d, n), axis=1)
    is_total = n1 * sine > n2
    assert np.array_equal(np.isnan(out).all(axis=1), is_total)
    assert 100 < is_total.sum() < 1900
    d, n, out, n1, n2 = (x[~is_total] for x in (d, n, out, n1, n2))
    # The vector form of Snell's law: the tangential part of n d stays. Units, so a few roundings.
    np.testing.assert_allclose(
        n2[:, None] * np.cross(out, n), n1[:, None] * np.cross(d, n), atol=2e-15
    )
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1, atol=4e-16)
    assert (np.einsum("ij,ij->i", out, n) * np.einsum("ij,ij->i", d, n) > 0).all()


def test_reflection_turns_the_part_along_the_normal():
    d, n, _ = some()
    out, d, n = reflect(d, n), unit(d), unit(n)
    along = np.einsum("ij,ij->i", d, n)[:, None] * n
    np.testing.assert_allclose(out, d - 2 * along, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(out, axis=1), 1, atol=4e-16)


def test_reflectance_is_that_of_both_polarisations():
    """The mean of the squares of Fresnel's amplitudes, by the angles on both sides."""
    d, n, _ = some(200)
    n1, n2 = 1.33, np.linspace(1.0, 2.4, 200)
    i = np.arccos(np.abs((unit(d) * unit(n)).sum(axis=1)))
    sine = n1 * np.sin(i) / n2
    passes = sine < 1.0
    t = np.arcsin(np.where(passes, sine, 0.0))
    across = np.cos(i) * n1 - np.cos(t) * n2, np.cos(i) * n1 + np.cos(t) * n2
    along = np.cos(i) * n2 - np.cos(t) * n1, np.cos(i) * n2 + np.cos(t) * n1
    expected = 0.5 * ((across[0] / across[1]) ** 2 + (along[0] / along[1]) ** 2)
    found = reflectance(3 * d, n, n1, n2)
    np.testing.assert_allclose(found[passes], expected[passes], rtol=1e-9, atol=1e-15)
    assert 0 < passes.sum() < 200
    assert (found[~passes] == 1.0).all()
    assert reflectance((0, 0, 2), (0, 0, -1), 1.0, 1.5) == pytest.approx(0.04)


def test_one_vector_stands_for_all():
    d, n, _ = some(5)
    assert refract(d, n[0], 1, 1.5).shape == (5, 3)
    assert np.array_equal(refract(d[0], n, 1, 1.5)[3], refract(d[0], n[3], 1, 1.5))
    assert refract(np.empty((0, 3)), (0, 0, 1), 1, 1.5).shape == (0, 3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0, 0), (0, 0, 1), 1, 1), r"direction\[0\] = \[0\.0, 0\.0, 0\.0\] is no direction"),
        (((0, 0, 1), (0, np.nan, 1), 1, 1), r"normal\[0\] = .* leave out rays that miss"),
        ((np.ones((2, 3)), np.ones((3, 3)), 1, 1), "2 directions but 3 normals"),
        ((np.ones((2, 2)), np.ones((2, 3)), 1, 1), r"direction has shape \(2, 2\)"),
        ((np.ones((2, 3)), np.ones((2, 3)), [1, 1, 1], 1), r"n1 has shape \(3,\) for 2 rays"),
        ((np.ones((2, 3)), np.ones((2, 3)), 1, 0), "n2 is 0: pass indices of refraction above 0"),
    ],
)
def test_what_is_no_ray_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        refract(*arguments)


@pytest.mark.parametrize("length", [5e-324, 1e-310, 1e-170, 1e200])
def test_directions_have_any_length(length):
    turned, unturned = (refract((0, 0, size), (0, 0.6, 0.8), 1.0, 1.5) for size in (length, 1.0))
    np.testing.assert_array_equal(turned, unturned)
