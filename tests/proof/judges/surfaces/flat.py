"""Judges planes, rectangles, boxes and triangle meshes: planes in double-double, and to many digits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Box, Plane, Rectangle, TriangleMesh
from proof.judges.kernels import closed_forms
from proof.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker


class PlaneJudge(SurfaceJudge, of=Plane):
    """What is known of a plane."""

    surface: Plane

    def worker(self, object_id: int) -> Worker:
        """Return a function that meets the plane."""
        at, normal = np.array(self.surface.origin), np.array(self.surface.exact_normal)
        return lambda first, o, d, _low, out: closed_forms.plane_events(
            at, normal, object_id, first, o, d, out
        )

    def solver(self) -> Solver:
        """Return a function that meets the plane to many digits."""
        from proof.judges.digits import numbers, on_plane

        at, normal = numbers(self.surface.origin), numbers(self.surface.exact_normal)
        return lambda _patch, _u, _v, _t, o, d: on_plane(at, normal, o, d)

    def gap(
        self,
        origins: FloatArray,
        along: FloatArray,
        u: FloatArray,
        v: FloatArray,
        patch_id: NDArray[Any],
    ) -> FloatArray:
        """Return how far points lie from the plane: (u, v) are fractional parts."""
        del u, v, patch_id
        return np.abs((origins - self.surface.origin + along) @ self.surface.unit_normal)


class RectangleJudge(SurfaceJudge, of=Rectangle):
    """What is known of a rectangle."""

    surface: Rectangle

    def worker(self, object_id: int) -> Worker:
        """Return a function that meets the face."""
        corner, edge_u, edge_v = self.surface.corner, self.surface.edge_u, self.surface.edge_v
        return _face_worker(
            self.surface, corner[None].copy(), edge_u[None].copy(), edge_v[None].copy(), object_id
        )

    def solver(self) -> Solver:
        """Return a function that meets the face's plane to many digits."""
        from proof.judges.digits import cross, numbers, on_plane

        edges = numbers(self.surface.edge_u), numbers(self.surface.edge_v)
        at, normal = numbers(self.surface.corner), cross(*edges)
        return lambda _patch, _u, _v, _t, o, d: on_plane(at, normal, o, d)


class BoxJudge(SurfaceJudge, of=Box):
    """What is known of a box."""

    surface: Box

    def worker(self, object_id: int) -> Worker:
        """Return a function that meets the slabs."""
        lo, hi = np.array(self.surface.lo), np.array(self.surface.hi)
        return lambda first, o, d, _low, out: closed_forms.box_events(
            lo, hi, object_id, first, o, d, out
        )

    def solver(self) -> Solver:
        """Return a function that meets a face's plane to many digits."""
        import mpmath

        from proof.judges.digits import numbers

        sides = [numbers(self.surface.lo), numbers(self.surface.hi)]

        def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
            axis, upper = divmod(patch, 2)
            return (sides[upper][axis] - o[axis]) / d[axis] if d[axis] != 0 else mpmath.nan

        return solve


class MeshJudge(SurfaceJudge, of=TriangleMesh):
    """What is known of a triangle mesh."""

    surface: TriangleMesh

    def worker(self, object_id: int) -> Worker:
        """Return a function that meets every face."""
        mesh = self.surface
        a, b, c = (np.ascontiguousarray(mesh.vertices[mesh.faces[:, k]]) for k in range(3))
        return _face_worker(mesh, a, b - a, c - a, object_id)

    def within(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the weights of hits, or those of a point of the triangle's border."""
        del patch_id
        u, v = np.maximum(u, 0.0), np.maximum(v, 0.0)
        total = np.maximum(u + v, 1.0)
        return u / total, v / total

    def solver(self) -> Solver:
        """Return a function that meets a face's plane to many digits."""
        from proof.judges.digits import cross, numbers, on_plane

        mesh = self.surface

        def solve(patch: int, _u: float, _v: float, _t: float, o: Vector, d: Vector) -> Number:
            a, b, c = (numbers(corner) for corner in mesh.vertices[mesh.faces[patch]])
            sides = [[x - y for x, y in zip(corner, a, strict=True)] for corner in (b, c)]
            return on_plane(a, cross(*sides), o, d)

        return solve


def _face_worker(
    surface: Rectangle | TriangleMesh,
    corners: FloatArray,
    edges_u: FloatArray,
    edges_v: FloatArray,
    object_id: int,
) -> Worker:
    middle, size, is_triangle = surface.middle, surface.size, surface.is_triangular
    return lambda first, o, d, _low, out: closed_forms.face_events(
        corners, edges_u, edges_v, is_triangle, middle, size, object_id, first, o, d, out
    )
