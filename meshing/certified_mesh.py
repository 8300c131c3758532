"""Triangles with a proven distance from the surface that they stand for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshing.checks import FloatArray

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class CertifiedMesh:
    """Triangles, where they lie on the surface, and how far from it they can be.

    Attributes
    ----------
    vertices : (v, 3) float64
        In scene units. Pieces that share an edge or a corner share its vertices.
    faces : (f, 3) int64
        Rows of ``vertices``, counterclockwise as seen from where S_u x S_v points to.
    uv : (f, 3, 2) float64
        Parameters of each corner of each face, on its own side of a seam.
    patch_id : (f,) int32
        Patch or profile segment of each face.
    deviation_bound : float
        Proven: at equal weights of the corners a point of a face and the point of the surface at
        (u, v) are no farther apart, roundings of the vertices included. Scene units.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    uv: FloatArray
    patch_id: NDArray[np.int32]
    deviation_bound: float

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.faces)

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The triangles as a `trimesh.Trimesh`, for export and for trimesh's own tools."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)
