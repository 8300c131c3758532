"""Irradiance under rectangles and parallelograms, from tiny to huge, in all integrators."""

import math

import mpmath
import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Emissive,
    ImageTexture,
    Lambertian,
    Object,
    PathOptions,
    PhotonMapOptions,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    SphereLight,
    render,
)

FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
# All pixels see the origin.
CAMERA = Camera((0, -0.5, 0.5), (0, 0, 0), (0, 0, 1), 1e-6, 16, 16)
# How often a right mean is refused by chance.
ALARM = 1e-5
SIZES = (1e-3, 1.0, 1e3, 1e6)


def lamp(shape, size, height=1.0):
    """Return corner and edges, shining down on the origin from about ``height`` above it."""
    corner, u, v = {
        "square": ((-0.5 * size, -0.5 * size, height), (0, size, 0), (size, 0, 0)),
        "aside": ((height, -0.3 * size, height), (0, 2 * size, 0), (size, 0, 0)),
        "slanted": ((-0.7 * size, -0.9 * size, height), (0, size, 0), (size, 0.8 * size, 0)),
        "tilted": ((0.3, -0.2, height), (0, size, 0.2 * size), (size, 0.4 * size, 0.3 * size)),
        "long": ((0.2, -0.5 * size, height), (0, size, 0), (1e-3 * height, 0, 0)),
    }[shape]
    return corner, u, v


def irradiance(corner, u, v):
    """Irradiance at the origin of the floor, for radiance one (Lambert 1760).

    Half the sum of the angles between corners, each times the height of its plane's normal.
    """
    with mpmath.workdps(40):
        corner, u, v = (np.array([mpmath.mpf(x) for x in part]) for part in (corner, u, v))
        corners = (corner, corner + u, corner + u + v, corner + v)
        total = mpmath.mpf(0)
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            normal = np.cross(b, a)
            across = mpmath.sqrt(normal @ normal)
            total += mpmath.atan2(across, a @ b) * normal[2] / across
        return float(abs(total) / 2)


def assert_shows(scene, truth, integrator, precision, seeds=(0,), **settings):
    """Compare the mean of pixels, which are independent of each other, with the truth."""
    values = np.concatenate([
        render(
            scene, integrator, 4, seed=seed, threads=1, max_depth=0, **settings
        ).image[..., 0].ravel().astype(float)
        for seed in seeds
    ])  # fmt: skip
    error = values.std(ddof=1) / math.sqrt(values.size)
    limit = stats.t.isf(ALARM / 2, values.size - 1) * error
    # Sums in float32; the camera sees the floor up to 1e-8 beside the point.
    assert abs(values.mean() - truth) <= limit + 2e-6 * truth
    assert error <= precision * truth


OWN = {
    "path": None,
    "whitted": None,
    "ppm": PPMOptions(200),
    "photon_map": PhotonMapOptions(200),
}


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", OWN)
@pytest.mark.parametrize("shape", ["square", "aside", "slanted", "tilted", "long"])
def test_irradiance_is_lamberts(integrator, shape):
    for size in SIZES:
        corner, u, v = lamp(shape, size)
        scene = Scene(CAMERA, [FLOOR], [RectangleLight(corner, u, v, 1.0)])
        # The cosine at the floor is all that varies: by less than its mean.
        assert_shows(
            scene, 0.5 / math.pi * irradiance(corner, u, v), integrator, 0.03,
            options=OWN[integrator],
        )  # fmt: skip


@pytest.mark.statistical
@pytest.mark.parametrize("strategy", ["both", "lights", "directions"])
@pytest.mark.parametrize("shape", ["aside", "slanted", "tilted"])
def test_asking_running_into_and_both_see_the_same(strategy, shape):
    """Weights are right: the densities are those of what is done, from 1/2 to 1e-9 of the size."""
    for size, height in ((2.0, 1.0), (40.0, 1.0), (1.0, 1e-9), (1e6, 1.0)):
        # A narrow way in between for the camera.
        camera = Camera((0, 0, 0.5 * height), (0, 0, 0), (0, 1, 0), 1e-6, 16, 16)
        corner, u, v = lamp(shape, size, height)
        if shape == "tilted":
            corner = (0.3 * height, -0.2 * height, height)
        scene = Scene(camera, [FLOOR], [RectangleLight(corner, u, v, 1.0)])
        assert_shows(
            scene, 0.5 / math.pi * irradiance(corner, u, v), "path", 0.1, seeds=(1, 2, 3),
            options=PathOptions(strategy=strategy),
        )  # fmt: skip


@pytest.mark.statistical
@pytest.mark.parametrize("strategy", ["both", "lights", "directions"])
def test_a_picture_lies_on_the_lamp_as_it_is_seen(strategy):
    """Each half of a lamp shines where its parameters say: half the lamp's polygon."""
    corner, u, v = (np.array(part) for part in lamp("slanted", 3.0))
    for squares, half in (((2.0, 1.0), (0.5 * u, v)), ((1.0, 2.0), (u, 0.5 * v))):
        shining = Emissive(CheckerTexture(1.0, 0.0, squares, "uv"))
        lit = Object(Rectangle(corner, u, v), shining, "lamp")
        scene = Scene(CAMERA, [FLOOR, lit])
        truth = 0.5 / math.pi * irradiance(corner, *half)
        assert_shows(
            scene, truth, "path", 0.1, seeds=(1, 2), options=PathOptions(strategy=strategy)
        )


@pytest.mark.parametrize(
    ("lamp", "surface"),
    [
        (lambda radiance: RectangleLight((0, 0, 0), (1, 0, 0), (0, 1, 0), radiance), "Rectangle"),
        (lambda radiance: SphereLight((0, 0, 0), 1.0, radiance), "Sphere"),
    ],
)
def test_a_texture_as_radiance_is_refused_with_what_takes_one(lamp, surface):
    words = rf"Light radiance is a texture: .* Object\({surface}\(\.\.\.\), Emissive\(texture\)\)"
    with pytest.raises(TypeError, match=words):
        lamp(ImageTexture(np.ones((4, 4, 3))))
