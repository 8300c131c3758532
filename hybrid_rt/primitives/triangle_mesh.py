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
from meshing.checks import (
    IdArray,
    as_affine,
    as_floats,
    as_path,
    broadcast_parameters,
    refuse_mask,
    shown,
    units,
)
from meshing.double_double import pair_of, rounded_image, stretched
from meshing.surface import Surface

if TYPE_CHECKING:
    import trimesh

    from meshing import CertifiedMesh

# (u, v) of the corners of a face.
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
# Beyond it float64 leaves less than 1e-7 of a picture that repeats.
LARGEST_COORDINATE = 1e9


class TriangleMesh(Surface):
    """A triangle mesh in float64; (u, v) are the barycentric weights of vertices 1 and 2 of a face.

    A face without area is never hit, but keeps its index. An `ImageTexture`, and a `CheckerTexture`
    in "uv", are looked up at texture coordinates, interpolated over each face. (u, v) of hits stay
    barycentric. Of a mesh without texture coordinates they are looked up at (u, v), so they repeat
    on every triangle.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Or any object with ``vertices`` (v, 3), scene units, and ``faces`` (f, 3), integers.
    texture_coordinates : (v, 2) array-like, optional
        Of each vertex; the second one runs upward, as in OBJ files. By default those of the mesh,
        ``mesh.visual.uv``, if it has any. They are kept as an attribute: float64, or None.

    Raises
    ------
    ValueError, TypeError
        If a vertex is not finite, the index of a vertex is out of range, there are no faces, or the
        object has no vertices and faces; if there is not one pair of texture coordinates for each
        vertex, or one is not finite or above 1e9.
    """

    is_triangular = True
    texture_coordinates: FloatArray | None = None

    def __init__(
        self, mesh: trimesh.Trimesh, *, texture_coordinates: ArrayLike | None = None
    ) -> None:
        if isinstance(mesh, str | os.PathLike):
            file = shown(os.fspath(mesh))
            raise TypeError(
                f"TriangleMesh mesh is {file}: of a file, take TriangleMesh.read({file})"
            )
        if not has(mesh, "vertices", "faces"):
            of_scene = "; of a scene: SCENE.to_mesh(), or one mesh for each part of SCENE.dump()"
            raise TypeError(
                f"TriangleMesh mesh is {shown(mesh)}: pass a trimesh.Trimesh, or what has vertices "
                "and faces" + of_scene * has(mesh, "to_mesh", "dump")
            )
        refuse_mask(mesh.faces, "TriangleMesh faces")
        faces = np.array(mesh.faces)
        if faces.dtype.kind not in "iu":
            raise TypeError(f"TriangleMesh faces have type {faces.dtype}: pass whole numbers")
        vertices = as_floats(mesh.vertices, "TriangleMesh vertices").copy()
        if not len(faces):
            raise ValueError(
                f"TriangleMesh mesh has {len(vertices)} vertices and no faces: pass a mesh of triangles; of a "
                "file, TriangleMesh.read says what it holds"
            )
        self._set(vertices, faces.astype(np.int64))
        if texture_coordinates is not None:
            self._set_coordinates(texture_coordinates, "TriangleMesh texture_coordinates", "")
        elif isinstance(mesh, TriangleMesh):
            self._keep_coordinates(mesh.texture_coordinates)
        elif (uv := getattr(getattr(mesh, "visual", None), "uv", None)) is not None:
            own = ", or texture_coordinates of your own"
            self._set_coordinates(uv, "TriangleMesh mesh.visual.uv", own)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> TriangleMesh:
        """Return the mesh of a file: STL, PLY, OBJ, glTF, or another that trimesh reads.

        All parts of the file are in it, with their texture coordinates.

        Raises
        ------
        FileNotFoundError, ValueError, TypeError, ModuleNotFoundError
            If there is no such file, or it cannot be read; the message names it.
        """
        from hybrid_rt.primitives.mesh_files import read_mesh

        return cls(read_mesh(as_path(path, "TriangleMesh file")))

    def _set_coordinates(self, given: ArrayLike, what: str, otherwise: str) -> None:
        """Check and keep texture coordinates; ``what`` they are, and what else to pass, is for messages."""
        coordinates = as_floats(given, what).copy()
        shape = (len(self.vertices), 2)
        if coordinates.shape != shape:
            raise ValueError(
                f"{what} has shape {coordinates.shape}: pass {shape}, a pair for each vertex{otherwise}"
            )
        good = (np.abs(coordinates) <= LARGEST_COORDINATE).all(axis=1)  # not where one is nan
        if not good.all():
            i = int(good.argmin())
            raise ValueError(
                f"{what}[{i}] is {coordinates[i].tolist()}: pass finite numbers within "
                f"{LARGEST_COORDINATE:g}{otherwise}"
            )
        coordinates.flags.writeable = False
        self._keep_coordinates(coordinates)

    def _keep_coordinates(self, coordinates: FloatArray | None) -> None:
        # Not set if there are none, so pickles and fingerprints of such meshes do not hold them.
        if coordinates is not None:
            self.texture_coordinates = coordinates

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

    def _with(self, vertices: FloatArray, faces: NDArray[np.int64], moved: float) -> TriangleMesh:
        """Return a mesh with the same texture coordinates."""
        mesh = type(self).__new__(type(self))
        mesh._set(vertices, faces)
        mesh._keep_coordinates(self.texture_coordinates)
        mesh.moved = moved
        return mesh

    def __len__(self) -> int:
        """Return the number of faces."""
        return len(self.faces)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner of the vertices that faces use."""
        used = self.vertices[self.faces.ravel()]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    def _corners(self, face: IdArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        return a, b, c

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        a, b, c = self._corners(patch_id)
        return a + u[:, None] * (b - a) + v[:, None] * (c - a)

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del u, v
        a, b, c = self._corners(patch_id)
        return b - a, c - a

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        """Return normals of faces; they follow the winding order."""
        return units(np.cross(*self._partials(u, v, patch_id)))

    def texture_point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return where textures are looked up at (u, v) of faces, (n, 2) float64.

        That is at (u, v) itself if the mesh has no texture coordinates. Arguments and errors are
        those of `meshing.surface.Surface.point`.
        """
        u, v, face, _ = broadcast_parameters(u, v, patch_id, len(self))
        if self.texture_coordinates is None:
            return np.stack([u, v], axis=1)
        a, b, c = (self.texture_coordinates[self.faces[face, k]] for k in range(3))
        # Where all corners are at one place, as in palettes, so is the result, to the last bit.
        return a + u[:, None] * (b - a) + v[:, None] * (c - a)

    def area_sampler(self) -> Triangles:
        """Return the area sampler."""
        a, b, c = self._corners(np.arange(len(self)))
        return Triangles(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))

    def triangles(self) -> CertifiedMesh:
        """Return the triangles themselves."""
        from meshing import CertifiedMesh

        uv = np.broadcast_to(CORNERS, (len(self), 3, 2))
        numbers = np.arange(len(self), dtype=np.int32)
        return CertifiedMesh(self.vertices, self.faces, uv, numbers, 0.0)

    def transformed(self, matrix: ArrayLike) -> TriangleMesh:
        """Return the image under an affine map; see `meshing.surface.Surface.transformed`."""
        linear, shift = as_affine(matrix, "TriangleMesh")
        vertices, off = rounded_image(linear, shift, pair_of(self.vertices))
        return self._with(vertices, self.faces.copy(), off + stretched(linear, self.moved))

    def flipped(self) -> TriangleMesh:
        """Return the same faces wound the other way, which reverses their normals."""
        return self._with(self.vertices.copy(), self.faces[:, [0, 2, 1]].copy(), self.moved)

    def __repr__(self) -> str:
        """Say which mesh this is."""
        has_them = "" if self.texture_coordinates is None else ", texture coordinates"
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces{has_them})"
