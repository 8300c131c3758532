"""The picture of ``hybrid-rt demo``: teapot, vase, glass and mirror on a tiled floor.

The teapot is Martin Newell's of 1975 (32 bicubic patches), here on its true surfaces.
"""

from importlib import resources

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian, Mirror, Phong
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import ImageTexture
from meshing import BezierPatches, SurfaceOfRevolution

# Four samples a pixel are one complete net each for pixel, light and sky: clean enough, and quick.
PASSES = 4

FLOOR_SIZE = 20.0
# Pixels per tile of the drawn floor; a tile is one unit and never covers more on the screen.
TILE_PIXELS = 64

# (height, radius) for a vase about 5 high: underside, foot, belly, neck, lip, and back down the
# inside; each a cubic.
VASE_PROFILE = (
    ((0.0, 0.0), (0.0, 0.3), (0.0, 0.6), (0.0, 0.9)),
    ((0.0, 0.9), (0.25, 1.0), (0.3, 0.62), (0.55, 0.72)),
    ((0.55, 0.72), (1.3, 1.02), (1.7, 1.75), (2.6, 1.45)),
    ((2.6, 1.45), (3.5, 1.15), (3.5, 0.42), (4.3, 0.5)),
    ((4.3, 0.5), (4.7, 0.55), (4.9, 0.75), (5.0, 0.95)),
    ((5.0, 0.95), (5.06, 1.01), (5.1, 0.93), (5.0, 0.87)),
    ((5.0, 0.87), (4.85, 0.66), (4.7, 0.45), (4.3, 0.4)),
    ((4.3, 0.4), (3.5, 0.32), (3.5, 1.05), (2.6, 1.35)),
    ((2.6, 1.35), (1.7, 1.65), (1.3, 0.92), (0.6, 0.5)),
    ((0.6, 0.5), (0.45, 0.35), (0.4, 0.2), (0.4, 0.0)),
)


def teapot() -> BezierPatches:
    """Return Newell's teapot, standing on z = 0, its normals outward."""
    with resources.as_file(resources.files("hybrid_rt") / "data" / "teapot.bpt") as file:
        return BezierPatches.read(file).flipped()


def vase(x: float, y: float, height: float) -> SurfaceOfRevolution:
    """Return the vase, standing on the floor at (x, y)."""
    profile = np.array(VASE_PROFILE) * (height / 5.0)
    return SurfaceOfRevolution(list(profile), (x, y, 0.0), (0.0, 0.0, 1.0))


def tiles(n_tiles: int, seed: int = 5) -> FloatArray:
    """Return square tiles, light and dark by turns, with varied colours and joints, (n, n, 3), linear."""
    light, dark, joint = (0.72, 0.66, 0.56), (0.16, 0.2, 0.25), (0.42, 0.39, 0.35)
    is_dark = np.indices((n_tiles, n_tiles)).sum(axis=0) % 2 == 1
    colors = np.where(is_dark[:, :, None], dark, light)
    colors *= np.random.default_rng(seed).uniform(0.85, 1.1, (n_tiles, n_tiles, 1))
    picture = colors.repeat(TILE_PIXELS, axis=0).repeat(TILE_PIXELS, axis=1)
    place = np.arange(n_tiles * TILE_PIXELS) % TILE_PIXELS
    is_joint = (place < 2) | (place >= TILE_PIXELS - 1)
    picture[is_joint] = joint
    picture[:, is_joint] = joint
    return picture


def scene() -> Scene:
    """Return the demo scene."""
    half = FLOOR_SIZE / 2
    floor = Rectangle((-half, -half, 0.0), (FLOOR_SIZE, 0.0, 0.0), (0.0, FLOOR_SIZE, 0.0))
    return Scene(
        camera=Camera(
            look_from=(1.0, -12.0, 5.4),
            look_at=(0.4, 0.3, 1.5),
            up=(0.0, 0.0, 1.0),
            vertical_fov=34.0,
            width=640,
            height=480,
        ),
        objects=[
            Object(teapot(), Phong((0.56, 0.17, 0.07), 0.2, 60.0), "teapot"),
            Object(vase(3.5, 3.0, 4.3), Phong((0.03, 0.12, 0.42), 0.25, 90.0), "vase"),
            Object(Sphere((2.7, -2.4, 1.0), 1.0), Dielectric(1.5, (0.12, 0.03, 0.06)), "glass"),
            Object(Sphere((-3.4, 2.8, 1.6), 1.6), Mirror((0.92, 0.92, 0.9)), "mirror"),
            Object(floor, Lambertian(ImageTexture(tiles(round(FLOOR_SIZE)))), "floor"),
        ],
        # The area light casts the soft shadows; the weak point light beside the camera and a sky
        # that hardly varies keep them from black without adding noise.
        lights=[
            RectangleLight((-5.5, -5.0, 9.5), (0.0, 2.6, 0.0), (2.4, 0.0, -1.0), 34.0),
            PointLight((6.0, -11.0, 6.0), 40.0),
        ],
        environment=GradientSky((0.2, 0.21, 0.24), (0.27, 0.34, 0.47), up=(0.0, 0.0, 1.0)),
    )
