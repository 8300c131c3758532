"""A room of nothing but spheres: walls of radius 1e5, lamps that shine and reflect.

Floor, ceiling and walls are huge spheres whose normals point into the room. In it a mirror, a glass
and a painted sphere under two shining ones.

Run it: python scenes/sphere_room.py --passes 128
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    Dielectric,
    Emissive,
    ImageTexture,
    Lambertian,
    Mirror,
    Object,
    Scene,
    Sphere,
)

WALL_RADIUS = 1e5
# Half sizes of the room along x, y (up) and z; the camera stands before its open front wall.
HALF = (5.0, 4.0, 6.0)
WALLS = {
    "left": (0, -1, (0.7, 0.22, 0.2)),
    "right": (0, 1, (0.2, 0.3, 0.7)),
    "floor": (1, -1, (0.72, 0.7, 0.66)),
    "ceiling": (1, 1, (0.75, 0.75, 0.75)),
    "back": (2, -1, (0.75, 0.75, 0.75)),
    "front": (2, 1, (0.1, 0.1, 0.1)),
}


def wall(name: str) -> Object:
    """Return one wall: a sphere that touches the room from outside."""
    axis, side, color = WALLS[name]
    center = np.zeros(3)
    center[axis] = side * (HALF[axis] + WALL_RADIUS)
    return Object(Sphere(center, WALL_RADIUS), Lambertian(color), name)


def globe(n: int = 256) -> NDArray[np.float64]:
    """Draw stripes along the meridians and a band around the equator, (n, 2 n, 3) linear."""
    v, u = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(2 * n) + 0.5) / (2 * n), indexing="ij")
    stripes = np.floor(12 * u) % 2 == 0
    picture = np.where(stripes[:, :, None], (0.85, 0.75, 0.25), (0.15, 0.35, 0.25))
    picture[np.abs(v - 0.5) < 0.06] = (0.75, 0.15, 0.1)
    return picture


def scene() -> Scene:
    """Describe the picture."""
    lamp = Emissive((8.0, 7.2, 6.0), Lambertian(0.8))
    return Scene(
        camera=Camera(
            look_from=(0.0, -0.2, 5.9),
            look_at=(0.0, -0.6, 0.0),
            up=(0.0, 1.0, 0.0),
            vertical_fov=62.0,
            width=640,
            height=480,
        ),
        objects=[
            *(wall(name) for name in WALLS),
            Object(Sphere((-2.6, -2.6, -3.2), 1.4), Mirror(0.95), "mirror"),
            Object(Sphere((2.2, -2.7, -0.6), 1.3), Dielectric(1.5), "glass"),
            Object(
                Sphere((-0.3, -3.2, -1.0), 0.8, pole=(0.2, 1.0, 0.2)),
                Lambertian(ImageTexture(globe())),
                "globe",
            ),
            Object(Sphere((-1.6, 3.0, -2.0), 0.6), lamp, "left lamp"),
            Object(Sphere((2.0, 3.2, -3.0), 0.5), lamp, "right lamp"),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
