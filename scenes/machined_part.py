"""A machined part: a drilled flange with a fillet, a neck with three windows, a chamfered rim.

Its flat faces are rectangles cut by an outline and holes, its neck and bore are cylinders with windows;
fillet and chamfer are turned, the outer wall is swept from lines and arcs. All faces are exact.

Run it: python scenes/machined_part.py --passes 128
"""

import math
import sys

import numpy as np

from hybrid_rt import (
    Camera,
    GradientSky,
    Lambertian,
    Metal,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
)
from meshing import (
    Cone,
    Curve2,
    Cylinder,
    Extrusion,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    circular_arc,
    polygon,
)
from meshing.surface import Surface

UP = (0.0, 0.0, 1.0)
# Half the flange's side, the radius of its corners, its thickness; where its holes are, and how wide.
HALF, CORNER, THICK = 1.6, 0.5, 0.3
HOLES, DRILL = [(x, y) for x in (-1.15, 1.15) for y in (-1.15, 1.15)], 0.2
# Radii of bore, neck and fillet; the neck's height, and its chamfer.
BORE, NECK, FILLET, HEIGHT, CHAMFER = 0.6, 0.75, 0.3, 1.7, 0.06
# Windows: width in whole turns, from and to which height.
WINDOWS, WIDE, LOW, HIGH = (0.0, 1 / 3, 2 / 3), 0.14, 0.75, 1.4
# The table is lower by a hair than the part's lower face: of two faces in one plane only one is seen.
TABLE = -0.001


def outline() -> tuple[list[np.ndarray], list[np.ndarray | None]]:
    """Return lines and arcs around the flange in x and y, counterclockwise, and their weights."""
    curves: list[np.ndarray] = []
    weights: list[np.ndarray | None] = []
    inner = HALF - CORNER
    for turn in range(4):
        cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[turn]
        arcs, given = circular_arc((inner, inner), CORNER, 0.0, 0.25)
        side = np.array([(HALF, -inner), (HALF, inner)])
        for piece, w in zip([side, *arcs], [None, *given], strict=True):
            curves.append(np.asarray(piece) @ np.array([(cosine, sine), (-sine, cosine)]))
            weights.append(w)
    return curves, weights


def face(z: float, circles: list[tuple[float, float, float]], is_flange: bool) -> Surface:
    """Return a level face at a height: circles (x, y, radius), and the flange's outline."""
    side = 2 * HALF
    curves, weights = outline()
    loops = [circle(((x + HALF) / side, (y + HALF) / side), r / side) for x, y, r in circles]
    if is_flange:
        loops.append([Curve2((c + HALF) / side, w) for c, w in zip(curves, weights, strict=True)])
    return TrimmedSurface(Rectangle((-HALF, -HALF, z), (side, 0, 0), (0, side, 0)), loops)


def windowed(radius: float, low: float, high: float) -> TrimmedSurface:
    """Return a cylinder about z with the windows cut out."""
    whole = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    v0, v1 = ((z - low) / (high - low) for z in (LOW, HIGH))
    cuts = [polygon([(at, v0), (at + WIDE, v0), (at + WIDE, v1), (at, v1)]) for at in WINDOWS]
    return TrimmedSurface(Cylinder((0, 0, low), UP, radius, high - low), [whole, *cuts])


def window_walls() -> list[Surface]:
    """Return what the windows show of the wall between bore and neck."""
    found: list[Surface] = []
    for at in WINDOWS:
        for z, ends in ((LOW, (NECK, BORE)), (HIGH, (BORE, NECK))):
            profile = [(z, ends[0]), (z, ends[1])]
            found.append(SurfaceOfRevolution(profile, (0, 0, 0), UP, u_range=(at, at + WIDE)))
        for turn in (at, at + WIDE):
            away = np.array([math.cos(2 * math.pi * turn), math.sin(2 * math.pi * turn), 0.0])
            found.append(
                Rectangle(BORE * away + (0, 0, LOW), (NECK - BORE) * away, (0, 0, HIGH - LOW))
            )
    return found


def part() -> list[Surface]:
    """Return the faces of the part."""
    curves, weights = outline()
    flat = [np.column_stack([c, np.zeros(len(c))]) for c in curves]
    holes = [(x, y, DRILL) for x, y in HOLES]
    arcs, fillet = circular_arc((THICK + FILLET, NECK + FILLET), FILLET, 0.5, 0.75)
    rim = HEIGHT - CHAMFER
    return [
        face(0.0, [*holes, (0, 0, BORE)], True).flipped(),
        face(THICK, [*holes, (0, 0, NECK + FILLET)], True),
        face(HEIGHT, [(0, 0, BORE), (0, 0, NECK - CHAMFER)], False),
        Extrusion(flat, (0, 0, THICK), weights),
        *(Cylinder((x, y, 0), UP, DRILL, THICK).flipped() for x, y in HOLES),
        SurfaceOfRevolution(arcs, (0, 0, 0), UP, weights=fillet),
        windowed(NECK, THICK + FILLET, rim),
        windowed(BORE, 0.0, HEIGHT).flipped(),
        Cone((0, 0, rim), UP, NECK, CHAMFER, NECK - CHAMFER),
        *window_walls(),
    ]


def scene() -> Scene:
    """Describe the picture."""
    steel = Metal((0.78, 0.79, 0.82), 0.18)
    return Scene(
        camera=Camera(
            look_from=(1.2, -5.6, 4.2),
            look_at=(0.0, 0.0, 0.55),
            up=UP,
            vertical_fov=36.0,
            width=640,
            height=480,
        ),
        objects=[
            *(Object(surface, steel) for surface in part()),
            Object(
                Rectangle((-9, -9, TABLE), (18, 0, 0), (0, 18, 0)), Lambertian((0.4, 0.3, 0.22))
            ),
        ],
        lights=[
            RectangleLight((-4.5, -1.5, 5.5), (0, 4, 0), (3.0, 0, 1.5), (4.5, 4.2, 3.8)),
            RectangleLight((3.5, -5.5, 4.0), (0, 0, 2), (0, 3, 0), (2.2, 2.4, 2.7)),
        ],
        environment=GradientSky((0.2, 0.2, 0.22), (0.55, 0.62, 0.72), UP),
    )


if __name__ == "__main__":
    from hybrid_rt.cli import render_script

    sys.exit(render_script(scene, __file__))
