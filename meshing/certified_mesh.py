"""Triangles with a proven distance from their surface."""

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
    """Triangles, their parameters on the surface, and a bound on their distance from it.

    Attributes
    ----------
    vertices : (v, 3) float64
        In scene units. Pieces that share an edge or a corner share its vertices.
    faces : (f, 3) int64
        Rows of ``vertices``, counterclockwise as seen from the side of S_u x S_v.
    uv : (f, 3, 2) float64
        Parameters of each corner of each face; at a seam, those of the face's own side.
    patch_id : (f,) int32
        Patch or profile segment of each face.
    deviation_bound : float
        Proven bound, in scene units, on the distance between a point of a face and the surface
        point at the (u, v) that the same barycentric weights interpolate. It includes the rounding
        of the vertices. Of trimmed surfaces, no point of the mesh is farther from the part inside the
        loops, and no point of that, borders included, is farther from the mesh.
    surface_id : (f,) int32, or None
        Surface of each face, where `tessellate` was given a list.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    uv: FloatArray
    patch_id: NDArray[np.int32]
    deviation_bound: float
    surface_id: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        """Return the number of triangles."""
        return len(self.faces)

    def __repr__(self) -> str:
        """Count triangles and vertices, and state the deviation."""
        counts = f"{len(self.faces)} triangles, {len(self.vertices)} vertices"
        return f"CertifiedMesh({counts}, deviation at most {self.deviation_bound:.3g})"

    @cached_property
    def mesh(self) -> trimesh.Trimesh:
        """The triangles as a `trimesh.Trimesh`, for export and for trimesh's own tools."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)
