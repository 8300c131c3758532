"""Meshes of several faces that are coloured by (u, v): each face shows the whole texture.

(u, v) of a mesh are barycentric in each face. If the mesh has no texture coordinates, a picture that
was meant to cover it once is put onto every triangle.
"""

from __future__ import annotations

from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.scene.compiled import CompiledScene


def pictures_on_meshes(scene: CompiledScene) -> list[str]:
    """Return the names of such meshes: `CompiledScene.colored_by_uv`, without texture coordinates."""
    return [
        scene.called[i]
        for i, surface in enumerate(scene.surfaces)
        if isinstance(surface, TriangleMesh)
        and len(surface) > 1
        and surface.texture_coordinates is None
        and scene.colored_by_uv[i]
    ]
