"""Triangle meshes."""

from __future__ import annotations

import os
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.checks import has
from hybrid_rt.core.records import FloatArray
from meshing.area import Triangles
from meshing.checks import as_affine, as_floats, broadcast_parameters, refuse_mask, shown
from meshing.surface import Surface

if TYPE_CHECKING:
    import trimesh

    from meshing import CertifiedMesh

# (u, v) of the corners of a face.
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


class TriangleMesh(Surface):
    """A triangle mesh in float64; (u, v) are the barycentric weights of vertices 1 and 2 of a face.

    A face without area is never hit, but keeps its index. Texture coordinates of files are not read:
    an `ImageTexture`, or a `CheckerTexture` in "uv", repeats on every triangle.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Or any object with ``vertices`` (v, 3), scene units, and ``faces`` (f, 3), integers.

    Raises
    ------
    ValueError, TypeError
        If a vertex is not finite, the index of a vertex is out of range, there are no faces, or the
        object has no vertices and faces.
    """

    is_triangular = True

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        if isinstance(mesh, str | os.PathLike):
            file = shown(os.fspath(mesh))
            raise TypeError(
                f"TriangleMesh mesh is {file}: of a file, pass trimesh.load_mesh({file})"
            )
        if not has(mesh, "vertices", "faces"):
            raise TypeError(
                f"TriangleMesh mesh is {shown(mesh)}: pass a trimesh.Trimesh, or what has vertices "
                "and faces"
                + (
                    "; of a scene: SCENE.to_mesh(), or one mesh for each part of SCENE.dump()"
                    if has(mesh, "to_mesh", "dump")
                    else ""
                )
            )
        refuse_mask(mesh.faces, "TriangleMesh faces")
        faces = np.array(mesh.faces)
        if faces.dtype.kind not in "iu":
            raise TypeError(f"TriangleMesh faces have type {faces.dtype}: pass whole numbers")
        vertices = as_floats(mesh.vertices, "TriangleMesh vertices").copy()
        self._set(vertices, faces.astype(np.int64))

    def _set(self, vertices: FloatArray, faces: NDArray[np.int64]) -> None:
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"TriangleMesh vertices have shape {vertices.shape}: pass (v, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
            raise ValueError(f"TriangleMesh faces have shape {faces.shape}: pass (f, 3), f > 0")
        bad = ~np.isfinite(vertices).all(axis=1)
        if bad.any():
            i = int(bad.argmax())
            raise ValueError(
                f"TriangleMesh vertices[{i}] is {vertices[i].tolist()}: pass finite numbers"
            )
        outside = (faces < 0) | (faces >= len(vertices))
        if outside.any():
            i = int(outside.any(axis=1).argmax())
            raise ValueError(
                f"TriangleMesh faces[{i}] is {faces[i].tolist()}, of {len(vertices)} vertices: "
                "pass indices of the vertices"
            )
        vertices.flags.writeable = False
        faces.flags.writeable = False
        self.vertices, self.faces = vertices, faces

    @classmethod
    def _from(cls, vertices: FloatArray, faces: NDArray[np.int64]) -> TriangleMesh:
        self = cls.__new__(cls)
        self._set(vertices, faces)
        return self

    def __len__(self) -> int:
        """Return the number of faces."""
        return len(self.faces)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner of the vertices that faces use."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the points (..., 3) float64 at (u, v) of faces, scene units.

        Parameters
        ----------
        u, v : floats that broadcast with each other and with ``patch_id``
        patch_id : whole numbers
            Faces, in the order given.

        Raises
        ------
        ValueError, TypeError
            If they do not broadcast, or there is no such face.
        """
        u, v, face, shape = broadcast_parameters(u, v, patch_id, len(self), "patch_id")
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        points: FloatArray = a + u[:, None] * (b - a) + v[:, None] * (c - a)
        return points.reshape(*shape, 3)

    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0
    ) -> tuple[FloatArray, FloatArray]:
        """Return the edges S_u and S_v (..., 3) float64 of faces.

        Arguments and errors are those of `point`.
        """
        _, _, face, shape = broadcast_parameters(u, v, patch_id, len(self), "patch_id")
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        return (b - a).reshape(*shape, 3), (c - a).reshape(*shape, 3)

    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the unit normals (..., 3) float64 of faces; they follow the winding order.

        Arguments and errors are those of `point`.
        """
        _, _, face, shape = broadcast_parameters(u, v, patch_id, len(self), "patch_id")
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        n = np.cross(b - a, c - a)
        normals: FloatArray = n / np.linalg.norm(n, axis=1, keepdims=True)
        return normals.reshape(*shape, 3)

    def area_sampler(self) -> Triangles:
        """Return the area sampler."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return Triangles(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    def triangles(self) -> CertifiedMesh:
        """Return the triangles themselves."""
        from meshing import CertifiedMesh

        uv = np.broadcast_to(CORNERS, (len(self), 3, 2))
        numbers = np.arange(len(self), dtype=np.int32)
        return CertifiedMesh(self.vertices, self.faces, uv, numbers, 0.0)

    def transformed(self, matrix: ArrayLike) -> TriangleMesh:
        """Return the image under an affine map; faces keep their order.

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1); last row (0, 0, 0, 1); not singular.

        Raises
        ------
        ValueError, TypeError
            For any other matrix.
        """
        linear, shift = as_affine(matrix, "TriangleMesh")
        return self._from(self.vertices @ linear.T + shift, self.faces.copy())

    def flipped(self) -> TriangleMesh:
        """Return the same faces wound the other way, which reverses their normals."""
        return self._from(self.vertices.copy(), self.faces[:, [0, 2, 1]].copy())

    def __repr__(self) -> str:
        """Say which mesh this is."""
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces)"
