"""Certified tessellation: triangles within a proven distance of a surface, without cracks.

Patches are halved into rectangular leaves until the bound of `meshing.kernels.leaves` meets the
tolerance; surfaces of revolution are cut into rings of cells by `meshing.bounds`. Every corner of
a leaf becomes a vertex of all leaves that touch it, also across shared edges. Each leaf is then
triangulated through all vertices on its sides: there are no cracks, and the bound still holds.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import singledispatch
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshing.bezier import BezierPatches, RationalPatches
from meshing.bounds import TooManyTrianglesError, rings_of
from meshing.certified_mesh import CertifiedMesh
from meshing.checks import FloatArray, number, shown, whole
from meshing.kernels import leaves as leaf_kernels
from meshing.kernels import polygons
from meshing.kernels.leaves import MAX_DEPTH
from meshing.revolution import SurfaceOfRevolution
from meshing.seams import Seams, seams_of_patches, seams_of_revolution
from meshing.sheet import PatchSheet
from meshing.spans import across
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface

Keys: TypeAlias = NDArray[np.int64]

# About 3 GB with everything that is needed on the way.
MAX_TRIANGLES = 20_000_000
# A vertex is one integer: patch, then two parameters of 20 bits each.
_BITS = 20
_MASK = (1 << _BITS) - 1
MAX_PATCHES = 1 << (63 - 2 * _BITS)
# Pieces that close on themselves or whose corners coincide are halved this often both ways, so
# that their triangles have different corners.
_LEAST_DEPTH = 2


def tessellate(
    surface: Surface, tolerance: float, *, max_triangles: int = MAX_TRIANGLES
) -> CertifiedMesh:
    """Tessellate a surface into triangles within a proven distance of it.

    Parameters
    ----------
    surface : BezierPatches, NurbsSurface, SurfaceOfRevolution, or TrimmedSurface of one
    tolerance : float
        Largest distance allowed, absolute, in scene units. A tolerance below the rounding of the
        surface's coordinates may be missed; ``deviation_bound`` says what was reached.
    max_triangles : int
        Largest number of triangles allowed; checked before they are made.

    Returns
    -------
    CertifiedMesh
        Adaptive: few triangles where the surface is flat, many where it is curved. The tolerance
        is that of (u, v) too: a turned disc or cone takes more triangles than its shape alone, as
        straight lines in (u, v) bend in space. There are no cracks within patches or across shared
        edges, and closed surfaces are watertight. For a trimmed surface these are all triangles that
        reach inside the loops: they cover it, and extend up to one triangle beyond its edges.

    Raises
    ------
    ValueError
        If the tolerance is not positive and finite, or takes more than ``max_triangles``.

    References
    ----------
    Filip, Magedson, Markot, "Surface algorithms using bounds on derivatives", Computer Aided
    Geometric Design 3, 1986.
    """
    tolerance = number(tolerance, "tessellate tolerance", above=0.0, hint="in scene units")
    whole(max_triangles, "tessellate max_triangles", at_least=1, up_to=2**31 - 1)
    if isinstance(surface, TrimmedSurface):
        mesh = tessellate(surface.surface, tolerance, max_triangles=max_triangles)
        if surface.joined_spans is not None:
            mesh = _on_sheet(mesh, surface.joined_spans)
        low, high = mesh.uv.min(axis=1), mesh.uv.max(axis=1)
        boxes = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
        keeps = ~surface.is_outside(boxes)
        return replace(
            mesh, faces=mesh.faces[keeps], uv=mesh.uv[keeps], patch_id=mesh.patch_id[keeps]
        )
    if isinstance(surface, PatchSheet):
        mesh = tessellate(surface.pieces, tolerance, max_triangles=max_triangles)
        return _on_sheet(mesh, surface.spans)
    return _mesh_of(surface, cut(surface, tolerance, max_triangles), tolerance, max_triangles)


def _on_sheet(mesh: CertifiedMesh, spans: FloatArray) -> CertifiedMesh:
    """Return a mesh of pieces with the (u, v) across all of them."""
    u, v = across(spans, mesh.uv[..., 0], mesh.uv[..., 1], mesh.patch_id[:, None])
    return replace(mesh, uv=np.stack([u, v], axis=-1))


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
        f"tessellate surface is {shown(surface)}: pass BezierPatches, a NurbsSurface, an Extrusion or a "
        "SurfaceOfRevolution; other surfaces are met without triangles, and a grid of .point(u, v) makes a mesh of one"
    )


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


def _mesh_of(surface: Surface, pieces: Cut, tolerance: float, max_triangles: int) -> CertifiedMesh:
    seams, leaves, units, bound = pieces
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

    n_faces = int(sum((side[:, 1] - side[:, 0] - 1).sum() for side in (left, right, bottom, top)))
    n_faces -= 2 * len(leaves)
    if n_faces > max_triangles:
        raise TooManyTrianglesError(n_faces, max_triangles, tolerance)
    codes = _identity(keys, seams, units)
    _, chosen, weld = np.unique(codes, return_index=True, return_inverse=True)
    at_u, at_v = u / units[0], v / units[1]
    points = surface.point(at_u[chosen], at_v[chosen], p[chosen])
    faces = np.empty((n_faces, 3), dtype=np.int64)
    uv = np.empty((n_faces, 3, 2))
    patch_id = np.empty(n_faces, dtype=np.int32)
    n_faces = polygons.triangulate(
        leaves, left, right, bottom, top, by_v, weld.reshape(-1), points, at_u, at_v,
        faces, uv, patch_id,
    )  # fmt: skip
    return CertifiedMesh(points, faces[:n_faces], uv[:n_faces], patch_id[:n_faces], float(bound))


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
