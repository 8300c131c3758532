"""Surfaces cut into rectangles of (u, v), whose triangles are within a proven distance, without cracks.

Patches are halved into rectangular leaves until the bound of `meshing.kernels.leaves` meets the
tolerance; surfaces of revolution are cut into rings of cells by `meshing.bounds`. Every corner of
a leaf becomes a vertex of all leaves that touch it, also across shared edges. Each leaf is then
triangulated through all vertices on its sides: there are no cracks, and the bound still holds.
"""

import math
from functools import singledispatch
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshing.bezier import BezierPatches, RationalPatches
from meshing.bounds import TooManyTrianglesError, rings_of
from meshing.checks import BoolArray, FloatArray, shown
from meshing.kernels import leaves as leaf_kernels
from meshing.kernels import polygons
from meshing.kernels.leaves import MAX_DEPTH
from meshing.revolution import SurfaceOfRevolution
from meshing.seams import Seams, seams_of_patches, seams_of_revolution, seams_of_square
from meshing.surface import Surface

Keys: TypeAlias = NDArray[np.int64]

# A vertex is one integer: patch, then two parameters of 20 bits each.
_BITS = 20
_MASK = (1 << _BITS) - 1
MAX_PATCHES = 1 << (63 - 2 * _BITS)
# Pieces that close on themselves or whose corners coincide are halved this often both ways, so
# that their triangles have different corners.
_LEAST_DEPTH = 2


class Cut(NamedTuple):
    """A surface cut into leaves, each to be triangulated."""

    seams: Seams
    leaves: NDArray[np.int32]
    """(n, 5): piece, then u0, u1, v0, v1 in ``units``."""
    units: tuple[int, int]
    """What u = 1 and v = 1 are in a leaf."""
    bound: float
    """Proven distance of the triangles, roundings included."""


@singledispatch
def cut(surface: object, tolerance: float, max_triangles: int) -> Cut:
    """Cut a surface into leaves; each class of free-form surfaces registers its function."""
    del tolerance, max_triangles
    raise TypeError(
        f"tessellate surface is {shown(surface)}: pass BezierPatches, a NurbsSurface, an Extrusion, a SurfaceOfRevolution, "
        "a Rectangle, Sphere or Torus, or a TrimmedSurface; of others a grid of .point(u, v) makes a mesh"
    )


@cut.register(Surface)
def _cut_square(surface: Surface, tolerance: float, max_triangles: int) -> Cut:
    if surface.bend is None:
        return cut.dispatch(object)(surface, tolerance, max_triangles)
    seams = seams_of_square(surface)
    slack = _slack(64, surface.reach + surface.size, seams) + surface.moved
    uu, uv, vv = surface.bend
    # Cells that close on themselves have different corners.
    m, n = (4 if closed else 1 for closed in surface.closes)
    if seams.is_collapsed[2:4].all():  # from pole to pole there is no triangle
        n = max(n, 2)
    target = max(tolerance - slack, slack)
    while (bound := (uu / m**2 + 2.0 * uv / (m * n) + vv / n**2) / 8.0) > target:
        if max(m, n) == 1 << MAX_DEPTH or 2.0 * m * n > max_triangles:
            raise TooManyTrianglesError(2.0 * m * n * bound / target, max_triangles, tolerance)
        m, n = (2 * m, n) if uu / m**2 >= vv / n**2 else (m, 2 * n)
    i, j = (np.ravel(k).astype(np.int32) for k in np.mgrid[:m, :n])
    whole = 1 << MAX_DEPTH
    sides = (i * (whole // m), (i + 1) * (whole // m), j * (whole // n), (j + 1) * (whole // n))
    return Cut(seams, np.stack([0 * i, *sides], axis=1), (whole, whole), bound + slack)


def _slack(roundings: int, largest: float, seams: Seams) -> float:
    """Bound what rounding of vertices, and welding them, adds to the deviation."""
    # Per coordinate; sqrt(3) of it in space.
    return math.sqrt(3.0) * (roundings * 2.0**-53 * largest + seams.gap)


@cut.register(BezierPatches)
def _cut_patches(surface: BezierPatches, tolerance: float, max_triangles: int) -> Cut:
    if len(surface) >= MAX_PATCHES:
        raise ValueError(
            f"tessellate surface has {len(surface)} patches: pass less than {MAX_PATCHES}"
        )
    seams = seams_of_patches(surface)
    least_depth = np.where(seams.corners_apart < 3, _LEAST_DEPTH, 0)
    roundings = 3 * int(surface.degrees.sum(axis=1).max()) + 8
    roundings += surface.remainder is not None
    if isinstance(surface, RationalPatches):
        # A quotient of two such sums, and the product of each net's own rounding.
        roundings = 2 * roundings + 4
        nets, rational = surface.homogeneous, True
    else:
        nets, rational = surface.control, None
    slack = _slack(roundings, float(np.abs(surface.control).max()), seams) + surface.moved
    data = (nets, surface.starts, surface.degrees, rational, least_depth, slack, tolerance)
    # Counted first, kept in a second run: no memory is taken before the count is known.
    max_leaves = max(max_triangles // 2, 1)
    leaves = np.empty((0, 5), dtype=np.int32)
    count, bound, forecast = leaf_kernels.find_leaves(*data, max_leaves, leaves)
    if forecast > max_leaves:
        raise TooManyTrianglesError(2.0 * forecast, max_triangles, tolerance)
    leaves = np.empty((count, 5), dtype=np.int32)
    leaf_kernels.find_leaves(*data, max_leaves, leaves)
    return Cut(seams, leaves, (1 << MAX_DEPTH, 1 << MAX_DEPTH), bound + slack)


@cut.register(SurfaceOfRevolution)
def _cut_revolution(surface: SurfaceOfRevolution, tolerance: float, max_triangles: int) -> Cut:
    seams = seams_of_revolution(surface)
    roundings = 3 * max(map(len, surface.segments)) + 16
    reach = max(float(np.abs(segment).sum(axis=1).max()) for segment in surface.segments)
    slack = _slack(roundings, float(np.abs(surface.origin).max()) + reach, seams)
    slack += surface.moved + float(np.abs(surface.remainder).sum() * (1.0 + reach))
    base, rings, bound = rings_of(surface, tolerance, slack, max_triangles)
    table = np.array(rings, dtype=np.int64)
    cells = table[:, 3]
    unit_u = int(base << max(int(np.log2(cells.max() // base) + 0.5), 1))
    ring = np.repeat(np.arange(len(table)), cells)
    first = np.arange(len(ring)) - np.repeat(np.cumsum(cells) - cells, cells)
    width = unit_u // cells[ring]
    leaves = np.empty((len(ring), 5), dtype=np.int32)
    leaves[:, 0] = table[ring, 0]
    leaves[:, 1] = first * width
    leaves[:, 2] = (first + 1) * width
    leaves[:, 3] = table[ring, 1]
    leaves[:, 4] = table[ring, 2]
    return Cut(seams, leaves, (unit_u, 1 << MAX_DEPTH), bound + slack)


class Rings(NamedTuple):
    """Leaves with the vertices on their sides, which neighbours share."""

    leaves: NDArray[np.int32]
    sides: tuple[Keys, Keys, Keys, Keys]
    """Ranges (n, 2) of vertices on the left and on the right, of ``by_v`` at the bottom and at the top."""
    by_v: Keys
    weld: Keys
    """Row in ``points`` of each vertex."""
    points: FloatArray
    at: tuple[FloatArray, FloatArray]
    """u and v of each vertex on its piece."""
    patch: Keys

    def triangles(
        self, rows: BoolArray, tolerance: float, max_triangles: int
    ) -> tuple[NDArray[np.int64], FloatArray, NDArray[np.int32]]:
        """Return faces, their (u, v) and their patches, of some of the leaves."""
        leaves, sides = self.leaves[rows], [side[rows] for side in self.sides]
        n_faces = int(sum((side[:, 1] - side[:, 0] - 1).sum() for side in sides)) - 2 * len(leaves)
        if n_faces > max_triangles:
            raise TooManyTrianglesError(n_faces, max_triangles, tolerance)
        faces = np.empty((n_faces, 3), dtype=np.int64)
        uv = np.empty((n_faces, 3, 2))
        patch_id = np.empty(n_faces, dtype=np.int32)
        n_faces = polygons.triangulate(
            leaves, *sides, self.by_v, self.weld, self.points, *self.at, faces, uv, patch_id
        )
        return faces[:n_faces], uv[:n_faces], patch_id[:n_faces]


def rings_of_leaves(surface: Surface, pieces: Cut) -> Rings:
    """Return leaves with all vertices on their sides."""
    seams, leaves, units, _ = pieces
    patch, u0, u1, v0, v1 = leaves.T.astype(np.int64)
    corners = [_key(patch, u, v) for u in (u0, u1) for v in (v0, v1)]
    keys = _share_across_edges(np.unique(np.concatenate(corners)), seams, units)

    # The same vertices, in the order of (patch, v, u).
    p, u, v = _parts(keys)
    swapped = _key(p, v, u)
    by_v = np.argsort(swapped, kind="stable")
    swapped = swapped[by_v]
    left, right = (_range(keys, _key(patch, x, v0), _key(patch, x, v1)) for x in (u0, u1))
    bottom, top = (_range(swapped, _key(patch, y, u0), _key(patch, y, u1)) for y in (v0, v1))
    codes = _identity(keys, seams, units)
    _, chosen, weld = np.unique(codes, return_index=True, return_inverse=True)
    at_u, at_v = u / units[0], v / units[1]
    points = surface.point(at_u[chosen], at_v[chosen], p[chosen])
    sides = (left, right, bottom, top)
    return Rings(leaves, sides, by_v, weld.reshape(-1), points, (at_u, at_v), p)


def _key(patch: Keys, u: Keys, v: Keys) -> Keys:
    return (patch << (2 * _BITS)) | (u << _BITS) | v


def _parts(keys: Keys) -> tuple[Keys, Keys, Keys]:
    return keys >> (2 * _BITS), (keys >> _BITS) & _MASK, keys & _MASK


def _range(keys: Keys, first: Keys, last: Keys) -> Keys:
    stop = np.searchsorted(keys, last, side="right")
    return np.stack((np.searchsorted(keys, first), stop), axis=1)


def _on_edges(keys: Keys, units: tuple[int, int]) -> tuple[Keys, Keys, Keys]:
    """List vertices on edges of pieces: index, edge, and position along the edge.

    A corner lies on two edges and is listed for both.
    """
    p, u, v = _parts(keys)
    index, edge, position = [], [], []
    for side, (x, at, along) in enumerate(
        ((u, 0, v), (u, units[0], v), (v, 0, u), (v, units[1], u))
    ):
        rows = np.flatnonzero(x == at)
        index.append(rows)
        edge.append(4 * p[rows] + side)
        position.append(along[rows])
    return np.concatenate(index), np.concatenate(edge), np.concatenate(position)


def _along_leader(edge: Keys, position: Keys, seams: Seams, units: tuple[int, int]) -> Keys:
    length = np.where(edge % 4 < 2, units[1], units[0])
    return np.where(seams.is_reversed[edge], length - position, position)


def _share_across_edges(keys: Keys, seams: Seams, units: tuple[int, int]) -> Keys:
    """Give every edge the vertices of all edges that it coincides with."""
    _, edge, position = _on_edges(keys, units)
    position = _along_leader(edge, position, seams, units)
    wanted = np.unique((seams.group[edge] << _BITS) | position)
    leader, position = wanted >> _BITS, wanted & _MASK

    # Members of each group, one group after the other.
    members = np.argsort(seams.group, kind="stable")
    first = np.searchsorted(seams.group[members], leader, side="left")
    count = np.searchsorted(seams.group[members], leader, side="right") - first
    row = np.repeat(np.arange(len(leader)), count)
    nth = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    edge = members[first[row] + nth]
    position = _along_leader(edge, position[row], seams, units)

    side, p = edge % 4, edge // 4
    at = np.where(side == 1, units[0], np.where(side == 3, units[1], 0))
    u = np.where(side < 2, at, position)
    v = np.where(side < 2, position, at)
    return np.union1d(keys, _key(p, u, v))


def _identity(keys: Keys, seams: Seams, units: tuple[int, int]) -> Keys:
    """Give vertices numbers such that equal numbers mean the same point of the surface."""
    n_edges = len(seams.group)
    codes = np.arange(len(keys)) + (n_edges << _BITS << 1)
    index, edge, position = _on_edges(keys, units)
    position = _along_leader(edge, position, seams, units)
    codes[index] = n_edges + ((seams.group[edge] << _BITS) | position)
    # Collapsed edges are one of their corners; corners come last because they lie on two edges.
    is_point = seams.is_collapsed[edge]
    corner_of_edge = seams.corner.reshape(-1, 4)[:, [0, 2, 0, 1]].reshape(-1)
    codes[index[is_point]] = corner_of_edge[edge[is_point]]
    p, u, v = _parts(keys)
    for i in (0, 1):
        for j in (0, 1):
            rows = np.flatnonzero((u == i * units[0]) & (v == j * units[1]))
            codes[rows] = seams.corner[4 * p[rows] + 2 * i + j]
    return codes
