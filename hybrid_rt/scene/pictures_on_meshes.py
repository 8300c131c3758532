"""Meshes of several faces that are coloured by (u, v): each face shows the whole texture.

(u, v) of a mesh are barycentric in each face, and texture coordinates of files are not read, so a
picture that was meant to cover a mesh once is put onto every triangle.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from hybrid_rt.core.records import BoolArray
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.texture import CHECKER_UV, IMAGE


def pictures_on_meshes(scene: CompiledScene) -> list[str]:
    """Return the names of meshes of several faces with a texture over (u, v).

    These are an `ImageTexture`, and a `CheckerTexture` in "uv", in any colour of the material, also
    in what it emits.

    Parameters
    ----------
    scene : CompiledScene
    """
    follows_uv = np.isin(scene.textures.kind, (IMAGE, CHECKER_UV))
    by_material = [
        bool(follows_uv[scene.lobes.texture[start:stop]].any())
        for start, stop in pairwise(scene.lobes.first)
    ]
    return [
        scene.called[i]
        for i, surface in enumerate(scene.surfaces)
        if surface.is_triangular
        and len(surface) > 1
        and (by_material[scene.material_of[i]] or _shines_by_uv(scene, i, follows_uv))
    ]


def _shines_by_uv(scene: CompiledScene, surface: int, follows_uv: BoolArray) -> bool:
    """Tell whether a surface emits by a texture over (u, v)."""
    light = scene.light_of[surface]
    row = NOTHING if light == NOTHING else scene.lights.texture[light]
    return bool(row != NOTHING and follows_uv[row])
