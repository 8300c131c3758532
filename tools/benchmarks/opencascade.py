"""First hits by OpenCASCADE, to compare speeds with.

``IntCurvesFace_Intersector`` meets a line with a face numerically, to a tolerance, and without a proof that
it found every root. Needs cadquery-ocp-novtk, which the extra ``dev`` brings.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
)
from OCP.BRepLib import BRepLib
from OCP.collections import (
    Array1_double,
    Array1_gp_Pnt2d,
    Array1_int,
    Array2_double,
    Array2_gp_Pnt,
)
from OCP.Geom import Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BezierCurve
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Pnt2d
from OCP.IntCurvesFace import IntCurvesFace_Intersector

from hybrid_rt.core.records import FloatArray
from meshing import Curve2, NurbsSurface, TrimmedSurface

# Roots are wanted as exactly as it gives them.
TOLERANCE = 1e-12
FARTHEST = 1e100


def first_hits(
    surface: NurbsSurface | TrimmedSurface, origins: FloatArray, directions: FloatArray
) -> FloatArray:
    """Return t (n,) of the first hits along unit directions, inf where there is none.

    Knot vectors are clamped. Of a trimmed surface the first loop is the outline, the others are holes.
    """
    meet = IntCurvesFace_Intersector(_as_face(surface), TOLERANCE)
    t = np.full(len(origins), np.inf)
    # It looks at one ray at a time.
    rays = zip(origins.tolist(), directions.tolist(), strict=True)
    for i, (origin, direction) in enumerate(rays):
        meet.Perform(gp_Lin(gp_Pnt(*origin), gp_Dir(*direction)), 0.0, FARTHEST)
        found = [meet.WParameter(k) for k in range(1, meet.NbPnt() + 1)]
        t[i] = min(found, default=np.inf)
    return t


def _as_face(surface: NurbsSurface | TrimmedSurface) -> Any:
    """Return a NURBS surface, whole or trimmed, as a ``TopoDS_Face``."""
    trimmed = surface if isinstance(surface, TrimmedSurface) else None
    geometry = _as_geometry(surface if trimmed is None else trimmed.surface)
    if trimmed is None:
        return BRepBuilderAPI_MakeFace(geometry, TOLERANCE).Face()
    domain = np.array(geometry.Bounds()).reshape(2, 2)
    wires = [
        _as_wire(geometry, loop, domain, is_hole=k > 0) for k, loop in enumerate(trimmed.loops)
    ]
    face = BRepBuilderAPI_MakeFace(geometry, wires[0], True)
    for wire in wires[1:]:
        face.Add(wire)
    BRepLib.BuildCurves3d_s(face.Face())
    return face.Face()


def _as_geometry(surface: Any) -> Any:
    p, q = surface.control.shape[:2]
    points, weights = Array2_gp_Pnt(1, p, 1, q), Array2_double(1, p, 1, q)
    w = np.ones((p, q)) if surface.weights is None else surface.weights
    for i in range(p):
        for j in range(q):
            points.SetValue(i + 1, j + 1, gp_Pnt(*surface.control[i, j].tolist()))
            weights.SetValue(i + 1, j + 1, float(w[i, j]))
    (knots_u, counts_u), (knots_v, counts_v) = (
        np.unique(knots, return_counts=True) for knots in surface.knots
    )
    return Geom_BSplineSurface(
        points, weights, _reals(knots_u), _reals(knots_v), _wholes(counts_u), _wholes(counts_v),
        *surface.degree,
    )  # fmt: skip


def _as_wire(geometry: Any, loop: Sequence[Curve2], domain: FloatArray, *, is_hole: bool) -> Any:
    """Return a loop as a wire: counterclockwise in (u, v), and clockwise around a hole."""
    corners = np.array([arc.control[0] for arc in loop])
    x, y = (corners - corners.mean(axis=0)).T
    is_clockwise = bool((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() < 0.0)
    wire = BRepBuilderAPI_MakeWire()
    arcs = [(arc.control, arc.weights) for arc in loop]
    if is_clockwise != is_hole:
        arcs = [(uv[::-1], None if w is None else w[::-1]) for uv, w in reversed(arcs)]
    for uv, w in arcs:
        places = domain[:, 0] + uv * np.diff(domain, axis=1).T
        points = Array1_gp_Pnt2d(1, len(places))
        for k, place in enumerate(places.tolist()):
            points.SetValue(k + 1, gp_Pnt2d(*place))
        weighted = (points,) if w is None else (points, _reals(w))
        wire.Add(BRepBuilderAPI_MakeEdge(Geom2d_BezierCurve(*weighted), geometry).Edge())
    return wire.Wire()


def _reals(values: FloatArray) -> Any:
    return _listed(Array1_double(1, len(values)), values)


def _wholes(values: NDArray[np.int64]) -> Any:
    return _listed(Array1_int(1, len(values)), values)


def _listed(array: Any, values: NDArray[Any]) -> Any:
    for k, value in enumerate(values.tolist()):
        array.SetValue(k + 1, value)
    return array
