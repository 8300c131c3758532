"""The topology of a surface's pieces: shared edges, shared corners, collapsed edges.

Each piece has four edges, numbered 4 p + side with the sides u = 0, u = 1, v = 0, v = 1; the first
two run along v, the others along u. Corners are numbered 4 p + 2 i + j for (u, v) = (i, j).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshing.bezier import BezierPatches, RationalPatches
from meshing.checks import FloatArray
from meshing.kernels import joining
from meshing.profiles import radius_rounding
from meshing.revolution import SurfaceOfRevolution
from meshing.surface import Surface

# Control points that went through a rotation or a unit conversion agree to a few roundings.
JOIN_TOLERANCE = 64.0 * 2.0**-52
# Corners (2 i + j) at the two ends of each side.
_ENDS = np.array([[0, 1], [2, 3], [0, 2], [1, 3]])
# A direction along which points of ordinary models seldom have equal positions.
_SWEEP = np.array([0.5377, 0.6421, 0.5464])


@dataclass(frozen=True)
class Seams:
    """Identities between corners and edges of k pieces."""

    corner: NDArray[np.int64]  # (4 k,), a label; the same point has the same label
    group: NDArray[np.int64]  # (4 k,), representative of the edges that are the same as this one
    is_reversed: NDArray[np.bool_]  # (4 k,), whether the edge runs against ``group``
    is_collapsed: NDArray[np.bool_]  # (4 k,), whether the edge is a single point
    gap: float  # largest distance of points that were welded

    @property
    def corners_apart(self) -> NDArray[np.int64]:
        """(k,) int64: number of distinct corners of each piece."""
        labels = np.sort(self.corner.reshape(-1, 4), axis=1)
        return 1 + (np.diff(labels, axis=1) != 0).sum(axis=1)


def seams_of_patches(surface: BezierPatches) -> Seams:
    """Find the shared and the collapsed edges of Bezier patches."""
    control, starts, degrees = surface.control, surface.starts, surface.degrees
    tolerance = JOIN_TOLERANCE * float(np.abs(control).max())
    m, n = degrees.T
    first = starts[:-1]
    last_row = first + m * (n + 1)
    rows = np.stack((first, first + n, last_row, last_row + n), axis=1).reshape(-1)
    corner, gap = label_points(control[rows], tolerance)

    edge_first = np.stack((first, last_row, first, first + n), axis=1).reshape(-1)
    edge_step = np.stack((np.ones_like(n), np.ones_like(n), n + 1, n + 1), axis=1).reshape(-1)
    edge_degree = np.stack((n, n, m, m), axis=1).reshape(-1)
    ends = corner.reshape(-1, 4)[:, _ENDS].reshape(-1, 2)
    low, high = ends.min(axis=1), ends.max(axis=1)
    kind = edge_degree
    if isinstance(surface, RationalPatches):
        w = surface.homogeneous[:, 3]
        kind = _kinds_of_weights(w, edge_first, edge_step, edge_degree, ends)
    order = np.lexsort((kind, high, low))
    keys = np.stack((low, high, kind), axis=1)[order]
    run = np.concatenate(([0], np.cumsum((keys[1:] != keys[:-1]).any(axis=1))))
    group = np.empty(len(order), dtype=np.int64)
    is_reversed = np.empty(len(order), dtype=np.bool_)
    edge_gap = joining.join_edges(
        control, edge_first, edge_step, edge_degree, order, run, tolerance, group, is_reversed
    )
    return Seams(
        corner=corner,
        group=group,
        is_reversed=is_reversed,
        is_collapsed=_collapsed(control, edge_first, edge_step, edge_degree, tolerance),
        gap=max(gap, float(edge_gap)),
    )


def _kinds_of_weights(
    weights: FloatArray,
    first: NDArray[np.int64],
    step: NDArray[np.int64],
    degree: NDArray[np.int64],
    ends: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Return a number (n,) of degree and weights; these count up to a factor, and to rounding.

    Edges of other weights are other curves, or run along the same one at another pace.
    """
    rows = np.full((len(first), int(degree.max()) + 2), -1.0)
    rows[:, 0] = degree
    for k in range(int(degree.max()) + 1):
        has = k <= degree
        # From the corner of the lower number on.
        at = np.where(ends[:, 0] <= ends[:, 1], k, degree - k)
        w = weights[first[has] + at[has] * step[has]]
        rows[has, 1 + k] = w
    ratios = rows[:, 1:] / rows[:, 1:2]
    rows[:, 1:] = np.where(rows[:, 1:] < 0.0, -1.0, np.float32(ratios))
    return np.unique(rows, axis=0, return_inverse=True)[1].reshape(-1)


def seams_of_revolution(surface: SurfaceOfRevolution) -> Seams:
    """Find the seam, the joints of the profile, also those with a gap of rounding, its ends on the axis."""
    segments = surface.segments
    k = len(segments)
    ends = np.array([[segment[0], segment[-1]] for segment in segments])
    size = float(np.abs(ends).max())
    node = np.arange(2 * k).reshape(k, 2)
    node[1:, 0] = node[:-1, 1]
    is_closed = np.abs(ends[0, 0] - ends[-1, 1]).max() <= JOIN_TOLERANCE * size
    if is_closed:
        node[-1, 1] = node[0, 0]
    joints = np.abs(ends[1:, 0] - ends[:-1, 1])
    # Both ends of a whole circle are the same point: the corner labels of u = 0 and u = 1 agree.
    corner = np.concatenate((node, node), axis=1)
    group = np.arange(4 * k).reshape(k, 4)
    if surface.is_whole_turn:
        group[:, 1] = group[:, 0]
    else:
        # Of a part only points of the axis are where u = 0 and u = 1 meet.
        on_axis = ends[:, :, 1] <= radius_rounding(segments)
        corner[:, 2:] = np.where(on_axis, node, node + 2 * k)
    # Circles at the same place along the profile share the first edge that lies there.
    circles = np.stack((4 * np.arange(k) + 2, 4 * np.arange(k) + 3), axis=1)
    leader = np.full(2 * k, 4 * k)
    np.minimum.at(leader, node.reshape(-1), circles.reshape(-1))
    group[:, 2:] = leader[node]
    is_collapsed = np.zeros((k, 4), dtype=np.bool_)
    is_collapsed[:, 2:] = ends[:, :, 1] <= radius_rounding(segments)
    return Seams(
        corner=corner.reshape(-1),
        group=group.reshape(-1),
        is_reversed=np.zeros(4 * k, dtype=np.bool_),
        is_collapsed=is_collapsed.reshape(-1),
        gap=float(max(joints.max(initial=0.0), JOIN_TOLERANCE * size * is_closed)),
    )


def seams_of_square(surface: Surface) -> Seams:
    """Return the seams of a surface of one piece: where it closes, and its poles."""
    corner, group = np.arange(4).reshape(2, 2), np.arange(4)
    closes_u, closes_v = surface.closes
    if closes_u:
        corner[1], group[1] = corner[0], group[0]
    if closes_v:
        corner[:, 1], group[3] = corner[:, 0], group[2]
    is_collapsed = np.array([False, False, *surface.poles])
    return Seams(corner.reshape(-1), group, np.zeros(4, np.bool_), is_collapsed, 0.0)


def label_points(points: FloatArray, tolerance: float) -> tuple[NDArray[np.int64], float]:
    """Return labels, equal where points are within a tolerance, and how far these are apart."""
    # Equal points first: thousands of patches may meet in one point.
    distinct, inverse = np.unique(points, axis=0, return_inverse=True)
    along = distinct @ _SWEEP
    label = joining.join_points(distinct, np.argsort(along, kind="stable"), along, tolerance)
    gap = float(np.abs(distinct - distinct[label]).max())
    return label[inverse.reshape(-1)], gap


def _collapsed(
    control: FloatArray,
    first: NDArray[np.int64],
    step: NDArray[np.int64],
    degree: NDArray[np.int64],
    tolerance: float,
) -> NDArray[np.bool_]:
    extent = np.zeros(len(first))
    for k in range(1, int(degree.max()) + 1):
        row = first + np.minimum(k, degree) * step
        extent = np.maximum(extent, np.abs(control[row] - control[first]).max(axis=1))
    return extent <= tolerance
