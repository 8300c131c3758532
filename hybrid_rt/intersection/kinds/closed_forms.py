"""Spheres, rectangles, planes and boxes: tables for their kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import Finished
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere


class ClosedForm:
    """First hits on one of the kinds that are solved by a formula.

    Parameters
    ----------
    name : {"spheres", "rectangles", "planes", "boxes"}
    members : sequence of (object id, surface)
    """

    def __init__(self, name: str, members: Sequence[tuple[int, Any]]) -> None:
        make, self._trace, self._finish = _kernels(name)
        object_id = np.array([i for i, _ in members], np.int32)
        self.table = make([surface for _, surface in members], object_id)
        self._row_of = np.full(int(object_id.max()) + 1, -1, np.int64)
        self._row_of[object_id] = np.arange(len(object_id))

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots; formulas take no guess and count no work."""
        del guess, work
        self._trace(self.table, rays, best, any_hit)

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits on this kind."""
        if len(self._row_of) != len(kind_of):
            row_of = np.full(len(kind_of), -1, np.int64)
            row_of[: len(self._row_of)] = self._row_of
            row_of[kind_of != kind] = -1
            self._row_of = row_of
        self._finish(self.table, rays, best, self._row_of, out)


# From so many spheres on a tree is faster than asking all of them.
MANY = 8
# Spheres so much larger than the usual one would fill the tree's boxes: they are asked by all rays.
LARGE = 32.0
LEAF_SIZE = 2


class Spheres(ClosedForm):
    """First hits on spheres; many of them stand in a tree.

    Parameters
    ----------
    members : sequence of (object id, Sphere)
    many : int
        Number of spheres from which on there is a tree.
    """

    def __init__(self, members: Sequence[tuple[int, Any]], many: int = MANY) -> None:
        radius = np.array([sphere.radius for _, sphere in members])
        is_large = radius > LARGE * np.median(radius)
        if np.count_nonzero(~is_large) < many:
            is_large[:] = True
        order = np.argsort(~is_large, kind="stable")
        super().__init__("spheres", [members[k] for k in order])
        self._n_plain = int(np.count_nonzero(is_large))
        self._tree: Any = None
        if self._n_plain < len(members):
            self._build_tree()

    def _build_tree(self) -> None:
        from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree

        center = self.table.center[self._n_plain :]
        radius = self.table.radius[self._n_plain :, None]
        low, high = (center - radius).min(axis=0), (center + radius).max(axis=0)
        self._middle = 0.5 * low + 0.5 * high
        self._to_frame = float(2.0 ** -np.ceil(np.log2(np.linalg.norm(0.5 * high - 0.5 * low))))
        at, size = (center - self._middle) * self._to_frame, radius * self._to_frame
        self._tree = Tree(*build_tree(at - size, at + size, LEAF_SIZE))

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots."""
        del guess
        if self._n_plain:
            self._trace(self.table, self._n_plain, rays, best, any_hit)
        if self._tree is not None:
            from hybrid_rt.intersection.kernels.search.tree import new_stack
            from hybrid_rt.intersection.kernels.sphere import trace_sphere_tree

            trace_sphere_tree(
                self.table, self._tree, self._n_plain, self._middle, self._to_frame,
                rays, best, any_hit, new_stack(self._tree), work,
            )  # fmt: skip


def _kernels(name: str) -> tuple[Any, Any, Any]:
    """Import the kernels of one kind; no other kind is compiled for it."""
    if name == "spheres":
        from hybrid_rt.intersection.kernels.sphere import finish_spheres, trace_spheres

        return _spheres, trace_spheres, finish_spheres
    from hybrid_rt.intersection.kernels import planar

    if name == "rectangles":
        return _rectangles, planar.trace_rectangles, planar.finish_rectangles
    if name == "planes":
        return _planes, planar.trace_planes, planar.finish_planes
    return _boxes, planar.trace_boxes, planar.finish_boxes


def _spheres(spheres: Sequence[Sphere], object_id: IntArray) -> Any:
    from hybrid_rt.intersection.kernels.sphere import SphereTable

    return SphereTable(
        center=np.array([s.center for s in spheres]),
        radius=np.array([s.radius for s in spheres]),
        frame=np.array([s.frame for s in spheres]),
        orientation=np.array([float(s.orientation) for s in spheres]),
        object_id=object_id,
    )


def _rectangles(rectangles: Sequence[Rectangle], object_id: IntArray) -> Any:
    from hybrid_rt.intersection.kernels.planar import PlanarTable

    edge_u = np.array([r.edge_u for r in rectangles])
    edge_v = np.array([r.edge_v for r in rectangles])
    normal = np.array([r.unit_normal for r in rectangles])
    area = np.einsum("ij,ij->i", np.cross(edge_u, edge_v), normal)[:, None]
    return PlanarTable(
        corner=np.array([r.corner for r in rectangles]),
        normal=normal,
        edge_u=edge_u,
        edge_v=edge_v,
        row_u=np.cross(edge_v, normal) / area,
        row_v=np.cross(normal, edge_u) / area,
        size=np.linalg.norm(edge_u, axis=1) + np.linalg.norm(edge_v, axis=1),
        axes=np.zeros((len(rectangles), 2), np.int64),
        object_id=object_id,
    )


def _planes(planes: Sequence[Plane], object_id: IntArray) -> Any:
    from hybrid_rt.intersection.kernels.planar import PlanarTable

    unused = np.zeros((len(planes), 3))
    return PlanarTable(
        corner=np.array([p.origin for p in planes]),
        normal=np.array([p.unit_normal for p in planes]),
        edge_u=unused,
        edge_v=unused,
        row_u=unused,
        row_v=unused,
        size=np.zeros(len(planes)),
        axes=np.array([p.axes for p in planes], np.int64),
        object_id=object_id,
    )


def _boxes(boxes: Sequence[Box], object_id: IntArray) -> Any:
    from hybrid_rt.intersection.kernels.planar import BoxTable

    return BoxTable(
        lo=np.array([b.lo for b in boxes]),
        hi=np.array([b.hi for b in boxes]),
        orientation=np.array([float(b.orientation) for b in boxes]),
        object_id=object_id,
    )
