"""Halving of control nets by de Casteljau's algorithm, and bounding boxes of patches.

Nets lie on a stack, an array (slots, points, 3): each slot holds one net row by row. Nets of
rational patches have four columns, (w (P - c), w), c a point of each patch's own.
"""

import numpy as np

from meshing.kernels.jit import inner, kernel

# A box of control points is too wide by a multiple of the square of the net's extent in
# parameters: four halvings each way leave 1/256 of the excess.
LEVELS = 8


@inner
def halve(stack, low, high, degree_u, degree_v, along_u):
    """Halve the net in slot ``low``: its first half stays there, its second goes to ``high``."""
    stride = degree_v + 1
    lines = stride if along_u else degree_u + 1
    degree = degree_u if along_u else degree_v
    step = stride if along_u else 1
    for line in range(lines):
        first = line if along_u else line * stride
        for axis in range(stack.shape[2]):
            for i in range(degree + 1):
                stack[high, first + i * step, axis] = stack[low, first + i * step, axis]
            for level in range(1, degree + 1):
                for i in range(degree - level + 1):
                    k = first + i * step
                    stack[high, k, axis] = (
                        0.5 * stack[high, k, axis] + 0.5 * stack[high, k + step, axis]
                    )
                stack[low, first + level * step, axis] = stack[high, first, axis]


@inner
def coordinate(stack, slot, k, axis, rational):
    """Return a coordinate of a control point; of a rational patch's, about its c."""
    if rational is None:
        return stack[slot, k, axis]
    return stack[slot, k, axis] / stack[slot, k, 3]


@inner
def _extend(bounds, x, axis):
    bounds[0, axis] = min(bounds[0, axis], x)
    bounds[1, axis] = max(bounds[1, axis], x)


@inner
def _extend_by_corners(bounds, stack, slot, m, n, rational):
    last = m * (n + 1)
    for axis in range(3):
        for k in (0, n, last, last + n):
            _extend(bounds, coordinate(stack, slot, k, axis, rational), axis)


@inner
def _is_inside(bounds, stack, slot, count, rational):
    for k in range(count):
        for axis in range(3):
            x = coordinate(stack, slot, k, axis, rational)
            if x < bounds[0, axis] or x > bounds[1, axis]:
                return False
    return True


@kernel(allocates=True)
def patch_boxes(control, starts, degrees, rational, boxes):
    """Write the bounding box of each patch into ``boxes`` (k, 2, 3); rational ones: about its c.

    Only pieces whose nets exceed the box of the surface points known so far are halved, at most
    ``LEVELS`` times; then the box takes in their control points.
    """
    largest_net = 0
    for p in range(degrees.shape[0]):
        largest_net = max(largest_net, starts[p + 1] - starts[p])
    stack = np.empty((LEVELS + 2, largest_net, control.shape[1]))
    depth = np.empty(LEVELS + 2, np.int64)
    known = np.empty((2, 3))
    for p in range(degrees.shape[0]):
        m, n = degrees[p, 0], degrees[p, 1]
        count = starts[p + 1] - starts[p]
        hull = boxes[p]
        for axis in range(3):
            hull[0, axis] = known[0, axis] = np.inf
            hull[1, axis] = known[1, axis] = -np.inf
        largest = 0.0
        for k in range(count):
            for axis in range(control.shape[1]):
                stack[0, k, axis] = control[starts[p] + k, axis]
            for axis in range(3):
                x = coordinate(stack, 0, k, axis, rational)
                largest = max(largest, abs(x))
                _extend(hull, x, axis)
        rounding = (m + n) * LEVELS * 2.0**-53 * largest
        if rational is not None:
            # As much for the weights, and for the quotient and the product that it undoes.
            rounding = 2.0 * rounding + 4.0 * 2.0**-53 * largest
        _extend_by_corners(known, stack, 0, m, n, rational)
        depth[0] = 0
        top = 0
        while top >= 0:
            if _is_inside(known, stack, top, count, rational):
                top -= 1
            elif depth[top] == LEVELS:
                for k in range(count):
                    for axis in range(3):
                        _extend(known, coordinate(stack, top, k, axis, rational), axis)
                top -= 1
            else:
                halve(stack, top, top + 1, m, n, depth[top] % 2 == 0)
                depth[top] += 1
                depth[top + 1] = depth[top]
                _extend_by_corners(known, stack, top, m, n, rational)
                _extend_by_corners(known, stack, top + 1, m, n, rational)
                top += 1
        for axis in range(3):
            hull[0, axis] = max(hull[0, axis], known[0, axis] - rounding)
            hull[1, axis] = min(hull[1, axis], known[1, axis] + rounding)
