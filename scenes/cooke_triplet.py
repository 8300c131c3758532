"""A Cooke triplet on a bench, its six surfaces as printed; a papered wall behind it is upside down.

The prescription is that of `hybrid_rt.analysis.lens_examples`, in mm.

Run it: python scenes/cooke_triplet.py --passes 256
"""

import math
import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Asphere,
    Box,
    Camera,
    Dielectric,
    GradientSky,
    ImageTexture,
    Lambertian,
    Metal,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    Torus,
)
from hybrid_rt.analysis.lens_examples import COOKE_TRIPLET
from meshing import SurfaceOfRevolution

# Height of the axis over the bench; light of the picture travels along -y, from the wall to the eye.
HEIGHT = 24.0
AWAY = (0.0, -1.0, 0.0)


def picture(n: int = 256) -> NDArray[np.float64]:
    """Draw a sun over hills, (n, n, 3) linear."""
    x, y = np.meshgrid((np.arange(n) + 0.5) / n, 1 - (np.arange(n) + 0.5) / n)
    image = np.stack([0.25 + 0.5 * y, 0.5 + 0.25 * y, 0.85 + 0 * y], axis=-1)
    image[np.hypot(x - 0.35, y - 0.72) < 0.12] = (1.0, 0.75, 0.1)
    for height, color in ((0.46, (0.25, 0.45, 0.3)), (0.34, (0.12, 0.32, 0.1))):
        ridge = height + 0.07 * np.sin(2 * np.pi * (1.3 * x + 4 * height)) + 0.02 * np.sin(40 * x)
        image[y < ridge] = color
    image[(np.abs(x - 0.68) < 0.012) & (y > 0.2) & (y < 0.55)] = (0.2, 0.1, 0.05)
    image[np.hypot(x - 0.68, (y - 0.58) / 1.3) < 0.09] = (0.5, 0.12, 0.05)
    return image


def elements() -> list[Object]:
    """Return the three lenses of glass, each a front, a back and an edge, with rings and feet."""
    objects, y = [], 0.0
    glass: list[tuple[Asphere, float]] = []
    before = 1.0
    for s in COOKE_TRIPLET:
        if s.index != before:
            surface = Asphere(s.radius, s.conic, s.coefficients, s.aperture, (0, y, HEIGHT), AWAY)
            glass.append((surface, s.index))
        before, y = s.index, y - s.thickness
    for k in range(0, len(glass), 2):
        (front, index), (back, _) = glass[k], glass[k + 1]
        material, name, r = Dielectric(index), f"lens {k // 2 + 1}", 0.5 * front.aperture
        begins = float(front.sag_at(r))
        ends = float(back.sag_at(r)) + front.origin[1] - back.origin[1]
        edge = SurfaceOfRevolution([(begins, r), (ends, r)], front.origin, AWAY)
        for part, surface in (("front", front), ("back", back.flipped()), ("edge", edge)):
            objects.append(Object(surface, material, f"{name}, {part}"))
        middle = float(front.origin[1]) - 0.5 * (begins + ends)
        brass = Metal((0.85, 0.62, 0.3), 0.06)
        objects.append(
            Object(Torus((0, middle, HEIGHT), AWAY, r + 1.3, 1.2), brass, f"ring {k // 2 + 1}")
        )
        foot = Box((-2.5, middle - 1.2, 0.0), (2.5, middle + 1.2, HEIGHT - r - 1.5))
        objects.append(Object(foot, brass, f"foot {k // 2 + 1}"))
    return objects


def scene() -> Scene:
    """Describe the picture."""
    bench = Rectangle((-150, -350, 0), (300, 0, 0), (0, 580, 0))
    wall = Rectangle((-174, 260, -12), (288, 0, 0), (0, 0, 144))
    turn = math.radians(6.0)
    return Scene(
        camera=Camera(
            look_from=(420 * math.sin(turn), -20 - 420 * math.cos(turn), 46.0),
            look_at=(0.0, -16.0, 24.0),
            up=(0.0, 0.0, 1.0),
            vertical_fov=9.5,
            width=640,
            height=480,
        ),
        objects=[
            *elements(),
            Object(bench, Lambertian((0.42, 0.36, 0.3)), "bench"),
            Object(wall, Lambertian(ImageTexture(np.tile(picture(), (4, 8, 1)))), "wallpaper"),
        ],
        lights=[
            RectangleLight((-120, 60, 260), (0, 160, 0), (240, 0, 0), (5.0, 4.8, 4.4)),
            RectangleLight((-220, -200, 150), (0, 120, 60), (60, 0, 120), (3.0, 3.2, 3.6)),
        ],
        environment=GradientSky((0.25, 0.25, 0.27), (0.6, 0.68, 0.8), (0, 0, 1)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
