"""Rectangles that lie in one plane and overlap, or on a face of a box: one hides the other.

A mirror or a picture in the plane of its wall is such a pair. Rays name one surface where two
coincide, so the other may not be seen at all.
"""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.primitives import Box, Rectangle
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.shading.kernels.lobes.register import TRANSMITS
from meshing.surface import Surface

# Of the coordinates: rectangles that are nearer to each other count as being in one plane. It is far
# more than rounding, and less than any gap that is meant.
SLACK = 1e-9
# Of the edges: overlaps that are thinner count as edges that touch.
RIM = 1e-6
# Pairs are compared, and scenes of more rectangles and boxes are not looked at.
MOST_SURFACES = 2000


def surfaces_in_one_plane(scene: CompiledScene) -> list[list[str]]:
    """Return the pairs of surfaces of two opaque materials that overlap in one plane, by name.

    These are two rectangles, or a rectangle within a face of a box. (A box may well stand on a rectangle
    that is larger than its face, or on a box.)

    Parameters
    ----------
    scene : CompiledScene
    """
    is_clear = scene.materials_with(TRANSMITS)
    opaque = [
        i
        for i, surface in enumerate(scene.surfaces[: len(scene.called)])
        if isinstance(surface, Rectangle | Box) and not is_clear[scene.material_of[i]]
    ]
    rows = [i for i in opaque if isinstance(scene.surfaces[i], Rectangle)]
    if not rows or not 2 <= len(opaque) <= MOST_SURFACES:
        return []
    of_row = [scene.surfaces[i] for i in rows]
    u, v = np.array([0.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
    corners = np.array([surface.point(u, v) for surface in of_row])
    edges = np.array([(surface.edge_u, surface.edge_v) for surface in of_row])
    material = scene.material_of[rows]
    found = []
    for k, surface in enumerate(of_row[:-1]):
        others = np.arange(k + 1, len(rows))
        heights = (corners[others] - corners[k, 0]) @ surface.unit_normal
        slack = SLACK * np.abs(corners[k]).max()
        others = others[(np.abs(heights).max(axis=1) <= slack) & (material[others] != material[k])]
        for other in others[_overlap(corners, edges, k, others, surface.unit_normal)].tolist():
            found.append([scene.called[rows[k]], scene.called[rows[other]]])
    for i in sorted(set(opaque) - set(rows)):
        others = np.flatnonzero(material != scene.material_of[i])
        for row in others[_on_a_face(scene.surfaces[i], corners[others])].tolist():
            found.append([scene.called[i], scene.called[rows[row]]])
    return found


def _on_a_face(box: Surface, corners: FloatArray) -> BoolArray:
    """Tell which rectangles (n, 4, 3) lie within a face of a box.

    In the box's own frame, in which it is the unit cube, their corners lie within it, all on one face.
    """
    assert isinstance(box, Box)
    place = (corners - box.lo) @ np.linalg.inv(box.edges)
    slack = SLACK * np.abs(corners).max(initial=0.0) / np.linalg.norm(box.edges, axis=1).min()
    is_within = ((place > -RIM) & (place < 1.0 + RIM)).all(axis=(1, 2))
    is_on_one = [(np.abs(place - side) <= slack).all(axis=1).any(axis=1) for side in (0.0, 1.0)]
    on_a_face: BoolArray = is_within & (is_on_one[0] | is_on_one[1])
    return on_a_face


def _overlap(
    corners: FloatArray, edges: FloatArray, k: int, others: IntArray, normal: FloatArray
) -> BoolArray:
    """Tell which of some parallelograms in the plane of another one overlap with it.

    Two convex shapes do not if a line along an edge of either lies between them.
    """
    does = np.ones(others.size, dtype=np.bool_)
    for side in range(4):
        along = edges[[k], side] if side < 2 else edges[others, side - 2]
        across = np.cross(along, normal)
        own = corners[k] @ across.T
        theirs = np.einsum("ncx,nx->nc", corners[others], np.broadcast_to(across, (others.size, 3)))
        rim = RIM * np.ptp(own, axis=0)
        does &= theirs.max(axis=1) > own.min(axis=0) + rim
        does &= theirs.min(axis=1) < own.max(axis=0) - rim
    return does
