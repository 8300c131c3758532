"""Vertex normals of triangle meshes."""

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import TriangleMesh


def vertex_normals(mesh: TriangleMesh) -> FloatArray:
    """Return unit vertex normals (v, 3): face normals weighted by the angle at the vertex.

    Vertices at the same position are merged, as files often store one per face. Thuermer and
    Wuethrich, "Computing vertex normals from polygonal facets", JGT 3(1), 1998.
    """
    _, place = np.unique(mesh.vertices, axis=0, return_inverse=True)
    place = place.ravel()
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = _unit(across)
    total = np.zeros((len(mesh.vertices), 3))
    for k in range(3):
        a = _unit(corners[:, (k + 1) % 3] - corners[:, k])
        b = _unit(corners[:, (k + 2) % 3] - corners[:, k])
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1.0, 1.0))
        np.add.at(total, place[mesh.faces[:, k]], angle[:, None] * flat)
    return _unit(total)[place]


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
