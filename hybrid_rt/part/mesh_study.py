"""How wrong the answers of a part report are when they are taken from a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.distance import ClosestPoint
from hybrid_rt.intersection.intersector import Intersector
from hybrid_rt.part.pairs import Found
from hybrid_rt.part.walls import FROM, Walls
from hybrid_rt.primitives import TriangleMesh
from meshing import tessellate

# Tolerances of the meshes, over the size of the part, and their triangles at most.
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
MOST_TRIANGLES = 2_000_000
# An error above this is too large.
ALLOWED = 0.01


@dataclass(frozen=True)
class MeshRow:
    """What a mesh within a tolerance answers.

    Attributes
    ----------
    tolerance : float
        As asked of `tessellate`, in the unit of the part.
    triangles : int
    volume_error, thickness_error : float
        Relative; of the thickness along the normal where it is least. nan: the ray does not leave the mesh.
    deviation : float
        Largest distance of samples of the part from the mesh: by so much a deviation is wrong.
    """

    tolerance: float
    triangles: int
    volume_error: float
    thickness_error: float
    deviation: float


def mesh_rows(walls: Walls, volume: float, ray: Found) -> list[MeshRow]:
    """Take the answers from meshes of several tolerances; those that take too many triangles are left out."""
    surfaces, size, rows = walls.solid.surfaces, walls.size, []
    for share in TOLERANCES:
        try:
            mesh = tessellate(tuple(surfaces), share * size, max_triangles=MOST_TRIANGLES)
        except ValueError:
            break
        body = TriangleMesh(mesh.mesh)
        near = ClosestPoint(body).query(walls.sampled[0])
        rows.append(MeshRow(
            share * size, len(mesh), abs(float(mesh.mesh.volume) / volume - 1.0),
            abs(_thickness(body, ray.place, size) / ray.value - 1.0) if np.isfinite(ray.value) else np.nan,
            float(np.abs(near.distance).max()),
        ))  # fmt: skip
    return rows


def largest_allowed(rows: list[MeshRow], name: str) -> float:
    """Return the largest tolerance from which on an answer is within 1 %; nan: none of those tried."""
    best = np.nan
    for row in reversed(rows):
        error = getattr(row, name)
        if not error <= ALLOWED:
            break
        best = row.tolerance
    return float(best)


def _thickness(body: TriangleMesh, place: FloatArray, size: float) -> float:
    """Return how long a chord is in a mesh; nan if it does not meet it twice."""
    way = place[1] - place[0]
    length = float(np.linalg.norm(way))
    way = way / length
    begin = place[0] - 0.5 * length * way
    every = Intersector(body, coarse="none").intersect_all(
        begin[None], way[None], t_min=FROM * size
    )
    t, front = every.hits.t, every.hits.front_face
    enters = np.flatnonzero(front)
    leaves = np.flatnonzero(~front)
    if not len(enters) or not len(leaves):
        return np.nan
    first = enters[np.abs(t[enters] - 0.5 * length).argmin()]
    after = leaves[t[leaves] > t[first]]
    return float(t[after[0]] - t[first]) if len(after) else np.nan
