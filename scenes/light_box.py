"""Nine coloured beams graze a sheet of paper, pass a lens of glass and meet a concave mirror.

Slits in a black plate cut the beams from spots. The lens is an extruded outline of circular arcs, exact
rational patches: the outer beams meet before the inner ones, as spherical aberration has it.

Run it: python scenes/light_box.py --passes 64 --photons 1000000
"""

import sys

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Lambertian,
    Mirror,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    SpotLight,
)
from meshing import BezierPatches, Extrusion, circular_arc

# Photons find what lens and mirror throw onto the paper.
INTEGRATOR = "ppm"
# Of the beams: places along y, width and height of the slits, how far behind them lamps stand, how high.
PLACES = np.linspace(-0.88, 0.88, 9)
WIDE, HIGH, BEHIND, LAMP = 0.035, 0.36, 3.0, 0.42
COLORS = (
    (1.0, 0.08, 0.08), (1.0, 0.3, 0.04), (1.0, 0.62, 0.05), (0.7, 0.9, 0.08), (0.15, 1.0, 0.2),
    (0.05, 0.85, 0.75), (0.08, 0.5, 1.0), (0.2, 0.2, 1.0), (0.6, 0.12, 1.0),
)  # fmt: skip
TALL = 0.5


def arc(x: float, radius: float, half: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return an arc of a circle through (x, 0), from y = -half to half: rational Bezier points."""
    turn = np.arcsin(half / abs(radius)) / (2.0 * np.pi)
    begin, end = (-turn, turn) if radius > 0 else (0.5 + turn, 0.5 - turn)
    (points,), (weights,) = circular_arc((x - radius, 0.0), abs(radius), begin, end)
    return np.column_stack([points, np.full(len(points), 0.001)]), np.asarray(weights)


def lens() -> list[BezierPatches]:
    """Return a biconvex lens that stands on the paper: its sides, its edges, its two lids."""
    up = np.array((0.0, 0.0, TALL))
    (right, w), (left, _) = arc(1.75, 2.3, 1.05), arc(0.95, -2.3, 1.05)
    sides = [right, np.array([right[-1], left[-1]]), left[::-1], np.array([left[0], right[0]])]
    lid = np.stack([right, left], axis=1)
    weights = np.stack([w, w], axis=1)
    return [
        Extrusion(sides, up, [w, None, w[::-1], None]),
        BezierPatches([lid + up], [weights]),
        BezierPatches([lid], [weights]).flipped(),
    ]


def box() -> list[Box]:
    """Return the plate with the slits, and the roof behind it that keeps its light from the lens."""
    edges = np.concatenate([[-1.3], np.repeat(PLACES, 2), [1.3]])
    edges[1:-1] += np.tile([-0.5 * WIDE, 0.5 * WIDE], len(PLACES))
    teeth = [Box((-0.06, a, 0.0), (0.0, b, HIGH)) for a, b in edges.reshape(-1, 2)]
    beam = Box((-0.06, -1.3, HIGH), (0.0, 1.3, 0.6))
    return [*teeth, beam, Box((-3.4, -1.3, 0.6), (0.0, 1.3, 0.64))]


def scene() -> Scene:
    """Describe the picture."""
    hollow, weights = arc(5.1, 3.4, 1.25)
    black, glass = Lambertian(0.03), Dielectric(1.5)
    down = np.arctan2(LAMP - 0.5 * HIGH, BEHIND)
    lamps = [
        SpotLight(
            (-BEHIND, y, LAMP),
            (np.cos(down), 0.0, -np.sin(down)),
            1500.0 * np.array(color),
            4.2,
            0.2,
        )
        for y, color in zip(PLACES, COLORS, strict=True)
    ]
    return Scene(
        camera=Camera(
            look_from=(3.3, -5.8, 5.4),
            look_at=(2.5, -0.12, 0.05),
            up=(0.0, 0.0, 1.0),
            vertical_fov=27.5,
            width=1280,
            height=800,
        ),
        objects=[
            *(Object(part, black, "light box") for part in box()),
            *(Object(part, glass, "lens") for part in lens()),
            Object(Extrusion(hollow, (0.0, 0.0, TALL), weights), Mirror(0.95), "concave mirror"),
            Object(Rectangle((-6, -6, 0), (16, 0, 0), (0, 14, 0)), Lambertian(0.8), "paper"),
        ],
        lights=[
            *lamps,
            RectangleLight((0.5, 3.0, 5.0), (0.0, 2.0, 0.0), (3.0, 0.0, 0.0), (1.6, 1.65, 1.8)),
        ],
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
