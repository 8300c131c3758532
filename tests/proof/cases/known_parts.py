"""Parts whose thickness, volume and box have closed forms, made by OpenCASCADE."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.collections import Array1_gp_Pnt
from OCP.Geom import Geom_BezierCurve, Geom_Circle, Geom_Ellipse
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

UP = (0, 0, 1)


def _place(at: Any = (0, 0, 0), way: Any = UP) -> gp_Ax2:
    return gp_Ax2(gp_Pnt(*map(float, at)), gp_Dir(*map(float, way)))


def box(x: float, y: float, z: float, at: Any = (0, 0, 0)) -> Any:
    """Return a box with a corner at a place."""
    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, at)), float(x), float(y), float(z)).Shape()


def rod(radius: float, length: float, at: Any = (0, 0, 0), way: Any = UP) -> Any:
    """Return a cylinder that begins at a place."""
    return BRepPrimAPI_MakeCylinder(_place(at, way), float(radius), float(length)).Shape()


def cone(first: float, last: float, length: float, at: Any = (0, 0, 0)) -> Any:
    """Return a cone along z, or its frustum, by its radii."""
    return BRepPrimAPI_MakeCone(_place(at), float(first), float(last), float(length)).Shape()


def ball(radius: float, at: Any = (0, 0, 0)) -> Any:
    """Return a ball about a place."""
    return BRepPrimAPI_MakeSphere(gp_Pnt(*map(float, at)), float(radius)).Shape()


def ring(major: float, minor: float) -> Any:
    """Return a torus about z."""
    return BRepPrimAPI_MakeTorus(float(major), float(minor)).Shape()


def cut(one: Any, *others: Any) -> Any:
    """Return a shape without others."""
    for other in others:
        one = BRepAlgoAPI_Cut(one, other).Shape()
    return one


def fused(one: Any, other: Any) -> Any:
    """Return two shapes as one."""
    return BRepAlgoAPI_Fuse(one, other).Shape()


def _points(corners: Any) -> list[gp_Pnt]:
    return [gp_Pnt(float(x), 0.0, float(z)) for x, z in corners]


def prism(corners: Any, length: float) -> Any:
    """Return a polygon in x and z, drawn out along y."""
    wire = BRepBuilderAPI_MakePolygon()
    for point in _points(corners):
        wire.Add(point)
    wire.Close()
    return _drawn(BRepBuilderAPI_MakeFace(wire.Wire()).Face(), (0, length, 0))


def _drawn(face: Any, way: Any) -> Any:
    return BRepPrimAPI_MakePrism(face, gp_Vec(*map(float, way))).Shape()


def _under_parabola(corners: Any, control: Any) -> Any:
    """Return a face in x and z between a polyline, and a parabola that joins its ends."""
    points, bent = _points(corners), Array1_gp_Pnt(1, 3)
    for k, point in enumerate(_points(control)):
        bent.SetValue(k + 1, point)
    wire = BRepBuilderAPI_MakeWire()
    for a, b in pairwise(points):
        wire.Add(BRepBuilderAPI_MakeEdge(a, b).Edge())
    wire.Add(BRepBuilderAPI_MakeEdge(Geom_BezierCurve(bent)).Edge())
    return BRepBuilderAPI_MakeFace(wire.Wire()).Face()


def _parabolic_plate() -> Any:
    """Thickness 3 + x^2 / 40, |x| <= 10."""
    corners = [(-10, 5.5), (-10, 0), (10, 0), (10, 5.5)]
    return _drawn(_under_parabola(corners, [(-10, 5.5), (0, 0.5), (10, 5.5)]), (0, 12, 0))


def _dish() -> Any:
    """Thickness 3 + r^2 / 40, r <= 10."""
    face = _under_parabola([(0, 3), (0, 0), (10, 0), (10, 5.5)], [(10, 5.5), (5, 3), (0, 3)])
    return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape()


def _elliptic_wall() -> Any:
    wire = BRepBuilderAPI_MakeWire(
        BRepBuilderAPI_MakeEdge(Geom_Ellipse(_place(), 10.0, 6.0)).Edge()
    )
    return cut(_drawn(BRepBuilderAPI_MakeFace(wire.Wire()).Face(), (0, 0, 15)), rod(4, 15))


def _loft() -> Any:
    """Return a loft from a circle of radius 10 to one of radius 6, which is a spline, with a bore of radius 3."""
    through = BRepOffsetAPI_ThruSections(True, True)
    for radius, z in ((10.0, 0), (6.0, 30)):
        edge = BRepBuilderAPI_MakeEdge(Geom_Circle(_place((0, 0, z)), radius)).Edge()
        through.AddWire(BRepBuilderAPI_MakeWire(edge).Wire())
    through.Build()
    return cut(through.Shape(), rod(3, 30))


def rounded_box() -> Any:
    """Return a box whose edges have rounds of radius 2."""
    whole = box(30, 20, 10)
    make, more = BRepFilletAPI_MakeFillet(whole), TopExp_Explorer(whole, TopAbs_EDGE)
    while more.More():
        make.Add(2.0, TopoDS.Edge(more.Current()))
        more.Next()
    return make.Shape()


def _tilted_bore_volume() -> float:
    # Gauss-Chebyshev of the second kind: the weight is the bore's half chord.
    k = np.arange(1, 61) * np.pi / 61
    y = 5.0 + 3.0 * np.cos(k)
    crossed = 4.0 * 9.0 * np.pi / 61 * (np.sin(k) ** 2 * np.sqrt(100.0 - y**2)).sum()
    return float(np.pi * 100.0 * 30.0 - crossed)


class KnownPart(NamedTuple):
    """A part with its least thickness along normals, its least ball, its volume and the sides of its box."""

    name: str
    make: Callable[[], Any]
    ray: float
    ball: float
    volume: float
    sides: tuple[float, float, float]
    # Searches that end only after minutes: of rays, of balls.
    takes_long: tuple[bool, bool] = (False, False)


PI, TAN30, TAN10 = np.pi, np.tan(np.pi / 6), np.tan(np.pi / 18)
DRAFT, LEAN, TAPER = np.arctan(1.0 / 20.0), np.arctan(4.0 / 30.0), np.arctan(1.0 / 15.0)
KNOWN_PARTS = [
    KnownPart("plate", lambda: box(60, 40, 3), 3.0, 3.0, 7200.0, (60, 40, 3)),
    KnownPart("tube", lambda: cut(rod(10, 30), rod(6, 30)), 4.0, 4.0, 1920 * PI, (20, 20, 30)),
    KnownPart("eccentric bore", lambda: cut(box(30, 32, 20), rod(5, 20, (9, 15, 0))),
              4.0, 4.0, 19200 - 500 * PI, (30, 32, 20)),
    KnownPart("tilted bore", lambda: cut(rod(10, 30), rod(3, 80, (-40, 5, 15), (1, 0, 0))),
              2.0, 2.0, _tilted_bore_volume(), (20, 20, 30)),
    KnownPart("skew bores", lambda: cut(box(30, 30, 30), rod(4, 30, (0, 15, 9.75), (1, 0, 0)),
                                        rod(4, 30, (15, 0, 20.25), (0, 1, 0))),
              2.5, 2.5, 27000 - 960 * PI, (30, 30, 30)),
    KnownPart("stepped shaft", lambda: fused(rod(10, 20), rod(6, 50)), 12.0, 12.0, 3080 * PI, (20, 20, 50), (False, True)),
    KnownPart("counterbore", lambda: cut(box(40, 40, 12), rod(8, 5, (20, 20, 7)), rod(4, 12, (20, 20, 0))),
              7.0, 7.0, 19200 - 432 * PI, (40, 40, 12)),
    KnownPart("hollow sphere", lambda: cut(ball(10), ball(8)), 2.0, 2.0, 1952 * PI / 3, (20, 20, 20)),
    KnownPart("shell off its centre", lambda: cut(ball(10), ball(8, (0.3, 0, 0.4))),
              1.5, 1.5, 1952 * PI / 3, (20, 20, 20)),
    KnownPart("torus tube", lambda: cut(ring(12, 5), ring(12, 3)), 2.0, 2.0, 384 * PI**2, (34, 34, 10)),
    KnownPart("cone shell", lambda: cut(cone(10, 4, 12), cone(7.5, 1.5, 12)),
              2.5 / np.sqrt(1.25), 2.5 / np.sqrt(1.25), 345 * PI, (20, 20, 12), (False, True)),
    # From the wide end's rim; a circle between bore, side and end.
    KnownPart("tapered bore", lambda: cut(rod(10, 30), cone(6, 4, 30)),
              4.0, 8.0 * np.cos(TAPER) / (1.0 + 14.0 / 15.0 * np.cos(TAPER)), 2240 * PI, (20, 20, 30), (False, True)),
    KnownPart("dimple", lambda: cut(box(24, 24, 10), ball(6, (12, 12, 10))), 4.0, 4.0, 5760 - 144 * PI, (24, 24, 10)),
    # The ray goes on through the groove where its walls are steep; its tip is what is near.
    KnownPart("groove", lambda: cut(box(40, 30, 10), prism([(14, 11), (26, 11), (20, 5)], 30)),
              5.0, 5.0, 11250.0, (40, 30, 10)),
    # At the top of a rib with draft: from one corner to the other side, and a circle that touches three sides.
    KnownPart("rib", lambda: prism([(-1, 0), (1, 0), (2, -20), (-2, -20)], 30),
              2.0 * np.cos(DRAFT) / np.cos(2.0 * DRAFT), 2.0 * np.cos(DRAFT) / (1.0 - np.cos(DRAFT) / 20.0),
              1800.0, (4, 30, 20), (False, True)),
    # 30 and 60 degrees: both edges are named, what is left is between the ends.
    KnownPart("wedge", lambda: prism([(0, 0), (40, 0), (40, 40 * TAN30)], 10),
              10.0, 10.0, 8000 * TAN30, (40, 10, 40 * TAN30)),
    KnownPart("knife edge", lambda: prism([(0, 0), (40, 0), (40, 40 * TAN10)], 3),
              3.0, 3.0, 2400 * TAN10, (40, 3, 40 * TAN10)),
    KnownPart("elliptic wall", _elliptic_wall, 2.0, 2.0, 660 * PI, (20, 12, 15)),
    KnownPart("parabolic plate", _parabolic_plate, 3.0, 3.0, 920.0, (20, 12, 5.5)),
    KnownPart("dish", _dish, 3.0, 3.0, 425 * PI, (20, 20, 5.5)),
    # A circle between bore, top and side; from the bore's rim to the side's.
    KnownPart("loft", _loft, 3.0, 6.0 * np.cos(LEAN) / (1.0 + np.cos(LEAN) - np.sin(LEAN)),
              1690 * PI, (20, 20, 30), (False, True)),
    KnownPart("rounded box", rounded_box, 10.0, 10.0,
              26 * 16 * 6 + 4 * (26 * 16 + 16 * 6 + 26 * 6) + 4 * PI * 48 + 32 * PI / 3, (30, 20, 10)),
]  # fmt: skip
