"""Newell's teapot of 1975 in blue glaze, on its 32 true Bezier patches, seen from close by.

Run it: python scenes/teapot.py --passes 16
"""

import sys

from hybrid_rt import (
    Camera,
    CheckerTexture,
    GradientSky,
    Lambertian,
    Object,
    Phong,
    Rectangle,
    RectangleLight,
    Scene,
)
from hybrid_rt.demo import teapot


def scene() -> Scene:
    """Describe the picture."""
    floor = Rectangle((-12.0, -12.0, 0.0), (24.0, 0.0, 0.0), (0.0, 24.0, 0.0))
    checks = CheckerTexture((0.75, 0.73, 0.7), (0.25, 0.24, 0.27), 24, "uv")
    return Scene(
        camera=Camera(
            look_from=(4.0, -8.0, 4.6),
            look_at=(0.35, 0.0, 1.35),
            up=(0.0, 0.0, 1.0),
            vertical_fov=36.0,
            width=800,
            height=600,
        ),
        objects=[
            Object(teapot(), Phong((0.04, 0.2, 0.5), 0.3, 120.0), "teapot"),
            Object(floor, Lambertian(checks), "floor"),
        ],
        lights=[RectangleLight((-5.0, -5.0, 8.0), (0.0, 3.0, 0.0), (3.0, 0.0, -1.0), 20.0)],
        environment=GradientSky((0.25, 0.23, 0.2), (0.4, 0.55, 0.8), up=(0.0, 0.0, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
