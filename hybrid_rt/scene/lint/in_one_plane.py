"""Rectangles that lie in one plane and overlap, or on a face of a box: one hides the other.

A mirror or a picture in the plane of its wall is such a pair, and so are two lamps. Rays name one surface
where two coincide, so the other may not be seen at all. (A `RectangleLight` is lifted out of what does not
shine, or shines to the other side; see `hybrid_rt.scene.lint.lamps_in_surfaces`.)
"""

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.primitives import Box, Rectangle
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.lamp_points import size_by_camera
from hybrid_rt.scene.lint.lamps_in_surfaces import LIFT, MOST_LIFTS, name_of
from hybrid_rt.shading.kernels.lobes.register import TRANSMITS
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface

# Of the coordinates: rectangles that are nearer to each other count as being in one plane. It is far
# more than rounding, and less than any gap that is meant.
SLACK = 1e-9
# Of the edges: overlaps that are thinner count as edges that touch.
RIM = 1e-6
# Pairs are compared, and scenes of more rectangles and boxes are not looked at.
MOST_SURFACES = 2000
# Points across a trimmed rectangle, and across what it may overlap with, that tell whether it does: an
# overlap that is narrower than one in so many of both may be missed. They lie on no even share.
ACROSS, SHIFT = 32, 0.381966
# Loops are looked at for so many pairs: it takes milliseconds each.
MOST_PAIRS = 200


def surfaces_in_one_plane(scene: CompiledScene) -> list[list[str]]:
    """Return the pairs of surfaces that overlap in one plane and differ, by name.

    They are of two opaque materials, or shine to the same side with different radiance: two rectangles, trimmed
    or not, or one within a face of a box. (A box may well stand on a larger rectangle, or on a box.)
    """
    is_clear = scene.materials_with(TRANSMITS)
    opaque = {
        i: surface
        for i, surface in enumerate(scene.surfaces)
        if not is_clear[scene.material_of[i]]
        and (isinstance(surface, Box) or _is_rectangle(surface))
    }
    rows = [i for i, surface in opaque.items() if not isinstance(surface, Box)]
    if not rows or not 2 <= len(opaque) <= MOST_SURFACES:
        return []
    of_row = [opaque[i] for i in rows]
    corners = np.array([_corners(surface) for surface in of_row])
    edges = corners[:, [1, 3]] - corners[:, :1]
    normals = np.array([surface.normal(0.5, 0.5) for surface in of_row])
    looks, is_lamp = _looks(scene)[rows], scene.light_of[rows] != NOTHING
    is_light = scene.material_of[rows] == NOTHING
    lifts = MOST_LIFTS * LIFT * size_by_camera(scene)
    found, n_pairs = [], 0
    for k, surface in enumerate(of_row[:-1]):
        normal, others = normals[k], np.arange(k + 1, len(rows))
        heights = (corners[others] - corners[k, 0]) @ normal
        slack = SLACK * np.abs(corners[k]).max() + lifts * (is_lamp[others] | is_lamp[k])
        is_pair = (np.abs(heights).max(axis=1) <= slack) & (looks[others] != looks[k])
        hides = is_lamp[others] & is_lamp[k] & (normals[others] @ normal > 0.0)
        is_pair &= hides | ~(is_light[others] | is_light[k])
        others = others[is_pair]
        for other in others[_overlap(corners, edges, k, others, normal)].tolist():
            is_whole = isinstance(surface, Rectangle) and isinstance(of_row[other], Rectangle)
            n_pairs += not is_whole
            if is_whole or (n_pairs <= MOST_PAIRS and _share_points(surface, of_row[other])):
                found.append([_name(scene, rows[k]), _name(scene, rows[other])])
    for i in sorted(set(opaque) - set(rows)):
        others = np.flatnonzero((looks != scene.material_of[i]) & ~is_light)
        for row in others[_on_a_face(opaque[i], corners[others])].tolist():
            found.append([scene.called[i], scene.called[rows[row]]])
    return found


def _looks(scene: CompiledScene) -> IntArray:
    """Return a number for each surface: of its material, or of a light's radiance, below 0."""
    looks = scene.material_of.copy()
    lights = np.flatnonzero(looks == NOTHING)
    radiance = scene.lights.strength[scene.light_of[lights]]
    if lights.size:
        _, number = np.unique(radiance, axis=0, return_inverse=True)
        looks[lights] = NOTHING - 1 - number.ravel()
    return looks


def _name(scene: CompiledScene, surface: int) -> str:
    return name_of(scene, surface, int(scene.light_of[surface]))


def _is_rectangle(surface: Surface) -> bool:
    """Tell whether a surface is a rectangle, or cut from one."""
    return isinstance(getattr(surface, "surface", surface), Rectangle)


def _box_of_loops(surface: Surface) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest (u, v) of a box in which the surface lies."""
    if not isinstance(surface, TrimmedSurface):
        return np.zeros(2), np.ones(2)
    # A curve lies within its control points, and nothing is outside of the unit square.
    points = np.concatenate([curve.control for loop in surface.loops for curve in loop])
    points = np.clip(points, 0.0, 1.0)
    return points.min(axis=0), points.max(axis=0)


def _corners(surface: Surface) -> FloatArray:
    """Return the corners of a rectangle, (4, 3); of a trimmed one those of a part that holds it."""
    low, high = _box_of_loops(surface)
    u, v = (
        low[i] + (high[i] - low[i]) * np.array(side)
        for i, side in enumerate(([0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]))
    )
    return surface.point(u, v)


def _share_points(one: Surface, other: Surface) -> bool:
    """Tell whether two surfaces in one plane, whose rectangles overlap, do so inside their loops."""
    return any(
        _is_on(b, *_place_on(b, _points_of(a))).any() for a, b in ((one, other), (other, one))
    )


def _points_of(surface: Surface) -> FloatArray:
    """Return points spread over a surface, inside its loops, (n, 3)."""
    low, high = _box_of_loops(surface)
    share = (np.arange(ACROSS) + SHIFT) / ACROSS
    u, v = (a.ravel() for a in np.meshgrid(*(low + np.outer(share, high - low)).T))
    on = _is_on(surface, u, v)
    return surface.point(u[on], v[on])


def _place_on(surface: Surface, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the (u, v) of points (n, 3) in the plane of a rectangle."""
    edges = np.stack(surface.partials(0.0, 0.0))
    u, v = np.linalg.solve(edges @ edges.T, edges @ (points - surface.point(0.0, 0.0)).T)
    return u, v


def _is_on(surface: Surface, u: FloatArray, v: FloatArray) -> BoolArray:
    """Tell which (u, v) are on a surface, and not on its border."""
    on: BoolArray = (np.minimum(u, v) > RIM) & (np.maximum(u, v) < 1.0 - RIM)
    if isinstance(surface, TrimmedSurface):
        inside, in_band = surface.contains(u[on], v[on])
        on[on] = inside & ~in_band
    return on


def _on_a_face(box: Surface, corners: FloatArray) -> BoolArray:
    """Tell which rectangles (n, 4, 3) lie within a face of a box: in its frame, on one of the unit cube."""
    assert isinstance(box, Box)
    place = (corners - box.lo) @ np.linalg.inv(box.edges)
    slack = SLACK * np.abs(corners).max(initial=0.0) / np.linalg.norm(box.edges, axis=1).min()
    is_within = ((place > -RIM) & (place < 1.0 + RIM)).all(axis=(1, 2))
    is_on_one = [(np.abs(place - side) <= slack).all(axis=1).any(axis=1) for side in (0.0, 1.0)]
    return is_within & (is_on_one[0] | is_on_one[1])


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
