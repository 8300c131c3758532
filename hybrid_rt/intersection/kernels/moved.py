"""Surfaces that rounding has moved: images by `transformed`, which lie within `moved` of the exact ones.

That distance is part of the band and, over the slope, of the bound of each root.
"""

from meshing.kernels.jit import inlined

# In place of t = 0.
JUST_BEHIND = -1e-300


@inlined
def not_zero(t, moved):
    """Return t; of a surface that was moved, a number below zero for zero.

    A ray's origin is no hit, and of the surface in which it lies there is no doubt. But an origin lies in
    a moved surface by rounding: the root may be ahead.
    """
    return t if t != 0.0 or moved == 0.0 else JUST_BEHIND
