"""A glazed vase: one profile of ten cubics, turned about its axis.

Run it: python scenes/vase.py --passes 16
"""

import sys

from hybrid_rt import (
    Camera,
    GradientSky,
    Lambertian,
    Object,
    Phong,
    PointLight,
    Rectangle,
    RectangleLight,
    Scene,
)
from hybrid_rt.demo import vase


def scene() -> Scene:
    """Describe the picture."""
    table = Rectangle((-20.0, -20.0, 0.0), (40.0, 0.0, 0.0), (0.0, 40.0, 0.0))
    wall = Rectangle((-20.0, 4.0, 0.0), (40.0, 0.0, 0.0), (0.0, 0.0, 20.0))
    return Scene(
        camera=Camera(
            look_from=(0.0, -13.0, 7.0),
            look_at=(0.0, 0.0, 2.6),
            up=(0.0, 0.0, 1.0),
            vertical_fov=32.0,
            width=600,
            height=800,
        ),
        objects=[
            Object(vase(0.0, 0.0, 5.0), Phong((0.03, 0.3, 0.22), 0.35, 150.0), "vase"),
            Object(table, Lambertian((0.55, 0.42, 0.3)), "table"),
            Object(wall, Lambertian((0.8, 0.76, 0.68)), "wall"),
        ],
        lights=[
            RectangleLight((-7.0, -6.0, 9.0), (0.0, 3.0, 0.0), (3.0, 0.0, -1.0), 22.0),
            PointLight((6.0, -8.0, 3.0), (30.0, 24.0, 18.0)),
        ],
        environment=GradientSky(0.1, 0.3, up=(0.0, 0.0, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
