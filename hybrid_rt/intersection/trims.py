"""Trimmed surfaces made ready for the kernels of their kinds, and their coarse triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.intersection.kernels.search.trims import Trim
from meshing import TrimmedSurface, tessellate
from meshing.certified_mesh import CertifiedMesh
from meshing.spans import within_patch
from meshing.tessellation import whole_triangles
from meshing.trims import boxes_outside, make_table


def trimmed_of(members: Sequence[tuple[int, Any]]) -> list[TrimmedSurface] | None:
    """Return the trimmed surfaces among (object id, surface); None if there are none.

    Raises TypeError if only some of them are trimmed.
    """
    trimmed = [surface for _, surface in members if isinstance(surface, TrimmedSurface)]
    if trimmed and len(trimmed) != len(members):
        raise TypeError("trimmed and whole surfaces in one kind: pass each to its own")
    return trimmed or None


def whole_of(members: Sequence[tuple[int, Any]]) -> list[tuple[int, Any]]:
    """Return object ids and surfaces, trimmed ones without their loops."""
    return [
        (i, surface.surface if isinstance(surface, TrimmedSurface) else surface)
        for i, surface in members
    ]


def trim_of(
    surfaces: Sequence[TrimmedSurface],
    counts: Sequence[int],
    spans: FloatArray,
    to_frame: float | FloatArray,
    scale: FloatArray,
) -> Trim:
    """Return the loops of trimmed surfaces.

    ``counts``, rows (patches) of each; ``to_frame``, lengths of the frame in a scene unit, one or
    one per row; ``scale`` (rows, 4), see `Trim`.
    ``spans`` (rows, 4): u0, u1, v0, v1 of each row on its surface.
    """
    span = spans.copy()
    span[:, 1] -= spans[:, 0]
    span[:, 3] -= spans[:, 2]
    gap = np.array([surface.gap for surface in surfaces])
    member = np.repeat(np.arange(len(surfaces)), counts).astype(np.int64)
    return Trim(make_table(surfaces), member, span, gap[member] * to_frame, scale)


def no_trim() -> Trim:
    """Return no loops, for kernels that are compiled once for whole and trimmed surfaces."""
    return trim_of([], [], np.empty((0, 4)), 1.0, np.empty((0, 4)))


def trim_of_single(surfaces: Sequence[TrimmedSurface]) -> Trim:
    """Return the loops of surfaces of one piece each, met in lengths of the world."""
    n = len(surfaces)
    spans = np.tile([0.0, 1.0, 0.0, 1.0], (n, 1))
    return trim_of(surfaces, [1] * n, spans, 1.0, np.zeros((n, 4)))


def may_hold_hits(
    trim: Trim, cells: FloatArray, rows: NDArray[np.unsignedinteger[Any]]
) -> BoolArray:
    """Tell which cells are not wholly outside the loops, (n,) bool.

    ``rows`` (n,) integers.
    ``cells`` (n, 4): middles in u and v and half sides, in the rows' own parameters.
    """
    um, vm, hu, hv = cells.T
    span = trim.span[rows]
    keeps = np.ones(len(rows), np.bool_)
    boxes = np.stack([um - hu, um + hu, vm - hv, vm + hv], axis=1)
    boxes[:, :2] = span[:, :1] + boxes[:, :2] * span[:, 1:2]
    boxes[:, 2:] = span[:, 2:3] + boxes[:, 2:] * span[:, 3:4]
    for m in range(len(trim.loops.member)):
        mine = np.flatnonzero(trim.member[rows] == m)
        # A gap makes roots count beyond the curves, by how much in (u, v) is not known here.
        if len(mine) and not trim.gap[rows[mine[0]]] > 0.0:
            keeps[mine] = ~boxes_outside(trim.loops, m, boxes[mine])
    # A tree of nothing cannot be built.
    if not keeps.any():
        keeps[0] = True
    return keeps


def coarse_triangles(surface: TrimmedSurface, tolerance: float) -> CertifiedMesh:
    """Return the triangles of a surface that reach inside its loops, at least one.

    ``uv`` is that of the patches, as kinds take it.
    """
    mesh, spans = whole_triangles(surface, tolerance), surface.spans
    if not len(mesh):
        mesh, spans = tessellate(surface.surface, tolerance), surface.surface.spans
        mesh = replace(mesh, faces=mesh.faces[:1], uv=mesh.uv[:1], patch_id=mesh.patch_id[:1])
    if spans is None:
        return mesh
    u, v = within_patch(spans, mesh.uv[..., 0], mesh.uv[..., 1], mesh.patch_id[:, None])
    return replace(mesh, uv=np.stack([u, v], axis=-1))
