"""Lenses: printed focal lengths, light that meets in one point, and another tracer's rays."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest

from hybrid_rt.analysis.lens import Lens, LensSurface
from hybrid_rt.analysis.lens_examples import (
    COOKE_PRINTED,
    COOKE_TRIPLET,
    DOUBLE_GAUSS,
    DOUBLE_GAUSS_PRINTED,
    stigmatic_singlet,
)


def test_the_printed_focal_lengths_come_out():
    lens = Lens(COOKE_TRIPLET)
    traced, paraxial = lens.focus(), lens.paraxial_focus()
    # As many digits as the book gives.
    np.testing.assert_allclose(traced, COOKE_PRINTED, atol=5e-4)
    # The ray runs 3e-3 beside the axis: third order changes f by f (h / f)^2 = 1e-7.
    np.testing.assert_allclose(traced, paraxial, atol=2e-7)
    gauss = Lens(DOUBLE_GAUSS)
    np.testing.assert_allclose(gauss.focus(), gauss.paraxial_focus(), atol=2e-6)
    # Indices are printed to three decimals: 5e-4 of 0.7 in the power of each surface.
    np.testing.assert_allclose(gauss.focus(), DOUBLE_GAUSS_PRINTED, atol=0.05)


def test_a_hyperboloid_brings_parallel_light_to_a_point():
    lens = Lens(stigmatic_singlet(1.5, 50.0, 60.0))
    focus = 25.0 + 50.0
    points, chief, rms = lens.spot(0.0, focus, 58.0)
    assert len(points) > 3000
    # Rounding: units in the last place of 75, over slopes of 1.
    assert np.abs(points).max() < 1e-13
    assert rms < 5e-14
    assert np.abs(chief).max() < 1e-14
    assert lens.focus().back_focal_distance == pytest.approx(50.0, abs=1e-9)
    # All paths to the focus are as long: of the ray on the axis, 25 of glass and 50 of air.
    x = np.linspace(-29, 29, 101)
    origins = np.stack([x, 0 * x, np.full(101, -10.0)], axis=1)
    rays = lens.trace(origins, np.broadcast_to([0.0, 0.0, 1.0], (101, 3)))
    assert rays.passed.all()
    last = np.linalg.norm(rays.position - (0, 0, focus), axis=1)
    np.testing.assert_allclose(rays.path + last, 10 + 1.5 * 25 + 50, atol=1e-13)
    # A sphere of the same power does not.
    front, back = stigmatic_singlet(1.5, 50.0, 30.0)
    ball = Lens((front, replace(back, conic=0.0)))
    assert ball.spot(0.0, focus, 28.0)[2] > 0.5


def through(prescription, origin, direction):
    """Trace one ray to 40 digits through spheres and planes, each by its quadratic; None: blocked."""
    o, d = [mpmath.mpf(float(x)) for x in origin], [mpmath.mpf(float(x)) for x in direction]
    length = mpmath.norm(mpmath.matrix(d))
    d, index, vertex = [x / length for x in d], mpmath.mpf(1), mpmath.mpf(0)
    for s in prescription:
        if math.isinf(s.radius):
            t, normal = (vertex - o[2]) / d[2], [mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(1)]
        else:
            centre = [0, 0, vertex + mpmath.mpf(s.radius)]
            away = [a - b for a, b in zip(o, centre, strict=True)]
            b, c = mpmath.fdot(away, d), mpmath.fdot(away, away) - mpmath.mpf(s.radius) ** 2
            t = -b - mpmath.sign(s.radius) * mpmath.sqrt(b * b - c)
            normal = [(a + t * x) / s.radius for a, x in zip(away, d, strict=True)]
        o = [a + t * x for a, x in zip(o, d, strict=True)]
        if mpmath.hypot(o[0], o[1]) > s.aperture / 2:
            return None
        cosine = mpmath.fdot(d, normal)
        ratio = index / mpmath.mpf(s.index)
        beyond = mpmath.sign(cosine) * mpmath.sqrt(1 - ratio**2 * (1 - cosine**2))
        d = [ratio * x + (beyond - ratio * cosine) * y for x, y in zip(d, normal, strict=True)]
        index, vertex = mpmath.mpf(s.index), vertex + mpmath.mpf(s.thickness)
    return o, d


@pytest.mark.parametrize("prescription", [COOKE_TRIPLET, DOUBLE_GAUSS], ids=["Cooke", "Gauss"])
def test_rays_are_those_of_another_tracer(prescription):
    rng = np.random.default_rng(4)
    half = 0.5 * prescription[0].aperture
    origins = np.column_stack([rng.uniform(-half, half, (150, 2)), np.full(150, -20.0)])
    directions = np.column_stack([rng.normal(0, 0.1, (150, 2)), np.ones(150)])
    lens = Lens(prescription)
    rays = lens.trace(origins, directions)
    with mpmath.workdps(40):
        wanted = [through(prescription, o, d) for o, d in zip(origins, directions, strict=True)]
    assert np.array_equal(rays.passed, [ray is not None for ray in wanted])
    assert 30 < rays.passed.sum() < 150
    for k in np.flatnonzero(rays.passed):
        position, direction = ([float(x) for x in part] for part in wanted[k])
        # Seven to eleven surfaces, a few roundings of 100 at each, over cosines above a half.
        np.testing.assert_allclose(rays.position[k], position, atol=2e-13)
        np.testing.assert_allclose(rays.direction[k], direction, atol=1e-14)


def test_light_that_does_not_pass_is_said():
    closed = [LensSurface(10.0, 5.0, 1.5, 8.0), LensSurface(-2.6, 0.0, 1.0, 5.0)]
    rays = Lens(closed).trace(
        np.array([[2.3, 0, -1], [0, 0, -1]]), np.array([[0, 0, 1], [0, 0, 1]])
    )
    # Beyond the critical angle at the back, and straight through.
    assert rays.passed.tolist() == [False, True]
    assert np.isnan(rays.position[0]).all()
    with pytest.raises(ValueError, match="no light from 60 degrees passes the lens"):
        Lens(COOKE_TRIPLET).spot(60.0, 100.0, 20.0)
