"""Triangle meshes of all objects: one table, one bounding volume hierarchy."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND
from hybrid_rt.intersection.kernels.search.tree import new_stack
from hybrid_rt.intersection.kernels.triangle import (
    TriangleTable,
    aim_at_triangles,
    finish_triangles,
    refine_triangles,
    rows_of_faces,
    trace_triangles,
)
from hybrid_rt.intersection.kind import Finished, OneRow, Single, bottom
from hybrid_rt.intersection.margins import Aim, Probes, Rows, Search
from hybrid_rt.intersection.members import (
    MOST_TREES,
    SMALL_PART,
    box_of,
    frame_of,
    in_frames,
    tree_over,
)
from hybrid_rt.primitives import TriangleMesh
from meshing.kernels.stored_calls import StoredCall
from meshing.surface import box_around

if TYPE_CHECKING:
    from hybrid_rt.intersection.coarse.proposals import Coarse
    from hybrid_rt.intersection.kernels.search.members import Members

_NOT_MOVED = np.empty((0, 3))
# A box test costs about as much as a triangle's.
LEAF_SIZE = 4


class TriangleKind:
    """First hits on triangle meshes.

    ``meshes``, sequence of (object id, TriangleMesh).
    """

    def __init__(self, meshes: Sequence[tuple[int, TriangleMesh]], search: bool = True) -> None:
        vertex = np.concatenate([mesh.vertices for _, mesh in meshes])
        n_vertices = np.cumsum([0, *(len(mesh.vertices) for _, mesh in meshes)])
        face = np.concatenate(
            [mesh.faces + n for (_, mesh), n in zip(meshes, n_vertices, strict=False)]
        )
        counts = [len(mesh) for _, mesh in meshes]
        object_id = np.repeat(np.array([i for i, _ in meshes], np.int32), counts)
        corners = vertex[face]
        order = np.arange(len(face), dtype=np.int32)
        moved = np.array([mesh.moved for _, mesh in meshes])
        around = _around(meshes)
        # A ray from nearby has a band that counts by the size of the whole mesh.
        wide = 2.0 * np.repeat(moved + TANGENT_BAND * around[[i for i, _ in meshes], 3], counts)
        bounds = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
        bounds += wide[:, None, None] * np.array([-1.0, 1.0])[:, None]
        middle, to_frame = frame_of(*box_around(bounds))
        # A tree for each frame of faces, and the longest side of one.
        self._trees: list[tuple[Members, float]] = []
        if search:
            groups = in_frames(bounds, SMALL_PART, MOST_TREES)
            for rows, begin in zip(groups, np.cumsum([0, *map(len, groups)]), strict=False):
                members = tree_over(bounds[rows], int(begin), LEAF_SIZE)
                order[begin : begin + len(rows)] = rows[members.tree.order]
                self._trees.append((members, _longest_side(corners[rows])))
        self._place = np.empty(len(face), np.int32)
        self._place[order] = np.arange(len(face), dtype=np.int32)
        self.table = TriangleTable(
            middle=np.append(middle, moved.max()),
            to_frame=to_frame,
            vertex=np.ascontiguousarray(vertex),
            face=np.ascontiguousarray(face),
            around=around,
            object_id=object_id,
            patch_id=np.concatenate([np.arange(n, dtype=np.int32) for n in counts]),
            corner=corners.reshape(-1, 9)[order],
            order=order,
        )
        self._first_face = np.full(int(object_id.max()) + 1, -1, np.int64)
        for (i, _), first in zip(meshes, np.cumsum([0, *counts[:-1]]), strict=True):
            self._first_face[i] = first

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the first hits on the meshes."""
        del guess
        self._trace(rays, _NOT_MOVED, best, any_hit, work)

    def _trace(
        self, rays: Rays, aside: FloatArray, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Trace rays, moved by ``aside``, world; the rest is as in `trace`."""
        for members, longest in self._trees:
            stack = new_stack(members.tree)
            trace_triangles(
                self.table, members, longest, rays, aside, best, any_hit, stack, work
            )  # fmt: skip

    def refine(
        self,
        coarse: Coarse,
        hits: CoarseHits,
        rows: NDArray[np.int64],
        rays: Rays,
        best: Nearest,
        accepted: BoolArray,
    ) -> None:
        """Intersect Embree's triangle again in float64."""
        first = np.full(coarse.n_objects, -1, np.int64)
        first[: len(self._first_face)] = self._first_face
        place = np.empty(len(hits.face), np.int32)
        rows_of_faces(hits, coarse.triangles, first, self._place, place)
        refine_triangles(self.table, place, rows, rays, best, accepted)

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits that are on meshes."""
        finish_triangles(self.table, rays, best, kind_of, kind, out)

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        rays, best, out, work = ray

        def calls(members: Members, longest: float, any_hit: bool) -> list[StoredCall]:
            return [
                StoredCall(
                    trace_triangles, self.table, members, longest, rays, _NOT_MOVED, best, any_hit,
                    new_stack(members.tree), work,
                )
            ]  # fmt: skip

        bottoms = [
            bottom(box_of(members.tree, *members[2:]), partial(calls, members, longest))
            for members, longest in self._trees
        ]
        finish = StoredCall(finish_triangles, self.table, rays, best, kind_of, kind, out)
        return Single(bottoms, [finish])

    @property
    def n_trees(self) -> int:
        """Number of trees."""
        return len(self._trees)

    def aim(self, rays: Rays, best: Nearest, out: Finished, rows: Rows) -> Aim:
        """Return where to displace rays whose hits are in doubt."""
        del out
        n, frame = len(rows), 1.0 / self.table.to_frame
        aim = Aim(np.empty(n), np.empty((n, 3)), np.empty(n, np.bool_), np.full(n, frame))
        aim_at_triangles(self.table, rays, best, rows, *aim[:3])
        return aim

    @property
    def searches(self) -> tuple[Search]:
        """The search alone: in a tree of triangles there is nothing quicker."""
        return (self._search,)

    def _search(self, probes: Probes, nearest: Nearest, work: FloatArray) -> None:
        self._trace(probes.rays, probes.aside, nearest, False, work)


def _longest_side(corners: FloatArray) -> float:
    """Return the length of the longest side of any face; ``corners`` is (f, 3, 3)."""
    sides = corners - np.roll(corners, 1, axis=1)
    return float(np.sqrt((sides**2).sum(axis=2).max()))


def _around(meshes: Sequence[tuple[int, TriangleMesh]]) -> FloatArray:
    """Return the middle of each mesh, the diameter of its box and its `moved`, one row per object."""
    around = np.zeros((max(i for i, _ in meshes) + 1, 5))
    for i, mesh in meshes:
        low, high = mesh.bounds
        around[i, :3] = 0.5 * low + 0.5 * high
        around[i, 3:] = np.linalg.norm(high - low), mesh.moved
    return around
