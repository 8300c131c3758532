"""A mirror exactly on a part of glass: it is seen through the glass, in any order of the objects."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    Dielectric,
    Mirror,
    Object,
    RectangleLight,
    Scene,
    Sphere,
    Torus,
    render,
)
from meshing import SurfaceOfRevolution, TrimmedSurface, circular_arc, polygon

CAMERA = Camera((0, 0, 20), (0, 0, 0), (0, 1, 0), vertical_fov=7, width=16, height=16)
LAMP = RectangleLight((-2, -2, 20.5), (0, 4, 0), (4, 0, 0), 10.0)
LOWER = [polygon([(0, 0), (1, 0), (1, 0.5), (0, 0.5)])]
ARC, WEIGHTS = circular_arc((0, 0), 1.0, 0.25, 0.5)
BALL, RING = Sphere((0, 0, 0), 1.0), Torus((0, 0, 0), (0, 0, 1), 0.7, 0.3)
COATED = {
    "a part of a ball": (BALL, TrimmedSurface(BALL, LOWER)),
    "a turned arc on a ball": (
        BALL,
        SurfaceOfRevolution(ARC, (0, 0, 0), (0, 0, 1), weights=WEIGHTS),
    ),
    "a part of a ring": (
        RING,
        TrimmedSurface(RING, [polygon([(0, 0.5), (1, 0.5), (1, 1), (0, 1)])]),
    ),
}


@pytest.mark.parametrize("name", COATED)
def test_a_coat_is_seen_in_any_order(name):
    body, coat = COATED[name]
    glass, silver = Object(body, Dielectric(1.9), "glass"), Object(coat, Mirror(0.9), "silver")
    images = [
        render(Scene(CAMERA, objects, [LAMP]), passes=4, max_depth=30).image
        for objects in ([glass, silver], [silver, glass])
    ]
    np.testing.assert_array_equal(*images)
    bare = render(Scene(CAMERA, [glass], [LAMP]), passes=4, max_depth=30).image
    # Light goes in, is reflected, and comes back to where it came from.
    assert images[0].mean() > 1.5 * bare.mean()


def test_a_silvered_bead_is_as_bright_as_one_whose_coat_lies_deeper():
    """Within the glass by so little that only rounding could tell; 2.80 by tracing its branches."""
    coats = (TrimmedSurface(Sphere((0, 0, 0), radius), LOWER) for radius in (1.0, 1.0 - 1e-7))
    means = [
        float(
            render(
                Scene(
                    CAMERA.resized(32, 32),
                    [Object(BALL, Dielectric(1.9)), Object(coat, Mirror(0.9))],
                    [LAMP],
                ),
                passes=64,
                max_depth=60,
            ).image.mean()
        )
        for coat in coats
    ]
    assert means[0] == pytest.approx(means[1], rel=0.01)
    assert means[0] == pytest.approx(2.804, rel=0.01)
