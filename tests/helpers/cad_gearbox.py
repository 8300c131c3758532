"""A gearbox as a STEP assembly: two shafts with wheels in ball bearings. python cad_gearbox.py gearbox.step"""

import math
import sys
from pathlib import Path

import cad_shapes as shapes
import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

X, Z = (1, 0, 0), (0, 0, 1)
SHAFTS, CORNERS = (-34.0, 34.0), [(x, y) for x in (-50, 50) for y in (-80, 80)]
STEEL, DARK, PAINT, BRASS = (
    (0.6, 0.6, 0.6),
    (0.25, 0.25, 0.27),
    (0.18, 0.22, 0.28),
    (0.75, 0.45, 0.12),
)


def rod(place, radius, length, way=X):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*place), gp_Dir(*way)), radius, length).Shape()


def box(place, sides):
    return BRepPrimAPI_MakeBox(gp_Pnt(*place), *sides).Shape()


def cut(shape, *holes):
    return BRepAlgoAPI_Cut(shape, shapes.compound(holes)).Shape()


def circle(n, radius):
    """Return n places around the x axis."""
    angles = 2.0 * math.pi * np.arange(n) / n
    return [(0.0, radius * math.cos(a), radius * math.sin(a)) for a in angles]


def bearing(inside, outside):
    """Return a ring with a groove for balls."""
    way = gp_Ax2(gp_Pnt(6, 0, 0), gp_Dir(*X))
    ring = cut(rod((0, 0, 0), outside, 12), rod((-1, 0, 0), inside, 14))
    return cut(ring, BRepPrimAPI_MakeTorus(way, 15.5, 4.0).Shape())


def wheel(n=28, radius=36.0, width=16.0):
    low, far = -0.5 * width, 2.0 * width
    gap = 0.27 * 2.0 * math.pi * radius / n
    teeth = [rod((-width, y, z), gap, far) for _, y, z in circle(n, radius + 0.6)]
    holes = [rod((-width, y, z), 5.4, far) for _, y, z in circle(6, 0.62 * radius)]
    body = cut(rod((low, 0, 0), radius, width), *teeth)
    return cut(body, rod((-width, 0, 0), 13.9, far), *holes)


def at(x, y, z, turn=0.0):
    place, c, s = np.eye(4), math.cos(turn), math.sin(turn)
    place[:3, 1:] = [(0, 0, x), (c, -s, y), (s, c, z)]
    return place


def write_gearbox(path):
    """Write it: 63 parts of 8 shapes."""
    base = box((-60, -90, -55), (120, 180, 10))
    wall = box((0, -80, -45), (12, 160, 45))
    shaft = BRepAlgoAPI_Fuse(rod((-85, 0, 0), 9, 170), rod((-30, 0, 0), 14, 60)).Shape()
    bolt = BRepAlgoAPI_Fuse(rod((0, 0, -12), 3.9, 12, Z), rod((0, 0, 0), 7, 5, Z)).Shape()
    seats = [(x, y) for x in (-56, 44) for y in SHAFTS]
    balls = [at(x + 6, y + dy, dz) for x, y in seats for _, dy, dz in circle(11, 15.5)]
    rings = [at(x, y, 0) for x, y in seats]
    parts = [
        (cut(base, *(rod((x, y, -60), 4, 30, Z) for x, y in CORNERS)), "base", PAINT, [np.eye(4)]),
        (
            cut(wall, *(rod((-1, y, 0), 22, 20) for y in SHAFTS)),
            "wall",
            PAINT,
            [at(x, 0, 0) for x in (-56, 44)],
        ),
        (bearing(18, 22), "outer ring", STEEL, rings),
        (bearing(9, 13), "inner ring", STEEL, rings),
        (BRepPrimAPI_MakeSphere(3.9).Shape(), "ball", (0.85, 0.86, 0.9), balls),
        (shaft, "shaft", STEEL, [at(-12, SHAFTS[0], 0), at(12, SHAFTS[1], 0)]),
        (wheel(), "wheel", BRASS, [at(0, SHAFTS[0], 0), at(0, SHAFTS[1], 0, math.pi / 28)]),
        (bolt, "bolt", DARK, [at(x, y, -45) for x, y in CORNERS]),
    ]
    named = [
        (s, n, c, [(f"{n} {k}", m) for k, m in enumerate(places)]) for s, n, c, places in parts
    ]
    return shapes.write_assembly(named, path)


if __name__ == "__main__":
    write_gearbox(Path(sys.argv[1]))
