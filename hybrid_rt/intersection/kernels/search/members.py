"""The surfaces of a table that a ray may meet: each of them, or those that a tree finds."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.frame import begin_of, end_of, enter_frame
from hybrid_rt.intersection.kernels.search.tree import box_ray, next_leaf
from meshing.kernels.jit import inlined

# Rays from farther away (in frame units) have a TANGENT band wider than the margin of the boxes.
FARTHEST = 2.0**25


class Members(NamedTuple):
    """Some surfaces of a table, in a frame that brings all of them within 1 of its origin."""

    tree: Any  # Tree; primitive p is row begin + p
    begin: int
    middle: Any  # (3,) float64, the frame's origin
    to_frame: float


@inlined
def offer_each(i, offer, end, table, rays, best, any_hit):
    """As `offer_near`, for all surfaces up to row ``end``, in their order."""
    for k in range(end):
        if any_hit and best.object_id[i] >= 0:
            break
        offer(i, k, table, rays, best)


@inlined
def offer_near(i, offer, table, members, rays, best, any_hit, stack):
    """Offer the roots of ray i with the surfaces that it comes near, front to back.

    ``offer``, kernel of i, row of the table, table, rays and best; ``best``, Nearest, changed.
    ``any_hit``: stop at the first hit.
    Returns nodes that were looked into.
    """
    if any_hit and best.object_id[i] >= 0:
        return 0
    tree, begin, middle, to_frame = members
    o, d, t_min = rays.origin[i], rays.direction[i], rays.t_min[i]
    dx, dy, dz = d[0], d[1], d[2]
    x, y, z, _, _, _, shift = enter_frame(
        o[0], o[1], o[2], dx, dy, dz, middle[0], middle[1], middle[2], to_frame
    )
    ray = box_ray(x, y, z, dx, dy, dz)
    t_lo = begin_of(t_min, to_frame, shift)
    is_far = abs(shift) > FARTHEST
    top, all_nodes = -1, 0
    first, count = np.int64(0), np.int64(tree.order.shape[0])
    # One place where surfaces are offered: their code is compiled into it.
    while True:
        if not is_far:
            t_cut = end_of(best.t[i], to_frame, shift)
            top, first, count, nodes = next_leaf(tree, ray, t_lo, t_cut, stack, top)
            all_nodes += nodes
        for k in range(first, first + count):
            if not (any_hit and best.object_id[i] >= 0):
                offer(i, begin + tree.order[k], table, rays, best)
        if is_far or count == 0 or (any_hit and best.object_id[i] >= 0):
            return all_nodes


@inlined
def finish_each(finish, table, rays, best, row_of, out):
    """Describe the hits on a kind by ``finish``; ``row_of`` (objects,) is the object's row or -1."""
    for i in range(best.t.shape[0]):
        if best.object_id[i] >= 0 and row_of[best.object_id[i]] >= 0:
            finish(table, row_of[best.object_id[i]], rays, best, i, out)
