"""Planes, parallelograms, boxes and triangles: t and the coordinates in the plane."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cache, cached_property
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.primitives import Box, Plane, Rectangle, TriangleMesh
from hybrid_rt.primitives.box import TurnedBox
from proof.exact.crossings import (
    ALONG,
    Crosser,
    Crossing,
    RationalVector,
    ball_of,
    cosine_of,
    cross,
    distance,
    dot,
    inside,
    near,
    rationals,
)
from proof.exact.faces import Face
from proof.exact.touches import FEW_SAMPLES, STEEP, touch_of_nets
from proof.filters.kernels import faces
from proof.surface import Gap, IsTouched, Judged, double_double, fractions, scratch


class Flat(Judged, of=None):
    """Crossings with faces: each a corner and two edges."""

    kernel = staticmethod(faces.first_on_faces)
    shape = faces.PARALLELOGRAM

    @cached_property
    def parts(self) -> tuple[FloatArray, Any, Any]:
        """What `faces` returns."""
        return self.faces()

    @abstractmethod
    def faces(self) -> tuple[FloatArray, Any, Any]:
        """Return an origin; from there corners (k, 3) and edges (k, 2, 3), as fractions.

        u runs along the first of both edges.
        """

    def crosser(self) -> Crosser:
        """Return a function that finds the crossings with all faces; a shared edge is crossed by both."""
        face, hulls = self._exact_faces(), self._ends() + self.parts[0]
        return lambda o, d: [found for k in near(hulls, o, d) for found in face(k).crossings(o, d)]

    def gap(self) -> Gap:
        """Return a function that measures from corner + u edge_u + v edge_v."""
        exact_face = self._exact_faces()

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            face, a, b = exact_face(patch), inside(u), inside(v)
            total = max(a + b, flint.fmpq(1)) if face.half else 1
            corner = zip(face.corner, face.edge_u, face.edge_v, strict=True)
            return distance([c + (a * e + b * f) / total for c, e, f in corner], point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        ends = self._ends() + self.parts[0]
        order = [0, 0, 1, 2] if self.shape == faces.TRIANGLE else [0, 2, 1, 3]
        return touch_of_nets(list(ends[:, order].reshape(-1, 2, 2, 3)), FEW_SAMPLES)

    def tables(self) -> tuple[Any, Any]:
        """Return corners, edges and normals in double-double."""
        origin, corners, edges = self.parts
        ends = self._ends()
        balls = np.zeros((len(corners), 4))
        balls[:, :3] = 0.5 * (ends.min(axis=1) + ends.max(axis=1))
        balls[:, 3] = np.linalg.norm(ends - balls[:, None, :3], axis=2).max(axis=1)
        radius = float(np.linalg.norm(ends, axis=2).max())
        if self.shape == faces.PLANE:
            balls[:, 3] = radius = np.inf
        normals = double_double(self.normals())
        table = faces.Faces(
            corners=double_double(corners),
            edges=double_double(edges),
            normals=np.concatenate([normals, 2.0**-104 * np.abs(normals[..., :1])], axis=-1),
            balls=balls,
            shape=self.shape,
            origin=origin,
            radius=radius,
            middle=self.middle,
            size=self.size,
        )
        return table, scratch()

    def normals(self) -> Any:
        """Return the normals of all faces as fractions, of any length."""
        return np.array([cross(e, f) for e, f in self.parts[2]], dtype=object)

    def _ends(self) -> FloatArray:
        """Return the corners of all faces from the origin, (k, 3 or 4, 3), rounded."""
        _, corners, edges = self.parts
        e, f = edges[:, 0], edges[:, 1]
        ends = [corners, corners + e, corners + f, corners + e + f]
        n = 3 if self.shape == faces.TRIANGLE else 4
        return np.stack(ends[:n], axis=1).astype(np.float64)

    def _exact_faces(self) -> Callable[[int], Face]:
        origin, corners, edges = self.parts
        at, half = fractions(origin), self.shape == faces.TRIANGLE
        return cache(lambda k: Face(k, corners[k] + at, edges[k, 0], edges[k, 1], half))


class RectangleFaces(Flat, of=Rectangle):
    """A parallelogram, given by corner and edges."""

    surface: Rectangle

    def faces(self) -> tuple[FloatArray, Any, Any]:
        """Return the only face."""
        edges = fractions([[self.surface.edge_u, self.surface.edge_v]])
        return np.array(self.surface.corner), fractions(np.zeros((1, 3))), edges


class BoxFaces(Flat, of=Box):
    """The six faces of a box along the axes, given by two corners."""

    surface: Box

    def faces(self) -> tuple[FloatArray, Any, Any]:
        """Return the faces from the lower corner and three edges."""
        edges = self.edges()
        corners = [edges[k // 2] * (k % 2) for k in range(6)]
        swapped = self.surface._is_swapped(np.arange(6))
        # On those v, not u, runs along the first of the two other axes.
        pairs = [edges[[k // 2 - 2, k // 2 - 1][:: -1 if s else 1]] for k, s in enumerate(swapped)]
        return np.array(self.surface.lo), np.array(corners), np.array(pairs)

    def gap(self) -> Gap:
        """Return a function that measures from the face: far from 0, u and v are rounded by more than a band."""
        lo, hi = rationals(self.surface.lo), rationals(self.surface.hi)

        def gap(patch: int, _u: float, _v: float, point: list[Any]) -> float:
            axis, upper = divmod(patch, 2)
            there = [min(max(x, a), b) for x, a, b in zip(point, lo, hi, strict=True)]
            there[axis] = (hi if upper else lo)[axis]
            return distance(there, point)

        return gap

    def edges(self) -> Any:
        """Return the three edges as fractions."""
        sides = fractions(self.surface.hi) - fractions(self.surface.lo)
        return fractions(np.eye(3)) * sides[:, None]


class TurnedBoxFaces(BoxFaces, of=TurnedBox):
    """A parallelepiped, given by a corner and three edges."""

    gap = Flat.gap

    def edges(self) -> Any:
        """Return the three edges as fractions."""
        return fractions(self.surface.edges)


class MeshFaces(Flat, of=TriangleMesh):
    """All triangles of a mesh."""

    surface: TriangleMesh
    shape = faces.TRIANGLE

    def faces(self) -> tuple[FloatArray, Any, Any]:
        """Return the triangles from the mean of all vertices."""
        origin = np.asarray(self.surface.vertices).mean(axis=0)
        a, b, c = (fractions(self.surface.vertices[self.surface.faces[:, k]]) for k in range(3))
        return origin, a - fractions(origin), np.stack([b - a, c - a], axis=1)


class PlaneFaces(Flat, of=Plane):
    """A plane, given by a point and a normal, floats taken as exact."""

    surface: Plane
    shape = faces.PLANE

    def crosser(self) -> Crosser:
        """Return a function that finds the crossing."""
        at, normal = rationals(self.surface.origin), rationals(self.surface.exact_normal)

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            slope = dot(normal, d)
            gap = dot(normal, [p - x for p, x in zip(at, o, strict=True)])
            if slope == 0:
                if gap != 0:
                    return []
                return [Crossing(-flint.arb("inf"), 0, 0.0, 0.0, 0.0, ALONG, flint.arb("inf"))]
            t = ball_of(gap / slope)
            return [Crossing(t, 0, 0.0, 0.0, cosine_of(normal, d), to_edge=np.inf)]

        return crossings

    def gap(self) -> Gap:
        """Return a function that measures from the plane itself."""
        at, normal = rationals(self.surface.origin), rationals(self.surface.unit_normal)

        def gap(_patch: int, _u: float, _v: float, point: list[Any]) -> float:
            away = [x - p for x, p in zip(point, at, strict=True)]
            return abs(float(dot(normal, away)))

        return gap

    def touch(self) -> IsTouched:
        """Return a function that measures the height of the origin."""
        n, at = self.surface.unit_normal, self.surface.origin

        def is_touched(origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
            begins = abs(float(n @ (origin - at))) <= reach
            return begins and (not leaves or abs(float(n @ d)) <= STEEP)

        return is_touched

    def ball(self) -> tuple[list[float], float | None]:
        """Return a point of the plane."""
        return self.surface.origin.tolist(), None

    def faces(self) -> tuple[FloatArray, Any, Any]:
        """Return what stands for it: only its normal counts."""
        return (
            np.array(self.surface.origin),
            fractions(np.zeros((1, 3))),
            fractions(np.eye(3)[None, :2]),
        )

    def normals(self) -> Any:
        """Return the normal as it was given."""
        return fractions([self.surface.exact_normal])

    def rough_gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the plane itself: u and v of hits are rounded to a part of their coordinates."""
        del u, v, patch
        height: FloatArray = np.abs(
            (origins - self.surface.origin + along) @ self.surface.unit_normal
        )
        return height
