"""Rays brought into the frames of places, and what they hit there brought back.

Each ray walks a tree over the boxes of all places, front to back, and stops at the next place whose box it
meets in the surfaces' own frame. There any kernel can trace it. Its t is the same number in both frames, but
for a power of two: limits, ties and points that are named lose nothing.

The inverse of a similarity A is its transpose over the square of its scale, up to rounding; one step of
iterative refinement, with the residual in doubled precision, leaves the rounding of the result alone.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import product, two_difference
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.frame import begin_of, end_of, enter_frame
from hybrid_rt.intersection.kernels.search.members import FARTHEST
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, PASSED, WITHIN_BAND
from hybrid_rt.intersection.kernels.search.rays import scale_ray
from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.tree import (
    SMALLEST_COMPONENT,
    Stack,
    box_ray,
    next_leaf,
)
from meshing.kernels.jit import inlined, kernel
from meshing.kernels.stored_calls import call_stored

# Origin and direction in the frame are within one rounding of the exact ones, which moves the ray by this
# times its way, and as much again for what that moves along a bent surface.
ROUNDING = 4.0 * UNIT_ROUNDOFF
# Boxes are met that are missed by this part of their size, or of the way to them: more than a matrix may be
# off from a similarity, and far more than the band.
NEAR_SIZE, NEAR_WAY = 2.0**-20, 2.0**-38


class Places(NamedTuple):
    """Places of surfaces; those of one object follow each other."""

    matrix: Any  # (n, 3, 4) float64
    block: Any  # (n,) int32: the row of its object below
    first: Any  # (blocks,) int64: its first place
    object_id: Any  # (blocks,) int32
    # (blocks, 3) float64: where the frame of the surfaces has its origin, where they are given
    origin: Any
    box: Any  # (blocks, 2, 3) float64: middle and half sides, in that frame
    n_patches: Any  # (blocks,) int64
    model: Any  # (blocks,) int32: which surfaces


class Walks(NamedTuple):
    """How far each ray has come on its way through the tree."""

    top: Any  # (n,) int32: height of its stack, -1 before the walk, -2 behind it
    first: Any  # (n,) int32: what is left of the leaf that it is in
    count: Any  # (n,) int32
    key: Any  # (n, m) int32: its stack
    parent: Any  # (n, m) uint32


class Pairs(NamedTuple):
    """Rays, each in the frame of a place."""

    row: Any  # (m,) int64: of the ray
    place: Any  # (m,) int32
    unit: Any  # (m,) float64: t in the world over t here, a power of two
    origin: Any  # (m, 3) float64
    direction: Any  # (m, 3) float64, scaled as `Rays` have them
    t_min: Any  # (m,) float64
    t: Any  # (m,) float64: limit
    known: Any  # (m, 6) float64, or (0, 6)


class OnePlace(NamedTuple):
    """What a single ray in a place is traced with, and how; rows of the model's kinds follow each other."""

    pairs: Any  # Pairs of one row
    found: Any  # Nearest of one row
    local: Any  # Finished of one row
    member: Any  # (1,) int32: the surface in the nearest place
    primitive: Any  # (1,) int32: the primitive on it
    row: Any  # (1,) int64: 0
    call: Any  # (n,) int64: calls that find first hits, any hit, and describe hits
    # (models, 4) int64: where those for each purpose begin, see `kernels.single_rays`
    first_call: Any
    first_patch: Any  # (surfaces,) int64, of all models
    first_surface: Any  # (models + 1,) int64


@inlined
def _less_product(h, low, a, x, y, z):
    """Return h + low - a . (x, y, z) as a sum of two numbers."""
    p, e = product(a[0], x)
    h, f = two_difference(h, p)
    low += f - e
    p, e = product(a[1], y)
    h, f = two_difference(h, p)
    low += f - e
    p, e = product(a[2], z)
    h, f = two_difference(h, p)
    low += f - e
    r = h + low
    return r, low - (r - h)


@inlined
def _taken_back(a, over, hx, lx, hy, ly, hz, lz):
    """Solve A x = h + l; ``over`` is 1 over the square of the scale."""
    x = (a[0, 0] * hx + a[1, 0] * hy + a[2, 0] * hz) * over
    y = (a[0, 1] * hx + a[1, 1] * hy + a[2, 1] * hz) * over
    z = (a[0, 2] * hx + a[1, 2] * hy + a[2, 2] * hz) * over
    rx, _ = _less_product(hx, lx, a[0], x, y, z)
    ry, _ = _less_product(hy, ly, a[1], x, y, z)
    rz, _ = _less_product(hz, lz, a[2], x, y, z)
    x += (a[0, 0] * rx + a[1, 0] * ry + a[2, 0] * rz) * over
    y += (a[0, 1] * rx + a[1, 1] * ry + a[2, 1] * rz) * over
    z += (a[0, 2] * rx + a[1, 2] * ry + a[2, 2] * rz) * over
    return x, y, z


@inlined
def _square_of_scale(a):
    total = 0.0
    for j in range(3):
        for k in range(3):
            total += a[j, k] * a[j, k]
    return total / 3.0


@inlined
def _is_reflection(a):
    x = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    y = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    z = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    return a[0, 0] * x + a[0, 1] * y + a[0, 2] * z < 0.0


@inlined
def _enter(i, k, rays, places, pairs, place):
    """Write ray i in the frame of a place as row k of ``pairs``, but for its limits."""
    o, d, a = rays.origin[i], rays.direction[i], places.matrix[place]
    over = 1.0 / _square_of_scale(a)
    hx, lx = two_difference(o[0], a[0, 3])
    hy, ly = two_difference(o[1], a[1, 3])
    hz, lz = two_difference(o[2], a[2, 3])
    c = places.origin[places.block[place]]
    if c[0] != 0.0 or c[1] != 0.0 or c[2] != 0.0:
        hx, lx = _less_product(hx, lx, a[0], c[0], c[1], c[2])
        hy, ly = _less_product(hy, ly, a[1], c[0], c[1], c[2])
        hz, lz = _less_product(hz, lz, a[2], c[0], c[1], c[2])
    x, y, z = _taken_back(a, over, hx, lx, hy, ly, hz, lz)
    pairs.origin[k, 0], pairs.origin[k, 1], pairs.origin[k, 2] = x, y, z
    x, y, z = _taken_back(a, over, d[0], 0.0, d[1], 0.0, d[2], 0.0)
    pairs.direction[k, 0], pairs.direction[k, 1], pairs.direction[k, 2] = x, y, z
    pairs.unit[k] = scale_ray(pairs.direction, k, pairs.direction, k)
    pairs.row[k], pairs.place[k] = i, place


@inlined
def _meets_box(o, d, a, c, box, t_min, t_best):
    """Tell whether a ray comes near the box of a place in time; plain sums will do for that."""
    over = 1.0 / _square_of_scale(a)
    hx, hy, hz = o[0] - a[0, 3], o[1] - a[1, 3], o[2] - a[2, 3]
    away, longest, size = 0.0, 0.0, max(box[1, 0], box[1, 1], box[1, 2])
    for k in range(3):
        x = (a[0, k] * hx + a[1, k] * hy + a[2, k] * hz) * over
        away = max(away, abs(x), abs(c[k]), abs(box[0, k]))
        longest = max(longest, abs(a[0, k] * d[0] + a[1, k] * d[1] + a[2, k] * d[2]) * over)
    margin = NEAR_SIZE * size + NEAR_WAY * away
    least, near, far = SMALLEST_COMPONENT * longest, t_min, t_best
    for k in range(3):
        x = (a[0, k] * hx + a[1, k] * hy + a[2, k] * hz) * over - c[k] - box[0, k]
        step = (a[0, k] * d[0] + a[1, k] * d[1] + a[2, k] * d[2]) * over
        if abs(step) < least:
            step = least
        half, per_t = box[1, k] + margin, 1.0 / step
        first, last = (-half - x) * per_t, (half - x) * per_t
        near, far = max(near, min(first, last)), min(far, max(first, last))
    return near <= far


@inlined
def _take_limits(i, k, rays, best, places, pairs):
    """Write the limits of t, and the points that are named, into row k of ``pairs``."""
    unit = pairs.unit[k]
    pairs.t_min[k] = rays.t_min[i] / unit
    t = best.t[i] / unit
    # A root at the same t in a lower place is nearer: here it has to be found.
    pairs.t[k] = t if best.object_id[i] < 0 else t + 2.0 * UNIT_ROUNDOFF * abs(t) + 2.0**-1074
    if rays.known.shape[0] == 0:
        return
    o, d = pairs.origin[k], pairs.direction[k]
    over = 1.0 / np.sqrt(_square_of_scale(places.matrix[pairs.place[k]]))
    start = abs(o[0]) + abs(o[1]) + abs(o[2])
    length = abs(d[0]) + abs(d[1]) + abs(d[2])
    for c in range(0, 4, 2):
        t, radius = rays.known[i, c] / unit, rays.known[i, c + 1]
        pairs.known[k, c], pairs.known[k, c + 1] = t, radius
        if radius > 0.0:
            pairs.known[k, c + 1] = radius * over + ROUNDING * (start + abs(t) * length)
    if rays.known[i, 3] == PASSED:
        # Surfaces in a place have numbers of their own: at the same t all of its object are passed, or none.
        is_later = places.object_id[places.block[pairs.place[k]]] > rays.known[i, 2]
        pairs.known[k, 2] = -1.0 if is_later else np.inf
    pairs.known[k, 4], pairs.known[k, 5] = -1.0, np.nan


@kernel
def next_places(places, members, rays, best, any_hit, walks, active, n_active, most, pairs):
    """Bring each ray that is still walking into the next places whose boxes it meets.

    ``rays``, Rays of n rows; ``best``, Nearest of n rows; ``walks``, Walks of n rows, changed.
    ``members``: a tree over places from ``members.begin`` on.
    ``any_hit``: rays that have a hit go no farther.
    ``active`` (n,) int64, changed: the first ``n_active`` are rows that are walking; afterwards
    those that go on.
    ``most``: places of each ray.
    ``pairs``, Pairs of ``n_active * most`` rows or more, written: their t is what is nearest so
    far, and a little more where a tie may be found.
    Returns ``n_active``.
    ``n_pairs``.
    ``nodes``: nodes that were looked into.
    """
    tree, begin, middle, to_frame = members
    n_pairs, n_left, all_nodes = 0, 0, 0
    for j in range(n_active):
        i = active[j]
        if any_hit and best.object_id[i] >= 0:
            continue
        o, d = rays.origin[i], rays.direction[i]
        x, y, z, _, _, _, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], to_frame
        )
        ray = box_ray(x, y, z, d[0], d[1], d[2])
        t_lo = begin_of(rays.t_min[i], to_frame, shift)
        top, first, count = np.int64(walks.top[i]), np.int64(walks.first[i]), walks.count[i]
        if top == -1 and abs(shift) > FARTHEST:
            # From so far single precision knows nothing: each place is asked.
            top, first, count = np.int64(0), np.int64(0), tree.order.shape[0]
        left = np.int64(count)
        stack = Stack(walks.key[i], walks.parent[i])
        found = 0
        while found < most:
            if left == 0:
                t_cut = end_of(best.t[i], to_frame, shift)
                top, first, left, nodes = next_leaf(tree, ray, t_lo, t_cut, stack, top)
                all_nodes += nodes
                if left == 0:
                    break
            place = np.int64(begin + tree.order[first])
            first += 1
            left -= 1
            block = places.block[place]
            if rays.known.shape[0] > 0 and rays.known[i, 4] == places.object_id[block]:
                continue
            a, c, box = places.matrix[place], places.origin[block], places.box[block]
            if _meets_box(o, d, a, c, box, rays.t_min[i], best.t[i]):
                _enter(i, n_pairs, rays, places, pairs, place)
                _take_limits(i, n_pairs, rays, best, places, pairs)
                n_pairs += 1
                found += 1
        if found == most:
            walks.top[i], walks.first[i], walks.count[i] = top, first, left
            active[n_left] = i
            n_left += 1
    return n_left, n_pairs, all_nodes


@kernel
def keep_nearest(places, pairs, found, rays, best, member, primitive):
    """Lower ``best`` to what was found in places.

    Equal t: the lower object, then the lower place, surface, patch of it.

    ``pairs``, Pairs of m rows.
    ``found``, Nearest of m rows: its objects are the surfaces in a place.
    ``rays``, Rays of n rows: in its scratch is noted which rays begin on a face, see
    `search.nearest.note_departure`.
    ``best``, Nearest of n rows, changed: ``primitive`` becomes the place.
    ``member``, ``primitive`` (n,) int32, changed: the surface, and the primitive on it.
    """
    for k in range(found.t.shape[0]):
        i, place, unit = pairs.row[k], pairs.place[k], pairs.unit[k]
        best.doubt[i] = min(best.doubt[i], found.doubt[k] * unit)
        if pairs.known.shape[0] > 0 and not np.isnan(pairs.known[k, 5]):
            # Of faces in two places nothing tells whether they lie in one plane.
            if not np.isnan(rays.known[i, 5]):
                best.doubt[i] = -np.inf
            rays.known[i, 5] = np.inf
        if found.object_id[k] < 0:
            continue
        t, object_id = found.t[k] * unit, places.object_id[places.block[place]]
        if t > best.t[i]:
            continue
        holder = best.object_id[i]
        if t == best.t[i]:
            if holder < 0 or holder < object_id:
                continue
            if holder == object_id and best.primitive[i] < place:
                continue
        best.t[i], best.t_bound[i] = t, found.t_bound[k] * unit
        best.object_id[i], best.primitive[i] = object_id, place
        best.a[i], best.b[i], best.tangent[i] = found.a[k], found.b[k], found.tangent[k]
        member[i], primitive[i] = found.object_id[k], found.primitive[k]


@kernel
def enter_again(places, rays, best, member, primitive, rows, pairs, found):
    """Bring rays with hits in places into these: the reverse of `keep_nearest`.

    ``rows`` (m,) int64 are the rays; ``pairs`` and ``found`` of m rows are written.
    """
    for k in range(rows.shape[0]):
        i = rows[k]
        _enter(i, k, rays, places, pairs, best.primitive[i])
        _take_limits(i, k, rays, best, places, pairs)
        unit = pairs.unit[k]
        found.t[k], found.t_bound[k] = best.t[i] / unit, best.t_bound[i] / unit
        found.object_id[k], found.primitive[k] = member[i], primitive[i]
        found.a[k], found.b[k], found.tangent[k] = best.a[i], best.b[i], best.tangent[i]
        found.doubt[k] = best.doubt[i] / unit


@inlined
def _image(a, j, c, p):
    """Return coordinate j of A (c + p) + b, with one rounding."""
    high, low = _less_product(a[j, 3], 0.0, a[j], -c[0], -c[1], -c[2])
    high, _ = _less_product(high, low, a[j], -p[0], -p[1], -p[2])
    return high


@kernel
def leave_places(places, pairs, found, first_patch, local, rays, best, out):
    """Bring hits that are described in the frames of places back into the world.

    ``pairs``, Pairs of m rows; ``found``, Nearest of m rows; ``local``, Finished of m rows;
    ``rays``, Rays of n rows; ``out``, Finished of n rows, written.
    ``first_patch`` (surfaces,) int64: of each surface in a place.
    ``best``, Nearest of n rows, changed: its bounds, doubts and marks become those of ``found``,
    with what the frame has rounded.
    """
    for k in range(found.t.shape[0]):
        i, place, unit = pairs.row[k], pairs.place[k], pairs.unit[k]
        a, block = places.matrix[place], places.block[place]
        n = local.normal[k]
        x = a[0, 0] * n[0] + a[0, 1] * n[1] + a[0, 2] * n[2]
        y = a[1, 0] * n[0] + a[1, 1] * n[1] + a[1, 2] * n[2]
        z = a[2, 0] * n[0] + a[2, 1] * n[1] + a[2, 2] * n[2]
        length = np.sqrt(x * x + y * y + z * z)
        if _is_reflection(a):
            length = -length
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = x / length, y / length, z / length
        for c in range(3):
            out.position[i, c] = _image(a, c, places.origin[block], local.position[k])
        out.u[i], out.v[i], out.flags[i] = local.u[k], local.v[k], local.flags[k]
        out.residual[i] = local.residual[k] * np.sqrt(_square_of_scale(a))
        own = first_patch[found.object_id[k]] + local.patch_id[k]
        out.patch_id[i] = (place - places.first[block]) * places.n_patches[block] + own
        # --- what the frame has rounded
        o, d, t = pairs.origin[k], pairs.direction[k], found.t[k]
        start, way, slope = 0.0, 0.0, 0.0
        for c in range(3):
            start += o[c] * o[c]
            way += d[c] * d[c]
            slope += n[c] * d[c]
        off = ROUNDING * (np.sqrt(start) + abs(t) * np.sqrt(way)) / abs(slope)
        best.t_bound[i] = (found.t_bound[k] + off) * unit
        best.doubt[i], best.tangent[i] = found.doubt[k] * unit, found.tangent[k]
        if best.t[i] - best.t_bound[i] <= rays.t_min[i]:
            best.tangent[i] = WITHIN_BAND


@kernel
def trace_one(places, members, rays, best, any_hit, walks, one, counters):
    """Lower ``best`` to the first hits of one ray in all places of a tree; see `next_places`.

    The calls of ``one`` trace ``one.pairs`` and lower ``one.found``.
    """
    walks.top[0], walks.first[0], walks.count[0], one.row[0] = -1, 0, 0, 0
    found, purpose = one.found, 1 if any_hit else 0
    while True:
        _, n_pairs, nodes = next_places(
            places, members, rays, best, any_hit, walks, one.row, 1, 1, one.pairs
        )
        counters[NODES] += nodes
        if n_pairs == 0:
            return
        found.t[0], found.t_bound[0], found.doubt[0] = one.pairs.t[0], 0.0, np.inf
        found.object_id[0], found.primitive[0], found.tangent[0] = -1, 0, CLEAR
        found.a[0] = found.b[0] = 0.0
        model = places.model[places.block[one.pairs.place[0]]]
        for c in range(one.first_call[model, purpose], one.first_call[model, purpose + 1]):
            call_stored(one.call[c])
        keep_nearest(places, one.pairs, found, rays, best, one.member, one.primitive)


@kernel
def describe_one(places, rays, best, one, out):
    """Describe the hit of one ray, which is in a place; see `trace_one`."""
    one.row[0] = 0
    enter_again(places, rays, best, one.member, one.primitive, one.row, one.pairs, one.found)
    one.local.flags[0] = 0
    model = places.model[places.block[best.primitive[0]]]
    for c in range(one.first_call[model, 2], one.first_call[model, 3]):
        call_stored(one.call[c])
    first_patch = one.first_patch[one.first_surface[model] : one.first_surface[model + 1]]
    leave_places(places, one.pairs, one.found, first_patch, one.local, rays, best, out)
