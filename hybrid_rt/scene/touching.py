"""Which dielectrics may coincide in part with other surfaces."""

from collections.abc import Hashable, Iterator

import numpy as np

from hybrid_rt.core.records import BoolArray
from hybrid_rt.intersection.coincident import FACE_ROUNDING
from hybrid_rt.scene.coaxial import ONE_AXIS, may_share_ring
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from meshing import SurfaceOfRevolution, TrimmedSurface
from meshing.surface import Surface


def touching(scene: CompiledScene) -> BoolArray:
    """Tell which surfaces are dielectric and may coincide in part with another, (surfaces,) bool.

    A surface with a carrier coincides with surfaces of an equal carrier (spheres with equal spheres), with
    parts of these, and with surfaces of revolution on whose axis its centre lies; it is not compared with
    patches. Others may coincide where their bounding boxes overlap, but surfaces of revolution about one
    axis only where their profiles may share an arc.
    """
    return scene.once("touching", lambda: _touching(scene))


def _touching(scene: CompiledScene) -> BoolArray:
    surfaces = scene.surfaces
    touches = np.zeros(max(len(surfaces), 1), dtype=np.bool_)
    glass = {i for i in range(len(surfaces)) if _is_glass(scene, scene.material_of[i])}
    if not glass:
        return touches
    carried: dict[Hashable, list[int]] = {}
    others = []
    for i, surface in enumerate(surfaces):
        whole = surface.surface if isinstance(surface, TrimmedSurface) else surface
        if whole.carrier is not None:
            carried.setdefault((type(whole), whole.carrier), []).append(i)
        if surface.carrier is None:
            others.append(i)
    for same in carried.values():
        touches[[i for i in same if i in glass]] = len(same) > 1
    bounds = scene.bounds[others]
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
    for i, j in _on_axes(scene, others, slack):
        touches[[k for k in (i, j) if k in glass]] = True
    return touches


def _on_axes(scene: CompiledScene, others: list[int], slack: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of a surface with a carrier and one of revolution on whose axis its centre lies."""
    surfaces = scene.surfaces
    carried = sorted(set(range(len(surfaces))) - set(others))
    bounds = scene.bounds[carried]
    centre = bounds.mean(axis=1)
    for j in others:
        turned = surfaces[j]
        if not isinstance(turned, SurfaceOfRevolution):
            continue
        low, high = turned.bounds
        meets = (bounds[:, 0] <= high + slack) & (bounds[:, 1] >= low - slack)
        away = np.abs(np.cross(centre - turned.origin, turned.axis)).max(axis=1)
        size = np.abs(bounds).max(axis=(1, 2)) + np.abs(turned.origin).max()
        for k in np.flatnonzero(meets.all(axis=1) & (away <= ONE_AXIS * size)):
            yield carried[k], j


def _may_coincide(one: Surface, other: Surface, slack: float) -> bool:
    if isinstance(one, SurfaceOfRevolution) and isinstance(other, SurfaceOfRevolution):
        return may_share_ring(one, other, slack)
    return True


def _is_glass(scene: CompiledScene, material: int) -> bool:
    return material != NOTHING and scene.glass_of[material] != NOTHING
