"""Rays against boxes along the axes."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    WITHIN_BAND,
    begins_at,
    doubt_start,
    is_known,
    not_zero,
    note_departure,
    offer,
)
from hybrid_rt.intersection.kernels.search.tolerances import (
    NEARLY_WITHIN,
    TANGENT_BAND,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner, kernel


class BoxTable(NamedTuple):
    """Boxes along the axes."""

    lo: Any  # (k, 4): and `meshing.surface.Surface.moved`
    hi: Any  # (k, 3)
    orientation: Any  # (k,)
    object_id: Any  # (k,) int32


def box_table(boxes, object_id):
    """Return the table of a list of boxes."""
    return BoxTable(
        lo=np.array([(*b.lo, b.moved) for b in boxes]).reshape(-1, 4),
        hi=np.array([b.hi for b in boxes]).reshape(-1, 3),
        orientation=np.array([float(b.orientation) for b in boxes]),
        object_id=object_id,
    )


@inlined
def _reach(lo, hi, o):
    """Return the scale of a box and a ray, along the axes."""
    reach = 0.0
    for c in range(3):
        reach = max(reach, hi[c] - lo[c], abs(lo[c] - o[c]), abs(hi[c] - o[c]))
    return reach


@inner
def _margin(lo, hi, o, d):
    """Return how far within the outline of a box a ray passes; negative: beside it.

    An edge of the outline is where a face that is entered meets one that is left: slopes p and q
    across them, at distances a and b ahead. The ray passes it by (b p - a q) / |(p, q)|.
    """
    least = np.inf
    for c in range(3):
        p = abs(d[c])
        a = lo[c] - o[c] if d[c] >= 0.0 else o[c] - hi[c]
        for e in range(3):
            q = abs(d[e])
            if e == c or p + q == 0.0:
                continue
            b = hi[e] - o[e] if d[e] >= 0.0 else o[e] - lo[e]
            least = min(least, (b * p - a * q) / np.sqrt(p * p + q * q))
    return least


@inlined
def _is_near_outline(lo, hi, o, d, inside, band):
    """Tell whether `_margin` is below a band.

    No slope is above 1, so the roots in it are at most sqrt(2): where b p - a q is above 1.5 band,
    they are not needed. Mostly one product tells: b p - a q is p q times the way from a face that is
    entered to one that is left, which is no shorter than ``inside``, the way inside the box.
    """
    least = min(abs(d[0]), abs(d[1]), abs(d[2]))
    if inside * least * least > 2.0 * band:
        return False
    for c in range(3):
        p = abs(d[c])
        a = lo[c] - o[c] if d[c] >= 0.0 else o[c] - hi[c]
        for e in range(3):
            q = abs(d[e])
            b = hi[e] - o[e] if d[e] >= 0.0 else o[e] - lo[e]
            if e != c and not b * p - a * q > 1.5 * band and p + q > 0.0:
                return _margin(lo, hi, o, d) < band
    return False


@inner
def _note_face(i, face, t_min, known, best):
    """Note the face of a box on which ray i begins."""
    x, y, z = np.float64(face < 2), np.float64(face // 2 == 1), np.float64(face > 3)
    note_departure(i, x, y, z, t_min, known, best)


@inlined
def offer_box(i, k, table, rays, best):
    """Offer both roots of ray i with box k, with the way inside it and the band for `finish_box`."""
    lo, hi, object_id = table.lo, table.hi, table.object_id
    o, d, t_min, known = rays.origin[i], rays.direction[i], rays.t_min, rays.known
    enter, leave, goes_on = -np.inf, np.inf, np.inf
    # Of an image that was moved another face may be entered last, or left first.
    latest_in, earliest_out = -np.inf, np.inf
    face_in = face_out = -1
    reach = _reach(lo[k], hi[k], o)
    moved = lo[k, 3]
    band = TANGENT_BAND * reach + moved
    is_beside = False
    for c in range(3):
        low, high = lo[k, c] - o[c], hi[k, c] - o[c]
        if d[c] == 0.0:
            if low > band or high < -band:
                return
            is_beside |= low > 0.0 or high < 0.0
            continue
        a, b = low / d[c], high / d[c]
        first, second = 2 * c, 2 * c + 1
        if d[c] < 0.0:
            a, b = b, a
            first, second = second, first
        if moved > 0.0:
            latest_in = max(latest_in, a + moved / abs(d[c]))
            earliest_out = min(earliest_out, b - moved / abs(d[c]))
        if a > enter:
            enter, face_in = a, first
        if b < leave:
            goes_on, leave, face_out = leave, b, second
        else:
            goes_on = min(goes_on, b)
    if face_in < 0:
        return
    p, q = abs(d[face_in // 2]), abs(d[face_out // 2])
    inside = leave - enter
    # How far the ray runs inside, seen across it at the edge between the two faces: no less than
    # inside p q / sqrt(2), so mostly no root is needed.
    if is_beside or not inside * p * q > 1.5 * band:
        depth = inside * (p * q / np.sqrt(p * p + q * q) if face_in // 2 != face_out // 2 else p)
        rounding = 4.0 * UNIT_ROUNDOFF * reach + moved
        if depth < band:
            # By so little that other pairs of faces count: of slabs that the ray runs along t says
            # little.
            depth = _margin(lo[k], hi[k], o, d)
        if depth < -rounding or is_beside:
            if depth > -band and leave + moved / q > t_min[i]:
                best.doubt[i] = min(best.doubt[i], leave)
            return
    crossed = 0.0
    if enter > leave:
        # By rounding, at an edge: the point of the ray next to it.
        crossed = enter - leave
        enter = leave = (enter * p * p + leave * q * q) / (p * p + q * q)
    off_in, off_out = max(moved / p, latest_in - enter), max(moved / q, leave - earliest_out)
    enter, leave = not_zero(enter, moved), not_zero(leave, moved)
    bound = 4.0 * UNIT_ROUNDOFF * abs(enter) + crossed + off_in
    if begins_at(i, enter, bound, p, known):
        _note_face(i, face_in, t_min, known, best)
    offer(i, enter, bound, p, CLEAR, object_id[k], face_in, inside, band, t_min, known, best)
    bound = 4.0 * UNIT_ROUNDOFF * abs(leave) + crossed + off_out
    if begins_at(i, leave, bound, q, known):
        _note_face(i, face_out, t_min, known, best)
    offer(i, leave, bound, q, CLEAR, object_id[k], face_out, inside, band, t_min, known, best)
    if min(abs(d[0]), abs(d[1]), abs(d[2])) < NEARLY_WITHIN:
        for c in range(3):
            if d[c] != 0.0:
                for side in (lo[k, c], hi[k, c]):
                    t = (side - o[c]) / d[c]
                    doubt_start(i, t, abs(d[c]), enter, leave, band, t_min, known, best)
    if is_known(i, leave, bound, q, known) and (goes_on - leave) * q < band:
        # It leaves the face so slowly that it passes the next one within the band.
        best.doubt[i] = min(best.doubt[i], goes_on)


@kernel
def trace_boxes(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the boxes up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, offer_box, end, table, rays, best, any_hit)


@kernel
def trace_box_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_boxes`, for the boxes in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(i, offer_box, table, members, rays, best, any_hit, stack)


@inlined
def finish_box(table, k, rays, best, i, out):
    """Describe the hit of ray i on box k."""
    o, d, t = rays.origin[i], rays.direction[i], best.t[i]
    if _is_near_outline(table.lo[k], table.hi[k], o, d, best.a[i], best.b[i]):
        best.tangent[i] = WITHIN_BAND
    face = best.primitive[i]
    axis = face // 2
    is_upper = face % 2 == 1
    gap = 0.0
    for c in range(3):
        p = o[c] + t * d[c]
        q = min(max(p, table.lo[k, c]), table.hi[k, c])
        if c == axis:
            q = table.hi[k, c] if is_upper else table.lo[k, c]
        gap += (p - q) ** 2
        out.position[i, c] = q
        out.normal[i, c] = 0.0
    s = table.orientation[k]
    out.normal[i, axis] = s if is_upper else -s
    first, second = (axis + 1) % 3, (axis + 2) % 3
    if is_upper != (s > 0):
        first, second = second, first
    lo, hi = table.lo[k], table.hi[k]
    out.u[i] = (out.position[i, first] - lo[first]) / (hi[first] - lo[first])
    out.v[i] = (out.position[i, second] - lo[second]) / (hi[second] - lo[second])
    out.patch_id[i] = face
    out.residual[i] = np.sqrt(gap)


@kernel
def finish_boxes(table, rays, best, row_of, out):
    """Describe the hits on boxes."""
    finish_each(finish_box, table, rays, best, row_of, out)
