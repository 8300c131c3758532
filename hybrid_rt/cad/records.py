"""What the process that reads CAD files hands over: plain arrays, and the words for what is in them."""

from __future__ import annotations

import numpy as np

# Points of each use of an edge, at even steps of the parameter that both of its faces share.
SAMPLES = 33
# Kinds of faces, in the order of their numbers.
KINDS = (
    "plane", "cylinder", "cone", "sphere", "torus", "revolution", "extrusion", "bezier", "bspline",
    "offset", "other", "mesh",
)  # fmt: skip
# How a profile, or a curve, runs with its parameter: as a spline, or by cos and sin (cosh and sinh) of it.
SPLINE, ELLIPSE, HYPERBOLA = 0, 1, 2
FACE = np.dtype([
    ("shape", "i4"), ("kind", "u1"), ("reversed", "?"), ("color", "f8", 3), ("bound", "f8"),
    ("size", "i8", 8), ("at", "i8"), ("reason", "U80"),
])  # fmt: skip
USE = np.dtype([
    ("face", "i4"), ("wire", "i4"), ("edge", "i4"), ("degenerated", "?"), ("reversed", "?"),
    ("tolerance", "f8"), ("corner", "f8"), ("degree", "i4"), ("points", "i4"), ("rational", "?"), ("at", "i8"),
])  # fmt: skip
# Names that OpenCASCADE makes up.
INVENTED = ("SOLID", "COMPOUND", "SHELL", "FACE", "COMPSOLID", "ASSEMBLY", "")
MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4, "ft": 304.8, "um": 1e-3, "km": 1e6}
NAMES_OF_UNITS = {
    "millimetre": "mm", "centimetre": "cm", "metre": "m", "inch": "inch", "foot": "ft",
    "micrometre": "um", "kilometre": "km", "millimeter": "mm", "meter": "m", "mm": "mm", "m": "m",
    "in": "inch", "cm": "cm", "ft": "ft", "um": "um", "km": "km",
}  # fmt: skip
