"""The rule by which a root becomes a first hit: the same for every kind of surface.

Each kind of surface has its own kernel that finds roots; all of them hand their roots to `offer`.
So the range of t, the points excluded by identity, and ties are decided in one place. What is not met
for certain is noted by `doubt`.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import NEARLY_WITHIN
from meshing.kernels.jit import inlined, inner


class Rays(NamedTuple):
    """Rays as the kernels take them; n rows, contiguous.

    Directions are the caller's times a power of two (so exact) that brings the largest component
    into [1/2, 1); t counts lengths of that scaled direction everywhere below the intersector.
    """

    origin: Any  # (n, 3) float64, world frame
    direction: Any  # (n, 3) float64
    t_min: Any  # (n,) float64; a hit needs t > t_min
    # (n, 6) float64, or (0, 6) for none: t and radius of departure, of target; the object that the
    # ray does not see; scratch of `note_departure`, nan to begin with. See `is_known`; `is_passed` has
    # another use for the target
    known: Any


class Nearest(NamedTuple):
    """The nearest root so far of each ray, lowered in place. Start: t = t_max, object_id = -1."""

    t: Any  # (n,) float64
    t_bound: Any  # (n,) float64, bound on |t - exact t|
    object_id: Any  # (n,) int32, index in the list of surfaces
    primitive: Any  # (n,) int32, patch, segment or face; else 0
    a: Any  # (n,) float64, two numbers that locate the point on the primitive,
    b: Any  # (n,) float64, (u, v) wherever the kernel has them for free
    # (n,) uint8: is the root's existence decided within the band? Without a root: does rounding alone
    # put one beyond t_max? See below
    tangent: Any
    doubt: Any  # (n,) float64, smallest t of a root rejected within the band; start: inf


# Planes are told apart by |n.g| with a direction g that no shape is likely to be symmetrical about; a
# smaller difference is taken for rounding.
FINGERPRINT = (0.4171, 0.5943, 0.6877)
ONE_PLANE = 2.0**-42

# What `Nearest.tangent` holds: no; yes; or to be found out by moving the ray (`intersection.margins`).
CLEAR, WITHIN_BAND, SUSPECT = 0, 1, 2
# In place of the target's radius: the ray goes on behind one of its own roots, see `is_passed`; in place of
# its t is the object of that root.
PASSED = -2.0
# In place of t = 0 of a surface that was moved.
JUST_BEHIND = -1e-300


@inlined
def not_zero(t, moved):
    """Return t; of a surface that rounding has moved (`Surface.moved`), a number below zero for zero.

    A ray's origin is no hit, and of the surface in which it lies there is no doubt. But an origin lies in
    a moved surface by rounding: the root may be ahead. (That distance is also part of the band and, over
    the slope, of the bound of each root.)
    """
    return t if t != 0.0 or moved == 0.0 else JUST_BEHIND


@inlined
def is_known(i, t, t_bound, n_dot_d, known):
    """Tell whether a root is a point that the caller has named: its departure or its target.

    ``known[i]`` holds, for each of the two, its t and the radius within which rounding may have
    moved it (negative: there is none). A root moves along the ray by that radius over |n.d|.
    """
    if known.shape[0] == 0:
        return False
    for k in range(0, 4, 2):
        radius = known[i, k + 1]
        if radius >= 0.0 and abs(t - known[i, k]) * n_dot_d <= t_bound * n_dot_d + radius:
            return True
    return False


@inlined
def begins_at(i, t, t_bound, n_dot_d, known):
    """Tell whether a root is the named departure of ray i; see `is_known`."""
    if known.shape[0] == 0 or known[i, 1] < 0.0:
        return False
    return abs(t - known[i, 0]) * n_dot_d <= t_bound * n_dot_d + known[i, 1]


@inner
def note_departure(i, nx, ny, nz, t_min, known, best):
    """Note a doubt if ray i begins on this face and, as noted before, on one of another plane.

    Within rounding of an edge nothing tells which of its faces a ray leaves, so that `is_known` holds for
    roots on all of them. Coplanar faces, and coincident ones of two objects, hide nothing from each
    other. A ray that goes on through a point has met what is there. ``n`` is the unit normal.
    """
    start, radius = known[i, 0], known[i, 1]
    if radius < 0.0 or abs(start) > 2.0 * radius or t_min[i] > 4.0 * radius:
        return
    mark = abs(nx * FINGERPRINT[0] + ny * FINGERPRINT[1] + nz * FINGERPRINT[2])
    if math.isnan(known[i, 5]):
        known[i, 5] = mark
    elif abs(mark - known[i, 5]) > ONE_PLANE:
        best.doubt[i] = -np.inf  # in front of whatever is hit, however near


@inlined
def is_passed(i, t, t_bound, n_dot_d, object_id, known):
    """Tell whether a root is a point that the caller has named, or the one that the ray goes on behind.

    The latter is a root of the same ray: `PASSED` stands in place of the target's radius, and the radius
    is 0, or what moves the ray. A root whose bound allows it the same t may be another one, where the ray
    grazes. So it is offered; the caller tells them apart. At the very same t the objects have their turns.
    """
    if known.shape[0] > 0 and known[i, 3] == PASSED:
        if t == known[i, 0] and object_id > known[i, 2]:
            return False
        return abs(t - known[i, 0]) * n_dot_d <= known[i, 1]
    return is_known(i, t, t_bound, n_dot_d, known)


@inlined
def is_left_behind(i, t, reach, t_min, known):
    """Tell whether a root before t_min is so clearly: by more than ``reach``, or as a point that is named.

    Spares finding the bound of a root at each departure.
    """
    return not t > t_min[i] and (t + reach <= t_min[i] or is_passed(i, t, reach, 1.0, 0, known))


@inlined
def is_unseen(i, object_id, known):
    """Tell whether ray i passes an object as if it were not there."""
    return known.shape[0] > 0 and known[i, 4] == object_id


@inlined
def offer(i, t, t_bound, n_dot_d, tangent, object_id, primitive, a, b, t_min, known, best):
    """Make a root the nearest one of ray i if it is; tell whether it was taken.

    ``n_dot_d`` is |n.d| with n unit and d as the ray has it, ``tangent`` what the row of
    `Nearest.tangent` becomes. Equal t: the lower object, then the
    lower primitive, then the lower (a, b): whichever was found first makes no difference. A root that
    its bound allows on both sides of t_min makes the row TANGENT; but the origin itself, t = 0, is no hit.
    """
    is_ahead = t > t_min[i]
    if not is_ahead and not t + t_bound > t_min[i]:
        return False
    t_best = best.t[i]
    if t > t_best:
        return False
    if t == t_best:
        holder = best.object_id[i]
        if holder < object_id:
            return False
        if holder == object_id:
            if best.primitive[i] < primitive:
                return False
            if best.primitive[i] == primitive and best.a[i] <= a:
                if best.a[i] == a and best.b[i] == b:
                    # The same root, found from two cells: the larger of its bounds holds.
                    best.t_bound[i] = max(best.t_bound[i], t_bound)
                    return False
                if best.a[i] < a or best.b[i] < b:
                    return False
    if is_passed(i, t, t_bound, n_dot_d, object_id, known):
        return False
    if is_unseen(i, object_id, known):
        return False
    if not is_ahead:
        if t != 0.0:
            best.doubt[i] = min(best.doubt[i], t_min[i])
        return False
    best.t[i] = t
    best.t_bound[i] = t_bound
    best.object_id[i] = object_id
    best.primitive[i] = primitive
    best.a[i] = a
    best.b[i] = b
    best.tangent[i] = tangent
    if t - t_bound <= t_min[i]:
        best.tangent[i] = WITHIN_BAND
    return True


@inner
def doubt(i, t, band, t_min, known, best):
    """Note that the surface passes within the band (world) of ray i at t, and is not met there."""
    if t > t_min[i] and not is_known(i, t, 8.0 * band, 1.0, known):
        best.doubt[i] = min(best.doubt[i], t)


@inner
def doubt_start(i, t, n_dot_d, low, high, band, t_min, known, best):
    """Note if rounding decides whether ray i begins before or behind a plane that it meets at t.

    The surface has a part of the plane from ``low`` to ``high``. The band (world) moves the root by
    itself over the slope ``n_dot_d``: far, where the ray runs nearly within the plane. Other rays that
    begin on a surface are marked by `offer`, where the bound of a root reaches across the beginning.
    """
    if not 0.0 < n_dot_d < NEARLY_WITHIN:
        return
    start, reach = t_min[i], band / n_dot_d
    is_there = abs(t - start) <= reach and low <= start + reach and high >= start - reach
    if is_there and not is_known(i, t, reach, n_dot_d, known):
        best.doubt[i] = min(best.doubt[i], start)
