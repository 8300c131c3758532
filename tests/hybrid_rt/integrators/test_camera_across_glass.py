"""Lenses and films that reach across the surface of a clear body: rays begin in several media."""

import math

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Emissive,
    GradientSky,
    Object,
    OrthographicCamera,
    PPMOptions,
    Rectangle,
    Scene,
    Sphere,
    render,
)

INTEGRATORS = ["path", "ppm", "whitted"]


def picture(scene, integrator, passes, **settings):
    options = PPMOptions(100) if integrator == "ppm" else None
    return render(scene, integrator, passes, options=options, threads=1, **settings)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("look_from_x", [0.5, -0.5])
def test_film_that_stands_half_in_a_block_of_absorbing_glass(integrator, look_from_x):
    """Rays begin half a unit below the top of the block, beside it, and above a dark floor.

    Of light straight on, a face reflects R = 0.04. Within: n^2 (1 - R) a / (1 - R^2 a^4), a = exp(-s / 2)
    the share that half of the block lets through, as light that goes down and comes up again passes
    all of it twice. Beside it nothing is weakened.
    """
    density = 0.8
    glass = Object(Box((0, -2, 0), (2, 2, 1)), Dielectric(1.5, absorption=density), "block")
    wall = Object(Rectangle((-9, -9, 3), (0, 18, 0), (18, 0, 0)), Emissive(1.0), "wall")
    camera = OrthographicCamera(
        (look_from_x, 0.1, 0.5), (look_from_x, 0.1, 2), (0, 1, 0), 1.0, 6, 2
    )
    result = picture(Scene(camera, [glass, wall]), integrator, 64)
    a = math.exp(-density / 2)
    within = 2.25 * 0.96 * a / (1 - 0.04**2 * a**4)
    assert result.report["warnings"] == []
    # Right is -x where the view goes up.
    columns = look_from_x - 0.5 * (np.arange(6) - 2.5)
    for column, x in enumerate(columns):
        found = result.image[:, column].mean()
        # Reflected rays are followed by chance, in a twenty-fifth of the paths: of 128 a few.
        assert found == pytest.approx(within if x > 0 else 1.0, rel=0.06 if x > 0 else 1e-6)


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_lens_that_reaches_out_of_a_ball(integrator):
    """In an even sky of radiance 1: n^2 within the ball, 1 without, by the shares of the lens."""
    camera = Camera((0, 0, 0.9), (0, 0, -1), (0, 1, 0), 20, 8, 8, aperture=3)
    ball = Object(Sphere((0, 0, 0), 1), Dielectric(1.5), "ball")
    result = picture(Scene(camera, [ball], [], GradientSky(1, 1)), integrator, 64, max_depth=64)
    assert result.report["warnings"] == []
    expected = 1 + 1.25 * (1 - 0.9**2) / 1.5**2
    error = result.report["noise"]["standard_error_of_image_mean"]
    assert error < 0.02
    assert abs(result.mean - expected) < 5 * error
