"""Rays brought into the form that the kernels take, one pass over a batch.

What NumPy does in thirty passes over memory takes as long as tracing a simple scene.
"""

import math
import sys
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.nearest import WITHIN_BAND
from meshing.kernels.jit import inlined, inner, kernel

ORIGIN_NOT_FINITE, ORIGIN_TOO_FAR, DIRECTION_NOT_FINITE, DIRECTION_ZERO = 0, 1, 2, 3
DIRECTION_TOO_SHORT = 4
# What is wrong with rays, in the order of the numbers above.
COMPLAINTS = (
    "is not finite", "is too far out", "is not finite", "has length zero",
    "is shorter than 2.3e-308, so has lost digits",
)  # fmt: skip

# Shorter numbers have fewer digits. Longer ones there are none: a hit beyond is a miss.
SMALLEST, LARGEST = 2.0**-1022, sys.float_info.max
# A bound on a smaller t may be subnormal.
TINY = 2.0**-960

# `hybrid_rt.core.records.Status`
MISS, HIT, TANGENT = 0, 1, 2
# `hybrid_rt.core.records.Flag`
NORMAL_DEGENERATE = 1
EDGE = 2


class Record(NamedTuple):
    """The columns of a `HitRecord`, n rows."""

    t: Any
    object_id: Any
    patch_id: Any
    u: Any
    v: Any
    position: Any
    normal: Any
    front_face: Any
    status: Any
    flags: Any
    t_bound: Any
    residual: Any


@inner
def _complain(what, i, first_bad, n_bad):
    if n_bad[what] == 0:
        first_bad[what] = i
    n_bad[what] += 1


@kernel
def check_rays(origin, direction, farthest, first_bad, n_bad):
    """Count the rays with each complaint, ``n_bad`` (5,), zero before; return the sum.

    ``first_bad`` (5,) receives the first row of each complaint there is.
    """
    for i in range(origin.shape[0]):
        largest = 0.0
        for k in range(3):
            if not math.isfinite(origin[i, k]):
                _complain(ORIGIN_NOT_FINITE, i, first_bad, n_bad)
                break
            if abs(origin[i, k]) > farthest:
                _complain(ORIGIN_TOO_FAR, i, first_bad, n_bad)
                break
        for k in range(3):
            if not math.isfinite(direction[i, k]):
                _complain(DIRECTION_NOT_FINITE, i, first_bad, n_bad)
                largest = np.inf
                break
            largest = max(largest, abs(direction[i, k]))
        if largest == 0.0:
            _complain(DIRECTION_ZERO, i, first_bad, n_bad)
        elif largest < SMALLEST:
            _complain(DIRECTION_TOO_SHORT, i, first_bad, n_bad)
    return n_bad.sum()


@inlined
def scale_ray(direction, i, scaled, j):
    """Scale direction i by the power of two that brings its largest component into [1/2, 1).

    Row j of ``scaled`` (n, 3) receives it. Returns that power of two.
    """
    largest = max(abs(direction[i, 0]), abs(direction[i, 1]), abs(direction[i, 2]))
    # The exponent in the bits of a float64 is that of `frexp` plus 1022.
    exponent = (np.float64(largest).view(np.int64) >> 52) - 1022
    if abs(exponent) < 1000:
        unit = np.int64((1023 - exponent) << 52).view(np.float64)
        for k in range(3):
            scaled[j, k] = direction[i, k] * unit
        return unit
    # The power itself may overflow.
    _, extreme = math.frexp(largest)
    for k in range(3):
        scaled[j, k] = math.ldexp(direction[i, k], -extreme)
    return math.ldexp(1.0, -extreme)


@inlined
def scaled_limit(t_max, unit):
    """Return the upper limit of t in lengths of a scaled direction."""
    # So that what comes back from the scaled t is a number.
    return (min(t_max, LARGEST) if unit > 1.0 else t_max) / unit


@kernel
def scale_rays(direction, t_min, t_max, scaled, unit, lowest, highest):
    """Scale directions (n, 3); see `scale_ray`.

    ``unit`` (n,) receives the power of two. Limits of t, (n,) or one for all (1,), become those of
    the scaled directions: ``lowest`` and ``highest`` (n,).
    """
    for i in range(direction.shape[0]):
        unit[i] = scale_ray(direction, i, scaled, i)
        lowest[i] = t_min[min(i, t_min.size - 1)] / unit[i]
        highest[i] = scaled_limit(t_max[min(i, t_max.size - 1)], unit[i])


@inlined
def complete_row(i, direction, unit, best, record):
    """Fill the columns of row i that are the same for every kind of surface; all those of a miss.

    ``unit`` brings t into the caller's lengths.
    """
    is_hit = best.object_id[i] >= 0
    # A root that rounding kept from us matters only in front of the hit.
    is_within = best.tangent[i] == WITHIN_BAND
    is_tangent = is_within or best.doubt[i] < best.t[i]
    record.status[i] = TANGENT if is_tangent else (HIT if is_hit else MISS)
    record.object_id[i] = best.object_id[i]
    if is_hit:
        record.t[i] = best.t[i] * unit
        record.t_bound[i] = best.t_bound[i] * unit
        if abs(record.t[i]) < TINY:  # what subnormal numbers round
            record.t_bound[i] += 2.0**-1073
        slope = 0.0
        for k in range(3):
            slope += direction[i, k] * record.normal[i, k]
        record.front_face[i] = slope < 0.0
        return
    record.t[i] = np.inf
    record.t_bound[i] = np.inf
    record.front_face[i] = False
    record.patch_id[i] = -1
    record.u[i] = np.nan
    record.v[i] = np.nan
    record.residual[i] = np.nan
    for k in range(3):
        record.position[i, k] = np.nan
        record.normal[i, k] = np.nan


@kernel
def complete_rows(direction, unit, best, record, totals):
    """Fill the columns that are the same for every kind of surface, and all columns of misses.

    ``direction`` (n, 3): as the rays have it.
    ``unit`` (n,): brings t into the caller's lengths.
    ``totals`` (2,) int64: hits and TANGENT rows are added here.
    """
    for i in range(unit.shape[0]):
        complete_row(i, direction, unit[i], best, record)
        totals[0] += best.object_id[i] >= 0
        totals[1] += record.status[i] == TANGENT


@inlined
def name_point(origin, direction, i, object_id, position, j, reach, rounding, most):
    """Return t and rounding of point j on ray i; ``object_id`` is that of the point.

    Other parameters are those of `name_points`.
    """
    ax, ay, az = (
        position[j, 0] - origin[i, 0],
        position[j, 1] - origin[i, 1],
        position[j, 2] - origin[i, 2],
    )
    dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
    t = (ax * dx + ay * dy + az * dz) / (dx * dx + dy * dy + dz * dz)
    # The ray passes the point at this distance: rounding, if the caller means this point.
    gap = max(abs(ax - t * dx), abs(ay - t * dy), abs(az - t * dz))
    size = reach[object_id]
    for k in range(3):
        size = max(size, abs(position[j, k]), abs(origin[i, k]))
    # Farther away the caller means another point: it excludes nothing.
    return t, rounding * size + gap if gap <= most * size else -1.0


@kernel
def name_points(origin, direction, object_id, position, reach, column, rounding, most, known):
    """Fill two columns of ``known`` (n, 6) with t and rounding of points on the rays.

    With the departures, the columns that follow are filled as for rays that see all objects.

    ``origin``, ``direction`` (n, 3); ``position`` (n, 3).
    ``object_id`` (n,) int32: negative: the ray names no point.
    ``reach`` (objects,): the largest number from which each object's points are computed.
    ``column``: 0 for departures, 2 for targets.
    ``rounding``, ``most``: rounding of a point, and the largest distance from the ray that is still
    taken for rounding, both over the size of its coordinates.
    """
    for i in range(object_id.size):
        if column == 0:
            known[i, 4], known[i, 5] = -1.0, np.nan
        if object_id[i] < 0:
            known[i, column] = 0.0
            known[i, column + 1] = -1.0
            continue
        known[i, column], known[i, column + 1] = name_point(
            origin, direction, i, object_id[i], position, i, reach, rounding, most
        )
