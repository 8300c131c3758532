"""Extremes over faces by branch and bound: the tight box of a body, and the draft of each face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.part.cells import BALL, BORDER, FACE, TURN, TURNED, Cells, Ints, Solid

# Cells smaller than this part of the size are no longer halved; so many halvings at most.
SMALLEST, DEEPEST = 1e-9, 60
# Cells by which boxes and drafts are found, at once.
MOST_CELLS = 50_000


class Box(NamedTuple):
    """The tight box of a body: points of it, (2, 3), and how far it may reach beyond them, proven."""

    corners: FloatArray
    bound: float


class Draft(NamedTuple):
    """Draft angles of a face, radians: the least and the largest found, and what is proven of them.

    They are those between the face and the pull direction, positive where the normal leans toward it.
    """

    least: float
    most: float
    least_bound: float
    most_bound: float


def box_of(cells: Cells, roots: Ints, size: float, tolerance: float) -> Box:
    """Return the box of a body: where a face goes farthest its normal is along the axis, or it ends."""
    corners, off = np.empty((2, 3)), 0.0
    for axis in range(3):
        for end, sign in ((0, -1.0), (1, 1.0)):
            way = sign * np.eye(3)[axis]
            most, bound = _farthest(cells, roots, way, size, tolerance)
            corners[end, axis] = sign * most
            off = max(off, bound - most)
    return Box(corners, off)


def _farthest(
    cells: Cells, roots: Ints, way: FloatArray, size: float, tolerance: float
) -> tuple[float, float]:
    leaves, best, floor = roots, -np.inf, -np.inf
    for _ in range(DEEPEST):
        points = cells.corners[leaves].reshape(-1, 4, 3) @ way
        upper = (
            points.max(axis=1) + cells.eps_along(leaves, np.tile(way, (len(leaves), 1, 1)))[:, 0]
        )
        # Points are rho along the normal from their core, where they have one.
        core = (cells.core[leaves].reshape(-1, 4, 3) @ way).max(axis=1)
        core += cells.core_eps[leaves, 0] + np.abs(cells.rho[leaves, 0])
        upper = np.where(cells.is_round[leaves, 0] > 0.0, np.minimum(upper, core), upper)
        kinds = cells.ints[leaves]
        real = (kinds[:, 3] == BORDER) | (kinds[:, 6] == 1)
        best = max(best, float((cells.middle[leaves[real]] @ way).max(initial=-np.inf)))
        # The first two corners of an arc are its ends.
        best = max(best, float(points[kinds[:, 3] == BORDER, :2].max(initial=-np.inf)))
        keeps = (upper > best + tolerance) & (
            (kinds[:, 3] != FACE) | _may_lie_along(cells, leaves, way)
        )
        done = keeps & (cells.radius[leaves, 0] < SMALLEST * size)
        floor = max(
            floor,
            float(
                upper[done | ((upper <= best + tolerance) & (upper > best))].max(initial=-np.inf)
            ),
        )
        leaves = leaves[keeps & ~done]
        if not len(leaves) or len(leaves) > MOST_CELLS:
            break
        flat = cells.ints[leaves, 3] == FACE
        arcs = leaves[~flat]
        cells.halved(arcs)
        arcs = cells.children[arcs].ravel()
        leaves = np.concatenate(
            [cells.cut(leaves[flat], _axis_to_cut(cells, leaves[flat], way)), arcs[arcs >= 0]]
        )
    if len(leaves):
        points = cells.corners[leaves].reshape(-1, 4, 3) @ way
        floor = max(floor, float((points.max(axis=1) + cells.eps[leaves, 0]).max()))
    return best, max(best, floor)


def _axis_to_cut(cells: Cells, leaves: Ints, way: FloatArray) -> Ints:
    """Return the parameter along which cells bend and rise more, as seen along a direction."""
    solid, patch = cells.solids[0], cells.ints[leaves, 2]
    s_uu, s_vv = solid.slopes[patch][:, 2::2].T
    half = 0.5 * (cells.box[leaves][:, 1::2] - cells.box[leaves][:, ::2])
    turns = np.isin(solid.form[patch], (TURNED, BALL))
    across = np.sqrt(np.maximum(1.0 - turns * (solid.axis[patch] @ way) ** 2, 0.0))
    # What does not change along a parameter is not cut by it.
    rise = cells.corners[leaves].reshape(-1, 4, 3) @ way
    bent_u = s_uu * half[:, 0] ** 2 * across + np.abs(rise[:, 1::2] - rise[:, ::2]).max(axis=1)
    bent_v = s_vv * half[:, 1] ** 2 + np.abs(rise[:, 2:] - rise[:, :2]).max(axis=1)
    return (bent_u < bent_v).astype(np.int64)


def _may_lie_along(cells: Cells, leaves: Ints, way: FloatArray) -> BoolArray:
    """Tell which cells may have a normal along a direction."""
    frame = cells.frame[leaves].reshape(-1, 3, 3) @ way
    spread = cells.spread[leaves]
    fits = (np.abs(frame[:, 1:]) <= spread[:, 1:] + 1e-9).all(axis=1)
    may: BoolArray = fits & (frame[:, 0] >= 1.0 - spread[:, 0] - 1e-9)
    return may


def drafts_of(
    cells: Cells, roots: Ints, solid: Solid, pull: FloatArray, tolerance: float
) -> list[Draft]:
    """Return the draft angles of the faces of a body for a pull direction, within a tolerance in radians.

    What is proven is that of the normals of cells; of planes, cylinders, cones, spheres and tori by closed forms.
    Where that takes more than so many cells, the bounds are wider than the tolerance.
    """
    n = len(solid.surfaces)
    found = np.tile([np.inf, -np.inf], (n, 1))
    for face, sides in enumerate(solid.sides):
        at = np.arcsin(
            np.clip(np.array([side.normals[1:-1] @ pull for side in sides]).ravel(), -1.0, 1.0)
        )
        found[face] = at.min(initial=np.inf), at.max(initial=-np.inf)
    proven = np.tile([np.inf, -np.inf], (n, 1))
    leaves = roots[cells.ints[roots, 3] == FACE]
    for _ in range(DEEPEST):
        face = cells.ints[leaves, 1]
        low, high, axis = _sines(cells, solid, leaves, pull)
        low, high = (np.arcsin(np.clip(x, -1.0, 1.0)) for x in (low, high))
        at = np.arcsin(np.clip(cells.frame[leaves][:, :3] @ pull, -1.0, 1.0))
        real = cells.ints[leaves, 6] == 1
        np.minimum.at(found[:, 0], face[real], at[real])
        np.maximum.at(found[:, 1], face[real], at[real])
        cuts = (low < found[face, 0] - tolerance) | (high > found[face, 1] + tolerance)
        cuts &= (cells.radius[leaves, 0] > SMALLEST * solid.size) & (len(leaves) < MOST_CELLS)
        np.minimum.at(proven[:, 0], face[~cuts], low[~cuts])
        np.maximum.at(proven[:, 1], face[~cuts], high[~cuts])
        leaves = leaves[cuts]
        if not len(leaves):
            break
        leaves = cells.cut(leaves, axis[cuts])
    return [Draft(*found[k].tolist(), *proven[k].tolist()) for k in range(n)]


def _sines(
    cells: Cells, solid: Solid, leaves: Ints, pull: FloatArray
) -> tuple[FloatArray, FloatArray, Ints]:
    """Return bounds on n d of cells, and along which parameter to cut them.

    With azimuth a and latitude b of n about an axis, n d = cos b (d_r cos(a - a_d)) + d_z sin b.
    """
    frame, spread = cells.frame[leaves].reshape(-1, 3, 3) @ pull, cells.spread[leaves]
    lean = np.abs(frame[:, 1]) * spread[:, 1] + np.abs(frame[:, 2]) * spread[:, 2]
    share = frame[:, 0] * (1.0 - spread[:, 0])
    low, high = np.minimum(frame[:, 0], share) - lean, np.maximum(frame[:, 0], share) + lean
    patch = cells.ints[leaves, 2]
    box = cells.box[leaves]
    half = 0.5 * (box[:, 1::2] - box[:, ::2])
    slopes = solid.slopes[patch]
    axis_of = (slopes[:, 0] * half[:, 0] < slopes[:, 1] * half[:, 1]).astype(np.int64)
    core = solid.core[patch]
    is_straight = (solid.form[patch] == TURNED) & (slopes[:, 4] == 0.0)
    round_ = is_straight | (core == 2) | (core == 3)
    if round_.any():
        axis, normal = solid.axis[patch], cells.frame[leaves][:, :3]
        b = np.arcsin(np.clip((normal * axis).sum(axis=1), -1.0, 1.0))
        d_z = axis @ pull
        across = pull - d_z[:, None] * axis
        d_r = np.linalg.norm(across, axis=1)
        flat = normal - np.sin(b)[:, None] * axis
        a = np.arctan2((np.cross(across, flat) * axis).sum(axis=1), (across * flat).sum(axis=1))
        h_a = np.minimum(solid.turn[patch] * half[:, 0], np.pi)
        h_b = np.where(
            core == 2, TURN * half[:, 1], np.where(core == 3, 0.5 * TURN * half[:, 1], 0.0)
        )
        # A pole may be anywhere about the axis.
        h_a = np.where(np.cos(b) < 1e-9, np.pi, h_a)
        c_low, c_high = _cosines(a, h_a)
        least = np.minimum(*(_wave(c * d_r, d_z, b, h_b)[0] for c in (c_low, c_high)))
        most = np.maximum(*(_wave(c * d_r, d_z, b, h_b)[1] for c in (c_low, c_high)))
        low, high = np.where(round_, least, low), np.where(round_, most, high)
        axis_of = np.where(round_, (d_r * np.minimum(h_a, 1.0) < h_b).astype(np.int64), axis_of)
    return low, high, axis_of


def _cosines(at: FloatArray, half: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return bounds on the cosine of angles within ``half`` of ``at``."""
    at = np.abs((at + np.pi) % TURN - np.pi)
    return np.cos(np.minimum(at + half, np.pi)), np.cos(np.maximum(at - half, 0.0))


def _wave(
    c: FloatArray, s: FloatArray, at: FloatArray, half: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return bounds on c cos x + s sin x for x within ``half`` of ``at``."""
    low, high = _cosines(at - np.arctan2(s, c), half)
    size = np.hypot(c, s)
    return size * low, size * high
