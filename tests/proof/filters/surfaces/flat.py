"""The filters of planes, parallelograms, boxes and triangles."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.primitives import Box, Plane, Rectangle, TriangleMesh
from hybrid_rt.primitives.box import TurnedBox
from proof.filters.kernels import faces
from proof.filters.kernels.first import N_COLUMNS
from proof.filters.surface_filter import (
    SurfaceFilter,
    crossings_scratch,
    double_double,
    fractions,
)


class FlatFilter(SurfaceFilter, of=Rectangle):
    """Solves for t and the coordinates in the plane, face by face."""

    shape = faces.PARALLELOGRAM

    def __init__(self, surface: Any) -> None:
        super().__init__(surface)
        origin, corners, edges = self._faces()
        normals = np.array([_cross(e, f) for e, f in edges], dtype=object)
        middle, size = self.ball()
        corner_floats, edge_floats = corners.astype(np.float64), edges.astype(np.float64)
        balls = np.zeros((len(corners), 4))
        ends = corner_floats[:, None] + np.stack(
            [
                0.0 * edge_floats[:, 0],
                edge_floats[:, 0],
                edge_floats[:, 1],
                edge_floats.sum(axis=1),
            ],
            axis=1,
        )
        if self.shape == faces.TRIANGLE:
            ends = ends[:, :3]
        balls[:, :3] = 0.5 * (ends.min(axis=1) + ends.max(axis=1))
        balls[:, 3] = np.linalg.norm(ends - balls[:, None, :3], axis=2).max(axis=1)
        radius = float(np.linalg.norm(ends, axis=2).max())
        if self.shape == faces.PLANE:
            balls[:, 3] = radius = np.inf
        self._table = faces.Faces(
            corners=double_double(corners),
            edges=double_double(edges),
            normals=_balls(normals),
            balls=balls,
            shape=self.shape,
            origin=origin,
            centre=origin,
            radius=radius,
            middle=middle,
            size=size,
        )
        self._scratch = faces.FaceScratch(np.zeros((3, 3)), crossings_scratch())

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Solve for all faces near each ray."""
        out = np.zeros((len(origins), N_COLUMNS))
        faces.first_on_faces(self._table, origins, directions, leaves, hit_t, self._scratch, out)
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from corner + u edge_u + v edge_v."""
        del patch
        surface = self.surface
        there = u[:, None] * surface.edge_u + v[:, None] * surface.edge_v
        distance: FloatArray = np.linalg.norm(surface.corner - origins + there - along, axis=1)
        return distance

    def _faces(self) -> tuple[FloatArray, Any, Any]:
        """Return an origin; from there corners (k, 3) and edges (k, 2, 3), as fractions."""
        surface = self.surface
        edges = fractions([[surface.edge_u, surface.edge_v]])
        return np.array(surface.corner), fractions(np.zeros((1, 3))), edges


class PlaneFilter(FlatFilter, of=Plane):
    """A point and a normal, floats taken for exact."""

    surface: Plane
    shape = faces.PLANE

    def __init__(self, surface: Plane) -> None:
        super().__init__(surface)
        normal = _balls(fractions([surface.exact_normal]))
        self._table = self._table._replace(normals=normal)

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the plane itself."""
        del u, v, patch
        away = origins - self.surface.origin + along
        distance: FloatArray = np.abs(away @ self.surface.unit_normal)
        return distance

    def ball(self) -> tuple[FloatArray, float]:
        """Return a point of the plane."""
        return np.array(self.surface.origin), -1.0

    def _faces(self) -> tuple[FloatArray, Any, Any]:
        return np.array(self.surface.origin), fractions(np.zeros((1, 3))), fractions(
            np.eye(3)[None, :2]
        )  # fmt: skip


class BoxFilter(FlatFilter, of=Box):
    """Six faces from a corner and three edges."""

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the face, along the box's own axes."""
        del u, v
        edges = np.asarray(self.surface.edges)
        away = origins - self.surface.lo + along
        share = np.clip(np.linalg.solve(edges.T, away.T).T, 0.0, 1.0)
        rows = np.arange(len(patch))
        share[rows, patch // 2] = patch % 2
        distance: FloatArray = np.linalg.norm(away - share @ edges, axis=1)
        return distance

    def _faces(self) -> tuple[FloatArray, Any, Any]:
        corners, pairs = [], []
        edges = self._edges()
        for face in range(6):
            axis, upper = divmod(face, 2)
            corners.append(edges[axis] if upper else 0 * edges[axis])
            pairs.append([edges[axis - 2], edges[axis - 1]])
        return (
            np.array(self.surface.lo),
            np.array(corners, dtype=object),
            np.array(pairs, dtype=object),
        )

    def _edges(self) -> Any:
        sides = fractions(self.surface.hi) - fractions(self.surface.lo)
        return fractions(np.eye(3)) * sides[:, None]


class TurnedBoxFilter(BoxFilter, of=TurnedBox):
    """A parallelepiped."""

    def _edges(self) -> Any:
        return fractions(self.surface.edges)


class MeshFilter(FlatFilter, of=TriangleMesh):
    """All triangles, one after the other."""

    surface: TriangleMesh
    shape = faces.TRIANGLE

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the point of the face with these weights."""
        a, b, c = (self.surface.vertices[self.surface.faces[patch, k]] for k in range(3))
        there = u[:, None] * (b - a) + v[:, None] * (c - a)
        distance: FloatArray = np.linalg.norm(a - origins + there - along, axis=1)
        return distance

    def _faces(self) -> tuple[FloatArray, Any, Any]:
        vertices = np.asarray(self.surface.vertices)
        origin = vertices.mean(axis=0)
        a, b, c = (fractions(vertices[self.surface.faces[:, k]]) for k in range(3))
        return origin, a - fractions(origin), np.stack([b - a, c - a], axis=1)


def _cross(a: Any, b: Any) -> Any:
    return np.array([a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)], dtype=object)


def _balls(values: Any) -> FloatArray:
    """Return fractions as balls in double-double."""
    pairs = double_double(values)
    return np.concatenate([pairs, 2.0**-104 * np.abs(pairs[..., :1])], axis=-1)
