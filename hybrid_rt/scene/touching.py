"""Which dielectrics may coincide in part with other surfaces."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from hybrid_rt.core.records import BoolArray
from hybrid_rt.intersection.coincident import FACE_ROUNDING
from hybrid_rt.scene.coaxial import may_share_ring
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from meshing import SurfaceOfRevolution
from meshing.surface import Surface


def touching(scene: CompiledScene) -> BoolArray:
    """Tell which surfaces are dielectric and may coincide in part with another, (surfaces,) bool.

    A surface with a carrier coincides only with surfaces of an equal carrier (spheres with equal
    spheres); others may coincide where their bounding boxes overlap, but surfaces of revolution
    about one axis only where their profiles may share an arc.
    """
    surfaces = scene.surfaces
    touches = np.zeros(max(len(surfaces), 1), dtype=np.bool_)
    glass = {i for i in range(len(surfaces)) if _is_glass(scene, scene.material_of[i])}
    carried: dict[Hashable, list[int]] = {}
    others = []
    for i, surface in enumerate(surfaces):
        carrier = surface.carrier
        if carrier is None:
            others.append(i)
        else:
            carried.setdefault((type(surface), carrier), []).append(i)
    for same in carried.values():
        touches[[i for i in same if i in glass]] = len(same) > 1
    bounds = np.array([surfaces[i].bounds for i in others]).reshape(-1, 2, 3)
    slack = FACE_ROUNDING * np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(initial=0.0)
    for i in glass & set(others):
        low, high = surfaces[i].bounds
        meets = (bounds[:, 0] <= high + slack).all(axis=1) & (bounds[:, 1] >= low - slack).all(
            axis=1
        )
        touches[i] = any(
            others[k] != i and _may_coincide(surfaces[i], surfaces[others[k]], slack)
            for k in np.flatnonzero(meets)
        )
    return touches


def _may_coincide(one: Surface, other: Surface, slack: float) -> bool:
    if isinstance(one, SurfaceOfRevolution) and isinstance(other, SurfaceOfRevolution):
        return may_share_ring(one, other, slack)
    return True


def _is_glass(scene: CompiledScene, material: int) -> bool:
    return material != NOTHING and scene.glass_of[material] != NOTHING
