"""Bisection of a control net about a ray, down to pieces that may hold a root.

`proof.judges.kernels.patch_roots` has the method.
"""

import math

import numpy as np

from meshing.kernels.jit import inner
from proof.judges.kernels.bezier import divide_by_weights, halve

# Size of the pieces from which Newton starts, over the patch's: two roots in one such piece are
# 1e-18 of the size from merging, far inside the band.
PIECE = 2.0**-29
# Pieces looked at per ray and patch before the oracle gives up (a ray within a flat patch).
MOST_PIECES = 200_000
MOST_LEAVES = 4096
MOST_REJECTED = 32


@inner
def normal_frame(x, y, z, frame):
    """Two unit normals of a unit vector, and the vector (Duff et al. 2017)."""
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    frame[0, 0] = 1.0 + sign * x * x * a
    frame[0, 1] = sign * b
    frame[0, 2] = -sign * x
    frame[1, 0] = b
    frame[1, 1] = sign + y * y * a
    frame[1, 2] = -y
    frame[2, 0] = x
    frame[2, 1] = y
    frame[2, 2] = z


@inner
def project(control, weight, start, count, frame, point, net):
    """Control points relative to a point of the ray, times their weights; and the weights.

    Two coordinates are across the ray, the third is along it.
    """
    for k in range(count):
        x = (control[start + k, 0] - point[0, 0]) - point[0, 1]
        y = (control[start + k, 1] - point[1, 0]) - point[1, 1]
        z = (control[start + k, 2] - point[2, 0]) - point[2, 1]
        w = weight[start + k]
        for axis in range(3):
            across = frame[axis, 0] * x + frame[axis, 1] * y + frame[axis, 2] * z
            net[axis * count + k] = w * across
        net[3 * count + k] = w


@inner
def misses(net, m, n, slop, low, high):
    """Whether a piece stays clear of the ray, or of the stretch (low, high) of it."""
    count = (m + 1) * (n + 1)
    for axis in range(3):
        least, most = net[axis * count], net[axis * count]
        for k in range(axis * count + 1, (axis + 1) * count):
            least = min(least, net[k])
            most = max(most, net[k])
        if axis < 2:
            if least > slop or most < -slop:
                return True
        elif least > high or most < low:
            return True
    # Across the longer tangent, as projected: the thin side of pieces seen at a grazing angle.
    a, b, c = n, m * (n + 1), count - 1
    ux = net[b] + net[c] - net[0] - net[a]
    uy = net[count + b] + net[count + c] - net[count] - net[count + a]
    vx = net[a] + net[c] - net[0] - net[b]
    vy = net[count + a] + net[count + c] - net[count] - net[count + b]
    if ux * ux + uy * uy < vx * vx + vy * vy:
        ux, uy = vx, vy
    length = math.sqrt(ux * ux + uy * uy)
    if length == 0.0:
        return False
    ux /= length
    uy /= length
    least, most = np.inf, -np.inf
    for k in range(count):
        across = ux * net[count + k] - uy * net[k]
        least = min(least, across)
        most = max(most, across)
    return least > slop or most < -slop


@inner
def extent(net, m, n, along_u):
    """Largest step between neighbouring control points, times the degree."""
    count = (m + 1) * (n + 1)
    stride = n + 1
    largest = 0.0
    for axis in range(3):
        base = axis * count
        if along_u:
            for k in range(base, base + m * stride):
                largest = max(largest, abs(net[k + stride] - net[k]))
        else:
            for i in range(m + 1):
                for k in range(base + i * stride, base + i * stride + n):
                    largest = max(largest, abs(net[k + 1] - net[k]))
    return largest * (m if along_u else n)


@inner
def bisect(nets, plain, spans, m, n, slop, smallest, low, high, leaves):
    """Halve the net in ``nets[0]`` down to pieces of size ``smallest`` at the ray.

    ``plain`` is empty without weights, else room for the control points of a piece. Returns the
    number of pieces, or -1 when there are too many; where ``leaves`` has room for one only, the
    search ends with the first.
    """
    count = (m + 1) * (n + 1)
    is_rational = plain.size > 0
    n_axes = 4 if is_rational else 3
    spans[0, 0], spans[0, 1], spans[0, 2], spans[0, 3] = 0.0, 1.0, 0.0, 1.0
    top, n_leaves, n_pieces = 0, 0, 0
    while top >= 0:
        n_pieces += 1
        if n_pieces > MOST_PIECES:
            return -1
        net = seen = nets[top]
        if is_rational:
            divide_by_weights(net, count, 3, plain)
            seen = plain
        if misses(seen, m, n, slop, low, high):
            top -= 1
            continue
        extent_u = extent(seen, m, n, True)
        extent_v = extent(seen, m, n, False)
        u0, u1, v0, v1 = spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3]
        if max(extent_u, extent_v) <= smallest or top + 1 >= nets.shape[0]:
            if n_leaves >= leaves.shape[0]:
                return -1
            least, most = np.inf, -np.inf
            for k in range(2 * count, 3 * count):
                least = min(least, seen[k])
                most = max(most, seen[k])
            leaves[n_leaves, 0] = 0.5 * (u0 + u1)
            leaves[n_leaves, 1] = 0.5 * (v0 + v1)
            leaves[n_leaves, 2] = 0.5 * (u1 - u0)
            leaves[n_leaves, 3] = 0.5 * (v1 - v0)
            leaves[n_leaves, 4] = least
            leaves[n_leaves, 5] = most
            n_leaves += 1
            top -= 1
            if leaves.shape[0] == 1:
                return 1
            continue
        other = nets[top + 1]
        if extent_u >= extent_v:
            for axis in range(n_axes):
                for j in range(n + 1):
                    halve(net, other, axis * count + j, n + 1, m + 1)
            middle = 0.5 * (u0 + u1)
            spans[top, 0] = middle
            spans[top + 1, 0], spans[top + 1, 1] = u0, middle
            spans[top + 1, 2], spans[top + 1, 3] = v0, v1
        else:
            for axis in range(n_axes):
                for i in range(m + 1):
                    halve(net, other, axis * count + i * (n + 1), 1, n + 1)
            middle = 0.5 * (v0 + v1)
            spans[top, 2] = middle
            spans[top + 1, 0], spans[top + 1, 1] = u0, u1
            spans[top + 1, 2], spans[top + 1, 3] = v0, middle
        top += 1
    return n_leaves
