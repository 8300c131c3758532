"""A field of small balls and cubes of random materials around three large balls.

After the last scene of Shirley's "Ray Tracing in One Weekend", with cubes among the balls.

Run it: python scenes/random_balls.py --passes 50
"""

import sys

import numpy as np

from hybrid_rt import Box, Camera, CheckerTexture, GradientSky, Object, Scene, Sphere
from hybrid_rt.materials import Dielectric, Lambertian, Metal
from hybrid_rt.materials.material import Material

SEED = 7
COLUMNS, ROWS = 8, 9
SHARE_OF_BALLS, SHARE_OF_DIFFUSE, SHARE_OF_METAL = 0.7, 0.4, 0.2
RADIUS, EDGE = 0.2, 0.4


def random_material(rng: np.random.Generator) -> Material:
    """Return a matt color, a metal, or glass."""
    kind = rng.random()
    if kind < SHARE_OF_DIFFUSE:
        return Lambertian(rng.random(3) * rng.random(3))
    if kind < SHARE_OF_DIFFUSE + SHARE_OF_METAL:
        return Metal(rng.uniform(0.5, 1.0, 3), rng.uniform(0.0, 0.5))
    return Dielectric(1.5)


def small_things(seed: int) -> list[Object]:
    """Return a ball or a cube for each place of a grid, each a little off its place."""
    rng = np.random.default_rng(seed)
    large = np.array([[4.0, 0.0], [-4.0, 0.0], [0.0, 0.0]])
    things = []
    for i in range(COLUMNS):
        for j in range(ROWS):
            x, z = 1.3 * (i - 3.5) + 0.6 * rng.random(), 1.0 * (j - 6.0) + 0.5 * rng.random()
            is_ball, material = rng.random() < SHARE_OF_BALLS, random_material(rng)
            if np.hypot(*(large - (x, z)).T).min() < 1.0:
                continue  # a large ball stands there
            surface: Sphere | Box
            if is_ball:
                surface = Sphere((x, RADIUS, z), RADIUS)
            else:
                half = EDGE / 2
                surface = Box((x - half, 0.0, z - half), (x + half, EDGE, z + half))
            things.append(Object(surface, material, f"{'ball' if is_ball else 'cube'} {i}, {j}"))
    return things


def scene() -> Scene:
    """Describe the picture."""
    ground = Lambertian(CheckerTexture((0.9, 0.9, 0.9), (0.2, 0.3, 0.1), 6.0))
    return Scene(
        camera=Camera(
            look_from=(0.0, 1.5, 5.0),
            look_at=(0.0, 0.0, -1.0),
            up=(0.0, 1.0, 0.0),
            vertical_fov=60.0,
            width=1280,
            height=720,
            aperture=0.005,
        ),
        objects=[
            Object(Sphere((0.0, -1000.0, 0.0), 1000.0), ground, "ground"),
            *small_things(SEED),
            Object(Sphere((4.0, 0.7, 0.0), 0.5), Dielectric(1.5), "large glass"),
            Object(Sphere((-4.0, 0.7, 0.0), 0.7), Lambertian((0.4, 0.2, 0.1)), "large matt"),
            Object(Sphere((0.0, 0.5, 0.0), 0.7), Metal((0.7, 0.6, 0.5), 0.0), "large metal"),
        ],
        environment=GradientSky((1.0, 1.0, 1.0), (0.5, 0.7, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
