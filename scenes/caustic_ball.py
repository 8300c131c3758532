"""A glass ball over a matt floor under a small bright square: the benchmark of caustics.

The lamp's radiance is 100; at 1000 the blur and the noise of the caustic show more.

Run it: python scenes/caustic_ball.py --passes 16
"""

import sys

from hybrid_rt import (
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
RADIUS, GAP = 0.6, 0.3
LAMP_HEIGHT, LAMP_SIDE, RADIANCE = 2.4, 0.1, 100.0


def scene() -> Scene:
    """Describe the picture."""
    half = 0.5 * LAMP_SIDE
    lamp = RectangleLight(
        (-half, -half, LAMP_HEIGHT), (0.0, LAMP_SIDE, 0.0), (LAMP_SIDE, 0.0, 0.0), RADIANCE
    )
    floor = Rectangle((-2.0, -2.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0))
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
            Object(Sphere((0.0, 0.0, GAP + RADIUS), RADIUS), Dielectric(1.5), "ball"),
        ],
        lights=[lamp],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
