"""Shining surfaces of any shape: irradiance from tiny to huge, densities, all integrators."""

import math

import mpmath
import numpy as np
import pytest
from shining import assert_mean, chosen, met

from hybrid_rt import (
    Box,
    Camera,
    Emissive,
    Lambertian,
    Object,
    PathOptions,
    PPMOptions,
    Rectangle,
    Scene,
    Sphere,
    TriangleMesh,
    render,
)
from meshing import BezierPatches, SurfaceOfRevolution

# The radius is 1 - z^2.
SPINDLE = SurfaceOfRevolution([(-1, 0), (0, 2), (1, 0)], (0, 0, 0), (0, 0, 1))
QUADS = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
TURN = np.array([[0.8, -0.6, 0.0, 0.0], [0.48, 0.64, -0.6, 0.0], [0.36, 0.48, 0.8, 0.0],
                 [0.0, 0.0, 0.0, 1.0]])  # fmt: skip


class Triangles:
    """What `TriangleMesh` takes."""

    def __init__(self, vertices, faces):
        self.vertices, self.faces = np.array(vertices, float), np.array(faces)


def corners(size, height=1.0):
    """Corners of a box whose lower face lies at ``height`` and reaches past the origin."""
    low = (-0.3 * size, -0.6 * size, height)
    return np.array([[low[k] + (i >> k & 1) * size for k in range(3)] for i in range(8)])


def box(size):
    place = corners(size)
    return Box(place[0], place[7])


def mesh_box(size):
    return TriangleMesh(
        Triangles(corners(size), [f for a, b, c, d in QUADS for f in ((a, b, c), (a, c, d))])
    )


def fine_sheet(size):
    """4608 triangles at height 1, facing down."""
    n = 48
    x, y = np.meshgrid(np.linspace(-0.3, 0.7, n + 1), np.linspace(-0.6, 0.4, n + 1), indexing="ij")
    place = np.stack([size * x.ravel(), size * y.ravel(), np.ones(x.size)], axis=-1)
    k = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    one = np.stack([k, k + 1, k + n + 2], axis=-1)
    return TriangleMesh(
        Triangles(place, np.concatenate([one, np.stack([k, k + n + 2, k + n + 1], -1)]))
    )


def flat_patch(size):
    a, b, c, d = corners(size)[[0, 2, 1, 3]]
    return BezierPatches(np.array([[[a, c], [b, d]]]))


x = (-1.0, 0.0, 1.0)
# z = x^2 + y^2 over [-1, 1]^2.
BENT = BezierPatches(
    np.array([[[(a, b, abs(a) + abs(b) - (a == 0) - (b == 0)) for b in x] for a in x]])
)

FLAT = {"box": box, "mesh": mesh_box, "fine mesh": fine_sheet, "flat patch": flat_patch}


def polygon(place, normal):
    """Irradiance at the origin by a polygon before it, above the horizon (Lambert 1760)."""
    with mpmath.workdps(40):
        total = mpmath.mpf(0)
        place = [[mpmath.mpf(float(x)) for x in p] for p in place]
        for a, b in zip(place, (*place[1:], place[0]), strict=True):
            across = np.cross(a, b)
            length = mpmath.sqrt(across @ across)
            cosine = sum(x * y for x, y in zip(a, b, strict=True))
            turn = across @ np.array([mpmath.mpf(x) for x in normal])
            total += mpmath.atan2(length, cosine) * turn / length
        return float(total / 2)


def irradiance(size):
    """Irradiance at the origin of a floor below the lower face of `corners`, all that is seen."""
    return abs(polygon(corners(size)[list(QUADS[0])], (0, 0, 1)))


@pytest.mark.statistical
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e6])
@pytest.mark.parametrize("shape", FLAT)
def test_irradiance_is_lamberts(shape, size):
    """Even in solid angle the cosine varies by 0.58 of its mean; by area it would be 1e3 and more."""
    # Seen from far below a box shows one face.
    below = {"box": 0.6, "mesh": 0.8, "fine mesh": 0.9, "flat patch": 0.9}[shape]
    _, _, _, value = chosen(FLAT[shape](size), (0.0, 0.0, 0.0))
    truth = irradiance(size)
    assert_mean(value, truth, below)


@pytest.mark.statistical
@pytest.mark.parametrize("depth", [1.0, 0.1, 1e-3, 1e-6])
def test_within_a_shining_sphere_every_floor_gets_pi(depth):
    """Radiance one from all sides. Half of what is chosen lies below the floor."""
    _, _, _, value = chosen(Sphere((0, 0, 0), 1.0).flipped(), (0.0, 0.0, 1.0 - depth))
    assert_mean(value, math.pi, 2.5)


@pytest.mark.statistical
@pytest.mark.parametrize("depth", [1.0, 1e-3, 1e-5])
def test_within_a_turned_body_that_shines_every_floor_gets_pi(depth):
    """A closed convex body that shines inward: pi everywhere within, whatever its shape."""
    # On the surface 0.6^2 + y^2 = (1 - 0.2^2)^2.
    y = math.sqrt(0.96**2 - 0.6**2)
    _, _, _, value = chosen(SPINDLE.flipped(), (0.6, y * (1.0 - depth), 0.2))
    assert_mean(value, math.pi, 3.0)


@pytest.mark.parametrize("height", [1e-6, 0.5])
@pytest.mark.parametrize(
    "surface",
    [
        box(2.0), box(2.0).transformed(TURN), mesh_box(2.0), fine_sheet(2.0), flat_patch(2.0),
        BENT, SPINDLE, Sphere((0.4, -0.1, 2), 1.0),
    ],
    ids=["box", "turned box", "mesh", "fine mesh", "flat patch", "bent patch", "spindle", "sphere"],
)  # fmt: skip
def test_density_of_what_is_run_into_is_that_of_asking(surface, height):
    """Both walk the same tree, one by random numbers and one to a given place."""
    place = surface.point([0.3], [0.4], [0])[0] + height * surface.normal([0.3], [0.4], [0])[0]
    light, seen_from, points, _ = chosen(surface, place, n=50)
    rows = np.flatnonzero(points.pdf_area > 0.0)
    assert rows.size >= 45
    density = light.seen_pdf_area(seen_from[rows], met(surface, points, rows))
    # A place within a rounding of the border of two parts may belong to either.
    differs = np.abs(density / points.pdf_area[rows] - 1.0) > 1e-6
    assert differs.sum() <= 1


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", ["whitted", "ppm", "both", "lights", "directions"])
@pytest.mark.parametrize("shape", ["box", "mesh", "flat patch"])
def test_pictures_show_it(shape, integrator):
    """A floor below lamps 1000 times as wide as they are far, in every way of finding their light."""
    options = None
    if integrator in ("both", "lights", "directions"):
        options, integrator = PathOptions(strategy=integrator), "path"
    elif integrator == "ppm":
        options = PPMOptions(200)
    size = 1e3
    floor = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
    camera = Camera((0, -0.5, 0.5), (0, 0, 0), (0, 0, 1), 1e-6, 16, 16)
    scene = Scene(camera, [floor, Object(FLAT[shape](size), Emissive(1.0), "lamp")])
    image = render(
        scene, integrator, 4, seed=5, threads=1, max_depth=0, options=options
    ).image[..., 0].ravel().astype(float)  # fmt: skip
    # Four samples a pixel. Of the sky 5e-6 are beside the lamps, which no direction may have met.
    assert_mean(image, 0.5 / math.pi * irradiance(size), 0.6, rounding=1e-5)


@pytest.mark.parametrize("middle", [1.0, 1.4], ids=["flat", "bent"])
def test_triangles_of_a_lamp_do_not_hide_it(middle):
    rows = [[(x, y, middle if x == 0.0 else 1.0) for x in (-0.5, 0.0, 0.5)] for y in (-0.5, 0.5)]
    lamp = Object(BezierPatches([rows]), Emissive((1, 1, 1)))
    floor = Object(Rectangle((-0.01, -0.01, 0), (0.02, 0, 0), (0, 0.02, 0)), Lambertian((1, 1, 1)))
    scene = Scene(Camera((0, -1, 0.5), (0, 0, 0), (0, 0, 1), 0.5, 16, 16), [floor, lamp])
    means = [
        render(
            scene, "path", 64, accuracy=accuracy, options=PathOptions(strategy=strategy), threads=1
        ).image.mean()
        for accuracy, strategy in (
            ("certified", "lights"), ("mesh", "lights"), ("mesh", "both"), ("refined", "lights"),
        )
    ]  # fmt: skip
    assert means[0] > 0.1
    # Triangles move the light by less than their distance from the surface, 1e-3 of its size.
    np.testing.assert_allclose(means[1:], means[0], rtol=5e-3)
