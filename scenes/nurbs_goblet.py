"""A painted NURBS goblet on a B-spline cloth: one picture runs across all patches of each.

Run it: python scenes/nurbs_goblet.py --passes 64
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Camera,
    GradientSky,
    ImageTexture,
    Lambertian,
    Metal,
    Mirror,
    Mix,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
)
from meshing import BezierPatches, NurbsSurface

# A full circle of degree 2, in quarters: points and weights.
H = np.sqrt(0.5)
CIRCLE = np.array(
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], float
)
CIRCLE_WEIGHTS = np.array([1, H, 1, H, 1, H, 1, H, 1])
CIRCLE_KNOTS = (0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4)
# Radius and height of the goblet's profile: foot, stem, bowl, lip, and down inside.
PROFILE = np.array(
    [
        (0.0, 0.0), (1.0, 0.0), (1.06, 0.09), (0.3, 0.14), (0.1, 0.8), (0.14, 1.45), (0.95, 1.4),
        (1.12, 2.3), (0.86, 2.95), (0.8, 2.97), (1.02, 2.3), (0.85, 1.62), (0.0, 1.6),
    ]
)  # fmt: skip


def clamped(n: int) -> NDArray[np.float64]:
    """Return the even cubic knots of n control points, the ends repeated."""
    return np.concatenate([[0.0] * 3, np.arange(n - 2.0), [n - 3.0] * 3])


def goblet() -> NurbsSurface:
    """Turn the profile about z: a product of a rational circle and a cubic spline."""
    net = np.empty((9, len(PROFILE), 3))
    net[..., :2] = CIRCLE[:, None] * PROFILE[:, :1]
    net[..., 2] = PROFILE[:, 1]
    weights = np.repeat(CIRCLE_WEIGHTS[:, None], len(PROFILE), axis=1)
    return NurbsSurface(net, CIRCLE_KNOTS, clamped(len(PROFILE)), (2, 3), weights)


def cloth(n: int = 9) -> NurbsSurface:
    """Lay a cubic sheet of n x n points on the table, in folds towards its corners."""
    side = np.linspace(-2.6, 2.6, n)
    x, y = np.meshgrid(side, side, indexing="ij")
    far = np.hypot(x, y)
    folds = 0.16 * np.clip(far - 1.1, 0.0, 1.6) * (1.0 + np.cos(7.0 * np.arctan2(y, x)))
    return NurbsSurface(np.stack([x, y, 0.02 + folds], axis=2), clamped(n), clamped(n), 3)


def ball(center: tuple[float, float, float], radius: float) -> BezierPatches:
    """Make a sphere of eight rational octants, weights 1, 1, 2 along each arc."""
    arc, w = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]), np.array([1.0, 1.0, 2.0])
    net = np.empty((3, 3, 3))
    net[..., :2], net[..., 2] = arc[:, None] * arc[:, :1], arc[:, 1]
    signs = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    nets = [radius * net * s + center for s in signs]
    return BezierPatches(nets, [w[:, None] * w] * 8)


def vines(n: int = 768) -> NDArray[np.float64]:
    """Draw the goblet's picture, (n, n, 3) linear: u once around, v from foot to inside."""
    v, u = np.mgrid[0:n, 0:n] / n
    v = 1.0 - v
    picture = np.empty((n, n, 3))
    picture[:] = 0.78, 0.74, 0.66
    stem = np.abs(v - 0.57 - 0.045 * np.sin(12 * np.pi * u)) < 0.006
    leaf_u, leaf_v = (12 * u) % 1.0 - 0.5, v - 0.57 + 0.055 * np.where((12 * u) % 2 < 1, 1, -1)
    leaf = (leaf_u / 0.34) ** 2 + (leaf_v / 0.028) ** 2 < 1.0
    picture[stem | leaf] = 0.06, 0.2, 0.09
    picture[((leaf_u / 0.1) ** 2 + ((leaf_v - 0.04) / 0.01) ** 2) < 1.0] = 0.55, 0.05, 0.06
    for band in (0.16, 0.46, 0.69):
        picture[np.abs(v - band) < 0.012] = 0.08, 0.12, 0.4
    return picture


def weave(n: int = 768) -> NDArray[np.float64]:
    """Draw the cloth's picture, (n, n, 3) linear: a border, stripes and a star in the middle."""
    y, x = (np.mgrid[0:n, 0:n] + 0.5) / n - 0.5
    picture = np.empty((n, n, 3))
    picture[:] = 0.72, 0.66, 0.52
    edge = np.maximum(np.abs(x), np.abs(y))
    picture[(np.floor(24 * x) + np.floor(24 * y)) % 2 == 0] = 0.66, 0.6, 0.45
    picture[(edge > 0.4) & (edge < 0.46)] = 0.42, 0.07, 0.06
    picture[(edge > 0.37) & (edge < 0.385)] = 0.1, 0.15, 0.33
    star = np.hypot(x, y) < 0.2 + 0.07 * np.cos(8 * np.arctan2(y, x))
    picture[star & (np.hypot(x, y) > 0.12)] = 0.1, 0.15, 0.33
    return picture


def scene() -> Scene:
    """Describe the picture."""
    painted = Mix([(0.88, Lambertian(ImageTexture(vines()))), (0.12, Mirror(0.9))])
    table = Rectangle((-12.0, -12.0, 0.0), (24.0, 0.0, 0.0), (0.0, 24.0, 0.0))
    return Scene(
        camera=Camera(
            look_from=(2.6, -7.6, 4.3),
            look_at=(0.12, 0.0, 1.22),
            up=(0.0, 0.0, 1.0),
            vertical_fov=32.0,
            width=800,
            height=600,
        ),
        objects=[
            Object(goblet(), painted, "goblet"),
            Object(cloth(), Lambertian(ImageTexture(weave())), "cloth"),
            Object(ball((1.55, -0.75, 0.45), 0.42), Metal((0.95, 0.78, 0.45), 0.05), "ball"),
            Object(table, Lambertian((0.3, 0.17, 0.09)), "table"),
        ],
        lights=[
            RectangleLight((-7.0, -7.0, 5.0), (0.0, 4.0, 0.0), (2.0, 0.0, 4.0), (9.0, 8.4, 7.5))
        ],
        environment=GradientSky((0.3, 0.26, 0.22), (0.45, 0.55, 0.7), (0.0, 0.0, 1.0)),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
