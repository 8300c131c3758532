"""On a table under a bright window: a cube of glass, a ball full of water, a brass ring, a vase.

The surroundings are a picture drawn here; the cube stands upon the table without air between, as
the water lies in its ball; the ring is a mesh shaded by its vertex normals.

Run it: python scenes/still_life.py --passes 128
"""

import sys

import numpy as np
import trimesh
from numpy.typing import NDArray

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    ImageEnvironment,
    ImageTexture,
    Metal,
    Object,
    Phong,
    Scene,
    Sphere,
    TriangleMesh,
)
from meshing import SurfaceOfRevolution


def surroundings(height: int = 128) -> NDArray[np.float64]:
    """Draw a grey-green room with a window of six panes, (height, 2 height, 3) linear."""
    v, u = np.meshgrid(
        1 - (np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height),
        indexing="ij",
    )  # fmt: skip
    room = np.where(v[..., None] < 0.5, (0.12, 0.1, 0.08), (0.3, 0.34, 0.3)) * (0.5 + v[..., None])
    across, up = (u - 0.29) / 0.16, (v - 0.6) / 0.2
    inside = (across > 0) & (across < 1) & (up > 0) & (up < 1)
    frame = (np.abs(across * 3 % 1 - 0.5) > 0.45) | (np.abs(up * 2 % 1 - 0.5) > 0.46)
    room[inside & ~frame] = (14.0, 15.0, 17.0)
    room[inside & frame] = (0.05, 0.04, 0.03)
    return room


def wood(n: int = 256) -> NDArray[np.float64]:
    """Draw boards, (n, n, 3) linear."""
    y, x = np.mgrid[0:n, 0:n] / n
    board = np.floor(6 * x)
    grain = np.sin(40 * (x + 0.03 * np.sin(9 * y + 2 * board)) + 5 * board) * 0.5 + 0.5
    shade = 0.75 + 0.25 * np.sin(3.7 * board)
    picture = (0.5 + 0.3 * grain * shade)[..., None] * np.array([0.55, 0.33, 0.17])
    picture[np.abs(6 * x % 1 - 0.5) > 0.49] *= 0.3
    return picture


def ring() -> TriangleMesh:
    """Return a torus of 1536 triangles that lies on the table."""
    place = np.eye(4)
    place[:3, 3] = (-0.1, -1.25, 0.16)
    mesh = trimesh.creation.torus(0.45, 0.16, major_sections=48, minor_sections=16)
    return TriangleMesh(mesh).transformed(place)


def scene() -> Scene:
    """Describe the picture."""
    glass, water = Dielectric(1.5, (0.12, 0.04, 0.08)), Dielectric(1.33, (0.1, 0.04, 0.02))
    middle = (1.05, -0.25, 0.62)
    vase = [(0.0, 0.0), (0.0, 0.55), (0.8, 0.75), (1.2, 0.1), (1.6, 0.3)]
    return Scene(
        camera=Camera(
            look_from=(0.5, -5.2, 2.4),
            look_at=(0.0, -0.2, 0.45),
            up=(0.0, 0.0, 1.0),
            vertical_fov=34.0,
            width=640,
            height=480,
            aperture=0.08,
        ),
        objects=[
            Object(
                Box((-2.6, -2.2, -0.2), (2.6, 2.2, 0.0)),
                Phong(ImageTexture(wood()), 0.08, 40.0),
                "table",
            ),
            Object(Box((-1.6, -0.75, 0.0), (-0.7, 0.15, 0.9)), glass, "cube"),
            Object(Sphere(middle, 0.62), glass, "ball"),
            Object(Sphere(middle, 0.52).flipped(), glass, "inside of the ball"),
            Object(Sphere(middle, 0.52), water, "water"),
            Object(ring(), Metal((0.83, 0.63, 0.3), 0.15), "ring", smooth=True),
            Object(
                SurfaceOfRevolution(vase, (0.1, 0.9, 0.0), (0, 0, 1)),
                Phong((0.2, 0.3, 0.55), 0.2, 80.0),
                "vase",
            ),
        ],
        environment=ImageEnvironment(surroundings(), (0, 0, 1)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
