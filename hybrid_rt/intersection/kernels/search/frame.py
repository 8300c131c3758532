"""A frame for a group of surfaces: centred on them, scaled by a power of two, lossless for rays.

World coordinates far from the origin, or rays that start far away, would lose in every later
subtraction what is kept here: the origin is carried as an unevaluated sum of two numbers.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import advance, two_difference
from meshing.kernels.jit import inlined

# Everything in the frame lies within this of its origin; rays start within twice that.
FRAME_RADIUS = 1.0
# What begins within this behind the nearest root is still looked into (times 1 + |t|): far more than
# two neighbours can disagree on the t of a root that they share.
CUT_SLACK = 2.0**-20


class FrameRay(NamedTuple):
    """A ray near a frame's ball: (high + low) + t d, where the caller's t is (t + shift) to_world."""

    x: Any  # the origin's high part
    y: Any
    z: Any
    lx: Any  # and its low one
    ly: Any
    lz: Any
    dx: Any
    dy: Any
    dz: Any
    shift: Any
    to_world: Any


@inlined
def enter_frame(ox, oy, oz, dx, dy, dz, mx, my, mz, to_frame):
    """Bring a ray's origin into a frame, near the frame's ball.

    Returns the origin in two parts and by how much t was advanced, in frame units: the ray is
    ``(high + low) + (t to_frame - shift) d``.
    """
    h0, l0 = two_difference(ox, mx)
    h1, l1 = two_difference(oy, my)
    h2, l2 = two_difference(oz, mz)
    h0, l0 = h0 * to_frame, l0 * to_frame
    h1, l1 = h1 * to_frame, l1 * to_frame
    h2, l2 = h2 * to_frame, l2 * to_frame
    largest = max(abs(h0), abs(h1), abs(h2))
    if largest <= FRAME_RADIUS:
        return h0, h1, h2, l0, l1, l2, 0.0
    dd = dx * dx + dy * dy + dz * dz
    # To the foot of the perpendicular on the middle, less 1.5 radii.
    shift = -(h0 * dx + h1 * dy + h2 * dz) / dd - 1.5 * FRAME_RADIUS / np.sqrt(dd)
    h0, l0 = advance(h0, l0, shift, dx)
    h1, l1 = advance(h1, l1, shift, dy)
    h2, l2 = advance(h2, l2, shift, dz)
    return h0, h1, h2, l0, l1, l2, shift


@inlined
def begin_of(t_min, to_frame, shift):
    """Return t_min in the frame, and a little less."""
    t = t_min * to_frame - shift
    return t - CUT_SLACK * (1.0 + abs(t))


@inlined
def end_of(t_best, to_frame, shift):
    """Return the t in the frame behind which nothing can be nearer than ``t_best``."""
    t = t_best * to_frame - shift
    return t + CUT_SLACK * (1.0 + abs(t))


@inlined
def any_normal(x, y, z):
    """Return a unit normal of a vector whose largest component is at least 1/2."""
    if abs(z) < 0.5:
        length = np.sqrt(x * x + y * y)
        return -y / length, x / length, 0.0
    length = np.sqrt(y * y + z * z)
    return 0.0, -z / length, y / length
