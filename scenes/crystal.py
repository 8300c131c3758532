"""Red wine in turned crystal, a fluted solid and a gold band, in the light of one lamp behind them.

Glass, wine and band are turned, the solid is a closed cubic B-spline: the bright lines on the table
are those of the true surfaces, however large the picture.

Run it: python scenes/crystal.py --passes 64 --photons 1000000
"""

import sys

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt import (
    Camera,
    Dielectric,
    Lambertian,
    Metal,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    SphereLight,
)
from meshing import NurbsSurface, SurfaceOfRevolution, circular_arc

# Photons find caustics, and what is seen of them through glass.
INTEGRATOR = "ppm"
# (height, radius): underside, rim of the foot, foot, a stem with two knops, bowl, lip, and back
# down the inside.
GLASS = (
    ((0.0, 0.0), (0.0, 0.96)),
    ((0.0, 0.96), (0.02, 1.0), (0.07, 1.0), (0.09, 0.96)),
    ((0.09, 0.96), (0.15, 0.6), (0.2, 0.2), (0.42, 0.13)),
    ((0.42, 0.13), (0.5, 0.11), (0.5, 0.3), (0.62, 0.3)),
    ((0.62, 0.3), (0.74, 0.3), (0.74, 0.11), (0.82, 0.12)),
    ((0.82, 0.12), (0.92, 0.13), (0.9, 0.22), (0.98, 0.22)),
    ((0.98, 0.22), (1.06, 0.22), (1.04, 0.14), (1.16, 0.14)),
    ((1.16, 0.14), (1.32, 0.15), (1.36, 0.6), (1.62, 0.82)),
    ((1.62, 0.82), (1.9, 1.06), (2.3, 1.08), (2.6, 1.0)),
    ((2.6, 1.0), (2.9, 0.92), (3.1, 0.84), (3.3, 0.8)),
    ((3.3, 0.8), (3.33, 0.79), (3.33, 0.745), (3.3, 0.75)),
    ((3.3, 0.75), (3.1, 0.79), (2.9, 0.87), (2.6, 0.95)),
    ((2.6, 0.95), (2.3, 1.02), (1.95, 0.99), (1.7, 0.76)),
    ((1.7, 0.76), (1.52, 0.58), (1.5, 0.3), (1.48, 0.0)),
)
# A little within the glass, and level on top.
WINE = (
    ((1.46, 0.0), (1.48, 0.31), (1.5, 0.6), (1.68, 0.78)),
    ((1.68, 0.78), (1.93, 1.01), (2.29, 1.035), (2.55, 0.975)),
    ((2.55, 0.975), (2.55, 0.0)),
)
UP = (0.0, 0.0, 1.0)


def ring(x: float, y: float, radius: float, height: float) -> SurfaceOfRevolution:
    """Return a plain band that stands on the table, its edges rounded."""
    half, inner = 0.035, radius - 0.07
    top, w_top = circular_arc((height - half, radius - half), half, 0.25, -0.25)
    foot, w_foot = circular_arc((half, radius - half), half, 0.75, 0.25)
    profile: list[ArrayLike] = [
        *foot,
        [(half, radius), (height - half, radius)],
        *top,
        [(height - half, inner), (half, inner)],
    ]
    weights = [*w_foot, None, *w_top, None]
    return SurfaceOfRevolution(profile, (x, y, 0.001), UP, weights=weights)


def fluted(x: float, y: float) -> NurbsSurface:
    """Return a solid of crystal with seven flutes that twist: a cubic B-spline, closed around."""
    # (radius, height, depth of the flutes, turn): along the profile, from below to the top.
    rows = (
        (0.0, 0.0, 0.0, 0.0), (0.3, 0.0, 0.0, 0.0), (0.6, 0.0, 0.06, 0.0), (0.72, 0.15, 0.1, 0.1),
        (0.78, 0.6, 0.12, 0.3), (0.74, 1.05, 0.12, 0.5), (0.5, 1.4, 0.1, 0.65),
        (0.18, 1.5, 0.0, 0.75), (0.0, 1.5, 0.0, 0.75),
    )  # fmt: skip
    n, flutes = 28, 7
    turn = 2.0 * np.pi * np.arange(n) / n
    ribs = np.cos(flutes * turn)
    net = np.empty((n, len(rows), 3))
    for j, (r, z, deep, twist) in enumerate(rows):
        around = r * (1.0 + deep * ribs)
        net[:, j] = np.stack(
            [x + around * np.cos(turn + twist), y + around * np.sin(turn + twist), 0 * turn + z],
            axis=1,
        )
    net[..., 2] += 0.001
    closed = np.concatenate([net, net[:3]])
    along = (0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 6, 6, 6)
    return NurbsSurface(closed, np.arange(n + 7), along, 3)


def scene() -> Scene:
    """Describe the picture."""
    place = (0.0, 0.0, 0.001)
    table = Rectangle((-9.0, -9.0, 0.0), (18.0, 0.0, 0.0), (0.0, 16.0, 0.0))
    wall = Rectangle((-12.0, 7.0, -1.0), (24.0, 0.0, 0.0), (0.0, 0.0, 12.0))
    return Scene(
        camera=Camera(
            look_from=(1.1, -9.0, 5.9),
            look_at=(0.74, -0.42, 1.1),
            up=UP,
            vertical_fov=31.0,
            width=1280,
            height=960,
            aperture=0.16,
            focus_distance=9.4,
        ),
        objects=[
            Object(SurfaceOfRevolution(GLASS, place, UP), Dielectric(1.55), "glass"),
            Object(
                SurfaceOfRevolution(WINE, place, UP),
                Dielectric(1.34, (0.12, 1.5, 1.25), priority=-1.0),
                "wine",
            ),
            Object(ring(-0.9, -2.0, 0.5, 0.2), Metal((1.0, 0.78, 0.42), 0.0), "gold ring"),
            Object(fluted(2.0, 1.2), Dielectric(1.55), "fluted crystal"),
            Object(table, Lambertian((0.8, 0.76, 0.7)), "table"),
            Object(wall, Lambertian((0.1, 0.13, 0.2)), "wall"),
        ],
        lights=[
            SphereLight((-3.0, 4.6, 4.7), 0.03, (30000.0, 28000.0, 24500.0)),
            RectangleLight((-6.5, -2.0, 2.5), (0.0, 3.0, 0.0), (0.0, 0.0, 3.5), (1.6, 1.8, 2.2)),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
