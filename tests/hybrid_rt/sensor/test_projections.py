"""Conventions of the orthographic and the panoramic camera, and the light that they show."""

import math

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Emissive,
    GradientSky,
    ImageEnvironment,
    Lambertian,
    Mirror,
    Object,
    OrthographicCamera,
    PanoramicCamera,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    TriangleMesh,
    render,
)
from hybrid_rt.core.fingerprint import fingerprint

# Right, up and forward of the cameras below; orthonormal.
RIGHT, UP, FORWARD = np.array([[2, -1, 2], [2, 2, -1], [1, -2, -2]]) / 3
EYE = np.array([1.0, 2, 3])


def orthographic(**changes):
    given = {"view_height": 4.0, "width": 8, "height": 4, "up": UP}
    return OrthographicCamera(EYE, EYE + 5 * FORWARD, **{**given, **changes})


def panoramic(eye=EYE, **changes):
    return PanoramicCamera(eye, eye + 5 * FORWARD, **{"width": 8, "height": 4, "up": UP, **changes})


def test_orthographic_rays_are_parallel_and_begin_on_the_film():
    origins, directions = orthographic().rays(np.array([4.0, 0, 8, 8]), np.array([2.0, 0, 4, 0]))
    corners = [EYE, EYE - 4 * RIGHT + 2 * UP, EYE + 4 * RIGHT - 2 * UP, EYE + 4 * RIGHT + 2 * UP]
    np.testing.assert_allclose(origins, corners, atol=1e-14)
    np.testing.assert_allclose(directions, np.tile(FORWARD, (4, 1)), atol=1e-15)


def test_panorama_has_longitudes_as_columns_and_latitudes_as_rows():
    places = {
        (4, 2): FORWARD,
        (6, 2): RIGHT,
        (2, 2): -RIGHT,
        (0, 2): -FORWARD,
        (8, 2): -FORWARD,
        (3, 0): UP,
        (5, 4): -UP,
        (4, 1): (FORWARD + UP) / math.sqrt(2),
        (6, 3): (RIGHT - UP) / math.sqrt(2),
        (5, 2): (FORWARD + RIGHT) / math.sqrt(2),
    }
    column, row = np.array(list(places), dtype=float).T
    origins, directions = panoramic().rays(column, row)
    np.testing.assert_array_equal(origins, np.tile(EYE, (len(places), 1)))
    np.testing.assert_allclose(directions, list(places.values()), atol=1e-15)


@pytest.mark.parametrize("view", [orthographic(), panoramic()], ids=["orthographic", "panoramic"])
def test_sees_is_the_inverse_of_rays(view):
    rng = np.random.default_rng(1)
    column, row = rng.uniform(0, 8, 500), rng.uniform(0, 4, 500)
    origins, directions = view.rays(column, row)
    distance = rng.uniform(0.1, 9, 500)
    way, pixel, pdf = view.sees(origins + distance[:, None] * directions)
    np.testing.assert_allclose(way, distance[:, None] * directions, atol=1e-13)
    np.testing.assert_array_equal(pixel, np.floor(row) * 8 + np.floor(column))
    per_area = view.direction_pdf(directions)
    # Parallel rays: one pixel is 1 x 1.
    expected = distance**2 if isinstance(view, OrthographicCamera) else per_area
    np.testing.assert_allclose(
        pdf, expected, rtol=1e-10
    )  # distances are subtracted from coordinates


def test_pdf_of_a_panorama_is_one_over_the_solid_angle_of_its_pixels():
    """The mean of 1 / pdf over a pixel is its solid angle, 2 pi / width (cos a - cos b)."""
    view, n = panoramic(), 2000
    place = (np.arange(n) + 0.5) / n
    for row in range(4):
        _, directions = view.rays(np.full(n, 3.3), row + place)
        solid = 2 * math.pi / 8 * (math.cos(math.pi * row / 4) - math.cos(math.pi * (row + 1) / 4))
        # The midpoint rule is off by the square of a step, (pi / 4 / 2000)^2 / 24.
        assert (1 / view.direction_pdf(directions)).mean() == pytest.approx(solid, rel=1e-7)


def test_orthographic_does_not_see_behind_or_beside():
    points = EYE + np.array([-FORWARD, FORWARD + 4.1 * RIGHT, FORWARD - 2.1 * UP, 0 * UP])
    _, pixel, pdf = orthographic().sees(points)
    np.testing.assert_array_equal(pixel, -1)
    np.testing.assert_array_equal(pdf, 0)


def test_panorama_sees_its_poles_and_its_edge():
    points = EYE + np.array([UP, -UP, -FORWARD, -FORWARD - 1e-9 * RIGHT, -FORWARD + 1e-9 * RIGHT])
    _, pixel, pdf = panoramic().sees(points)
    assert pixel[0] < 8
    assert pixel[1] >= 24
    assert (pixel[3], pixel[4]) == (16, 23)
    assert pixel[2] in (16, 23)
    assert np.isfinite(pdf).all()
    assert (pdf > 0).all()


def test_may_see_is_true_of_all_boxes_with_a_point_in_the_picture():
    view, rng = orthographic(), np.random.default_rng(2)
    n_unseen = 0
    for _ in range(300):
        low = EYE + rng.uniform(-6, 6, 3)
        bounds = np.array([low, low + rng.uniform(0, 3, 3)])
        _, pixel, _ = view.sees(rng.uniform(*bounds, (200, 3)))
        may = view.may_see(bounds)
        assert may or not (pixel >= 0).any()
        n_unseen += not may
    assert n_unseen > 100
    assert panoramic().may_see(np.array([low, low + 1]))


@pytest.mark.parametrize("make", [orthographic, panoramic])
def test_resized_and_fingerprints(make):
    view = make(width=80, height=40)
    assert repr(view.resized(8)) == repr(make())
    assert (view.resized(3, 5).width, view.resized(3, 5).height) == (3, 5)
    assert fingerprint(view.resized(8)) == fingerprint(make())
    assert fingerprint(view) != fingerprint(make())
    with pytest.raises(ValueError, match=f"{type(view).__name__} width"):
        view.resized(0)
    assert not view.has_lens


@pytest.mark.parametrize(
    ("make", "changes", "words"),
    [
        (orthographic, {"view_height": 0}, "OrthographicCamera view_height is 0: pass"),
        (orthographic, {"view_height": 1e-14}, "pass a look_from nearer"),
        (orthographic, {"up": FORWARD}, "OrthographicCamera up is .*, parallel"),
        (panoramic, {"up": (0, 0, 0)}, "PanoramicCamera up"),
        (panoramic, {"height": 0}, "PanoramicCamera height"),
        (panoramic, {"width": 1.5}, "PanoramicCamera width"),
    ],
)
def test_impossible_cameras_are_refused_by_name(make, changes, words):
    with pytest.raises((ValueError, TypeError), match=words):
        make(**changes)


@pytest.mark.parametrize(
    ("make", "name", "words"),
    [
        (orthographic, "vertical_fov", "pass view_height, scene units: the rays are parallel"),
        (panoramic, "fov", "pass no field of view: the picture shows 360 x 180 degrees"),
    ],
)
def test_words_of_other_cameras_are_answered(make, name, words):
    with pytest.raises(TypeError, match=words):
        make(**{name: 40})


# Beside the axes of view, so that nothing is symmetric: steps right, up and forward.
STEPS = np.array([[2.5, 0.5, 3], [-1.5, 1.5, 5], [0.5, -1.5, 2]])


def test_marks_land_on_the_pixels_of_an_orthographic_picture():
    balls = [
        Object(Sphere(EYE + step @ (RIGHT, UP, FORWARD), 0.3), Lambertian(0.5), f"ball {i}")
        for i, step in enumerate(STEPS)
    ]
    scene = Scene(orthographic(), balls, environment=GradientSky(1, 1))
    result = render(
        scene, "whitted", 2, outputs=["object_id", "depth", "normal", "albedo"], threads=1
    )
    expected = np.full((4, 8), -1.0)
    for i, (right, up, _) in enumerate(STEPS):
        expected[int(2 - up), int(4 + right)] = i
    np.testing.assert_array_equal(result.channels["object_id"], expected)
    on = expected >= 0
    depth = STEPS[expected[on].astype(int), 2] - 0.3  # the ray through the middle of a ball
    # Channels are float32.
    np.testing.assert_allclose(result.channels["depth"][on], depth, rtol=1e-6)
    np.testing.assert_allclose(result.channels["normal"][on], np.tile(-FORWARD, (3, 1)), atol=1e-6)
    assert result.denoised().image.shape == (4, 8, 3)


def test_a_panorama_of_an_environment_is_its_picture():
    """Blocks of 4 x 4 texels: what is half a texel within one is even."""
    blocks = np.random.default_rng(3).uniform(0.1, 2, (4, 8, 3))
    picture = blocks.repeat(4, axis=0).repeat(4, axis=1)
    view = PanoramicCamera((5, 5, 5), (4, 5, 5), (0, 1, 0), 32, 16)
    scene = Scene(view, [], [], ImageEnvironment(picture, up=(0, 1, 0)))
    image = render(scene, "whitted", 1, threads=1).image
    for k in (1, 2):
        # Texels are float32.
        np.testing.assert_allclose(image[k::4, k::4], blocks, rtol=1e-6)


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_everything_within_an_even_sphere_is_seen_evenly(integrator):
    sphere = trimesh.creation.icosphere(1, 2.0)
    sphere.invert()
    ball = Object(TriangleMesh(sphere), Emissive(1.0), "ball")
    result = render(Scene(panoramic(np.zeros(3)), [ball]), integrator, 2, threads=1)
    np.testing.assert_array_equal(result.image, 1)


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", ["path", "ppm", "whitted"])
def test_orthographic_floor_below_a_point_light(integrator):
    """Radiance 0.5 / pi x I h / r^3; over the film it adds up to 0.5 I / pi times a solid angle.

    That of a rectangle 2 a x 2 b at distance h is 4 atan(a b / (h sqrt(a^2 + b^2 + h^2))).
    """
    a, b, h = 1.5, 1.0, 0.7
    floor = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.5), "floor")
    view = OrthographicCamera((0, 0, 9), (0, 0, 0), (0, 1, 0), 2 * b, 12, 8)
    result = render(
        Scene(view, [floor], [PointLight((0, 0, h), 3)]), integrator, 32, seed=1, threads=1,
        options=PPMOptions(200) if integrator == "ppm" else None,
    )  # fmt: skip
    solid = 4 * math.atan(a * b / (h * math.sqrt(a * a + b * b + h * h)))
    expected = 0.5 / math.pi * 3 * solid / (4 * a * b)
    error = result.report["noise"]["standard_error_of_image_mean"]
    assert error < 2e-3 * expected
    # One seed in a million is beyond that; and what the first float32 digits leave.
    assert abs(result.mean - expected) < 5 * error + 1e-6


# Light comes to the floor by a mirror alone: the lamp shines up, and its image stands at z = 3.
LAMP = RectangleLight((1.5, -0.5, 1), (1, 0, 0), (0, 1, 0), 4.0)
MIRRORED = [
    Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor"),
    Object(Rectangle((-9, -9, 2), (0, 18, 0), (18, 0, 0)), Mirror(1.0), "mirror"),
]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
NODES, WEIGHTS = 0.5 * (NODES + 1), 0.5 * WEIGHTS


def radiance_of_floor(x, y):
    """Return 0.5 / pi times the irradiance by the lamp's image: L times the integral of h^2 / r^4."""
    u, v = np.meshgrid(1.5 + NODES, -0.5 + NODES)
    weight = np.outer(WEIGHTS, WEIGHTS)
    square = (u - x[..., None, None]) ** 2 + (v - y[..., None, None]) ** 2 + 9.0
    return 0.5 / math.pi * 4.0 * (weight * 9.0 / square**2).sum(axis=(-2, -1))


def orthographic_floor():
    """A film between floor and mirror, 1.2 high, and the mean of what it shows."""
    view = OrthographicCamera((-0.5, 0.1, 1.5), (-0.5, 0.1, 0), (0, 1, 0), 1.2, 6, 4)
    x, y = np.meshgrid(-0.5 + 1.8 * (NODES - 0.5), 0.1 + 1.2 * (NODES - 0.5))
    return view, (np.outer(WEIGHTS, WEIGHTS) * radiance_of_floor(x, y)).sum(), slice(None)


def panorama_of_floor():
    """The lowest third of a panorama, from half a unit above the floor: 60 degrees around the nadir."""
    view = PanoramicCamera((-0.5, 0.1, 0.5), (0, 0, 0.5), (0, 0, 1), 12, 6)
    polar, azimuth = math.pi / 3 * NODES, 2 * math.pi * np.arange(64) / 64
    away = 0.5 * np.tan(polar)[:, None]
    light = radiance_of_floor(-0.5 + away * np.cos(azimuth), 0.1 + away * np.sin(azimuth))
    return view, WEIGHTS @ light.mean(axis=1), slice(4, None)


@pytest.mark.statistical
@pytest.mark.parametrize("made", [orthographic_floor, panorama_of_floor])
@pytest.mark.parametrize("way", ["light paths", "ppm"])
def test_light_by_a_mirror_is_the_same_by_splats_and_by_paths(made, way):
    view, expected, rows = made()
    # Two directions from the floor, so that what it sends to itself by the mirror is left out.
    settings = {"integrator": "path", "passes": 512, "max_depth": 2, "threads": 1}
    if way == "ppm":
        settings |= {"integrator": "ppm", "passes": 4, "options": PPMOptions(8_000)}
    results = [render(Scene(view, MIRRORED, [LAMP]), seed=k, **settings) for k in range(4)]
    splats = {"ppm": "photons to camera", "light paths": "light paths"}[way]
    assert results[0].report["rays"][splats] > 100
    means = np.array([result.image[rows].mean() for result in results])
    error = math.hypot(means.std(ddof=1) / 2, 1e-3 * expected)
    assert error < 0.02 * expected
    # Student's t of four runs is beyond 6 in one of a hundred, the least error apart.
    assert abs(means.mean() - expected) < 6 * error
