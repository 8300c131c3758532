"""Camera paths of photon mapping at glass: both branches where they carry much, exact means."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Lambertian,
    Mirror,
    Mix,
    Object,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)
from hybrid_rt.integrators.photons.eye_pass import FAINT

pytestmark = pytest.mark.statistical
# How often a right mean is refused by chance.
ALARM = 1e-5
# All pixels look straight down past a lamp that shines down.
CAMERA = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 1e-6, 32, 32)
LAMP = RectangleLight((-9, -9, 2), (0, 18, 0), (18, 0, 0), 100.0)


def pixels(objects, passes=1):
    scene = Scene(CAMERA, objects, [LAMP])
    image = render(scene, "ppm", passes, seed=4, threads=1, options=PPMOptions(200)).image
    return image[..., 0].ravel().astype(float)


def assert_mean(values, truth):
    error = values.std(ddof=1) / math.sqrt(values.size)
    limit = stats.t.isf(ALARM / 2, values.size - 1) * error
    assert abs(values.mean() - truth) <= limit + 1e-6 * truth


@pytest.mark.parametrize("ior", [1.1, 1.5, 2.5])
def test_lamp_in_a_plate_of_glass(ior):
    """Both faces reflect r: together 2 r / (1 + r), the geometric series of all ways."""
    plate = Object(Box((-9, -9, -1), (9, 9, 0)), Dielectric(ior))
    values = pixels([plate])
    r = ((ior - 1.0) / (ior + 1.0)) ** 2
    assert_mean(values, 100.0 * 2.0 * r / (1.0 + r))
    # No path of less than FAINT comes in more than that: a variance of FAINT times the mean of what
    # is left to chance, at most. Choosing at each face would have the mean itself.
    assert values.var() <= 100.0**2 * FAINT * 2.0 * r / (1.0 + r)


def test_lamp_in_a_floor_that_hardly_mirrors():
    """A path of FAINT or more is never left to roulette."""
    floor = Mix([(1.0 - FAINT, Lambertian(0.0)), (FAINT, Mirror(1.0))])
    square = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    np.testing.assert_allclose(pixels([Object(square, floor)]), 100.0 * FAINT, rtol=1e-6)
    fainter = Mix([(1.0 - FAINT / 4, Lambertian(0.0)), (FAINT / 4, Mirror(1.0))])
    values = pixels([Object(square, fainter)])
    assert_mean(values, 100.0 * FAINT / 4)
    assert set(np.round(values, 4)) == {0.0, 2.0}
