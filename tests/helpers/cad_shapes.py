"""Shapes that OpenCASCADE makes, for tests of CAD files: one of each kind of face."""

import math
from itertools import pairwise

from OCP.BRep import BRep_Builder
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Transform,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeRevol,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.collections import Array1_double, Array1_gp_Pnt, Array1_int, Array2_gp_Pnt
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_BSplineCurve,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_OffsetSurface,
    Geom_Parabola,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.Message import Message
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Face

Message.DefaultMessenger_s().ChangePrinters().Clear()
Z = gp_Dir(0, 0, 1)
O = gp_Pnt(0, 0, 0)
AXIS = gp_Ax1(O, Z)


def _points(places):
    array = Array1_gp_Pnt(1, len(places))
    for k, place in enumerate(places):
        array.SetValue(k + 1, gp_Pnt(*map(float, place)))
    return array


def _face(surface, *ends):
    return BRepBuilderAPI_MakeFace(surface, *map(float, ends), 1e-9).Face()


def spline_curve(places, degree=3):
    """Return a clamped B-spline with even knots."""
    n = len(places) - degree + 1
    knots, counts = Array1_double(1, n), Array1_int(1, n)
    for k in range(n):
        knots.SetValue(k + 1, 0.7 * k)
        counts.SetValue(k + 1, degree + 1 if k in (0, n - 1) else 1)
    return Geom_BSplineCurve(_points(places), knots, counts, degree)


def filleted_box():
    box = BRepPrimAPI_MakeBox(30.0, 20.0, 10.0).Shape()
    make, more = BRepFilletAPI_MakeFillet(box), TopExp_Explorer(box, TopAbs_EDGE)
    while more.More():
        make.Add(2.0, TopoDS.Edge(more.Current()))
        more.Next()
    return make.Shape()


def drilled_cylinder():
    rod = BRepPrimAPI_MakeCylinder(10.0, 40.0).Shape()
    hole = BRepPrimAPI_MakeCylinder(
        gp_Ax2(gp_Pnt(-30, 1, 20), gp_Dir(1, 0, 0.2)), 4.0, 80.0
    ).Shape()
    return BRepAlgoAPI_Cut(rod, hole).Shape()


def two_nappes():
    """A cone beyond its apex, on both sides."""
    return _face(Geom_ConicalSurface(gp_Ax3(O, Z), 0.4, 4.0), 0.3, 5.5, -14.0, 3.0)


def spindle(first, last):
    """Part of a torus whose tube reaches beyond its axis."""
    return _face(Geom_ToroidalSurface(gp_Ax3(O, Z), 3.0, 5.0), 0.5, 4.5, first, last)


def revolved(curve, first, last, turn=(0.4, 5.1)):
    return _face(Geom_SurfaceOfRevolution(curve, AXIS), *turn, first, last)


def extruded(curve, first, last, way=(0.3, 0.2, 1.0), ends=(-2.0, 6.0)):
    return _face(Geom_SurfaceOfLinearExtrusion(curve, gp_Dir(*way)), first, last, *ends)


def across(x=0.0):
    """Where x runs along the axis of revolution, and y away from it."""
    return gp_Ax2(gp_Pnt(x, 0, 0), gp_Dir(0, -1, 0), gp_Dir(0, 0, 1))


def wavy_net(n=4):
    net = Array2_gp_Pnt(1, n, 1, n)
    for i in range(n):
        for j in range(n):
            net.SetValue(i + 1, j + 1, gp_Pnt(4.0 * i, 4.0 * j, 3.0 * math.sin(1.3 * i + 0.9 * j)))
    return net


def vase():
    return spline_curve([(4, 0, 0), (7, 0, 3), (3, 0, 7), (2, 0, 10), (5, 0, 13), (6, 0, 15)])


def drilled_wave():
    """A solid under an extruded spline, with a slanted hole: curves in (u, v) that are splines."""
    wave = spline_curve([(0, 0, 5), (4, 0, 8), (8, 0, 4), (12, 0, 7), (16, 0, 6)])
    wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(wave).Edge())
    corners = [(16, 0, 6), (16, 0, 0), (0, 0, 0), (0, 0, 5)]
    for a, b in pairwise(corners):
        wire.Add(BRepBuilderAPI_MakeEdge(gp_Pnt(*map(float, a)), gp_Pnt(*map(float, b))).Edge())
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    body = BRepPrimAPI_MakePrism(face, gp_Vec(0, 12, 0)).Shape()
    hole = BRepPrimAPI_MakeCylinder(
        gp_Ax2(gp_Pnt(8, 6, -5), gp_Dir(0.2, 0.1, 1)), 2.5, 30.0
    ).Shape()
    return BRepAlgoAPI_Cut(body, hole).Shape()


def lobed_prism():
    """A solid over a closed periodic spline."""
    from OCP.collections import HArray1_gp_Pnt
    from OCP.GeomAPI import GeomAPI_Interpolate

    places = HArray1_gp_Pnt(1, 7)
    for k in range(7):
        angle = 2.0 * math.pi * k / 7
        radius = 6.0 + 1.2 * math.cos(3.0 * angle)
        places.SetValue(k + 1, gp_Pnt(radius * math.cos(angle), radius * math.sin(angle), 0.0))
    make = GeomAPI_Interpolate(places, True, 1e-9)
    make.Perform()
    wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(make.Curve()).Edge()).Wire()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire).Face(), gp_Vec(1, 0, 12)).Shape()


def drilled_bowl():
    """A solid of a revolved ellipse with a hole aside: curves across bent parameters."""
    ellipse = Geom_Ellipse(across(), 9.0, 6.0)
    edge = BRepBuilderAPI_MakeEdge(ellipse, 0.0, math.pi).Edge()
    wire = BRepBuilderAPI_MakeWire(edge)
    wire.Add(BRepBuilderAPI_MakeEdge(gp_Pnt(0, 0, -9), gp_Pnt(0, 0, 9)).Edge())
    body = BRepPrimAPI_MakeRevol(BRepBuilderAPI_MakeFace(wire.Wire()).Face(), AXIS).Shape()
    hole = BRepPrimAPI_MakeCylinder(
        gp_Ax2(gp_Pnt(2.5, 0.5, -20), gp_Dir(0, 0.1, 1)), 1.5, 40.0
    ).Shape()
    return BRepAlgoAPI_Cut(body, hole).Shape()


# Kinds that files of them have faces of, and what makes them.
SHAPES = {
    "filleted box": filleted_box,
    "drilled cylinder": drilled_cylinder,
    "cone": lambda: BRepPrimAPI_MakeCone(6.0, 0.0, 9.0).Shape(),
    "two nappes": two_nappes,
    "sphere": lambda: BRepPrimAPI_MakeSphere(7.0).Shape(),
    "ball segment": lambda: BRepPrimAPI_MakeSphere(7.0, -0.5, 1.0, 4.0).Shape(),
    "torus": lambda: BRepPrimAPI_MakeTorus(9.0, 3.0).Shape(),
    "spindle, outside": lambda: spindle(-1.5, 1.8),
    "spindle, both sheets": lambda: spindle(-2.9, 3.0),
    "revolved spline": lambda: revolved(vase(), 0.2, 1.9),
    "revolved arc": lambda: revolved(Geom_Circle(across(1.0), 5.0), 0.4, 2.4),
    "revolved ring": lambda: revolved(
        Geom_Circle(gp_Ax2(gp_Pnt(8, 0, 2), gp_Dir(0, -1, 0), gp_Dir(0.6, 0, 0.8)), 3.0), 0.5, 5.5
    ),
    "revolved ellipse": lambda: revolved(Geom_Ellipse(across(), 8.0, 5.0), 0.3, 2.8),
    "revolved parabola": lambda: revolved(
        Geom_Parabola(gp_Ax2(gp_Pnt(5, 0, 0), gp_Dir(0, -1, 0), gp_Dir(1, 0, 0)), 2.0), -3.0, 4.0
    ),
    "revolved hyperbola": lambda: revolved(
        Geom_Hyperbola(gp_Ax2(O, gp_Dir(0, -1, 0), gp_Dir(1, 0, 0)), 3.0, 4.0), -1.2, 1.5
    ),
    "extruded spline": lambda: extruded(
        spline_curve([(0, 0, 0), (3, 5, 0), (7, -4, 1), (11, 3, 0), (14, 0, 2)]), 0.1, 1.3
    ),
    "extruded Bezier": lambda: extruded(
        Geom_BezierCurve(_points([(0, 0, 0), (3, 8, 0), (9, -8, 0), (12, 1, 0)])), 0.0, 1.0
    ),
    "extruded circle": lambda: extruded(Geom_Circle(gp_Ax2(O, Z), 5.0), 1.0, 5.9),
    "extruded ellipse": lambda: extruded(Geom_Ellipse(gp_Ax2(O, Z), 7.0, 4.0), -1.0, 2.5),
    "extruded hyperbola": lambda: extruded(Geom_Hyperbola(gp_Ax2(O, Z), 3.0, 4.0), -1.0, 1.3),
    "Bezier": lambda: BRepBuilderAPI_MakeFace(Geom_BezierSurface(wavy_net()), 1e-9).Face(),
    "Bezier without edges": lambda: bare(Geom_BezierSurface(wavy_net())),
    "ball without edges": lambda: bare(Geom_SphericalSurface(gp_Ax3(O, Z), 7.0)),
    "lobed prism": lobed_prism,
    "drilled wave": drilled_wave,
    "drilled bowl": drilled_bowl,
}


def bare(surface):
    """A face that is stored without edges: its border is that of the surface."""
    face = TopoDS_Face()
    BRep_Builder().MakeFace(face, surface, 1e-9)
    return face


def offset_face(distance=0.5):
    """An offset surface, which has no exact form."""
    return _face(Geom_OffsetSurface(Geom_BezierSurface(wavy_net()), distance), 0.0, 1.0, 0.0, 1.0)


def moved(shape, matrix):
    """Return a copy of a shape, moved by the upper rows of a 4 x 4 matrix: a similarity."""
    place = gp_Trsf()
    place.SetValues(*(float(x) for row in matrix[:3] for x in row))
    return BRepBuilderAPI_Transform(shape, place, True).Shape()


def write(shape, path, unit="MM", mode=1):
    """Write a shape as STEP, IGES or BREP."""
    kind = path.suffix.lower()
    if kind in (".step", ".stp"):
        from OCP.Interface import Interface_Static
        from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

        writer = STEPControl_Writer()
        Interface_Static.SetCVal_s("write.step.unit", unit)
        writer.Transfer(shape, STEPControl_AsIs)
        writer.Write(str(path))
        Interface_Static.SetCVal_s("write.step.unit", "MM")
    elif kind in (".iges", ".igs"):
        from OCP.IGESControl import IGESControl_Controller, IGESControl_Writer

        IGESControl_Controller.Init_s()
        writer = IGESControl_Writer(unit, mode)
        writer.AddShape(shape)
        writer.ComputeModel()
        writer.Write(str(path))
    else:
        from OCP.BRepTools import BRepTools

        BRepTools.Write_s(shape, str(path))
    return path


def first_hits(shape, origins, directions):
    """Return t of the first hits by OpenCASCADE, inf where there is none."""
    import numpy as np
    from OCP.gp import gp_Lin
    from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector

    meet = IntCurvesFace_ShapeIntersector()
    meet.Load(shape, 1e-9)
    t = np.full(len(origins), np.inf)
    for k, (o, d) in enumerate(zip(origins.tolist(), directions.tolist(), strict=True)):
        meet.PerformNearest(gp_Lin(gp_Pnt(*o), gp_Dir(*d)), 0.0, 1e100)
        if meet.NbPnt():
            t[k] = meet.WParameter(1)
    return t


def compound(shapes):
    """Return shapes as one."""
    whole, build = TopoDS_Compound(), BRep_Builder()
    build.MakeCompound(whole)
    for shape in shapes:
        build.Add(whole, shape)
    return whole


def placed(shape, matrix):
    """Return the same shape at another place, which may be mirrored: not a copy."""
    from OCP.TopLoc import TopLoc_Location

    place = gp_Trsf()
    place.SetValues(*(float(x) for row in matrix[:3] for x in row))
    return shape.Moved(TopLoc_Location(place), False)


def write_assembly(parts, path, unit="MM"):
    """Write shapes as a STEP assembly: parts are (shape, name, colour, [(name, matrix)])."""
    from OCP.Interface import Interface_Static
    from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor
    from OCP.STEPCAFControl import STEPCAFControl_Writer
    from OCP.TCollection import TCollection_ExtendedString as Text
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopLoc import TopLoc_Location
    from OCP.XCAFApp import XCAFApp_Application
    from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

    document = TDocStd_Document(Text("BinXCAF"))
    XCAFApp_Application.GetApplication_s().NewDocument(Text("BinXCAF"), document)
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colors = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    top = shapes.NewShape()
    TDataStd_Name.Set_s(top, Text("machine"))
    for shape, name, color, places in parts:
        label = shapes.AddShape(shape, False)
        TDataStd_Name.Set_s(label, Text(name))
        rgb = Quantity_Color(*color, Quantity_TypeOfColor.Quantity_TOC_RGB)
        colors.SetColor(label, rgb, XCAFDoc_ColorType.XCAFDoc_ColorSurf)
        for instance, matrix in places:
            place = gp_Trsf()
            place.SetValues(*(float(x) for row in matrix[:3] for x in row))
            component = shapes.AddComponent(top, label, TopLoc_Location(place))
            TDataStd_Name.Set_s(component, Text(instance))
    shapes.UpdateAssemblies()
    writer = STEPCAFControl_Writer()
    Interface_Static.SetCVal_s("write.step.unit", unit)
    writer.Transfer(document)
    writer.Write(str(path))
    Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def triangles(places, sides):
    """Return a face that is given by triangles only."""
    from OCP.Poly import Poly_Triangle, Poly_Triangulation

    mesh = Poly_Triangulation(len(places), len(sides), False)
    for k, place in enumerate(places):
        mesh.SetNode(k + 1, gp_Pnt(*map(float, place)))
    for k, side in enumerate(sides):
        mesh.SetTriangle(k + 1, Poly_Triangle(*(i + 1 for i in side)))
    face = TopoDS_Face()
    BRep_Builder().MakeFace(face, mesh)
    return face
