"""A city of 1e5 parts on a planet of radius 6.4e6: turned and patch shapes, each in many places.

Lengths are metres. Every part stands upright on the sphere. A block has a slab, a building, and trees around it.

Run it: python scenes/city.py --passes 16
"""

import sys
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    BezierPatches,
    Box,
    Camera,
    Cylinder,
    GradientSky,
    Instances,
    Lambertian,
    Object,
    Scene,
    Sphere,
    SphereLight,
    SurfaceOfRevolution,
)
from hybrid_rt.materials.material import Material
from meshing.surface import Surface

SEED = 11
PLANET = 6.4e6
# Blocks along a side, their pitch, and the width of a street.
BLOCKS, PITCH, STREET = 60, 64.0, 14.0
TREES_A_SIDE, PARK = 3, 30
FloatArray = NDArray[np.float64]


def upright(x: FloatArray, y: FloatArray, turn: FloatArray, size: FloatArray) -> FloatArray:
    """Return matrices (n, 3, 4) of things that stand on the planet, whose top is the origin."""
    root = np.sqrt(PLANET**2 - x**2 - y**2)
    up = np.stack([x, y, root], axis=-1) / PLANET
    ahead = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(x)], axis=-1)
    ahead -= (ahead * up).sum(axis=-1, keepdims=True) * up
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    foot = np.stack([x, y, -(x**2 + y**2) / (PLANET + root)], axis=-1)
    axes = np.stack([ahead, np.cross(up, ahead), up], axis=-1) * size[:, None, None]
    return np.concatenate([axes, foot[:, :, None]], axis=2)


def twisted(height: float, turns: float) -> BezierPatches:
    """Return four walls, of degree 1 x 3, that turn and taper as they rise, and a roof."""
    steps = np.arange(4) / 3.0
    width, angle = 15.0 * (1.0 - 0.45 * steps), 2.0 * np.pi * turns * steps

    def corner(k: int) -> FloatArray:
        at = angle + 0.5 * np.pi * k
        return np.stack([width * np.cos(at), width * np.sin(at), height * steps], axis=-1)

    walls = [np.stack([corner(k), corner(k + 1)]) for k in range(4)]
    top = [wall[0, -1] for wall in walls]
    return BezierPatches([*walls, np.array([[top[0], top[3]], [top[1], top[2]]])])


def stepped() -> SurfaceOfRevolution:
    """Return a round tower in three steps under a dome."""
    lines = [(0, 19), (60, 19), (60, 15), (105, 15), (105, 11), (140, 11)]
    segments = [np.array(pair, float) for pair in pairwise(lines)]
    return SurfaceOfRevolution(
        [*segments, np.array([(140, 11), (147, 11), (152, 6), (152, 0)], float)],
        (0, 0, 0), (0, 0, 1),
    )  # fmt: skip


def waisted() -> SurfaceOfRevolution:
    """Return a tower with a waist, and a flat roof."""
    return SurfaceOfRevolution(
        [np.array([(0, 20), (50, 6), (90, 9), (120, 16)], float), np.array([(120, 16), (123, 0)], float)],
        (0, 0, 0), (0, 0, 1),
    )  # fmt: skip


def slab_house(height: float) -> list[Surface]:
    """Return a house of boxes, with a tank on its roof."""
    return [
        Box((-18, -12, 0), (18, 12, height)),
        Box((-8, -8, height), (4, 8, height + 5)),
        Cylinder((11, 0, height), (0, 0, 1), 4.0, 6.0),
        Sphere((11, 0, height + 6), 4.0),
    ]


def crown() -> SurfaceOfRevolution:
    """Return the leaves of a tree."""
    return SurfaceOfRevolution([(2.2, 0), (2.0, 4.5), (8.0, 3.5), (9.5, 0)], (0, 0, 0), (0, 0, 1))


def lantern() -> list[Surface]:
    """Return a post with a ball on it."""
    return [Cylinder((0, 0, 0), (0, 0, 1), 0.12, 6.0), Sphere((0, 0, 6.2), 0.35)]


BUILDINGS: dict[str, tuple[Surface | list[Surface], Material, float, float]] = {
    # Shape, material, and how often it stands in the middle of the city, and at its rim.
    "twisted tower": (twisted(190.0, 0.3), Lambertian((0.26, 0.36, 0.48)), 0.22, 0.0),
    "low twisted house": (twisted(70.0, 0.12), Lambertian((0.70, 0.62, 0.52)), 0.18, 0.12),
    "stepped tower": (stepped(), Lambertian((0.74, 0.70, 0.64)), 0.24, 0.0),
    "waisted tower": (waisted(), Lambertian((0.55, 0.60, 0.66)), 0.16, 0.02),
    "house": (slab_house(32.0), Lambertian((0.62, 0.42, 0.34)), 0.05, 0.40),
    "tall house": (slab_house(64.0), Lambertian((0.66, 0.66, 0.62)), 0.12, 0.18),
}


def city(seed: int) -> list[Object]:
    """Return the parts: one object for each shape."""
    rng = np.random.default_rng(seed)
    row = PITCH * (np.arange(BLOCKS) - 0.5 * (BLOCKS - 1))
    x, y = (part.ravel() for part in np.meshgrid(row, row, indexing="ij"))
    is_in = np.hypot(x, y) < 0.5 * PITCH * BLOCKS * rng.uniform(0.75, 1.0, x.size)
    x, y = x[is_in], y[is_in]
    level, same = np.zeros_like(x), np.ones_like(x)
    half = 0.5 * (PITCH - STREET)
    objects = [
        Object(
            Instances(Box((-32, -32, -1), (32, 32, 0.04)), upright(x, y, level, same)),
            Lambertian(0.10),
            "streets",
        ),
        Object(
            Instances(Box((-half, -half, -1), (half, half, 0.2)), upright(x, y, level, same)),
            Lambertian(0.42),
            "pavement",
        ),
    ]
    # --- buildings: towers in the middle, houses and parks around it
    far = np.hypot(x, y) / (0.5 * PITCH * BLOCKS)
    middle = np.exp(-((far / 0.28) ** 2))[:, None]
    often = np.array([value[2:] for value in BUILDINGS.values()])
    share = middle * often[:, 0] + (1.0 - middle) * often[:, 1]
    choice = (np.cumsum(share, axis=1) < rng.random((x.size, 1))).sum(axis=1)
    grown = 0.42 + 0.75 * middle[:, 0]
    for k, (name, (shape, material, _, _)) in enumerate(BUILDINGS.items()):
        on = choice == k
        turn = 0.5 * np.pi * rng.integers(4, size=x.size)
        size = grown * rng.uniform(0.75, 1.25, x.size)
        objects.append(
            Object(Instances(shape, upright(x[on], y[on], turn[on], size[on])), material, name)
        )
    # --- along the edges of each block trees and lanterns, in the parks more trees
    side, along = np.meshgrid(np.arange(4), np.arange(TREES_A_SIDE), indexing="ij")
    a = 0.5 * np.pi * side.ravel()
    b = (2.0 * half - 8.0) * ((along.ravel() + 0.5) / TREES_A_SIDE - 0.5)
    out = half - 2.0
    tree_x = (x[:, None] + out * np.cos(a) - b * np.sin(a)).ravel()
    tree_y = (y[:, None] + out * np.sin(a) + b * np.cos(a)).ravel()
    is_park = choice == len(BUILDINGS)
    n = PARK * int(is_park.sum())
    at = np.repeat(np.flatnonzero(is_park), PARK)
    tree_x = np.append(tree_x, x[at] + rng.uniform(-20, 20, n))
    tree_y = np.append(tree_y, y[at] + rng.uniform(-20, 20, n))
    trees = upright(
        tree_x, tree_y, 2 * np.pi * rng.random(tree_x.size), rng.uniform(0.7, 1.2, tree_x.size)
    )
    lamp_x, lamp_y = ((p[:, None] + 0.8 + out * np.array([1, -1])).ravel() for p in (x, y))
    lanterns = upright(lamp_x, lamp_y, 0 * lamp_x, np.ones_like(lamp_x))
    # Crowns of three greens.
    for k, green in enumerate([(0.09, 0.17, 0.05), (0.14, 0.20, 0.06), (0.19, 0.18, 0.06)]):
        objects.append(Object(Instances(crown(), trees[k::3]), Lambertian(green), f"leaves {k}"))
    trunk = Cylinder((0, 0, 0), (0, 0, 1), 0.35, 2.6)
    objects.append(Object(Instances(trunk, trees), Lambertian((0.18, 0.12, 0.08)), "trunks"))
    objects.append(Object(Instances(lantern(), lanterns), Lambertian(0.6), "lanterns"))
    return objects


def scene() -> Scene:
    """Describe the picture."""
    h, a, wide = np.radians((24.0, 200.0, 0.265))
    way = np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
    sun = SphereLight(
        1e6 * way, 1e6 * np.sin(wide), np.array([2.7, 2.25, 1.6]) / (np.pi * np.sin(wide) ** 2)
    )
    planet = Sphere((0.0, 0.0, -PLANET), PLANET)
    return Scene(
        camera=Camera(
            look_from=(-800.0, -1330.0, 300.0),
            look_at=(-20.0, 0.0, 45.0),
            up=(0.0, 0.0, 1.0),
            vertical_fov=26.0,
            width=1280,
            height=720,
        ),
        objects=[Object(planet, Lambertian((0.16, 0.19, 0.09)), "planet"), *city(SEED)],
        lights=[sun],
        environment=GradientSky((0.52, 0.58, 0.66), (0.13, 0.25, 0.52), up=(0, 0, 1)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
