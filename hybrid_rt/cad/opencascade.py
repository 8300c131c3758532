"""CAD files to plain arrays by OpenCASCADE. A program of its own: it may crash, and harms nobody.

All names of OCP stand here, as they change with each major version; `hybrid_rt.cad.process` runs `main`.
What is written: a head (JSON), faces, uses of edges by faces, with their curves in the face's own (u, v),
and samples of these.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_Sewing
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.collections import IndexedMap_TopoDS_Shape_TopTools_ShapeMapHasher as Map
from OCP.collections import Sequence_TCollection_AsciiString as Names
from OCP.collections import Sequence_TDF_Label
from OCP.Geom import Geom_RectangularTrimmedSurface, Geom_TrimmedCurve
from OCP.Geom2d import Geom2d_TrimmedCurve
from OCP.Geom2dConvert import Geom2dConvert
from OCP.GeomAbs import GeomAbs_C1
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.GeomConvert import GeomConvert, GeomConvert_ApproxSurface
from OCP.gp import gp_Trsf
from OCP.IFSelect import IFSelect_RetDone
from OCP.IGESCAFControl import IGESCAFControl_Reader
from OCP.Message import Message
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_Orientation as Way
from OCP.TopAbs import TopAbs_ShapeEnum as Kind
from OCP.TopAbs import TopAbs_State as State
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Iterator, TopoDS_Shape, TopoDS_Solid
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool

from hybrid_rt.cad import records
from hybrid_rt.cad.records import ELLIPSE, FACE, HYPERBOLA, KINDS, MM, SAMPLES, SPLINE, USE

# Where parts of curves are compared with the whole. OpenCASCADE moves their ends to knots nearby (6e-7 was
# seen); wrong ones are off by their size.
CHECKS, WRONG = (0.03, 0.31, 0.52, 0.77, 0.99), 1e-5
# A border of a surface that is no longer than this is a point.
LEAST_BORDER = 1e-7
# Kinds of surfaces, with the methods that tell the sizes of elementary ones ("": none), and of conics.
SURFACES: dict[str, tuple[str, ...]] = {
    "Geom_Plane": ("plane", "", ""),
    "Geom_CylindricalSurface": ("cylinder", "Radius", ""),
    "Geom_ConicalSurface": ("cone", "RefRadius", "SemiAngle"),
    "Geom_SphericalSurface": ("sphere", "", "Radius"),  # a torus about a point
    "Geom_ToroidalSurface": ("torus", "MajorRadius", "MinorRadius"),
    "Geom_SurfaceOfRevolution": ("revolution",),
    "Geom_SurfaceOfLinearExtrusion": ("extrusion",),
    "Geom_BezierSurface": ("bezier",),
    "Geom_BSplineSurface": ("bspline",),
}
# What stands between separators of numbers and is none that a float holds; and texts, with what is in them.
_NO_NUMBER = re.compile(
    rb"[(,\s]([-+]?(?:nan|inf|infinity|\d+\.?\d*e\+?[3-9]\d\d+))(?=[),;\s])", re.IGNORECASE
)
_QUOTED = re.compile(rb"'[^']*'|/\*.*?\*/", re.DOTALL)
CONICS = {
    "Circle": (ELLIPSE, "Radius", "Radius"),
    "Ellipse": (ELLIPSE, "MajorRadius", "MinorRadius"),
    "Hyperbola": (HYPERBOLA, "MajorRadius", "MinorRadius"),
}


class RefusedFileError(Exception):
    """The file is not taken; the message says why."""


def read(path: str, asked: str) -> tuple[Any, str, float]:
    """Return the XCAF document of a file, the unit of its lengths, and by what they are to be multiplied."""
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    form = TCollection_ExtendedString("BinXCAF")
    document = TDocStd_Document(form)
    XCAFApp_Application.GetApplication_s().NewDocument(form, document)
    kind = Path(path).suffix.lower()
    if kind == ".brep":
        _read_brep(path, document)
        unit = "mm" if asked == "file" else asked  # it names none
        return document, unit, 1.0 / MM[unit]
    is_step = kind in (".stp", ".step")
    reader = STEPCAFControl_Reader() if is_step else IGESCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    if reader.ReadFile(path) != IFSelect_RetDone:
        raise RefusedFileError(f"holds no {'STEP' if is_step else 'IGES'} data that can be read")
    unit = _unit_of(reader, is_step=is_step) if asked == "file" else asked
    if is_step:
        # In metres; the transfer asks the document.
        XCAFDoc_DocumentTool.SetLengthUnit_s(document, 1e-3 * MM[unit])
    if not reader.Transfer(document):
        raise RefusedFileError("holds nothing that OpenCASCADE makes a shape of")
    return document, unit, 1.0 if is_step else 1.0 / MM[unit]


def _unit_of(reader: Any, *, is_step: bool) -> str:
    """Return the unit of length of a file, "mm" where it names none that is known."""
    if is_step:
        lengths, angles, solid = Names(), Names(), Names()
        reader.ChangeReader().FileUnits(lengths, angles, solid)
        name = lengths.Value(1).ToCString().lower() if lengths.Length() else "mm"
    else:
        given = reader.IGESModel().GlobalSection().UnitName()
        name = "mm" if given is None else given.ToCString().lower()
    return records.NAMES_OF_UNITS.get(name, "mm")


def _read_brep(path: str, document: Any) -> None:
    shape = TopoDS_Shape()
    if not BRepTools.Read_s(shape, path, BRep_Builder()) or shape.IsNull():
        raise RefusedFileError("holds no BREP data that can be read")
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).AddShape(shape, True)


class Extraction:
    """Walks the tree of a document and collects its shapes, each once, and where they are placed."""

    def __init__(self, document: Any, sew: float | None, approximate: float | None) -> None:
        self.shape_tool = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
        self.color_tool = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self.sew, self.approximate = sew, approximate
        self.shapes: list[dict[str, Any]] = []
        self.placed: list[dict[str, Any]] = []
        self.faces: list[tuple[Any, ...]] = []
        self.uses: list[tuple[Any, ...]] = []
        self.numbers: list[NDArray[np.float64]] = []
        self.uv: list[Any] = []
        self.xyz: list[Any] = []
        self.wires = self.points = self.n_numbers = self.n_edges = self.solids = 0
        self._shape_of: dict[str, int] = {}

    def run(self, scale: float) -> None:
        """Collect everything."""
        labels, place = Sequence_TDF_Label(), gp_Trsf()
        place.SetScaleFactor(scale)
        self.shape_tool.GetFreeShapes(labels)
        for label in labels:
            self._walk(label, place, [], None)

    def _walk(self, label: Any, place: Any, path: list[str], color: list[float] | None) -> None:
        tool, name = self.shape_tool, _name_of(label)
        color = self._color(label, is_label=True) or color
        if tool.IsReference_s(label):
            target = TDF_Label()
            tool.GetReferredShape_s(label, target)
            moved = place.Multiplied(tool.GetLocation_s(label).Transformation())
            self._walk(target, moved, [*path, name], color)
            return
        if tool.IsAssembly_s(label):
            parts = Sequence_TDF_Label()
            tool.GetComponents_s(label, parts, False)
            for part in parts:
                self._walk(part, place, path, color)
            return
        entry = TCollection_AsciiString()
        TDF_Tool.Entry_s(label, entry)
        key = entry.ToCString()
        if key not in self._shape_of:
            self._shape_of[key] = len(self.shapes)
            self._take(tool.GetShape_s(label), name)
        matrix = [[place.Value(i, j) for j in range(1, 5)] for i in range(1, 4)]
        self.placed.append({
            "shape": self._shape_of[key], "matrix": [*matrix, [0.0, 0.0, 0.0, 1.0]],
            "name": name or next((n for n in reversed(path) if n), ""),
            "instance": "/".join(n for n in path if n), "color": color,
        })  # fmt: skip

    def _color(self, of: Any, *, is_label: bool = False) -> list[float] | None:
        """Return the linear RGB of a label or shape, None if it has none."""
        color, tool = Quantity_Color(), self.color_tool
        for kind in (XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen):
            if (tool.GetColor_s if is_label else tool.GetColor)(of, kind, color):
                return [color.Red(), color.Green(), color.Blue()]
        return None

    def _take(self, shape: Any, name: str) -> None:
        """Collect the faces of a shape, with their edges."""
        if self.sew is not None:
            sewing = BRepBuilderAPI_Sewing(self.sew)
            sewing.Add(shape)
            sewing.Perform()
            shape = sewing.SewedShape()
        number, edges, first = len(self.shapes), Map(), len(self.faces)
        colors: list[tuple[Any, list[float] | None]] = []
        for solid in _found(shape, Kind.TopAbs_SOLID):
            colors += [(face, self._color(solid)) for face in _found(solid, Kind.TopAbs_FACE)]
        in_solids = Map()
        for face, _ in colors:
            in_solids.Add(face)
        colors += [(f, None) for f in _found(shape, Kind.TopAbs_FACE) if not in_solids.Contains(f)]
        flips = _inside_out(shape)
        for face, of_solid in colors:
            color = self._color(face) or of_solid
            self._take_face(face, number, color, edges, flips)
        self.n_edges += edges.Extent()
        self.shapes.append({"name": name, "faces": [first, len(self.faces)]})
        self.solids += sum(1 for _ in _found(shape, Kind.TopAbs_SOLID))
        self.wires += sum(1 for e in _found(shape, Kind.TopAbs_EDGE, Kind.TopAbs_FACE))
        self.points += sum(1 for e in _found(shape, Kind.TopAbs_VERTEX, Kind.TopAbs_EDGE))

    def _take_face(
        self, shape: Any, number: int, color: list[float] | None, edges: Any, flips: Any
    ) -> None:
        face = TopoDS.Face(shape)
        is_reversed = (face.Orientation() == Way.TopAbs_REVERSED) != flips.Contains(face)
        forward = _bordered(TopoDS.Face(face.Oriented(Way.TopAbs_FORWARD)))
        kind, bound, reason, surface = "other", 0.0, "", None
        size: list[int] = []
        numbers: list[Any] = []
        try:
            kind, size, numbers, bound, surface = self._describe(forward)
        except RefusedFileError as error:
            kind, reason = error.args[1] if len(error.args) > 1 else "other", error.args[0]
        except Exception as error:  # noqa: BLE001 (whatever OpenCASCADE raises of this face)
            reason = f"{type(error).__name__}: {error}"[:80]
        self.faces.append((
            number, KINDS.index(kind), is_reversed, color or [np.nan] * 3, bound,
            [*size, *[0] * (8 - len(size))], self._keep(numbers), reason,
        ))  # fmt: skip
        if surface is not None:
            self._take_wires(forward, surface, edges)

    def _keep(self, arrays: list[Any]) -> int:
        """Append numbers; return where they begin."""
        at = self.n_numbers
        for array in arrays:
            flat = np.asarray(array, np.float64).ravel()
            self.numbers.append(flat)
            self.n_numbers += len(flat)
        return at

    def _describe(self, face: Any) -> tuple[str, list[int], list[Any], float, Any]:
        """Return kind, sizes, numbers, bound and surface of a face."""
        surface = BRep_Tool.Surface_s(face)
        if surface is None:
            return "mesh", *_triangles_of(face), 0.0, None
        given = surface
        bound = 0.0
        name = type(surface).__name__
        while name in ("Geom_RectangularTrimmedSurface", "Geom_OffsetSurface"):
            if name == "Geom_RectangularTrimmedSurface":
                surface = surface.BasisSurface()
            elif surface.Surface() is not None:
                surface = surface.Surface()  # as of a plane, a cylinder: exact
            else:
                surface, bound = self._approximated(face, surface)
            name = type(surface).__name__
        kind, *radii = SURFACES.get(name, ("other",))
        if radii:
            sizes = [getattr(surface, radius)() if radius else 0.0 for radius in radii]
            return kind, [], [_frame(surface.Position()), sizes], 0.0, given
        if kind == "bezier":
            # Of its parameters 0 to 1 nothing changes.
            surface = GeomConvert.SurfaceToBSplineSurface_s(surface)
        if kind in ("bezier", "bspline"):
            kind = "offset" if bound else kind
            return kind, *_net_of(surface), bound, given
        if kind == "other":
            raise RefusedFileError(f"its surface is a {name}", "other")
        u, v = _range(face, "U"), _range(face, "V")
        if kind == "revolution":
            axis, along = surface.Axis(), v
            head: list[Any] = [_coordinates(axis.Location()), _coordinates(axis.Direction())]
        else:
            along, head = u, [_coordinates(surface.Direction()), v]
        size, numbers = _profile(surface.BasisCurve(), *along)
        return kind, size, [*head, *numbers], 0.0, given

    def _approximated(self, face: Any, surface: Any) -> tuple[Any, float]:
        """Return a B-spline near an offset surface, and its distance as OpenCASCADE estimates it."""
        if self.approximate is None:
            raise RefusedFileError(
                "an offset surface has no exact form: pass approximate=", "offset"
            )
        u, v = _range(face, "U"), _range(face, "V")
        part = Geom_RectangularTrimmedSurface(surface, *u, *v)
        near = GeomConvert_ApproxSurface(
            part, 0.5 * self.approximate, GeomAbs_C1, GeomAbs_C1, 14, 14, 400, 0
        )
        if not near.IsDone() or near.MaxError() > self.approximate:
            raise RefusedFileError(
                f"the offset surface is not approximated within {self.approximate:g}", "offset"
            )
        return near.Surface(), max(near.MaxError(), 1e-300)

    def _take_wires(self, face: Any, surface: Any, edges: Any) -> None:
        at, number = GeomAdaptor_Surface(surface), len(self.faces) - 1
        for n, wire in enumerate(_stored(face, Kind.TopAbs_WIRE)):
            for edge in _in_order(TopoDS.Wire(wire), face):
                curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
                first, last = BRep_Tool.Range_s(edge, face)
                is_back = edge.Orientation() == Way.TopAbs_REVERSED
                try:
                    degree, points, weights, knots = _curve2(curve, first, last, is_back)
                except RefusedFileError as error:
                    *row, before = self.faces[-1]
                    self.faces[-1] = (*row, before or error.args[0])
                    continue
                self.uses.append((
                    number, n, edges.Add(edge) + self.n_edges - 1, BRep_Tool.Degenerated_s(edge),
                    is_back, BRep_Tool.Tolerance_s(edge), _corner(edge), degree, len(points),
                    len(weights) > 0, self._keep([points, weights, knots]),
                ))  # fmt: skip
                uv = [
                    _coordinates(curve.Value(t)) for t in np.linspace(first, last, SAMPLES).tolist()
                ]
                self.uv.append(uv)
                self.xyz.append([_coordinates(at.Value(*place)) for place in uv])

    def save(self, out: str, unit: str, solids: int) -> None:
        """Write all of it; the file speaks of so many solids."""
        head = {
            "unit": unit, "mm": MM[unit], "shapes": self.shapes, "placed": self.placed,
            "wires": self.wires, "points": self.points, "open_solids": max(solids - self.solids, 0),
        }  # fmt: skip
        np.savez(
            out,
            head=np.frombuffer(json.dumps(head).encode(), np.uint8),
            faces=np.array(self.faces, FACE),
            uses=np.array(self.uses, USE),
            numbers=np.concatenate([np.empty(0), *self.numbers]),
            uv=np.array(self.uv, np.float64).reshape(-1, SAMPLES, 2),
            xyz=np.array(self.xyz, np.float64).reshape(-1, SAMPLES, 3),
        )


def _each(more: Any, current: str = "Current") -> Iterator[Any]:
    """Yield what an iterator of OpenCASCADE comes to."""
    while more.More():
        yield getattr(more, current)()
        more.Next()


def _found(shape: Any, *kinds: Any) -> Iterator[Any]:
    """Yield the parts of one kind of a shape, but not those in parts of another."""
    return _each(TopExp_Explorer(shape, *kinds))


def _stored(shape: Any, kind: Any) -> Iterator[Any]:
    """Yield the immediate parts of one kind."""
    return (part for part in _each(TopoDS_Iterator(shape), "Value") if part.ShapeType() == kind)


def _bordered(face: Any) -> Any:
    """Return a face with edges along the border of its surface where it is stored without any."""
    surface = BRep_Tool.Surface_s(face)
    if surface is None or any(_stored(face, Kind.TopAbs_WIRE)):
        return face
    made = BRepBuilderAPI_MakeFace(surface, LEAST_BORDER)
    return TopoDS.Face(made.Face().Oriented(Way.TopAbs_FORWARD)) if made.IsDone() else face


def _in_order(wire: Any, face: Any) -> list[Any]:
    """Return the edges of a wire as it runs; as they are stored where the explorer loses some."""
    found = list(_each(BRepTools_WireExplorer(wire, face)))
    every = [
        TopoDS.Edge(edge) for edge in _stored(wire, Kind.TopAbs_EDGE)
        if edge.Orientation() not in (Way.TopAbs_INTERNAL, Way.TopAbs_EXTERNAL)
    ]  # fmt: skip
    return found if len(found) == len(every) else every


def _inside_out(shape: Any) -> Any:
    """Return the faces of closed bodies whose normals point inward."""
    found = Map()
    bodies = list(_found(shape, Kind.TopAbs_SOLID))
    for shell in _found(shape, Kind.TopAbs_SHELL, Kind.TopAbs_SOLID):
        if BRep_Tool.IsClosed_s(shell):
            solid = TopoDS_Solid()
            BRep_Builder().MakeSolid(solid)
            BRep_Builder().Add(solid, shell)
            bodies.append(solid)
    for body in bodies:
        if not all(BRep_Tool.IsClosed_s(shell) for shell in _found(body, Kind.TopAbs_SHELL)):
            continue
        test = BRepClass3d_SolidClassifier(body)
        test.PerformInfinitePoint(1e-6)
        if test.State() == State.TopAbs_IN:
            for face in _found(body, Kind.TopAbs_FACE):
                found.Add(face)
    return found


def _corner(edge: Any) -> float:
    """Return how far, by the file, the ends of an edge may be from where others go on."""
    return max(
        (BRep_Tool.Tolerance_s(TopoDS.Vertex(v)) for v in _found(edge, Kind.TopAbs_VERTEX)),
        default=0.0,
    )


def _name_of(label: Any) -> str:
    identity = TDataStd_Name.GetID_s()
    if not label.IsAttribute(identity):
        return ""
    name = TDataStd_Name()
    label.FindAttribute(identity, name)
    text = name.Get().ToExtString()
    return "" if text.upper() in records.INVENTED or text.startswith("=>[") else text


def _coordinates(point: Any) -> Any:
    """Return the two or three coordinates of a point or direction."""
    return point.Coord()


def _frame(place: Any) -> list[tuple[float, ...]]:
    parts = place.Location(), place.XDirection(), place.YDirection(), place.Direction()
    return [_coordinates(part) for part in parts]


def _range(face: Any, way: str) -> list[float]:
    """Return where the trimmed part of a face begins and ends in "U", or in "V"."""
    at = BRepAdaptor_Surface(face, True)
    return [getattr(at, f"{end}{way}Parameter")() for end in ("First", "Last")]


def _net_of(spline: Any) -> tuple[list[int], list[Any]]:
    """Return sizes and numbers of a B-spline surface: points, weights if it has any, both knot vectors."""
    if spline.IsUPeriodic():
        spline.SetUNotPeriodic()
    if spline.IsVPeriodic():
        spline.SetVNotPeriodic()
    n, m = spline.NbUPoles(), spline.NbVPoles()
    poles = spline.Poles()
    at = [(i, j) for i in range(1, n + 1) for j in range(1, m + 1)]
    is_rational = spline.IsURational() or spline.IsVRational()
    return [spline.UDegree(), spline.VDegree(), n, m, int(is_rational)], [
        [_coordinates(poles.Value(*k)) for k in at],
        [spline.Weight(*k) for k in at] if is_rational else [],
        list(spline.UKnotSequence()), list(spline.VKnotSequence()),
    ]  # fmt: skip


def _poles(spline: Any) -> tuple[int, list[Any], list[float], list[float]]:
    """Return degree, points, weights (none, if all are 1) and knots of a B-spline curve."""
    each = range(1, spline.NbPoles() + 1)
    weights = [spline.Weight(k) for k in each] if spline.IsRational() else []
    points = [_coordinates(spline.Pole(k)) for k in each]
    return spline.Degree(), points, weights, list(spline.KnotSequence())


def _profile(curve: Any, first: float, last: float) -> tuple[list[int], list[Any]]:
    """Return sizes and numbers of a curve in space: first, last, then a frame and radii, or a spline."""
    while type(curve).__name__ == "Geom_TrimmedCurve":
        curve = curve.BasisCurve()
    name = type(curve).__name__.removeprefix("Geom_")
    if name in CONICS:
        form, *radii = CONICS[name]
        radii = [getattr(curve, radius)() for radius in radii]
        return [form], [[first, last], _frame(curve.Position()), radii]
    if name not in ("Line", "Parabola", "BezierCurve", "BSplineCurve"):
        raise RefusedFileError(f"its profile is a {name}", "other")
    part = Geom_TrimmedCurve(curve, first, last) if name in ("Line", "Parabola") else curve
    spline = GeomConvert.CurveToBSplineCurve_s(part)
    if spline.IsPeriodic():
        spline.SetNotPeriodic()
    degree, points, weights, knots = _poles(spline)
    return [SPLINE, degree, len(points), len(weights) > 0], [[first, last], points, weights, knots]


def _curve2(
    curve: Any, first: float, last: float, is_back: bool
) -> tuple[int, list[Any], list[float], list[float]]:
    """Return degree, points, weights and knots of a curve of an edge, in the order in which its wire runs."""
    if curve is None:
        raise RefusedFileError("an edge has no curve in the (u, v) of the face")
    while type(curve).__name__ == "Geom2d_TrimmedCurve":
        curve = curve.BasisCurve()
    if type(curve).__name__ == "Geom2d_Line":
        ends = (last, first) if is_back else (first, last)
        return 1, [_coordinates(curve.Value(t)) for t in ends], [], [0.0, 0.0, 1.0, 1.0]
    spline = _spline2(curve, first, last)
    if is_back:
        spline.Reverse()
    begin = curve.Value(last if is_back else first)
    if _is_off(spline.Pole(1), begin):
        raise RefusedFileError("a curve of an edge does not begin at its first control point")
    return _poles(spline)


def _is_off(point: Any, right: Any) -> bool:
    return bool(point.Distance(right) > WRONG * max(1.0, *map(abs, right.Coord())))


def _spline2(curve: Any, first: float, last: float) -> Any:
    """Return part of a curve as a B-spline; of a spline the parameter stays, and is asked whether it has."""
    is_spline = type(curve).__name__ == "Geom2d_BSplineCurve"
    spline: Any = curve.Copy() if is_spline else None
    if is_spline and spline.IsPeriodic():
        # Parts of periodic ones come out wrong.
        spline.SetNotPeriodic()
    if is_spline and spline.FirstParameter() <= first and last <= spline.LastParameter():
        spline.Segment(first, last)  # with ends that are control points
    else:
        spline = Geom2dConvert.CurveToBSplineCurve_s(Geom2d_TrimmedCurve(curve, first, last))
        if spline.IsPeriodic():
            spline.SetNotPeriodic()
    for share in CHECKS if is_spline else ():
        t = first + share * (last - first)
        if _is_off(spline.Value(t), curve.Value(t)):
            raise RefusedFileError("OpenCASCADE cuts a curve of an edge wrongly")
    return spline


def _triangles_of(face: Any) -> tuple[list[int], list[Any]]:
    """Return counts, corners and indices of a face that is given by triangles only."""
    place = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, place)
    if mesh is None:
        raise RefusedFileError("it has neither a surface nor triangles", "other")
    moved = place.Transformation()
    points = [_coordinates(mesh.Node(k).Transformed(moved)) for k in range(1, mesh.NbNodes() + 1)]
    sides = [
        [mesh.Triangle(k).Value(i) - 1 for i in (1, 2, 3)] for k in range(1, mesh.NbTriangles() + 1)
    ]
    return [len(points), len(sides)], [points, sides]


def _solids_named(path: str) -> int:
    """Return how many solids a STEP file speaks of; those that are not closed come as shells."""
    if not path.lower().endswith((".stp", ".step")):
        return 0
    return len(
        re.findall(rb"=\s*(?:MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS)\s*\(", Path(path).read_bytes())
    )


def _refuse_no_numbers(path: str) -> None:
    """Refuse NAN and INF where numbers stand, and numbers too large: OpenCASCADE may never end at these."""
    if path.lower().endswith((".igs", ".iges")):
        return  # texts in them are not marked
    content = Path(path).read_bytes()
    if _NO_NUMBER.search(content) and (found := _NO_NUMBER.search(_QUOTED.sub(b"", content))):
        raise RefusedFileError(f"holds {found[1].decode()!r} where a number is expected: repair it")


def main(path: str, out: str, options: str) -> int:
    """Read a file, write arrays; return the exit code: 4 with a reason on the standard output."""
    wanted = json.loads(options)
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (wanted["bytes"], wanted["bytes"]))
        # Who waits for this process may end before it.
        resource.setrlimit(resource.RLIMIT_CPU, (wanted["seconds"] + 1, wanted["seconds"] + 2))
    try:
        _refuse_no_numbers(path)
        document, unit, scale = read(path, wanted["unit"])
        found = Extraction(document, wanted["sew"], wanted["approximate"])
        found.run(scale)
        if not found.faces:
            raise RefusedFileError(
                f"holds no faces ({found.wires} wires, {found.points} points outside faces)"
            )
        found.save(out, unit, _solids_named(path))
    except RefusedFileError as error:
        reason = error.args[0]
    except MemoryError:
        reason = "needs more memory to read than gigabytes= allows"
    else:
        return 0
    sys.stdout.write(f"\n{reason}")  # OpenCASCADE may have said something before
    return 4
