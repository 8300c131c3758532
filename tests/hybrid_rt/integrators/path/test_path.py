"""Path tracing of whole pictures: huge walls, lenses, convergence, the same bits, options."""

import math

import numpy as np
import pytest
from path_means import assert_mean_equals

from hybrid_rt.integrators import PathOptions, workers
from hybrid_rt.lights import SphereLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

pytestmark = pytest.mark.statistical


def room(walls="rectangles", radius=1e5):
    """A closed room of side two with the camera in it; its walls flat, or huge spheres."""
    colors = {"floor": 0.7, "ceiling": 0.7, "back": 0.7, "left": (0.6, 0.1, 0.1),
              "right": (0.1, 0.5, 0.1), "front": 0.5}  # fmt: skip
    sides = {
        "floor": ((0, -1, 0), (2, 0, 0), (0, 0, -2)), "ceiling": ((0, 1, 0), (2, 0, 0), (0, 0, 2)),
        "back": ((0, 0, -1), (2, 0, 0), (0, 2, 0)), "left": ((-1, 0, 0), (0, 2, 0), (0, 0, 2)),
        "right": ((1, 0, 0), (0, 0, 2), (0, 2, 0)), "front": ((0, 0, 1), (0, 2, 0), (2, 0, 0)),
    }  # fmt: skip
    objects = [Object(Sphere((0.4, -0.6, 0.2), 0.4), Mirror(0.9), "mirror")]
    for name, side in sides.items():
        middle, u, v = np.array(side, dtype=float)
        if walls == "rectangles":
            surface = Rectangle(middle - 0.5 * (u + v), u, v)
        else:
            surface = Sphere(middle * (1 + radius), radius)
        objects.append(Object(surface, Lambertian(colors[name]), name))
    lamp = SphereLight((-0.3, 0.5, 0), 0.15, 8.0)
    return Scene(Camera((0, 0, 0.99), (0, 0, 0), (0, 1, 0), 80, 48, 48), objects, [lamp])


@pytest.mark.parametrize("radius", [1e5, 1e7])
def test_walls_of_huge_spheres_look_flat(radius):
    def gap(**settings):
        flat = render(room(), seed=3, **settings).image.astype(float)
        return (render(room("spheres", radius), seed=3, **settings).image - flat).reshape(-1, 3)

    # Direct light by the same random numbers: walls differ by 1 / radius, at borders of shadows
    # and in corners that matters for a pixel now and then.
    lights = PathOptions("lights")
    direct = np.abs(gap(passes=4, max_depth=0, options=lights)).max(axis=1)
    assert np.mean(direct < 1e-3) > 0.99
    # Farther on the frames of the walls differ, so paths do too.
    assert_mean_equals(gap(passes=16, max_depth=4), np.zeros(3))


def test_circle_of_confusion_of_a_point_out_of_focus():
    """A small lamp behind the plane of focus: its image is aperture |d - f| / d over f wide."""
    aperture, focus, distance, n = 0.2, 4.0, 8.0, 64
    camera = Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), 10, n, n, aperture, focus)
    lamp = SphereLight((0, 0, distance), 0.01, 1.0)
    image = render(Scene(camera, lights=[lamp]), "path", passes=256).image[:, :, 0]
    rows, columns = np.nonzero(image)
    pixel = 2 * focus * math.tan(math.radians(5)) / n
    radius = np.hypot(columns + 0.5 - n / 2, rows + 0.5 - n / 2).max() * pixel
    expected = aperture / 2 * (distance - focus) / distance
    # The outermost lit pixel's centre lies within a pixel of the border.
    assert expected - 1.5 * pixel < radius < expected + 1.0 * pixel


def test_error_falls_with_the_root_of_the_passes():
    # Its own error adds 4 % to that of 16 passes.
    reference = render(room(), passes=192, seed=77, max_depth=4).image.astype(float)
    passes = [1, 2, 4, 8, 16]
    errors = []
    for n in passes:
        image = render(room(), passes=n, seed=5, max_depth=4).image
        errors.append(math.sqrt(np.square(image - reference).mean()))
    slope = np.polyfit(np.log(passes), np.log(errors), 1)[0]
    # -1/2 for independent samples; low-discrepancy ones gain on what is smooth.
    assert -0.9 < slope < -0.45


@pytest.mark.parametrize(("threads", "block"), [(1, 100), (3, 2**15)])
def test_threads_and_blocks_change_no_bit(threads, block, monkeypatch):
    before = render(room(), passes=3, seed=4, threads=2).image
    monkeypatch.setattr(workers, "BLOCK", block)
    np.testing.assert_array_equal(render(room(), passes=3, seed=4, threads=threads).image, before)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"strategy": "magic"}, "strategy is 'magic'"),
        ({"survival": 1.5}, "survival"),
        ({"light_paths": -0.5}, "light_paths"),
    ],
)
def test_impossible_options_are_refused(options, words):
    with pytest.raises(ValueError, match=words):
        PathOptions(**options)
