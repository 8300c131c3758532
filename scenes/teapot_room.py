"""The teapot with a mirror and a glass ball in a papered room under an area light.

Run it: python scenes/teapot_room.py --integrator whitted --passes 16
Or with all indirect light: python scenes/teapot_room.py --passes 128
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    Dielectric,
    ImageTexture,
    Lambertian,
    Mirror,
    Mix,
    Object,
    Phong,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)
from hybrid_rt.demo import teapot, tiles

# Half width, half depth and height of the room; z is up.
HALF_X, HALF_Y, HEIGHT = 7.0, 8.0, 8.0


def wallpaper(n: int = 512) -> NDArray[np.float64]:
    """Draw stripes with rows of leaves, (n, n, 3) linear."""
    y, x = np.mgrid[0:n, 0:n] / n
    across, along = 10 * x, 10 * y + 0.5 * (np.floor(10 * x) % 2)
    picture = np.where(
        (np.floor(across) % 2 == 0)[:, :, None], (0.62, 0.6, 0.5), (0.55, 0.56, 0.46)
    )
    px, py = across % 1.0 - 0.5, along % 1.0 - 0.5
    leaf = (px + 0.4 * py) ** 2 / 0.02 + py**2 / 0.09 < 1.0
    picture[leaf] = (0.16, 0.3, 0.17)
    picture[np.abs(across % 1.0 - 0.02) < 0.02] = (0.4, 0.35, 0.22)
    return picture


def scene() -> Scene:
    """Describe the picture."""
    x, y, h = HALF_X, HALF_Y, HEIGHT
    paper = Lambertian(ImageTexture(wallpaper()))
    floor = Mix([(0.85, Lambertian(ImageTexture(tiles(12)))), (0.15, Mirror(0.9))])
    return Scene(
        camera=Camera(
            look_from=(2.2, -7.6, 4.2),
            look_at=(0.1, 0.0, 1.5),
            up=(0.0, 0.0, 1.0),
            vertical_fov=52.0,
            width=800,
            height=600,
        ),
        objects=[
            Object(teapot(), Phong((0.5, 0.22, 0.12), 0.25, 60.0), "teapot"),
            Object(Sphere((-4.2, 2.6, 1.7), 1.7), Mirror((0.95, 0.95, 0.95)), "mirror"),
            Object(Sphere((2.4, -2.6, 0.95), 0.95), Dielectric(1.5, (0.25, 0.06, 0.12)), "glass"),
            Object(Rectangle((-x, -y, 0), (2 * x, 0, 0), (0, 2 * y, 0)), floor, "floor"),
            Object(
                Rectangle((-x, -y, h), (0, 2 * y, 0), (2 * x, 0, 0)), Lambertian(0.7), "ceiling"
            ),
            Object(Rectangle((-x, y, 0), (2 * x, 0, 0), (0, 0, h)), paper, "back wall"),
            Object(Rectangle((-x, -y, 0), (0, 2 * y, 0), (0, 0, h)), paper, "left wall"),
            Object(Rectangle((x, y, 0), (0, -2 * y, 0), (0, 0, h)), paper, "right wall"),
            Object(Rectangle((x, -y, 0), (-2 * x, 0, 0), (0, 0, h)), Lambertian(0.5), "front wall"),
        ],
        # Shines down: edge_u x edge_v.
        lights=[RectangleLight((-2.0, -2.0, h - 0.05), (0.0, 4.0, 0.0), (4.0, 0.0, 0.0), 7.0)],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
