"""One walk through the trees of all kinds of surfaces: front to back, no farther than the nearest root.

Each tree has a frame of its own; a tree over their boxes says which of them a ray comes to. What is in one is
found by stored calls of the kernels of its kind, so that one walk serves whatever kinds there are.
"""

from typing import Any, NamedTuple

from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import offer_near
from meshing.kernels.jit import inlined, kernel
from meshing.kernels.stored_calls import call_stored

# A box is looked into where the ray comes this near to it, of the way there; the band is far narrower.
NEAR = 2.0**-38
# Less of a direction counts as so much.
STEEPEST = 1e-30


class Bottoms(NamedTuple):
    """Trees of any kinds, each with the calls that trace a ray through it."""

    box: Any  # (k, 2, 3) float64: around what is in each, and the band
    call: Any  # (n,) int64, see `meshing.kernels.stored_calls`
    begin: Any  # (2, k + 1) int64: where those of each begin, for first hits and for any hits
    members: Any  # Members: a tree over the boxes
    stack: Any  # Stack for it


@inlined
def _comes_near(i, box, rays, best):
    """Tell whether ray i comes near a box in time; plain sums will do for that."""
    o, d, near, far = rays.origin[i], rays.direction[i], 0.0, best.t[i]
    margin = NEAR * max(abs(o[0]), abs(o[1]), abs(o[2]))
    for k in range(3):
        step = d[k] if abs(d[k]) > STEEPEST else STEEPEST
        first, last = (box[0, k] - margin - o[k]) / step, (box[1, k] + margin - o[k]) / step
        near, far = max(near, min(first, last)), min(far, max(first, last))
    return near <= far


@inlined
def _ask(i, k, asked, rays, best):
    bottoms, purpose = asked
    if _comes_near(i, bottoms.box[k], rays, best):
        for c in range(bottoms.begin[purpose, k], bottoms.begin[purpose, k + 1]):
            call_stored(bottoms.call[c])


@inlined
def ask_each(bottoms, rays, best, any_hit):
    """Lower ``best`` to the nearest root of a ray, both of one row, for which the calls were stored.

    ``any_hit``: stop at the first hit.
    """
    asked = bottoms, 1 if any_hit else 0
    for k in range(bottoms.box.shape[0]):
        if any_hit and best.object_id[0] >= 0:
            break
        _ask(0, k, asked, rays, best)


@kernel
def trace_bottoms(bottoms, rays, best, any_hit, one, nearest, counters):
    """Lower ``best`` to the nearest roots of a batch of rays.

    ``one``, Rays of one row, and ``nearest``, Nearest of one row: those for which the calls were stored. Where
    the batch names no points, what ``one`` names holds for all.
    """
    has_known, asked = rays.known.shape[0] > 0, (bottoms, 1 if any_hit else 0)
    for i in range(best.t.shape[0]):
        if any_hit and best.object_id[i] >= 0:
            continue
        for k in range(3):
            one.origin[0, k], one.direction[0, k] = rays.origin[i, k], rays.direction[i, k]
        one.t_min[0] = rays.t_min[i]
        for k in range(6 if has_known else 0):
            one.known[0, k] = rays.known[i, k]
        _copy_row(best, i, nearest, 0)
        # The calls count in the same place.
        nodes = offer_near(0, _ask, asked, bottoms.members, one, nearest, any_hit, bottoms.stack)
        counters[NODES] += nodes
        _copy_row(nearest, 0, best, i)
        if has_known:
            rays.known[i, 5] = one.known[0, 5]


@kernel
def rows_near(box, rays, best, rows):
    """Write which of n rays come near a box (2, 3) into ``rows`` (n,) int64; return how many."""
    n = 0
    for i in range(best.t.shape[0]):
        if _comes_near(i, box, rays, best):
            rows[n] = i
            n += 1
    return n


@inlined
def _copy_row(source, i, to, j):
    to.t[j], to.t_bound[j], to.doubt[j] = source.t[i], source.t_bound[i], source.doubt[i]
    to.object_id[j], to.primitive[j] = source.object_id[i], source.primitive[i]
    to.a[j], to.b[j], to.tangent[j] = source.a[i], source.b[i], source.tangent[i]
