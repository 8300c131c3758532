"""Parts from a lathe: a sectioned bearing, a cone, a cylinder, and a flange with its fillet.

Cylinders, cones and circular arcs (rational quadratics) turned about their axes. Of the bearing three
quarters of a turn are left; the flat faces of the cut are rectangles trimmed by the profiles of its rings.

Run it: python scenes/turned_parts.py --passes 128
"""

import math
import sys

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt import (
    Camera,
    GradientSky,
    Lambertian,
    Metal,
    Object,
    Phong,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)
from hybrid_rt.materials.material import Material
from meshing import Cone, Curve2, Cylinder, SurfaceOfRevolution, TrimmedSurface, circular_arc
from meshing.surface import Surface

UP = (0.0, 0.0, 1.0)
# The bearing is cut open toward the camera.
OPEN = (0.0, 0.75)


def bearing(x: float, y: float) -> list[tuple[Surface, Material]]:
    """Return two rings with grooves, the balls that run in them, and the sections of the rings."""
    steel, bright = Metal((0.72, 0.73, 0.76), 0.12), Metal((0.92, 0.92, 0.94), 0.0)
    paint = Phong((0.72, 0.36, 0.04), 0.08, 40.0)
    z, ring, ball = 0.36, 1.15, 0.26
    half, deep = 0.3, 0.2  # of a ring's width; of a groove
    cut = math.asin(deep / (1.02 * ball)) / (2.0 * math.pi)
    found: list[tuple[Surface, Material]] = []
    for side in (1.0, -1.0):
        # The groove, upward: of the outer ring on the far side of the balls, of the inner one on the near.
        begin, end = (0.25 + cut, 0.25 - cut) if side > 0 else (0.75 - cut, 0.75 + cut)
        arcs, round_arcs = circular_arc((0.0, ring), 1.02 * ball, begin, end)
        first, last = arcs[0][0], arcs[-1][-1]
        wall = ring + side * 0.5
        profile: list[ArrayLike] = [[(-half, first[1]), first], *arcs, [last, (half, last[1])]]
        profile += [[(half, last[1]), (half, wall)], [(half, wall), (-half, wall)]]
        profile.append([(-half, wall), (-half, first[1])])
        weights = [None, *round_arcs, None, None, None, None]
        surface = SurfaceOfRevolution(profile, (x, y, z), UP, weights=weights, u_range=OPEN)
        found.append((surface.flipped() if side > 0 else surface, steel))
        found += [(face, paint) for face in sections((x, y, z), profile, weights)]
    for k in range(9):
        turn = 2.0 * math.pi * (k + 0.5) / 9.0
        at = x + ring * math.cos(turn), y + ring * math.sin(turn), z
        found.append((Sphere(at, ball), bright))
    return found


def sections(
    middle: tuple[float, float, float],
    profile: list[ArrayLike],
    weights: list[NDArray[np.float64] | None],
) -> list[Surface]:
    """Return the two flat faces where a turned ring ends: what a profile of (height, radius) encloses."""
    low, inner = np.min([np.min(curve, axis=0) for curve in profile], axis=0)
    high, outer = np.max([np.max(curve, axis=0) for curve in profile], axis=0)
    size = np.array([high - low, outer - inner])
    outline = [
        Curve2((np.asarray(curve) - (low, inner)) / size, w)
        for curve, w in zip(profile, weights, strict=True)
    ]
    found: list[Surface] = []
    for turn in OPEN:
        away = np.array([math.cos(2.0 * math.pi * turn), math.sin(2.0 * math.pi * turn), 0.0])
        corner = middle + inner * away + (0.0, 0.0, low)
        face = Rectangle(corner, (0.0, 0.0, size[0]), size[1] * away)
        found.append(TrimmedSurface(face, [outline]))
    return found


def flange(x: float, y: float) -> list[tuple[Surface, Material]]:
    """Return a disc with a rounded edge, a neck on it, and the fillet between both."""
    edge, fillet, neck = 0.12, 0.3, 0.55
    outer, round_edge = circular_arc((0.12, 1.3 - edge), edge, 0.5, 0.0)
    inner, round_fillet = circular_arc((0.24 + fillet, neck + fillet), fillet, 0.5, 0.75)
    profile = [
        *outer,
        [(0.24, 1.3 - edge), (0.24, neck + fillet)],
        *inner,
        [(0.24 + fillet, neck), (1.5, neck)],
        [(1.5, neck), (1.58, neck - 0.08)],
        [(1.58, neck - 0.08), (1.58, 0.0)],
    ]
    weights = [*round_edge, None, *round_fillet, None, None, None]
    surface = SurfaceOfRevolution(profile, (x, y, 0.0), UP, weights=weights)
    return [(surface, Metal((0.86, 0.52, 0.36), 0.15))]


def scene() -> Scene:
    """Describe the picture."""
    red, blue = Phong((0.62, 0.06, 0.04), 0.12, 80.0), Phong((0.05, 0.14, 0.42), 0.12, 80.0)
    parts = [
        *bearing(-1.45, -0.6),
        *flange(1.55, 0.4),
        (Cone((0.35, -2.1, 0.0), UP, 0.6, 1.3), red),
        (Cylinder((-0.55, 1.55, 0.45), (1.0, -0.35, 0.0), 0.45, 1.6), blue),
        (Cone((-0.55, 1.55, 0.45), (-1.0, 0.35, 0.0), 0.45, 0.5, 0.2), blue),
        (
            SurfaceOfRevolution([(1.6, 0.45), (1.6, 0.0)], (-0.55, 1.55, 0.45), (1.0, -0.35, 0.0)),
            blue,
        ),
    ]
    return Scene(
        camera=Camera(
            look_from=(0.8, -6.9, 4.2),
            look_at=(-0.1, -0.25, 0.45),
            up=UP,
            vertical_fov=35.0,
            width=640,
            height=480,
        ),
        objects=[
            *(Object(surface, material) for surface, material in parts),
            Object(
                Rectangle((-30, -30, 0), (60, 0, 0), (0, 60, 0)),
                Lambertian((0.5, 0.4, 0.3)),
                "bench",
            ),
        ],
        lights=[RectangleLight((-8.5, -6.5, 4.0), (0, 9, 0), (5.0, 0, 5.0), (3.6, 3.35, 3.0))],
        environment=GradientSky((0.3, 0.27, 0.24), (0.5, 0.6, 0.75), UP),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
