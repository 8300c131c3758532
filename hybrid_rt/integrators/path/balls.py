"""The mirror balls and glass balls by way of which lamps are reached."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.integrators.kernels.through_spheres import Balls
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.touching import touching
from hybrid_rt.shading.kernels.lobes.register import DELTA, TRANSMITS
from hybrid_rt.shading.kernels.medium_stack import IOR, PRIORITY, SCHLICK
from hybrid_rt.shading.kernels.texture import CONSTANT


class Core(NamedTuple):
    """A ball within a ball of glass, about the same centre."""

    surfaces: list[int]  # indices; those of two coincide
    lobe: int  # dielectric that fills it; `NOTHING`: it is hollow


NO_CORE = Core([], NOTHING)
# Ways that are turned by a whole turn more, less half of one, are not looked for.
MOST_TURNED = np.pi - 1e-4


def balls_of(scene: CompiledScene, *, wanted: bool = True) -> Balls:
    """Return the spheres that throw light in a way that `Balls` describes; none unless ``wanted``.

    Each is of one mirror, or of glass with an index above 1. Those that coincide with others are
    left out, as a ray crosses two surfaces there at once, and those within a ball of glass, which
    nothing outside reaches straight.
    """
    spheres, touches = _spheres_of(scene), touching(scene)
    glass = [i for i in spheres if is_clear(scene, i) and not touches[i]]
    within_ball = _within(spheres)
    within = {i for ball in glass for i in within_ball[ball]}
    mirrors = [i for i in spheres if _is_mirror(scene, i)]
    rows = [i for i in sorted(glass + mirrors) if i not in within]
    return _table(scene, rows if wanted else [])


def _table(scene: CompiledScene, rows: list[int]) -> Balls:
    spheres = _spheres_of(scene)
    within = _within(spheres)
    lobe = scene.lobes.first[scene.material_of[rows]] if rows else np.zeros(0, dtype=np.int32)
    color = scene.textures.number[scene.lobes.texture[lobe], :3]
    cores = [core_of(scene, i, within[i]) if is_clear(scene, i) else NO_CORE for i in rows]
    radius = np.array([spheres[i].radius for i in rows], dtype=np.float64)
    core = [spheres[one.surfaces[0]].radius if one.surfaces else 0.0 for one in cores]
    of_core = rows_of(scene, [])
    for row, one in enumerate(cores):
        of_core[one.surfaces] = row
    return Balls(
        center=np.array([spheres[i].center for i in rows]).reshape(-1, 3),
        radius=radius,
        square=radius * radius,
        surface=np.array(rows, dtype=np.int32),
        lobe=np.asarray(lobe, dtype=np.int32),
        is_glass=scene.lobes.traits[lobe] & TRANSMITS != 0,
        color=np.ascontiguousarray(scene.color_factor[lobe, None] * color, dtype=np.float64),
        of_surface=rows_of(scene, rows),
        core=np.array(core, dtype=np.float64) / radius,
        core_ior=np.array(
            [1.0 if one.lobe == NOTHING else scene.lobes.number[one.lobe, IOR] for one in cores]
        ).reshape(-1),
        core_lobe=np.array([one.lobe for one in cores], dtype=np.int32),
        core_surface=np.array([(*one.surfaces, NOTHING)[0] for one in cores], dtype=np.int32),
        of_core=of_core,
    )


def _spheres_of(scene: CompiledScene) -> dict[int, Sphere]:
    """Return the spheres of a scene by index; a trimmed one is no `Sphere`."""
    surfaces = scene.surfaces
    return {i: surface for i, surface in enumerate(surfaces) if isinstance(surface, Sphere)}


def _within(spheres: dict[int, Sphere]) -> dict[int, list[int]]:
    """Return for each sphere those that lie within it about the same centre."""
    about: dict[tuple[float, ...], list[int]] = {}
    for i, sphere in spheres.items():
        about.setdefault(tuple(map(float, sphere.center)), []).append(i)
    return {
        ball: [i for i in same if spheres[i].radius < spheres[ball].radius]
        for same in about.values()
        for ball in same
    }


def core_of(scene: CompiledScene, ball: int, found: list[int]) -> Core:
    """Return what a ball of glass holds, of the spheres within it about the same centre.

    Its own glass ends at a flipped sphere, and nothing or clear glass fills that; or a ball of clear
    glass overlaps it, with no lower priority. All surfaces have no tint, and none reflects by
    Schlick's formula. What else lies within is in the way, and no core; nor is glass of so high an
    index that it turns rays by more than a whole turn.
    """
    spheres, lobes = _spheres_of(scene), scene.lobes
    own = _only_lobe(scene, ball)
    ends = [i for i in found if spheres[i].orientation == -1 and _only_lobe(scene, i) == own]
    fills = [i for i in found if is_clear(scene, i)]
    is_alone = len(found) == len(ends) + len(fills) and len(ends) <= 1 and len(fills) <= 1
    if not found or not is_alone or len({spheres[i].radius for i in found}) != 1:
        return NO_CORE
    lobe = _only_lobe(scene, fills[0]) if fills else NOTHING
    if not ends and lobes.number[lobe, PRIORITY] < lobes.number[own, PRIORITY]:
        return NO_CORE
    for one in (own, lobe):
        if one == NOTHING:
            continue
        color = scene.color_factor[one] * scene.textures.number[lobes.texture[one], :3]
        if lobes.number[one, SCHLICK] != 0.0 or not (color == 1.0).all():
            return NO_CORE
    ior = float(lobes.number[own, IOR])
    within = 1.0 if lobe == NOTHING else float(lobes.number[lobe, IOR])
    radius = spheres[found[0]].radius / spheres[ball].radius
    return Core(found, lobe) if _most_turned(ior, radius, within) <= MOST_TURNED else NO_CORE


def _most_turned(ior: float, radius: float, within: float) -> float:
    """Return by how far a ball with a core turns rays at most, less half a turn."""
    b = np.sin(np.linspace(0.0, 0.5 * np.pi, 1001)) * min(1.0, ior * radius, within * radius)
    turned = np.arcsin(b) - np.arcsin(b / ior)
    turned += np.arcsin(b / (ior * radius)) - np.arcsin(np.minimum(b / (within * radius), 1.0))
    return float(2.0 * turned.max())


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
