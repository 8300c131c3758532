"""Surfaces and their certified tessellation.

`BezierPatches`, `NurbsSurface` and `SurfaceOfRevolution` are surfaces over (u, v) in [0, 1] x [0,
1]. `Cylinder`, `Cone` and `circular_arc` make common turned surfaces, `Extrusion` makes swept ones,
and `TrimmedSurface` cuts a surface along curves. `tessellate` turns a surface into a
`CertifiedMesh` that stays within a proven distance of it. Names are imported on first use: ``import
meshing`` alone compiles and loads nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshing.bezier import BezierPatches
    from meshing.certified_mesh import CertifiedMesh
    from meshing.curve2 import Curve2, bspline, circle, polygon
    from meshing.extrusion import Extrusion
    from meshing.nurbs import NurbsSurface
    from meshing.revolution import SurfaceOfRevolution
    from meshing.sheet import PatchSheet
    from meshing.tessellation import tessellate
    from meshing.trimmed import TrimmedSurface
    from meshing.turned_shapes import Cone, Cylinder, circular_arc

__all__ = [
    "BezierPatches",
    "CertifiedMesh",
    "Cone",
    "Curve2",
    "Cylinder",
    "Extrusion",
    "NurbsSurface",
    "PatchSheet",
    "SurfaceOfRevolution",
    "TrimmedSurface",
    "bspline",
    "circle",
    "circular_arc",
    "polygon",
    "tessellate",
]

_HOME = {
    "BezierPatches": "meshing.bezier",
    "CertifiedMesh": "meshing.certified_mesh",
    "Curve2": "meshing.curve2",
    "NurbsSurface": "meshing.nurbs",
    "PatchSheet": "meshing.sheet",
    "Cone": "meshing.turned_shapes",
    "Cylinder": "meshing.turned_shapes",
    "Extrusion": "meshing.extrusion",
    "SurfaceOfRevolution": "meshing.revolution",
    "circular_arc": "meshing.turned_shapes",
    "TrimmedSurface": "meshing.trimmed",
    "bspline": "meshing.curve2",
    "circle": "meshing.curve2",
    "polygon": "meshing.curve2",
    "tessellate": "meshing.tessellation",
}


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'meshing' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
