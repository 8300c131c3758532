"""The mirror balls and glass balls by way of which lamps are reached."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.through_spheres import Balls
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.lobes.register import DELTA, TRANSMITS
from hybrid_rt.shading.kernels.medium_stack import IOR
from hybrid_rt.shading.kernels.texture import CONSTANT


def balls_of(context: RenderContext) -> Balls:
    """Return the spheres that throw light in a way that `Balls` describes.

    Each is of one mirror, or of glass with an index above 1. None is, where bodies may touch: a ray
    then crosses two surfaces at once.
    """
    scene = context.scene
    rows = []
    if not context.plan["contacts"]:
        # A trimmed sphere is no `Sphere`.
        rows = [
            i
            for i, sphere in enumerate(scene.surfaces)
            if isinstance(sphere, Sphere) and (_is_mirror(scene, i) or is_clear(scene, i))
        ]
    lobe = scene.lobes.first[scene.material_of[rows]] if rows else np.zeros(0, dtype=np.int32)
    spheres = [scene.surfaces[i] for i in rows]
    color = scene.textures.number[scene.lobes.texture[lobe], :3]
    return Balls(
        center=np.array([sphere.center for sphere in spheres]).reshape(-1, 3),
        radius=np.array([sphere.radius for sphere in spheres], dtype=np.float64),
        surface=np.array(rows, dtype=np.int32),
        lobe=np.asarray(lobe, dtype=np.int32),
        is_glass=scene.lobes.traits[lobe] & TRANSMITS != 0,
        color=np.ascontiguousarray(scene.color_factor[lobe, None] * color, dtype=np.float64),
        of_surface=rows_of(scene, rows),
    )


def rows_of(scene: CompiledScene, rows: list[int]) -> IntArray:
    """Return the row of each surface in a table that holds some, (surfaces,) int32; -1: not there."""
    of_surface = np.full(max(len(scene.surfaces), 1), NOTHING, dtype=np.int32)
    of_surface[rows] = np.arange(len(rows))
    return of_surface


def is_clear(scene: CompiledScene, surface: int) -> bool:
    """Tell whether a surface bounds clear glass of one colour, with an index above 1."""
    lobe = _only_lobe(scene, surface)
    if lobe == NOTHING or scene.lobes.traits[lobe] & TRANSMITS == 0:
        return False
    is_whole = scene.lobes.weight[lobe] == 1.0 and scene.lobes.number[lobe, IOR] > 1.0
    # A flipped one holds glass outside.
    return bool(is_whole and scene.surfaces[surface].orientation == 1)


def _is_mirror(scene: CompiledScene, surface: int) -> bool:
    lobe = _only_lobe(scene, surface)
    return lobe != NOTHING and bool(scene.lobes.traits[lobe] & TRANSMITS == 0)


def _only_lobe(scene: CompiledScene, surface: int) -> int:
    """Return the lobe of a surface of one delta lobe, whose colour is constant; else `NOTHING`."""
    material = scene.material_of[surface]
    if material == NOTHING:
        return NOTHING
    lobe = int(scene.lobes.first[material])
    if scene.lobes.first[material + 1] - lobe != 1 or not scene.lobes.traits[lobe] & DELTA:
        return NOTHING
    is_constant = scene.textures.kind[scene.lobes.texture[lobe]] == CONSTANT
    return lobe if is_constant else NOTHING
