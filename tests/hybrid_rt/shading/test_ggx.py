"""Facets of rough surfaces: what their areas, shadows and normals add up to."""

import math

import mpmath
import numpy as np
import pytest
from scipy import stats

from hybrid_rt.shading.kernels.lobes.ggx import (
    facet_area,
    seen_and_lit,
    seen_through,
    stretched,
    visible_normal,
)

pytestmark = pytest.mark.interpreted

ALPHAS = [1e-4, 0.01, 0.1, 0.5, 1.0]


def smith(alpha, cosine):
    """Lambda as in Heitz 2014, table 1, in mpmath."""
    c, a = mpmath.mpf(cosine), mpmath.mpf(alpha)
    return (mpmath.sqrt(1 + a**2 * (1 - c**2) / c**2) - 1) / 2


@pytest.mark.parametrize("alpha", ALPHAS)
def test_facets_project_onto_the_whole_surface(alpha):
    """With t = tan^2, the integral of D cos is that of pi D cos^4 over t."""
    tangents = np.geomspace(1e-9, 1e9, 4001) * alpha**2
    cosine2 = 1 / (1 + tangents)
    area = [
        facet_area(alpha, math.sqrt(c2), t * c2) for c2, t in zip(cosine2, tangents, strict=True)
    ]
    # In steps of the logarithm: a smooth bell, of which the trapezoid rule loses nothing.
    values = math.pi * np.array(area) * cosine2**2 * tangents
    assert np.trapezoid(values, np.log(tangents)) == pytest.approx(1.0, rel=1e-6)
    below = tangents <= alpha**2
    half = np.trapezoid(values[below], np.log(tangents[below]))
    assert half == pytest.approx(0.5, rel=0.01)  # the grid ends within a step of alpha


@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("cos_in", [1.0, 0.6, 0.05, 1e-6])
@pytest.mark.parametrize("cos_out", [1.0, 0.3, 1e-3, 1e-9])
def test_shadows_are_smiths(alpha, cos_in, cos_out):
    a, b = smith(alpha, cos_in), smith(alpha, cos_out)
    assert stretched(alpha, cos_in) == pytest.approx(float(cos_in * (1 + 2 * a)), rel=1e-13)
    assert seen_and_lit(alpha, cos_in, cos_out) == pytest.approx(float(1 / (1 + a + b)), rel=1e-12)
    # lgamma of large arguments is good to 1e-16 of them.
    expected = float(mpmath.beta(1 + a, 1 + b))
    assert seen_through(alpha, cos_in, cos_out) == pytest.approx(expected, rel=1e-7, abs=1e-300)


@pytest.mark.parametrize("alpha", [0.01, 0.3, 1.0])
@pytest.mark.parametrize("incoming", [(0.0, 0.0, -1.0), (0.6, 0.0, -0.8), (0.3, 0.9, -0.02)])
def test_visible_normals_are_distributed_as_seen(alpha, incoming):
    """Cells of the projected disc that the stretched facets fill evenly, after Heitz 2018."""
    d = np.array(incoming) / np.linalg.norm(incoming)
    rng = np.random.default_rng(4)
    n = 4000
    normals = np.array([visible_normal(alpha, 0.0, 0.0, 1.0, *d, *rng.random(2)) for _ in range(n)])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-14)
    assert (normals @ d < 1e-12).all()
    assert (normals[:, 2] >= 0).all()
    # Marginal of the slope across the plane of incidence: s = m_y' / m_z. Seen facets have the
    # density (-d . m) D / (share); over the other slope it is integrated here.
    across = np.array([-d[1], d[0], 0.0])
    across = (
        across / np.linalg.norm(across) if np.linalg.norm(across) > 0 else np.array([0, 1.0, 0])
    )
    along = np.cross(across, [0.0, 0.0, 1.0])
    s = normals @ across / normals[:, 2] / alpha
    x = np.sinh(np.linspace(-12, 12, 2001))
    p, q = np.meshgrid(x, x, indexing="ij")  # slopes over alpha: along, across
    seen = np.maximum(-d[2] - alpha * p * (d @ along), 0.0)
    weight = np.cosh(np.linspace(-12, 12, 2001))
    density = (seen / (math.pi * (1 + p * p + q * q) ** 2) * weight[:, None]).sum(axis=0) * weight
    share = np.cumsum(density) / density.sum()
    place = np.interp(s, x, share)
    assert stats.kstest(place, "uniform").pvalue > 1e-4 / 9
