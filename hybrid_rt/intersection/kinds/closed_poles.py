"""Collapsed edges around which a surface is closed: no ray that passes there can be lost.

A collapsed edge is a point P, and its patch a sector there: in the cone of its control points as
seen from P. Sectors that share their sides, all around P, make a disc. Let a be its mean normal,
and let every control point of the disc, seen from P, rise by at most ``steep`` over its distance
from the axis a. Seen along a ray's direction d the disc's rim is then a closed curve around P. No
ray that passes P within the rim's distance misses the disc, since the winding number of the rim
about it is the degree of the disc's projection.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.patch.finish import POLE_COLUMNS

# Points agree where they differ by no more than this part of the largest coordinate.
SAME = 16.0 * 2.0**-52
# Sectors are looked for at points that are the same in so many steps of the frame.
PLACES = 2.0**32
# The disc reaches to this part of the patches, and its sectors are cut into so many.
PART, CUTS = 2.0**-16, 4
# Cosine of half the widest sector, and what is left of a vector's length, seen aslant, for
# ``steep`` times the tangent of the angle between d and a up to `kernels.patch.finish.ASLANT`.
NARROW, LEFT = 0.5, 0.25
# The rim's area, over the sum of squares, below which it has no axis.
LEAST_AREA = 1e-3


class _Sector(NamedTuple):
    """One collapsed edge: the net from it on, as (wx, wy, wz, w) about its point."""

    patch: int
    side: int
    point: FloatArray  # (3,) in the frame
    net: FloatArray  # (a, b, 4), b away from the edge


def closed_poles(
    control: FloatArray,
    start: Sequence[int],
    degree: Sequence[tuple[int, int]],
    centre: FloatArray,
    object_id: IntArray,
) -> FloatArray:
    """Describe the closed pole at each side of each patch.

    ``control`` (total, 4): homogeneous nets about ``centre``, the last column 1 for polynomial
    patches.
    ``start``, ``degree``, ``centre``, ``object_id``: of k patches, as in `PatchTable`.
    Returns (k, 4, `POLE_COLUMNS`): for the sides u = 0, 1, v = 0, 1: the point about the patch's
    centre, the axis, ``steep`` and the distance of the rim; all 0 where there is none.
    """
    out = np.zeros((len(start), 4, POLE_COLUMNS))
    sectors: dict[tuple[int, ...], list[_Sector]] = {}
    for patch, side in _candidates(control, start, degree):
        m, n = degree[patch]
        net = control[start[patch] : start[patch] + (m + 1) * (n + 1)].reshape(m + 1, n + 1, 4)
        size = np.abs(net[..., :3] / net[..., 3:]).max()
        net = _from_side(net, side)
        point = net[0, 0, :3] / net[0, 0, 3]
        away = net[..., :3] - net[..., 3:] * point
        if (np.abs(away[:, 0]) <= SAME * size).all():
            away[:, 0] = 0.0
            net = np.concatenate([away, net[..., 3:]], axis=2)
            one = _Sector(patch, side, point + centre[patch], net)
            # Where rounding parts them nothing is proven, and displaced rays are traced.
            place = np.round(one.point * PLACES).astype(np.int64).tolist()
            sectors.setdefault((int(object_id[patch]), *place), []).append(one)
    for some in sectors.values():
        for ring in _rings(some):
            pole = _pole([_turned(some[k].net, forward) for k, forward in ring])
            if pole is None:
                continue
            for one in (some[k] for k, _ in ring):
                out[one.patch, one.side] = [*(one.point - centre[one.patch]), *pole]
    return out


def _candidates(
    control: FloatArray, start: Sequence[int], degree: Sequence[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Return patches and sides whose two corners agree, roughly."""
    first, (m, n) = np.asarray(start), np.asarray(degree).T
    corners = first + np.stack([0 * m, n, m * (n + 1), m * (n + 1) + n])
    points = control[corners, :3] / control[corners, 3:]
    size = np.abs(points).max(axis=(0, 2))
    pairs = [(0, 1), (2, 3), (0, 2), (1, 3)]
    same = [np.abs(points[a] - points[b]).max(axis=1) <= 1e-9 * size for a, b in pairs]
    found = np.argwhere(np.stack(same, axis=1))
    return [(int(k), int(side)) for k, side in found]


def _from_side(net: FloatArray, side: int) -> FloatArray:
    """Return a net whose second axis leads away from a side."""
    if side < 2:
        net = net.transpose(1, 0, 2)
    return net[:, ::-1] if side % 2 else net


def _turned(net: FloatArray, forward: bool) -> FloatArray:
    return net if forward else net[::-1]


def _rings(sectors: Sequence[_Sector]) -> list[list[tuple[int, bool]]]:
    """Return sectors that follow each other around a point, each with its sense, until they close."""
    ends = [(k, end) for k in range(len(sectors)) for end in (0, 1)]
    partner: dict[tuple[int, int], tuple[int, int]] = {}
    for one in ends:
        same = [other for other in ends if other != one and _agree(sectors, one, other)]
        if len(same) == 1:
            partner[one] = same[0]
    rings, seen = [], set()
    for first in range(len(sectors)):
        ring, at = [], (first, 0)
        while at[0] not in seen:
            seen.add(at[0])
            ring.append((at[0], at[1] == 0))
            at = partner.get((at[0], 1 - at[1]), (-1, 0))
            if at[0] < 0:
                break
        if at == (first, 0) and ring:
            rings.append(ring)
    return rings


def _agree(sectors: Sequence[_Sector], one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Tell whether two sides of sectors are the same curve."""
    (a, p), (b, q) = ((sectors[k], sectors[k].net[-end]) for k, end in (one, other))
    if len(p) != len(q):
        return False
    x, y = a.point + p[:, :3] / p[:, 3:], b.point + q[:, :3] / q[:, 3:]
    near = SAME * max(np.abs(x).max(), np.abs(y).max())
    ratio = (p[:, 3] / p[0, 3]) / (q[:, 3] / q[0, 3])
    return bool((np.abs(x - y) <= near).all() and (np.abs(ratio - 1.0) <= SAME).all())


def _pole(nets: Sequence[FloatArray]) -> tuple[float, ...] | None:
    """Return the axis, how steep and how wide a closed disc of sectors is; None: nothing is proven."""
    parts = []
    for net in nets:
        near = np.swapaxes(_first_part(np.swapaxes(net, 0, 1), PART), 0, 1)
        for cut in range(CUTS, 0, -1):
            parts.append(_first_part(near, 1.0 / cut))
            near = _first_part(near[::-1], 1.0 - 1.0 / cut)[::-1] if cut > 1 else near
    seen = [part[..., :3] / part[..., 3:] for part in parts]
    rim = np.concatenate([points[:-1, -1] for points in seen])
    area = np.cross(rim, np.roll(rim, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(area))
    if not length > LEAST_AREA * float((rim**2).sum()):
        return None
    axis = area / length
    steep, reach, turn = 0.0, np.inf, 0.0
    for points in seen:
        vectors = points[:, 1:]
        rise = vectors @ axis
        flat = vectors - rise[..., None] * axis
        wide = np.linalg.norm(flat, axis=-1)
        if not wide.min() > 1e-6 * wide.max():
            return None
        steep = max(steep, float((np.abs(rise) / wide).max()))
        reach = min(reach, float(wide[:, -1].min()))
        unit = flat / wide[..., None]
        middle = unit.sum(axis=(0, 1))
        if not (unit @ middle).min() > NARROW * np.linalg.norm(middle):
            return None
        first, last = unit[0, -1], unit[-1, -1]
        turn += float(np.arctan2(np.cross(first, last) @ axis, first @ last))
    # A whole number of turns; none if a sector folds back.
    if not turn > np.pi:
        return None
    return (*axis.tolist(), steep, LEFT * reach)


def _first_part(net: FloatArray, end: float) -> FloatArray:
    """Restrict the first axis of a net to [0, end] by de Casteljau's algorithm."""
    out, rest = [], np.array(net)
    while len(rest):
        out.append(rest[0])
        rest = (1.0 - end) * rest[:-1] + end * rest[1:]
    return np.array(out)
