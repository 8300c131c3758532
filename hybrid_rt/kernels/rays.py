"""Rays brought into the form that the kernels take, one pass over a batch.

What NumPy does in thirty passes over memory takes as long as tracing a simple scene.
"""

import math

from meshing.kernels.jit import hot_kernel, inner

ORIGIN_NOT_FINITE, ORIGIN_TOO_FAR, DIRECTION_NOT_FINITE, DIRECTION_ZERO = 0, 1, 2, 3
# What is wrong with rays, in the order of the numbers above.
COMPLAINTS = ("is not finite", "is too far out", "is not finite", "has length zero")


@inner
def _complain(what, i, first_bad, n_bad):
    if n_bad[what] == 0:
        first_bad[what] = i
    n_bad[what] += 1


@hot_kernel
def scale_rays(origin, direction, scaled, unit, farthest, first_bad, n_bad):
    """Scale directions (n, 3) by the power of two that brings the largest component into [1/2, 1).

    ``unit`` (n,) receives that power of two. ``first_bad`` and ``n_bad`` (4,), -1 and 0 before,
    tell the first row of each complaint and how many there are.
    """
    for i in range(origin.shape[0]):
        largest = 0.0
        is_finite = True
        for k in range(3):
            if not math.isfinite(origin[i, k]):
                _complain(ORIGIN_NOT_FINITE, i, first_bad, n_bad)
                is_finite = False
                break
            if abs(origin[i, k]) > farthest:
                _complain(ORIGIN_TOO_FAR, i, first_bad, n_bad)
                is_finite = False
                break
        for k in range(3):
            if not math.isfinite(direction[i, k]):
                _complain(DIRECTION_NOT_FINITE, i, first_bad, n_bad)
                is_finite = False
                break
            largest = max(largest, abs(direction[i, k]))
        if not is_finite:
            continue
        if largest == 0.0:
            _complain(DIRECTION_ZERO, i, first_bad, n_bad)
            continue
        _, exponent = math.frexp(largest)
        unit[i] = math.ldexp(1.0, -exponent)
        for k in range(3):
            # The product is as exact, and the power itself may overflow.
            if abs(exponent) < 1000:
                scaled[i, k] = direction[i, k] * unit[i]
            else:
                scaled[i, k] = math.ldexp(direction[i, k], -exponent)


@hot_kernel
def name_points(origin, direction, object_id, position, reach, column, rounding, most, known):
    """Fill two columns of ``known`` (n, 4) with t and rounding of points on the rays.

    Parameters
    ----------
    origin, direction : (n, 3) float64
    object_id : (n,) int32
        Negative: the ray names no point.
    position : (n, 3) float64
    reach : (objects,) float64
        The largest number from which each object's points are computed.
    column : int
        0 for departures, 2 for targets.
    rounding, most : float
        Rounding of a point, and the largest distance from the ray that is still taken for
        rounding, both over the size of its coordinates.
    """
    for i in range(object_id.size):
        if object_id[i] < 0:
            known[i, column] = 0.0
            known[i, column + 1] = -1.0
            continue
        ax, ay, az = (
            position[i, 0] - origin[i, 0],
            position[i, 1] - origin[i, 1],
            position[i, 2] - origin[i, 2],
        )
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        t = (ax * dx + ay * dy + az * dz) / (dx * dx + dy * dy + dz * dz)
        # The ray passes the point at this distance: rounding, if the caller means this point.
        gap = max(abs(ax - t * dx), abs(ay - t * dy), abs(az - t * dz))
        size = reach[object_id[i]]
        for k in range(3):
            size = max(size, abs(position[i, k]), abs(origin[i, k]))
        known[i, column] = t
        known[i, column + 1] = rounding * size + min(gap, most * size)
