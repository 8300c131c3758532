"""Ways of light from a point to another through flat faces that are parallel, refracted at each.

Such a way lies in the plane of both points and the normal. One number describes it: the sine of the
angle to the normal, times the index, is the same on both sides of each face (Born and Wolf, "Principles
of optics", section 3.2). Only how much of the way lies outside and how much inside matters, not in
which order.
"""

import math

from meshing.kernels.jit import inner

# Bisection halves the bracket, Newton iteration squares its error: this many steps are not reached.
MOST_STEPS = 100
# Relative error of the tangent that describes a way.
CLOSE = 1e-14


@inner
def tangent_through(outside, inside, across, ior):
    """Return the tangent of the angle to the normal, outside, of the way between two points.

    The distance across grows with the tangent, so there is one way. As it is a concave function,
    Newton's steps from below never pass the root.

    Parameters
    ----------
    outside, inside : float
        Thickness of what lies between the points, outside and inside of the glass: not negative,
        the first positive.
    across : float
        Distance of the points along the faces.
    ior : float
        Index of refraction, above 1.
    """
    square = ior * ior
    # The slope is largest at the start: the first step is too short.
    at = across / (outside + inside / ior)
    for _ in range(MOST_STEPS):
        root = math.sqrt(square + (square - 1.0) * at * at)
        excess = outside * at + inside * at / root - across
        slope = outside + inside * square / (root * root * root)
        step = excess / slope
        at -= step
        if abs(step) <= CLOSE * at:
            break
    return at


@inner
def section_through(outside, inside, cos_o, cos_i, ior, is_inside):
    """Return the cross-section over the solid angle of a pencil of rays.

    The two widths, in the plane of the way and across it, are those of the distance along the faces
    as a function of the angles.

    Parameters
    ----------
    outside, inside : float
        Lengths of the way outside and inside of the glass.
    cos_o, cos_i : float
        Cosines of the angles to the normal, outside and inside.
    ior : float
    is_inside : bool
        Whether the pencil begins inside; it ends outside.
    """
    across = outside + inside / ior
    within = outside / (cos_o * cos_o) + inside / (ior * cos_i * cos_i)
    return across * within * cos_o * start_factor(cos_o, cos_i, ior, is_inside)


@inner
def start_factor(cos_o, cos_i, ior, is_inside):
    """Return the square of the index times the cosine to the normal where a pencil begins.

    Over the cosine outside it is the solid angle outside over that at the beginning.
    """
    return ior * ior * cos_i if is_inside else cos_o
