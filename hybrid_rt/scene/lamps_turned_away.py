"""Rectangular lamps that light nothing, as everything lies behind them.

They shine on the side of edge_u x edge_v, so two edges that are swapped turn the light away.
"""

from __future__ import annotations

import numpy as np

from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.lamps_in_surfaces import name_of
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE


def lamps_turned_away(scene: CompiledScene) -> list[str]:
    """Return the names of rectangular lamps that have all surfaces and the camera behind them.

    Their light meets nothing, so the picture is the same without them. A lamp with a surface that
    reaches to its front is not named, even if no light comes there.

    Parameters
    ----------
    scene : CompiledScene
    """
    lamps = np.flatnonzero(scene.lights.kind == RECTANGLE).tolist()
    if not lamps or not all(surface.is_bounded for surface in scene.surfaces):
        return []
    camera = scene.camera
    lens = 0.5 * camera.aperture
    eye = np.array([camera.look_from - lens, camera.look_from + lens])
    boxes = np.array([eye, *(surface.bounds for surface in scene.surfaces)])
    middle, half = 0.5 * boxes.sum(axis=1), 0.5 * (boxes[:, 1] - boxes[:, 0])
    names = []
    for light in lamps:
        normal = np.cross(scene.lights.edge_u[light], scene.lights.edge_v[light])
        # How far the corner of each box that is farthest to the front lies before the lamp.
        before = (middle - scene.lights.origin[light]) @ normal + half @ np.abs(normal)
        own = int(scene.surface_of_light[light])
        if own != NOTHING:
            before[own + 1] = -np.inf
        if (before <= 0.0).all():
            names.append(name_of(scene, own, light))
    return names
