"""A frame for a group of surfaces: centred on them, scaled by a power of two, lossless for rays.

World coordinates far from the origin, or rays that start far away, would lose in every later
subtraction what is kept here: the origin is carried as an unevaluated sum of two numbers.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.arctangent import angle_of
from hybrid_rt.core.kernels.compensated import advance, two_difference
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from meshing.kernels.jit import inlined

# Everything in the frame lies within this of its origin; rays start within twice that.
FRAME_RADIUS = 1.0
# What begins within this behind the nearest root is still looked into (times 1 + |t|): far more than
# two neighbours can disagree on the t of a root that they share.
CUT_SLACK = 2.0**-20
# Rays that pass the ball or the slab around an object by more than this, and the band, miss it.
MARGIN = 2.0**-30


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


class TurnedRay(NamedTuple):
    """A ray in the turned frame of one object: x + s v, |v| = 1, from its point nearest the origin.

    The caller's t is (shift + s / length) over the frame's scale.
    """

    x: Any
    y: Any
    z: Any
    vx: Any
    vy: Any
    vz: Any
    half: Any  # within the ball |s| is at most this; 0: it passes the ball, or its t are of no use
    length: Any  # of the direction in the world
    shift: Any
    band: Any  # what is nearer than this, in the frame, is `TANGENT`


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


@inlined
def clearly_passes(i, rays, c, size):
    """Tell whether ray i passes the ball of a size about c by more than the margin and the band."""
    o, d = rays.origin[i], rays.direction[i]
    dx, dy, dz = d[0], d[1], d[2]
    dd = dx * dx + dy * dy + dz * dz
    x, y, z = o[0] - c[0], o[1] - c[1], o[2] - c[2]
    away, along = x * x + y * y + z * z, x * dx + y * dy + z * dz
    reach = (1.0 + MARGIN) * size + 4.0 * TANGENT_BAND * np.sqrt(away)
    return away - along * along / dd > reach * reach + 16.0 * UNIT_ROUNDOFF * away


@inlined
def enter_turned_frame(i, rays, best, c, e, to_frame, size):
    """Return ray i in the frame of the rows e about c, where it comes near the ball of this size."""
    o, d = rays.origin[i], rays.direction[i]
    dx, dy, dz = d[0], d[1], d[2]
    dd = dx * dx + dy * dy + dz * dz
    hx, hy, hz, lx, ly, lz, shift = enter_frame(
        o[0], o[1], o[2], dx, dy, dz, c[0], c[1], c[2], to_frame
    )
    # --- does the ray meet the ball, and when?
    away = np.sqrt((o[0] - c[0]) ** 2 + (o[1] - c[1]) ** 2 + (o[2] - c[2]) ** 2) * to_frame
    band = TANGENT_BAND * max(away, 2.0 * size)
    reach = size + 2.0 * band + MARGIN
    step = -(hx * dx + hy * dy + hz * dz) / dd
    x, y, z = hx + step * dx, hy + step * dy, hz + step * dz
    square = reach * reach - (x * x + y * y + z * z)
    half, length = np.sqrt(max(square, 0.0)), np.sqrt(dd)
    per_t, to_world = 1.0 / length, 1.0 / to_frame
    shift += step
    if (
        square <= 0.0
        or (shift + half * per_t) * to_world <= rays.t_min[i]
        or (shift - half * per_t) * to_world > best.t[i]
    ):
        return TurnedRay(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, length, shift, band)
    # --- from its point nearest the origin of the frame
    hx, _ = advance(hx, lx, step, dx)
    hy, _ = advance(hy, ly, step, dy)
    hz, _ = advance(hz, lz, step, dz)
    dx, dy, dz = dx * per_t, dy * per_t, dz * per_t
    x, y, z = turned(e, hx, hy, hz)
    vx, vy, vz = turned(e, dx, dy, dz)
    return TurnedRay(x, y, z, vx, vy, vz, half, length, shift, band)


@inlined
def turned(e, x, y, z):
    """Return the components of a vector along the rows of e."""
    return (
        e[0, 0] * x + e[0, 1] * y + e[0, 2] * z,
        e[1, 0] * x + e[1, 1] * y + e[1, 2] * z,
        e[2, 0] * x + e[2, 1] * y + e[2, 2] * z,
    )


@inlined
def cut_to_slab(lo, hi, z, vz, bottom, top):
    """Return the part of [lo, hi] in which z + s vz is from bottom to top; lo >= hi: none."""
    if vz != 0.0:
        a, b = (bottom - z) / vz, (top - z) / vz
        return max(lo, min(a, b)), min(hi, max(a, b))
    return lo, (hi if bottom < z < top else lo)


@inlined
def cylinder_roots(across, turn, beside, root):
    """Return the roots of across s^2 + 2 turn s + beside, in order; root: of turn^2 - across beside."""
    if turn == 0.0:
        return -root / across, root / across
    q = -(turn + (root if turn > 0.0 else -root))
    a, b = q / across, (beside / q if q != 0.0 else 0.0)
    return min(a, b), max(a, b)


@inlined
def turned_point(i, rays, t, c, e, to_frame):
    """Return the point at t of ray i in the frame of the rows e about c."""
    o, d = rays.origin[i], rays.direction[i]
    fx, gx = two_difference(o[0], c[0])
    fy, gy = two_difference(o[1], c[1])
    fz, gz = two_difference(o[2], c[2])
    px, _ = advance(fx, gx, t, d[0])
    py, _ = advance(fy, gy, t, d[1])
    pz, _ = advance(fz, gz, t, d[2])
    return turned(e, px * to_frame, py * to_frame, pz * to_frame)


@inlined
def share_of_turn(y, x):
    """Return the angle of (x, y) in whole turns, from 0 to below 1."""
    turn = angle_of(y, x) / (2.0 * np.pi)
    turn -= np.floor(turn)
    return turn if turn < 1.0 else 0.0
