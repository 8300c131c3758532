"""Lamps that shine by a picture with a small, very bright place: they are sampled by its brightness."""

import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Box,
    Camera,
    Emissive,
    ImageTexture,
    Lambertian,
    Object,
    PathOptions,
    PPMOptions,
    Rectangle,
    Scene,
    Sphere,
    render,
)
from hybrid_rt.lights.surface import shining_surface
from hybrid_rt.lights.unevenness import is_very_uneven
from meshing import BezierPatches, TrimmedSurface, circle, polygon

N, DIM, BRIGHT = 64, 0.05, 1e4
TEXELS = np.full((N, N, 3), DIM)
TEXELS[N // 3, N // 5] = BRIGHT
PICTURE = ImageTexture(TEXELS)
RECTANGLE = Rectangle((-2, -2, 3), (0, 4, 0), (4, 0, 0))
x = (-1.0, 0.0, 1.0)
PATCH = BezierPatches([[[(a, b, 3.0 + 0.3 * a * b) for b in x] for a in x]])
HOLED = TrimmedSurface(
    RECTANGLE, [polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), circle((0.7, 0.3), 0.1)]
)
LAMPS = {
    "rectangle": RECTANGLE,
    "sphere": Sphere((0, 0, 5), 1),
    "dome": Sphere((0, 0, 0), 9).flipped(),
    "box": Box((-1, -1, 3), (1, 1, 4)),
    "patch": PATCH,
    "trimmed": HOLED,
}


def test_only_very_uneven_pictures_count():
    half = np.zeros((4, 4, 3))
    half[:2] = 1.0  # the mean of its squares is twice the square of its mean
    assert not is_very_uneven(ImageTexture(half))
    assert is_very_uneven(PICTURE)
    assert not is_very_uneven(ImageTexture(np.zeros((4, 4, 3))))


@pytest.mark.statistical
@pytest.mark.parametrize("seen", [False, True], ids=["leaving", "as seen"])
@pytest.mark.parametrize("name", LAMPS)
def test_samples_follow_their_density(name, seen):
    """The mean of 1 / pdf over samples is the area that they can lie on, and most lie where it is bright."""
    lamp = shining_surface(LAMPS[name], PICTURE)
    assert lamp.is_by_brightness
    xi = np.random.default_rng(3).random((40_000, 2))
    place = np.zeros((len(xi), 3))
    points = lamp.seen_points(place, xi) if seen else lamp.points(xi)
    held = points.pdf_area > 0.0
    inverse = np.divide(1.0, points.pdf_area, out=np.zeros(len(xi)), where=held)
    error = inverse.std(ddof=1) / np.sqrt(len(xi))
    # A sphere and a box are seen in part; what is not seen may get no samples.
    if not (seen and name in ("sphere", "box")):
        # Areas of curved cells are those of their midpoints, to 1e-4.
        gap = stats.norm.isf(5e-6) * error + 1e-4 * lamp.area
        assert inverse.mean() == pytest.approx(lamp.area, abs=gap)
    # Bilinear lookup spreads the bright texel over 2 x 2 of them.
    column, row = points.u * N - 0.5, (1.0 - points.v) * N - 0.5
    is_bright = (np.abs(column - N // 5) < 1.5) & (np.abs(row - N // 3) < 1.5)
    if not (seen and name in ("sphere", "box")):
        assert is_bright[held].mean() > 0.5


@pytest.mark.statistical
@pytest.mark.parametrize("method", ["path", "lights", "whitted", "ppm"])
@pytest.mark.parametrize("name", ["rectangle", "patch"])
def test_pictures_have_the_light_of_the_bright_texel(name, method):
    """It alone gives the floor as much as a bilinear hat of radiance at its place; the rest is even."""
    surface = LAMPS[name]
    floor = Object(Rectangle((-6, -6, 0), (12, 0, 0), (0, 12, 0)), Lambertian(0.5))
    camera = Camera((0, 0, 1.5), (0, 0, 0), (0, 1, 0), vertical_fov=40, width=16, height=16)
    lit = surface if surface.normal(0.5, 0.5)[2] < 0.0 else surface.flipped()
    scene = Scene(camera, [floor, Object(lit, Emissive(PICTURE))])
    integrator = "path" if method == "lights" else method
    options = PathOptions(strategy="lights") if method == "lights" else None
    if method == "ppm":
        options = PPMOptions(20_000)
    result = render(scene, integrator, passes=16, threads=1, options=options)
    # --- the radiance of the floor, by quadrature over the lamp: the hat has twice a texel's width
    step = (np.arange(40) + 0.5) / 40
    fine = (np.arange(16) + 0.5) / 16 * 2.0 - 1.0
    place = (np.arange(24) + 0.5) / 24 * 16
    column, row = np.meshgrid(place, place)
    origin, way = camera.rays(column.ravel(), row.ravel())
    floor_at = origin - origin[:, 2:] / way[:, 2:] * way
    total = np.zeros(len(floor_at))
    hat = (1.0 - np.abs(fine)) / N
    u_hat, v_hat = (N // 5 + 0.5 + fine) / N, 1.0 - (N // 3 + 0.5 + fine) / N
    even = np.ones(40) / 40
    grid = (step, step, even, even, DIM)
    for u, v, w_u, w_v, radiance in (grid, (u_hat, v_hat, hat / 8, hat / 8, BRIGHT - DIM)):
        uu, vv = (a.ravel() for a in np.meshgrid(u, v, indexing="ij"))
        weight = np.outer(w_u, w_v).ravel()
        point, normal = lit.point(uu, vv), lit.normal(uu, vv)
        s_u, s_v = lit.partials(uu, vv)
        area = np.linalg.norm(np.cross(s_u, s_v), axis=1) * weight
        gap = point - floor_at[:, None]
        square = (gap**2).sum(axis=2)
        facing = np.maximum(-(gap * normal).sum(axis=2), 0.0) * gap[:, :, 2]
        total += radiance * (facing / square**2) @ area
    truth = float((0.5 / np.pi * total).mean())
    # Two and a half half-intervals: 5 standard errors of a mean that few groups know.
    assert result.mean == pytest.approx(truth, abs=2.5 * result.mean_half_interval + 2e-3 * truth)
    if integrator != "ppm":
        assert result.mean_half_interval < 0.05 * truth
