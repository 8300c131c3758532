"""Welding: which corners and edges of patches are the same, up to rounding."""

import numpy as np

from meshing.kernels.jit import inner, kernel


@inner
def _root(parent, i):
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel(allocates=True)
def join_points(points, order, along, tolerance):
    """Label points; points within ``tolerance`` of each other in each coordinate get equal labels.

    ``order`` sorts ``along``, the positions of the points along some unit vector.
    """
    n = points.shape[0]
    parent = np.arange(n)
    for a in range(n):
        i = order[a]
        for b in range(a + 1, n):
            j = order[b]
            if along[j] - along[i] > 2.0 * tolerance:
                break
            far = 0.0
            for axis in range(3):
                far = max(far, abs(points[i, axis] - points[j, axis]))
            if far <= tolerance:
                low, high = _root(parent, i), _root(parent, j)
                parent[max(low, high)] = min(low, high)
    label = np.empty(n, np.int64)
    for i in range(n):
        label[i] = _root(parent, i)
    return label


@inner
def _edge_gap(control, first, step, degree, i, j, is_reversed):
    gap = 0.0
    for k in range(degree[i] + 1):
        other = degree[j] - k if is_reversed else k
        a = first[i] + k * step[i]
        b = first[j] + other * step[j]
        for axis in range(3):
            gap = max(gap, abs(control[a, axis] - control[b, axis]))
    return gap


@kernel(allocates=True)
def join_edges(control, first, step, degree, order, run, tolerance, group, is_reversed):
    """Give equal edges the same group, that of the first of them; return the largest difference.

    Edge e has the control points ``first[e] + k step[e]``. In ``order``, edges with equal ends and
    equal degrees are adjacent; ``run`` (n,) numbers these runs. Each edge is compared only with the
    first edge of each group found so far in its run.
    """
    n = order.size
    leaders = np.empty(n, np.int64)
    n_leaders = 0
    largest = 0.0
    for a in range(n):
        i = order[a]
        if a == 0 or run[a] != run[a - 1]:
            n_leaders = 0
        group[i] = i
        is_reversed[i] = False
        for b in range(n_leaders):
            j = leaders[b]
            same = _edge_gap(control, first, step, degree, i, j, False)
            opposite = _edge_gap(control, first, step, degree, i, j, True)
            if min(same, opposite) <= tolerance:
                group[i] = j
                is_reversed[i] = opposite < same
                largest = max(largest, min(same, opposite))
                break
        if group[i] == i:
            leaders[n_leaders] = i
            n_leaders += 1
    return largest
