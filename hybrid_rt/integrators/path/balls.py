"""The mirror balls and glass balls by way of which lamps are reached."""

from __future__ import annotations

import numpy as np

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
        rows = [i for i in range(len(scene.surfaces)) if _is_ball(scene, i)]
    lobe = scene.lobes.first[scene.material_of[rows]] if rows else np.zeros(0, dtype=np.int32)
    spheres = [scene.surfaces[i] for i in rows]
    of_surface = np.full(max(len(scene.surfaces), 1), NOTHING, dtype=np.int32)
    of_surface[rows] = np.arange(len(rows))
    color = scene.textures.number[scene.lobes.texture[lobe], :3]
    return Balls(
        center=np.array([sphere.center for sphere in spheres]).reshape(-1, 3),
        radius=np.array([sphere.radius for sphere in spheres], dtype=np.float64),
        surface=np.array(rows, dtype=np.int32),
        lobe=np.asarray(lobe, dtype=np.int32),
        is_glass=scene.lobes.traits[lobe] & TRANSMITS != 0,
        color=np.ascontiguousarray(scene.color_factor[lobe, None] * color, dtype=np.float64),
        of_surface=of_surface,
    )


def _is_ball(scene: CompiledScene, surface: int) -> bool:
    sphere, material = scene.surfaces[surface], scene.material_of[surface]
    # A trimmed sphere is no `Sphere`; a glass one that is flipped holds glass outside.
    if not isinstance(sphere, Sphere) or material == NOTHING:
        return False
    first, stop = scene.lobes.first[material], scene.lobes.first[material + 1]
    if stop - first != 1 or not scene.lobes.traits[first] & DELTA:
        return False
    if scene.textures.kind[scene.lobes.texture[first]] != CONSTANT:
        return False
    if scene.lobes.traits[first] & TRANSMITS == 0:
        return True
    is_whole = scene.lobes.weight[first] == 1.0 and scene.lobes.number[first, IOR] > 1.0
    return bool(is_whole and sphere.orientation == 1)
