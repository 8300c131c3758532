"""Tori on a table: a ring of glass, an iced one, one of silver with a gold one on it, and their lamp.

All are closed forms; the lamp is a ring too, and its light is chosen by area on its tube.

Run it: python scenes/rings.py --passes 128
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Dielectric,
    Emissive,
    GradientSky,
    ImageTexture,
    Lambertian,
    Metal,
    Object,
    Phong,
    Rectangle,
    Scene,
    Torus,
)


def icing(n: int = 256) -> NDArray[np.float64]:
    """Draw dough, pink icing on its upper side, and sprinkles, (n, 4 n, 3) linear."""
    v, u = np.meshgrid(
        1 - (np.arange(n) + 0.5) / n, (np.arange(4 * n) + 0.5) / (4 * n), indexing="ij"
    )
    drips = 0.03 * np.sin(2 * np.pi * 9 * u) + 0.02 * np.sin(2 * np.pi * 23 * u)
    is_iced = (v > 0.04 + drips) & (v < 0.47 + drips)
    picture = np.where(is_iced[..., None], (0.75, 0.2, 0.32), (0.55, 0.3, 0.12))
    rng = np.random.default_rng(12)
    colors = np.array([(0.9, 0.85, 0.2), (0.15, 0.5, 0.8), (0.9, 0.9, 0.9), (0.3, 0.65, 0.2)])
    for x, y in rng.uniform((0.0, 0.12), (1.0, 0.4), (150, 2)):
        turn, color = rng.uniform(0, np.pi), colors[rng.integers(4)]
        along = np.cos(turn) * 3.4 * (u - x) + np.sin(turn) * 1.9 * (v - y)
        across = -np.sin(turn) * 3.4 * (u - x) + np.cos(turn) * 1.9 * (v - y)
        picture[(np.abs(along) < 0.05) & (np.abs(across) < 0.012)] = color
    return picture


def scene() -> Scene:
    """Describe the picture."""
    # The silver ring leans back a little; the gold one hangs on its highest point.
    axis, large, thick = np.array([0.5, -0.9, 0.2]), 0.85, 0.16
    axis /= np.linalg.norm(axis)
    side = np.cross((0.0, 0.0, 1.0), axis)
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    middle = np.array([1.15, 1.0, large * up[2] + thick])
    hangs = middle + large * up - (0, 0, 0.26 - thick)
    return Scene(
        camera=Camera(
            look_from=(0.4, -6.4, 3.3),
            look_at=(0.0, -0.25, 0.62),
            up=(0.0, 0.0, 1.0),
            vertical_fov=34.0,
            width=640,
            height=480,
        ),
        objects=[
            Object(
                Rectangle((-7, -7, 0), (14, 0, 0), (0, 14, 0)),
                Lambertian(CheckerTexture((0.62, 0.58, 0.52), (0.5, 0.46, 0.4), 28, "uv")),
                "table",
            ),
            Object(
                Torus((-1.25, -0.2, 0.38), (0, 0, 1), 0.9, 0.38),
                Dielectric(1.5, (0.5, 0.12, 0.06)),
                "glass",
            ),
            Object(Torus(middle, axis, large, thick), Metal((0.9, 0.9, 0.92), 0.02), "silver"),
            Object(Torus(hangs, side, 0.34, 0.08), Metal((0.95, 0.66, 0.28), 0.05), "gold"),
            Object(
                Torus((0.75, -1.75, 0.3), (0, 0, 1), 0.55, 0.3),
                Phong(ImageTexture(icing()), 0.1, 60.0),
                "iced",
            ),
            Object(Torus((-0.4, 0.3, 4.0), (0, 0, 1), 1.2, 0.1), Emissive((15, 13, 10.5)), "lamp"),
        ],
        environment=GradientSky((0.05, 0.05, 0.06), (0.25, 0.3, 0.4), (0, 0, 1)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
