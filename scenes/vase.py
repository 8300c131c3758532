"""A glazed vase: one profile of ten cubics, turned about its axis.

Run it: python scenes/vase.py --passes 16
"""

import sys

from hybrid_rt import (
    Camera,
    GradientSky,
    Lambertian,
    Mirror,
    Mix,
    Object,
    Phong,
    Rectangle,
    RectangleLight,
    Scene,
)
from hybrid_rt.demo import vase


def scene() -> Scene:
    """Describe the picture."""
    table = Rectangle((-20.0, -20.0, 0.0), (40.0, 0.0, 0.0), (0.0, 40.0, 0.0))
    wall = Rectangle((-20.0, 5.0, 0.0), (40.0, 0.0, 0.0), (0.0, 0.0, 20.0))
    glaze = Mix([(0.93, Phong((0.02, 0.2, 0.3), 0.1, 60.0)), (0.07, Mirror(1.0))])
    return Scene(
        camera=Camera(
            look_from=(0.0, -14.0, 5.2),
            look_at=(0.15, 0.0, 2.55),
            up=(0.0, 0.0, 1.0),
            vertical_fov=29.0,
            width=600,
            height=800,
            aperture=0.25,
            focus_distance=13.6,
        ),
        objects=[
            Object(vase(0.0, 0.0, 5.0), glaze, "vase"),
            Object(vase(2.5, 2.6, 2.4), Phong((0.55, 0.16, 0.05), 0.2, 40.0), "small vase"),
            Object(table, Lambertian((0.36, 0.2, 0.1)), "table"),
            Object(wall, Lambertian((0.62, 0.56, 0.46)), "wall"),
        ],
        lights=[
            RectangleLight((-10.0, -8.0, 5.0), (0.0, 5.0, 0.0), (2.5, 0.0, 5.0), (8.0, 7.6, 7.0))
        ],
        environment=GradientSky((0.3, 0.25, 0.2), (0.5, 0.62, 0.8), up=(0.0, 0.0, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
