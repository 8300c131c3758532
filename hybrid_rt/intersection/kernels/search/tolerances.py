"""Rounding, and the limits of every search: constants that more than one kind of surface uses.

What a kernel alone uses stands in that kernel. The sums of roundings that these constants enter are
those of ``docs/rounding_patches.md`` and ``docs/rounding_turned.md``.
"""

UNIT_ROUNDOFF = 2.0**-53
# A root decided by less than this many eps x scale is reported as TANGENT.
TANGENT_BAND = 64 * 2.0**-52

# --- Newton
# It squares the error: from 1e-1 of a cell five steps reach rounding; silhouettes need more.
MAX_STEPS = 12
# Steps that bring a point of a piece beside the ray: the first leaves the square of its size.
APPROACHES = 3

# --- bisection
# Pieces examined for one ray and cell before the search admits defeat (counted and flagged).
MAX_PIECES = 4096
# 100 halvings take any cell to the last digit; one sibling waits at each.
DEPTH = 128

# --- neighbours
# Neighbouring pieces both keep a root that lies within this (relative) of their common border, or
# within so many roundings: one for each of their two roots, and as much for what Newton leaves.
BORDER_SLACK = 1e-9
OWNED = 4.0

# --- slopes
# A ray that meets the limit normal of a collapsed edge at more than this crosses the surface.
CLEAR_CROSSING = 1e-3
# Below this slope curvature, not slope, ends a contact: the root of the rounding.
FLATTEST = 2.0**-27
# Bounds of roots that are no touch are below this part of the size.
NEAR_BEGIN = 2.0**-30
# Rays that meet a plane at a smaller cosine run along it: the band moves their root far.
NEARLY_WITHIN = 1e-9
