"""Rectangular lamps that light nothing, as everything lies behind them.

They shine on the side of edge_u x edge_v, so two edges that are swapped turn the light away.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.scene.compiled import CompiledScene
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
    if not all(surface.is_bounded for surface in scene.surfaces):
        return []
    corners = [_corners(surface.bounds) for surface in scene.surfaces]
    camera = scene.camera
    lens = 0.5 * camera.aperture
    eye = _corners(np.array([camera.look_from - lens, camera.look_from + lens]))
    names = []
    for light in np.flatnonzero(scene.lights.kind == RECTANGLE).tolist():
        own = int(scene.surface_of_light[light])
        others = np.concatenate([eye, *(c for i, c in enumerate(corners) if i != own)])
        normal = np.cross(scene.lights.edge_u[light], scene.lights.edge_v[light])
        if ((others - scene.lights.origin[light]) @ normal <= 0.0).all():
            names.append(name_of(scene, own, light))
    return names


def _corners(bounds: FloatArray) -> FloatArray:
    """Return the eight corners of a box, given by its lowest and its highest one."""
    return np.array(list(product(*np.transpose(bounds))))
