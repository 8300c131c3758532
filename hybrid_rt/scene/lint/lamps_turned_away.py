"""Rectangular lamps and spot lights that light nothing, as everything lies beside their light.

Rectangles shine on the side of edge_u x edge_v, so two edges that are swapped turn the light away; a
spot light is turned away by a direction that was meant to be a point.
"""

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.lint.lamps_in_surfaces import name_of
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE, SPOT

# Rounding of an angle, generously.
SLACK = 1e-9
LARGEST = 32


def lamps_turned_away(scene: CompiledScene) -> tuple[list[str], list[str]]:
    """Return the names of lamps whose light reaches no surface, nor the camera, and of those with a picture.

    These are rectangles that have everything behind them, and spot lights that have all surfaces
    outside their cones. A lamp is not named if the box around a surface reaches into its light.
    """
    lights = scene.lights
    lamps = np.flatnonzero((lights.kind == RECTANGLE) | (lights.kind == SPOT)).tolist()
    if not lamps or not all(surface.is_bounded for surface in scene.surfaces):
        return [], []
    camera = scene.camera
    eye = np.array([camera.look_from - camera.reach, camera.look_from + camera.reach])
    boxes = np.concatenate([eye[None], scene.bounds])
    # The largest boxes are in the light of most lamps.
    largest = np.argsort(-np.ptp(boxes, axis=1).max(axis=1), kind="stable")[:LARGEST]
    names, pictures = [], []
    for light in lamps:
        own = int(scene.surface_of_light[light])
        if lights.kind[light] == SPOT:
            # No camera sees it.
            is_away = not _in_cone(
                boxes[1:], lights.origin[light], lights.edge_u[light], lights.edge_v[light, 1]
            )
        else:
            plane = lights.origin[light], np.cross(lights.edge_u[light], lights.edge_v[light])
            is_away = not any(
                _before(boxes[rows[rows != own + 1]], *plane)
                for rows in (largest, np.arange(len(boxes)))
            )
        if is_away:
            names.append(name_of(scene, own, light))
            if own != NOTHING and scene.colored_by_uv[own]:
                pictures.append(names[-1])
    return names, pictures


def _before(boxes: FloatArray, origin: FloatArray, normal: FloatArray) -> bool:
    """Tell whether some box (k, 2, 3) reaches to the front of a plane."""
    middle, half = 0.5 * boxes.sum(axis=1), 0.5 * (boxes[:, 1] - boxes[:, 0])
    return bool(((middle - origin) @ normal + half @ np.abs(normal) > 0.0).any())


def _in_cone(boxes: FloatArray, tip: FloatArray, axis: FloatArray, opening: float) -> bool:
    """Tell whether the ball around some box reaches into a cone; ``opening`` is 1 - cos of its half."""
    away = boxes.mean(axis=1) - tip
    distance = np.linalg.norm(away, axis=1)
    radius = 0.5 * np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    beside = distance > radius
    if not beside.all():
        return True
    to_middle = np.arctan2(np.linalg.norm(np.cross(away, axis), axis=1), away @ axis)
    cone = 2.0 * np.arcsin(np.sqrt(0.5 * min(opening, 2.0)))
    return bool((to_middle - np.arcsin(radius / distance) <= cone + SLACK).any())
