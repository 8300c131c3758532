"""A copper teapot, a mirror and a glass ball in a papered room, lit by photons.

Caustics of the ball and of the polished copper lie on the tiles; half of the light in the room has
been thrown on by walls.

Run it: python scenes/teapot_ppm.py --passes 32
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    Dielectric,
    ImageTexture,
    Lambertian,
    Metal,
    Mirror,
    Mix,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)
from hybrid_rt.demo import teapot, tiles

# Photons find caustics seen through glass and in mirrors, which paths meet by luck only.
INTEGRATOR = "ppm"
# Half width, half depth and height of the room; z is up.
HALF_X, HALF_Y, HEIGHT = 7.0, 8.0, 8.0
COPPER = (0.93, 0.55, 0.38)


def wallpaper(n: int = 512) -> NDArray[np.float64]:
    """Draw broad stripes with a thin line on either side, (n, n, 3) linear."""
    x = np.arange(n) / n * 8.0
    is_broad = np.floor(x) % 2 == 0
    row = np.where(is_broad[:, None], (0.45, 0.52, 0.5), (0.66, 0.64, 0.56))
    row[np.abs(x % 1.0 - 0.08) < 0.02] = (0.5, 0.36, 0.18)
    return np.broadcast_to(row, (n, n, 3)).copy()


def scene() -> Scene:
    """Describe the picture."""
    x, y, h = HALF_X, HALF_Y, HEIGHT
    paper = Lambertian(ImageTexture(wallpaper()))
    floor = Mix([(0.9, Lambertian(ImageTexture(tiles(12)))), (0.1, Mirror(0.9))])
    return Scene(
        camera=Camera(
            look_from=(2.2, -7.6, 4.4),
            look_at=(0.1, 0.0, 1.3),
            up=(0.0, 0.0, 1.0),
            vertical_fov=50.0,
            width=800,
            height=600,
        ),
        objects=[
            Object(teapot(), Metal(COPPER, 0.03), "teapot"),
            Object(Sphere((-4.2, 2.6, 1.7), 1.7), Mirror((0.95, 0.95, 0.95)), "mirror"),
            Object(Sphere((2.2, -2.9, 1.05), 1.0), Dielectric(1.5, (0.3, 0.06, 0.12)), "glass"),
            Object(Rectangle((-x, -y, 0), (2 * x, 0, 0), (0, 2 * y, 0)), floor, "floor"),
            Object(
                Rectangle((-x, -y, h), (0, 2 * y, 0), (2 * x, 0, 0)), Lambertian(0.7), "ceiling"
            ),
            Object(Rectangle((-x, y, 0), (2 * x, 0, 0), (0, 0, h)), paper, "back wall"),
            Object(Rectangle((-x, -y, 0), (0, 2 * y, 0), (0, 0, h)), paper, "left wall"),
            Object(Rectangle((x, y, 0), (0, -2 * y, 0), (0, 0, h)), paper, "right wall"),
            Object(Rectangle((x, -y, 0), (-2 * x, 0, 0), (0, 0, h)), Lambertian(0.5), "front wall"),
        ],
        # Shines down: edge_u x edge_v. Small, so that caustics are sharp.
        lights=[RectangleLight((-3.4, -3.4, h - 0.05), (0, 0.8, 0), (0.8, 0, 0), 190.0)],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
