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

_HOMES = {
    "bezier": ("BezierPatches",),
    "certified_mesh": ("CertifiedMesh",),
    "curve2": ("Curve2", "bspline", "circle", "polygon"),
    "extrusion": ("Extrusion",),
    "nurbs": ("NurbsSurface",),
    "revolution": ("SurfaceOfRevolution",),
    "sheet": ("PatchSheet",),
    "tessellation": ("tessellate",),
    "trimmed": ("TrimmedSurface",),
    "turned_shapes": ("Cone", "Cylinder", "circular_arc"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'meshing' has no attribute {name!r}")
    value = getattr(import_module(f"meshing.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
