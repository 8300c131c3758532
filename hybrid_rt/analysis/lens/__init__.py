"""Lenses given by a prescription: their surfaces, the light that passes them in order, their focus.

Distances and heights are in the unit of the prescription. Light travels along the z axis, and the
first vertex is at z = 0.
"""

from hybrid_rt.analysis.lens.lens import Focus, Lens
from hybrid_rt.analysis.lens.prescription import LensSurface
from hybrid_rt.analysis.lens.traced import Fate, Traced

__all__ = ["Fate", "Focus", "Lens", "LensSurface", "Traced"]
