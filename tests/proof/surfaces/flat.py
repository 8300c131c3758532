"""Planes, parallelograms, boxes and triangles: t and the coordinates in the plane."""

from __future__ import annotations

import math
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
    distance,
    dot,
    inside,
    rational,
    rationals,
)
from proof.exact.faces import BoxFace, Face
from proof.exact.touches import FEW_SAMPLES, STEEP, touch_of_nets
from proof.filters.kernels import faces
from proof.surface import (
    ExactSurface,
    Gap,
    IsTouched,
    SurfaceFilter,
    crossings_scratch,
    double_double,
    fractions,
)

# Triangles farther from the ray than this part of everything's extent are not looked at.
CLEAR = 1e-9


class ExactPlane(ExactSurface, of=Plane):
    """Exact crossings with a plane, given by a point and a normal, floats taken as exact."""

    surface: Plane

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
            return [Crossing(t, 0, 0.0, 0.0, cosine_of(normal, d), to_edge=math.inf)]

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


class ExactRectangle(ExactSurface, of=Rectangle):
    """Exact crossings with a parallelogram, given by corner and edges."""

    surface: Rectangle

    def crosser(self) -> Crosser:
        """Return a function that finds the crossing."""
        return Face(
            0, self.surface.corner, self.surface.edge_u, self.surface.edge_v, False
        ).crossings

    def gap(self) -> Gap:
        """Return a function that measures from corner + u edge_u + v edge_v."""
        surface = self.surface
        corner, e, f = (rationals(x) for x in (surface.corner, surface.edge_u, surface.edge_v))

        def gap(_patch: int, u: float, v: float, point: list[Any]) -> float:
            a, b = inside(u), inside(v)
            there = [p + a * x + b * y for p, x, y in zip(corner, e, f, strict=True)]
            return distance(there, point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        c, e, f = self.surface.corner, self.surface.edge_u, self.surface.edge_v
        return touch_of_nets([np.array([[c, c + f], [c + e, c + e + f]])], FEW_SAMPLES)


class ExactBox(ExactSurface, of=Box):
    """Exact crossings with an axis-aligned box, given by two corners."""

    surface: Box

    def crosser(self) -> Crosser:
        """Return a function that finds all crossings with the faces."""
        lo, hi = np.asarray(self.surface.lo), np.asarray(self.surface.hi)
        # Corner and edges would be rounded: a face is given by what it is between.
        faces = [BoxFace(face, face // 2, lo, hi) for face in range(6)]
        return lambda o, d: [found for face in faces for found in face.crossings(o, d)]

    def gap(self) -> Gap:
        """Return a function that measures from the face."""
        lo, hi = rationals(self.surface.lo), rationals(self.surface.hi)

        def gap(patch: int, _u: float, _v: float, point: list[Any]) -> float:
            axis, upper = divmod(patch, 2)
            there = [min(max(x, a), b) for x, a, b in zip(point, lo, hi, strict=True)]
            there[axis] = (hi if upper else lo)[axis]
            return distance(there, point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        box = self.surface
        nets = [
            np.array([[box.point(u, v, face) for v in (0, 1)] for u in (0, 1)])
            for face in range(len(box))
        ]
        return touch_of_nets(nets, FEW_SAMPLES)


class ExactTurnedBox(ExactBox, of=TurnedBox):
    """Exact crossings with a parallelepiped, given by a corner and three edges."""

    surface: TurnedBox

    def crosser(self) -> Crosser:
        """Return a function that finds all crossings with the six parallelograms."""
        corner, edges = self._frame()
        faces = []
        for face in range(6):
            axis, upper = divmod(face, 2)
            begin = _sum(corner, edges[axis]) if upper else corner
            faces.append(Face(face, begin, edges[axis - 2], edges[axis - 1], False))
        return lambda o, d: [found for face in faces for found in face.crossings(o, d)]

    def gap(self) -> Gap:
        """Return a function that measures from the face's point at (u, v)."""
        corner, edges = self._frame()
        swapped = self.surface._is_swapped(np.arange(6))

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            axis, upper = divmod(patch, 2)
            a, b = (inside(v), inside(u)) if swapped[patch] else (inside(u), inside(v))
            there = [
                c + upper * edges[axis][k] + a * edges[axis - 2][k] + b * edges[axis - 1][k]
                for k, c in enumerate(corner)
            ]
            return distance(there, point)

        return gap

    def _frame(self) -> tuple[list[Any], list[list[Any]]]:
        return rationals(self.surface.lo), [rationals(edge) for edge in self.surface.edges]


class ExactMesh(ExactSurface, of=TriangleMesh):
    """Exact crossings with triangles; a shared edge is crossed once for each."""

    surface: TriangleMesh

    def crosser(self) -> Crosser:
        """Return a function that finds all crossings."""
        corners = self.surface.vertices[self.surface.faces]
        faces: dict[int, Face] = {}
        extent = float(np.abs(corners).max())

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            near = _near(corners, np.array([float(x) for x in o]), [float(x) for x in d], extent)
            found = []
            for k in near.tolist():
                if k not in faces:
                    faces[k] = Face(k, *_triangle(corners[k]), True)
                found += faces[k].crossings(o, d)
            return found

        return crossings

    def gap(self) -> Gap:
        """Return a function that measures from the point of the face with these weights."""
        vertices, faces = self.surface.vertices, self.surface.faces

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            a, b, c = (rationals(vertices[k]) for k in faces[patch])
            p, q = rational(max(u, 0.0)), rational(max(v, 0.0))
            total = max(p + q, flint.fmpq(1))
            p, q = p / total, q / total
            there = [x + p * (y - x) + q * (z - x) for x, y, z in zip(a, b, c, strict=True)]
            return distance(there, point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        corners = self.surface.vertices[self.surface.faces]
        return touch_of_nets([np.array([[a, a], [b, c]]) for a, b, c in corners], FEW_SAMPLES)


def _near(corners: Any, o: Any, d: list[float], extent: float) -> Any:
    """Return the triangles whose hull the ray may meet, by float64 far beyond rounding."""
    k = int(np.abs(d).argmax())
    i, j = (k + 1) % 3, (k + 2) % 3
    away = corners - o
    margin = CLEAR * (extent + float(np.abs(o).max())) * abs(d[k])
    is_near = np.ones(len(corners), np.bool_)
    for c in (i, j):
        f = d[k] * away[:, :, c] - d[c] * away[:, :, k]
        is_near &= (f.min(axis=1) <= margin) & (f.max(axis=1) >= -margin)
    return np.flatnonzero(is_near)


def _triangle(corners: Any) -> tuple[Any, Any, Any]:
    a, b, c = (rationals(corner) for corner in corners)
    return a, [x - y for x, y in zip(b, a, strict=True)], [x - y for x, y in zip(c, a, strict=True)]


def _sum(a: RationalVector, b: RationalVector) -> list[Any]:
    return [x + y for x, y in zip(a, b, strict=True)]


class FlatFilter(SurfaceFilter, of=Rectangle):
    """Solves for t and the coordinates in the plane, face by face."""

    kernel = staticmethod(faces.first_on_faces)

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
