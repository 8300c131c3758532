"""The caustic of a glass ball, seen through a pane: glass, matt, glass again.

No path from the camera finds the small lamp through the pane and the ball but by luck; photons do.
The pane's straight edges and the lamp's image in it are there as well.

Run it: python scenes/caustic_through_glass.py --passes 32
"""

import sys

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Lambertian,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)

# Photons find caustics seen through glass and in mirrors, which paths meet by luck only.
INTEGRATOR = "ppm"


def scene() -> Scene:
    """Describe the picture."""
    floor = Rectangle((-2.0, -2.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    pane = Box((-1.9, -1.45, 0.05), (1.9, -1.35, 2.0))
    return Scene(
        camera=Camera(
            look_from=(0.0, -3.0, 2.2),
            look_at=(0.0, 0.0, 0.3),
            up=(0.0, 0.0, 1.0),
            vertical_fov=45.0,
            width=256,
            height=256,
        ),
        objects=[
            Object(floor, Lambertian(0.8), "floor"),
            Object(Sphere((0.0, 0.0, 0.9), 0.6), Dielectric(1.5), "ball"),
            Object(pane, Dielectric(1.5), "pane"),
        ],
        lights=[RectangleLight((-0.05, -0.05, 2.4), (0.0, 0.1, 0.0), (0.1, 0.0, 0.0), 100.0)],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
