"""The flat mirrors by way of which lamps are reached."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.kernels.by_mirrors import Mirrors
from hybrid_rt.integrators.path.balls import rows_of
from hybrid_rt.integrators.path.boxes import NEAR, RIM
from hybrid_rt.primitives import Plane, Rectangle, TriangleMesh
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.lobes.register import DELTA, TRANSMITS
from hybrid_rt.shading.kernels.texture import CONSTANT
from meshing.surface import Surface

# Every way is computed before one is chosen: the largest mirrors, so many at most.
MOST_MIRRORS = 8
# Where surfaces are looked at, and on how many of their pieces, to see whether they are flat.
GRID, MOST_PIECES = np.linspace(0.0, 1.0, 5), 64


def mirrors_of(scene: CompiledScene, *, alone: bool, wanted: bool = True) -> Mirrors:
    """Return the rectangles that are mirrors of one colour, or mirrors in part; none unless ``wanted``.

    Those on which another flat surface lies are left out: a shadow ray that ends in both would not
    tell which of them is there.
    ``alone``: mirrors in part, which spread light as well, are left out too.
    """
    rows = {}
    for i, surface in enumerate(scene.surfaces if wanted else []):
        lobe = _mirror_of(scene, i, alone)
        if isinstance(surface, Rectangle) and lobe != NOTHING and not _is_covered(scene, i):
            rows[i] = lobe
    largest = sorted(rows, key=lambda i: -_area(scene.surfaces[i]))[:MOST_MIRRORS]
    return _table(scene, {i: rows[i] for i in sorted(largest)})


def _table(scene: CompiledScene, lobe_of: dict[int, int]) -> Mirrors:
    rows, lobe = list(lobe_of), np.array(list(lobe_of.values()), dtype=np.int64)
    surfaces = [scene.surfaces[i] for i in rows]
    edges = np.array([(one.edge_u, one.edge_v) for one in surfaces]).reshape(-1, 2, 3)
    color = scene.textures.number[scene.lobes.texture[lobe], :3]
    return Mirrors(
        corner=np.array([one.corner for one in surfaces]).reshape(-1, 3),
        along=np.ascontiguousarray(np.linalg.pinv(edges).transpose(0, 2, 1)),
        normal=np.array([one.unit_normal for one in surfaces]).reshape(-1, 3),
        surface=np.array(rows, dtype=np.int32),
        color=np.ascontiguousarray(scene.color_factor[lobe, None] * color, dtype=np.float64),
        chance=np.array(scene.lobes.weight[lobe], dtype=np.float64),
        of_surface=rows_of(scene, rows),
    )


def _mirror_of(scene: CompiledScene, surface: int, alone: bool) -> int:
    """Return the one delta lobe of a surface, if its colour is constant and nothing is clear."""
    material = scene.material_of[surface]
    if material == NOTHING or scene.glass_of[material] != NOTHING:
        return NOTHING
    lobes = scene.lobes
    own = np.arange(lobes.first[material], lobes.first[material + 1])
    found = own[lobes.traits[own] & DELTA != 0]
    if found.size != 1 or (alone and own.size != 1) or (lobes.traits[own] & TRANSMITS).any():
        return NOTHING
    is_constant = scene.textures.kind[lobes.texture[found[0]]] == CONSTANT
    return int(found[0]) if is_constant and lobes.weight[found[0]] > 0.0 else NOTHING


def _area(surface: Rectangle) -> float:
    return float(np.linalg.norm(np.cross(surface.edge_u, surface.edge_v)))


def _is_covered(scene: CompiledScene, mirror: int) -> bool:
    """Tell whether another surface may lie in the plane of a mirror as a whole, on it but for its rim.

    Bodies that stand on a mirror hide what is below them.
    """
    own = scene.surfaces[mirror]
    u, v = np.meshgrid([RIM, 1.0 - RIM], [RIM, 1.0 - RIM])
    corners = own.point(u.ravel(), v.ravel())
    slack = NEAR * np.abs(own.bounds).max()
    room = slack * np.abs(own.unit_normal)
    low, high = corners.min(axis=0) - room, corners.max(axis=0) + room
    for i, surface in enumerate(scene.surfaces):
        if i == mirror:
            continue
        if isinstance(surface, Plane):
            heights = (corners - surface.origin) @ surface.unit_normal
            is_on = True
        else:
            heights = (_points_of(surface) - corners[0]) @ own.unit_normal
            is_on = bool((surface.bounds[0] < high).all() and (surface.bounds[1] > low).all())
        if is_on and np.abs(heights).max() <= slack:
            return True
    return False


def _points_of(surface: Surface) -> FloatArray:
    """Return points of a surface that do not lie in one plane, unless it is flat."""
    if isinstance(surface, TriangleMesh):
        return surface.vertices[surface.faces].reshape(-1, 3)
    u, v, piece = np.meshgrid(GRID, GRID, np.arange(min(len(surface), MOST_PIECES)))
    return surface.point(u.ravel(), v.ravel(), piece.ravel())
