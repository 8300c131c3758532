import math
import re

import numpy as np
import pytest

from hybrid_rt import GradientSky, Lambertian, Object, Scene, Sphere, render
from hybrid_rt.sensor.camera import Camera

SOUND = {"look_from": (1, 2, 3), "look_at": (4, -2, 3), "up": (0, 0, 1)}


def camera(**changes):
    return Camera(**{**SOUND, "width": 8, "height": 4, "vertical_fov": 90.0, **changes})


def test_middle_corners_and_pixel_size_are_those_of_a_right_angle_of_view():
    view, right, up = np.array([0.6, -0.8, 0]), np.array([-0.8, -0.6, 0]), np.array([0, 0, 1])
    origins, directions = camera().rays(np.array([4.0, 0, 8]), np.array([2.0, 0, 4]))
    np.testing.assert_array_equal(origins, np.tile([1, 2, 3], (3, 1)))
    corners = np.array([view, view - 2 * right + up, view + 2 * right - up])
    corners /= np.linalg.norm(corners, axis=1)[:, None]
    np.testing.assert_allclose(directions, corners, atol=1e-15)


@pytest.mark.parametrize("fov", [1e-300, 1e-9, 179.999999, math.nextafter(180.0, 0.0)])
def test_directions_are_unit_vectors_in_all_fields_of_view(fov):
    places = np.random.default_rng(3).uniform(0, 4, (50, 2)).T
    _, directions = camera(vertical_fov=fov).rays(2 * places[0], places[1])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-15)


def test_up_may_lie_almost_along_the_view():
    """Within 1e-7 of it there are still three directions at right angles."""
    _, directions = camera(up=(3, -4, 5e-7)).rays(np.array([4.0]), np.array([2.0]))
    np.testing.assert_allclose(directions, [[0.6, -0.8, 0.0]], atol=1e-15)


def test_resized_keeps_all_but_the_resolution():
    view = camera(width=300, height=200, aperture=0.5, focus_distance=3.0)
    assert repr(view.resized(8, 4)) == repr(camera(aperture=0.5, focus_distance=3.0))
    for width, height in ((150, 100), (100, 67), (1, 1)):
        small = view.resized(width)
        assert (small.width, small.height) == (width, height)
    with pytest.raises(ValueError, match="Camera width"):
        view.resized(0)


def test_aperture_zero_is_exactly_the_pinhole():
    places = np.random.default_rng(1).uniform(0, 4, (50, 2))
    lens = np.random.default_rng(2).uniform(size=(50, 2))
    pinhole = camera().rays(*places.T)
    closed = camera(aperture=0.0).rays(*places.T, lens)
    for a, b in zip(pinhole, closed, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not camera().has_lens


def test_rays_of_one_film_place_meet_in_the_plane_of_focus():
    lens = np.random.default_rng(2).uniform(size=(200, 2))
    column, row = np.full(200, 1.3), np.full(200, 3.1)
    view = camera(aperture=0.5, focus_distance=3.0)
    origins, directions = view.rays(column, row, lens)
    forward = np.array([0.6, -0.8, 0])
    along = directions @ forward
    points = origins + (3.0 / along)[:, None] * directions
    np.testing.assert_allclose(points, np.tile(points[0], (200, 1)), atol=1e-14)
    offset = np.linalg.norm(origins - [1, 2, 3], axis=1)
    assert 0.24 < offset.max() <= 0.25
    np.testing.assert_allclose((origins - [1, 2, 3]) @ forward, 0, atol=1e-15)


def test_focus_is_at_look_at_unless_said():
    assert camera().focus_distance == pytest.approx(5.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"vertical_fov": 180}, "vertical_fov"),
        ({"vertical_fov": float("nan")}, "vertical_fov"),
        ({"up": (3, -4, 0)}, "up is .*, parallel"),
        ({"up": (3, -4, 1e-9)}, "up"),
        ({"look_at": (1, 2, 3)}, "look_at"),
        ({"width": 0}, "width"),
        ({"aperture": -0.1}, "aperture"),
        ({"aperture": 0.1, "focus_distance": 0}, "focus_distance"),
        (
            {"aperture": 1e50},
            r"aperture is 1e\+50, focus_distance 5: pass a lens at most 1e\+06 times",
        ),
    ],
)
def test_impossible_cameras_are_refused_by_name(changes, words):
    with pytest.raises(ValueError, match=words):
        camera(**changes)


@pytest.mark.parametrize(
    ("fov", "far", "is_named"),
    [
        (0.7, 4.0, True),
        (40.0, 4.0, False),
        (0.7, 400.0, False),
    ],
)
def test_a_field_of_view_that_seems_to_be_in_radians_is_named(fov, far, is_named):
    """Where the ball, one across, fits into the picture, it is a telescope."""
    view = Camera((0, -far, 0), (0, 0, 0), (0, 0, 1), fov, 8, 6)
    scene = Scene(view, [Object(Sphere((0, 0, 0), 0.5), Lambertian(0.5))], [], GradientSky(1, 1))
    report = render(scene, "whitted", 1, threads=1).report
    assert report["narrow_view"] == (fov if is_named else None)
    words = f"vertical_fov is {fov:g} degrees, .* if radians are meant, pass {np.degrees(fov):.4g}"
    assert bool(re.search(words, " ".join(report["warnings"]))) == is_named
