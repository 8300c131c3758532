"""Surfaces at other places, as the judges can take them."""

from __future__ import annotations

from typing import Any

from hybrid_rt.core.records import FloatArray
from meshing import SurfaceOfRevolution, TrimmedSurface


def placed(surface: Any, matrix: FloatArray) -> Any:
    """Return an image of which all numbers are floats.

    Judges of turned surfaces take origin and axis from floats, so those of the image are rounded, and
    the result is what was given. Judges of patches know what rounding left of control points.
    """
    return _rounded(surface.transformed(matrix))


def _rounded(surface: Any) -> Any:
    if isinstance(surface, SurfaceOfRevolution):
        return surface.rounded()
    if isinstance(surface, TrimmedSurface):
        return TrimmedSurface(_rounded(surface.surface), surface.loops, surface.gap)
    return surface
