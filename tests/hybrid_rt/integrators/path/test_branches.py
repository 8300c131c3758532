"""Both branches at glass that the camera sees, and Russian roulette."""

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    ImageEnvironment,
    Lambertian,
    Mix,
    Object,
    PathOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)

# At normal incidence, and for angles below four degrees to a part in a thousand.
REFLECTANCE = 0.04


def behind_the_camera() -> ImageEnvironment:
    """Return surroundings of radiance 1 for y below 0, and black beyond."""
    image = np.zeros((64, 128, 3))
    image[:, :64] = 1.0
    return ImageEnvironment(image, (0, 0, 1))


def pane_scene(sky, material):
    camera = Camera((0, -10, 0), (0, 0, 0), (0, 0, 1), 3, 16, 16)
    return Scene(camera, [Object(Box((-2, 0, -2), (2, 0.1, 2)), material)], [], sky)


def pane_before(sky, passes, **settings):
    scene = pane_scene(sky, Dielectric(1.5))
    return render(scene, passes=passes, **settings).image[..., 0]


def test_what_a_pane_reflects_is_there_in_one_pass():
    """Of both faces, with what goes to and fro in between: 2 R / (1 + R).

    Paths that choose would be bright in one pixel of 13.
    """
    image = pane_before(behind_the_camera(), 1)
    assert image.min() > 0.99 * REFLECTANCE
    # What the second face reflects leaves the first one with a probability of 0.96.
    assert image.mean() == pytest.approx(2 * REFLECTANCE / (1 + REFLECTANCE), rel=0.03)


def test_glass_that_is_half_of_a_mixture_is_not_divided():
    """A mixture of one part has its light: half of that of the glass."""
    half, whole = (
        render(scene, passes=64, seed=1).image.mean()
        for scene in (
            pane_scene(behind_the_camera(), Mix([(0.5, Dielectric(1.5))])),
            pane_scene(behind_the_camera(), Dielectric(1.5)),
        )
    )
    # R / 2 of the first face and R / 8 of the second one, over 2 R / (1 + R), but for what goes to
    # and fro. By chance: 3 % of the mean, 16384 paths of which one in 40 is bright.
    reflected = REFLECTANCE
    expected = 0.5 * reflected + 0.125 * reflected * (1 - reflected) ** 2
    assert half == pytest.approx(expected, rel=0.2)
    assert whole == pytest.approx(2 * reflected / (1 + reflected), rel=0.02)


@pytest.mark.parametrize(("max_depth", "expected"), [(0, 0.0), (1, REFLECTANCE), (2, REFLECTANCE)])
def test_branches_end_at_the_depth_limit(max_depth, expected):
    image = pane_before(behind_the_camera(), 1, max_depth=max_depth)
    assert image == pytest.approx(expected, rel=2e-3)


def test_a_dark_floor_is_no_noisier_by_roulette():
    """What a path carries is compared with what it carried at the vertex before.

    Compared with one, it made the noise five times as large.
    """
    walls = Object(Box((-1, -1, -0.1), (1, 1, 2)).flipped(), Lambertian(0.8))
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.02))
    screen = Object(Box((-0.5, -0.5, 1.5), (0.5, 0.5, 1.6)), Lambertian(0.8))
    lamp = RectangleLight((-0.2, -0.2, 1.7), (0.4, 0, 0), (0, 0.4, 0), 10.0)
    camera = Camera((0, 0, 1.4), (0, 0, 0), (0, 1, 0), 50, 24, 24)
    scene = Scene(camera, [walls, floor, screen], [lamp])
    noise = [
        render(scene, passes=64, seed=1, options=options).report["noise"]["relative_rmse_trimmed"]
        for options in (PathOptions(), PathOptions(roulette_depth=64))
    ]
    assert noise[0] < 1.4 * noise[1]
