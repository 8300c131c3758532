"""A turned body of greenish glass before textured walls, its caustic on a checkered floor.

One profile of degree five, one of degree three; absorption within the glass, a tint on its surface.

Run it: python scenes/glass_lathe.py --passes 32
Or by a photon map alone: python scenes/glass_lathe.py --integrator photon_map --passes 4
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Dielectric,
    ImageTexture,
    Lambertian,
    Mirror,
    Object,
    PointLight,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)
from meshing import SurfaceOfRevolution

# Photons find caustics seen through glass and in mirrors, which paths meet by luck only.
INTEGRATOR = "ppm"
# (height, radius): a foot of degree three, then a body of degree five that closes at the top.
FOOT = ((0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.12, 0.86))
BODY = ((0.12, 0.86), (0.5, 0.32), (0.85, 1.7), (1.75, 1.35), (2.5, 0.95), (2.5, 0.0))


def planet(n: int = 256) -> NDArray[np.float64]:
    """Draw bands of latitude, (n, 2 n, 3) linear."""
    v = (np.arange(n) + 0.5) / n
    u = (np.arange(2 * n) + 0.5) / (2 * n)
    wave = v[:, None] + 0.03 * np.sin(6 * np.pi * u[None, :])
    band = (np.floor(9 * wave) % 2)[:, :, None]
    return (1 - band) * np.array([0.7, 0.32, 0.12]) + band * np.array([0.85, 0.75, 0.55])


def scene() -> Scene:
    """Describe the picture."""
    floor = Rectangle((-5.0, -5.0, 0.0), (10.0, 0.0, 0.0), (0.0, 10.0, 0.0))
    wall = Rectangle((-5.0, 3.0, 0.0), (10.0, 0.0, 0.0), (0.0, 0.0, 5.0))
    glass = SurfaceOfRevolution([FOOT, BODY], (0.0, 0.0, 0.001), (0.0, 0.0, 1.0))
    return Scene(
        camera=Camera(
            look_from=(1.6, -6.6, 3.6),
            look_at=(0.5, 0.0, 0.85),
            up=(0.0, 0.0, 1.0),
            vertical_fov=38.0,
            width=640,
            height=480,
        ),
        objects=[
            Object(glass, Dielectric(1.5, (0.28, 0.06, 0.18), tint=(0.97, 1.0, 0.98)), "body"),
            Object(
                Sphere((2.1, 1.0, 0.7), 0.7, pole=(0.3, 0.0, 1.0)),
                Lambertian(ImageTexture(planet())),
                "planet",
            ),
            Object(Sphere((-2.3, 1.3, 0.8), 0.8), Mirror(0.92), "mirror"),
            Object(floor, Lambertian(CheckerTexture(0.78, (0.42, 0.4, 0.38), 20, "uv")), "floor"),
            Object(
                wall,
                Lambertian(CheckerTexture((0.55, 0.6, 0.7), (0.5, 0.54, 0.62), (20, 10), "uv")),
                "wall",
            ),
        ],
        lights=[
            RectangleLight((-3.6, -2.2, 4.6), (0.0, 0.4, 0.0), (0.32, 0.0, 0.24), 160.0),
            PointLight((3.5, -5.0, 5.0), 14.0),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
