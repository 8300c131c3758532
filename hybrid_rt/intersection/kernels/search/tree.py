"""A bounding volume hierarchy with eight children a node: built once, walked by every kernel.

Built from the top down: the widest of a node's ranges is split by the binned surface-area
heuristic until eight ranges stand side by side (Wald, Benthin, Boulos 2008, "Getting rid of
packets"). Boxes are float32 and rounded outward, and the tests below lose no box that the exact
ray meets (Ize 2013, "Robust BVH ray traversal"); what a leaf holds is decided in float64.

Coordinates are those of the tree's own frame: everything within 1 of the origin, and ray origins
within 2 (`frame`).
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.boxes import LANES, BoxRay, push_boxes, sort_key
from meshing.kernels.jit import inlined, inner, kernel

WIDTH = LANES
BINS = 16
# Origins (up to 2) are rounded to float32: 2**-24 * 2; two such roundings and some air.
BOX_MARGIN = np.float32(2.0**-19)
# A smaller direction component cannot leave a slab within any distance we trace.
SMALLEST_COMPONENT = 1e-18


# Rows of a node: six of bounds, and its links.
CHILD, COUNT, ROWS = 6, 7, 8


class Tree(NamedTuple):
    """Nodes of eight rows of eight numbers each, 256 bytes.

    ``rows[n, :3]`` are lower and ``rows[n, 3:6]`` upper bounds of the children of node n; in the
    same memory, as integers, ``links[n, CHILD]`` names each child: a node, or the first place in
    ``order``; and ``links[n, COUNT]`` is 0 for a node, else how many primitives the leaf holds.
    """

    rows: Any  # (n, 8, 8) float32
    links: Any  # (n, 8, 8) int32
    order: Any  # (m,) int32: primitives, leaf by leaf
    stack: int  # places that a depth-first walk may need


class Stack(NamedTuple):
    """Where the children wait that a ray has yet to visit; see `search.boxes`."""

    key: Any  # (m,) int32
    parent: Any  # (m,) uint32


def new_stack(tree: Tree, more: int = 0) -> Stack:
    """Return a stack for one walk at a time, with room for ``more`` than the tree's children."""
    m = tree.stack + more
    return Stack(np.empty(m, np.int32), np.empty(m, np.uint32))


@inner
def _half_area(lo, hi):
    x, y, z = hi[0] - lo[0], hi[1] - lo[1], hi[2] - lo[2]
    return x * y + y * z + z * x


@inner
def _range_bounds(lower, upper, order, begin, end, lo, hi):
    lo[:] = np.inf
    hi[:] = -np.inf
    for k in range(begin, end):
        p = order[k]
        for axis in range(3):
            lo[axis] = min(lo[axis], lower[p, axis])
            hi[axis] = max(hi[axis], upper[p, axis])


@inner
def _split(lower, upper, order, begin, end, work):
    """Reorder a range into two by the binned surface-area heuristic; return where they part."""
    # Doubled centres, so that no division rounds.
    lo, hi, box_lo, box_hi = work[0], work[1], work[2], work[3]
    lo[:] = np.inf
    hi[:] = -np.inf
    for k in range(begin, end):
        p = order[k]
        for axis in range(3):
            c = lower[p, axis] + upper[p, axis]
            lo[axis] = min(lo[axis], c)
            hi[axis] = max(hi[axis], c)
    best_cost = np.inf
    best_axis, best_bin = -1, 0
    bins = work[8 : 8 + 4 * BINS]
    for axis in range(3):
        width = hi[axis] - lo[axis]
        if not width > 0.0:
            continue
        bins[: 2 * BINS, :] = np.inf
        bins[BINS : 2 * BINS, :] = -np.inf
        bins[2 * BINS :, :] = 0.0
        for k in range(begin, end):
            p = order[k]
            c = lower[p, axis] + upper[p, axis]
            b = min(int((c - lo[axis]) / width * BINS), BINS - 1)
            bins[2 * BINS + b, 0] += 1.0
            for j in range(3):
                bins[b, j] = min(bins[b, j], lower[p, j])
                bins[BINS + b, j] = max(bins[BINS + b, j], upper[p, j])
        # Costs of everything right of each cut, then sweep from the left.
        box_lo[:] = np.inf
        box_hi[:] = -np.inf
        n = 0.0
        for b in range(BINS - 1, 0, -1):
            n += bins[2 * BINS + b, 0]
            for j in range(3):
                box_lo[j] = min(box_lo[j], bins[b, j])
                box_hi[j] = max(box_hi[j], bins[BINS + b, j])
            bins[3 * BINS + b, 0] = n * _half_area(box_lo, box_hi) if n > 0.0 else 0.0
            bins[3 * BINS + b, 1] = n
        box_lo[:] = np.inf
        box_hi[:] = -np.inf
        n = 0.0
        for b in range(BINS - 1):
            n += bins[2 * BINS + b, 0]
            for j in range(3):
                box_lo[j] = min(box_lo[j], bins[b, j])
                box_hi[j] = max(box_hi[j], bins[BINS + b, j])
            if n == 0.0 or bins[3 * BINS + b + 1, 1] == 0.0:
                continue
            cost = n * _half_area(box_lo, box_hi) + bins[3 * BINS + b + 1, 0]
            if cost < best_cost:
                best_cost, best_axis, best_bin = cost, axis, b
    if best_axis < 0:  # all centres coincide
        return (begin + end) // 2
    i, k = begin, end - 1
    width = hi[best_axis] - lo[best_axis]
    while i <= k:
        p = order[i]
        c = lower[p, best_axis] + upper[p, best_axis]
        if min(int((c - lo[best_axis]) / width * BINS), BINS - 1) <= best_bin:
            i += 1
        else:
            order[i] = order[k]
            order[k] = p
            k -= 1
    return i


@kernel(allocates=True)
def build_tree(lower, upper, leaf_size):
    """Build the hierarchy over boxes (m, 3) float64; a leaf holds at most `leaf_size` of them."""
    m = lower.shape[0]
    order = np.arange(m).astype(np.int32)
    # A node either has eight children or holds more than leaf_size primitives in leaves.
    capacity = 8 * m // (7 * min(leaf_size + 1, WIDTH)) + 2
    rows = np.empty((capacity, ROWS, WIDTH), np.float32)
    links = rows.view(np.int32)
    # Nodes still to fill: number, range of `order`, depth.
    todo = np.empty((capacity, 4), np.int64)
    work = np.empty((8 + 4 * BINS, 3))
    begin = np.empty(WIDTH, np.int64)
    end = np.empty(WIDTH, np.int64)
    area = np.empty(WIDTH)
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, 0, m, 1
    n_todo, n_nodes, deepest = 1, 1, 1
    while n_todo > 0:
        n_todo -= 1
        node = todo[n_todo, 0]
        begin[0], end[0], depth = todo[n_todo, 1], todo[n_todo, 2], todo[n_todo, 3]
        deepest = max(deepest, depth)
        area[0] = np.inf
        n = 1
        while n < WIDTH:
            widest = -1
            for k in range(n):
                if end[k] - begin[k] > leaf_size and (widest < 0 or area[k] > area[widest]):
                    widest = k
            if widest < 0:
                break
            middle = _split(lower, upper, order, begin[widest], end[widest], work)
            begin[n], end[n] = middle, end[widest]
            end[widest] = middle
            for k in (widest, n):
                _range_bounds(lower, upper, order, begin[k], end[k], work[4], work[5])
                area[k] = _half_area(work[4], work[5])
            n += 1
        for k in range(WIDTH):
            if k >= n:
                rows[node, :3, k] = np.inf
                rows[node, 3:6, k] = -np.inf
                links[node, CHILD, k], links[node, COUNT, k] = -1, 0
                continue
            _range_bounds(lower, upper, order, begin[k], end[k], work[4], work[5])
            for axis in range(3):
                # float32() rounds to nearest: at most 2**-25 off within the frame.
                rows[node, axis, k] = np.float32(work[4, axis]) - BOX_MARGIN
                rows[node, 3 + axis, k] = np.float32(work[5, axis]) + BOX_MARGIN
            if end[k] - begin[k] <= leaf_size:
                links[node, CHILD, k] = begin[k]
                links[node, COUNT, k] = end[k] - begin[k]
            else:
                links[node, CHILD, k], links[node, COUNT, k] = n_nodes, 0
                todo[n_todo, 0], todo[n_todo, 3] = n_nodes, depth + 1
                todo[n_todo, 1], todo[n_todo, 2] = begin[k], end[k]
                n_todo += 1
                n_nodes += 1
    # Seven siblings wait at each level while the eighth is walked; eight places are written at once.
    stack = (WIDTH - 1) * deepest + 2 * WIDTH
    rows = rows[:n_nodes].copy()
    return rows, rows.view(np.int32), order, stack


@inlined
def _reciprocal(x):
    """1/x for a slab test, in float32, with tiny components replaced (never an infinity)."""
    if abs(x) < SMALLEST_COMPONENT:
        x = SMALLEST_COMPONENT if x >= 0.0 else -SMALLEST_COMPONENT
    return np.float32(1.0 / x)


@inlined
def box_ray(x, y, z, dx, dy, dz):
    """Return the `BoxRay` from an origin, frame units, along a direction."""
    rx, ry, rz = _reciprocal(dx), _reciprocal(dy), _reciprocal(dz)
    sx, sy, sz = 0 if rx > 0 else 3, 0 if ry > 0 else 3, 0 if rz > 0 else 3
    return BoxRay(np.float32(x), np.float32(y), np.float32(z), rx, ry, rz, sx, sy, sz)


@inlined
def cut_key(t):
    """Return the key above which nothing on the stack begins before t."""
    return sort_key(np.float32(t)) | 7


@inlined
def push_children(tree, node, ray, t_lo, t_cut, stack, top):
    """Push those children of a node that a ray meets between t_lo and t_cut.

    Returns the new height, and the key on top, `FARTHEST` if there is none.
    """
    return push_boxes(
        tree.rows, node, ray, np.float32(t_lo), np.float32(t_cut), stack.key, stack.parent, top
    )


@inlined
def descend(tree, node, ray, t_lo, t_cut, stack, top):
    """Go down from a node to the nearest leaf below it that begins before t_cut.

    Returns ``top`` the new height: what else is met is on the stack.
    ``first``, ``count`` the leaf's primitives, places in ``tree.order``; count 0: there is no such
    leaf.
    ``key`` of the leaf.
    ``nodes`` how many nodes were looked into.
    """
    nodes = 0
    while True:
        nodes += 1
        before = top
        top, key = push_children(tree, node, ray, t_lo, t_cut, stack, top)
        if top == before:
            return top, node, np.int64(0), key, nodes
        # The nearest never comes from the stack's memory: what follows need not wait for it.
        top -= 1
        count = np.int64(tree.links[node, COUNT, key & 7])
        node = np.int64(tree.links[node, CHILD, key & 7])
        if count > 0:
            return top, node, count, key, nodes


@inlined
def next_leaf(tree, ray, t_lo, t_cut, stack, top):
    """Walk on to the nearest leaf that begins before t_cut.

    ``top``: height of the stack; -1: the walk begins, at the root.

    Returns ``top``, ``first``, ``count``, ``nodes`` as `descend`; count 0: there is no leaf any
    more.
    """
    t_hi = cut_key(t_cut)
    nodes = 0
    while top != 0:
        if top > 0:
            top -= 1
            key, parent = np.int64(stack.key[top]), stack.parent[top]
            if key > t_hi:
                continue
            child = np.int64(tree.links[parent, CHILD, key & 7])
            count = np.int64(tree.links[parent, COUNT, key & 7])
        else:
            top, child, count = 0, np.int64(0), np.int64(0)
        if count == 0:
            top, child, count, _, more = descend(tree, child, ray, t_lo, t_cut, stack, top)
            nodes += more
        if count > 0:
            return top, child, count, nodes
    return top, np.int64(0), np.int64(0), nodes
