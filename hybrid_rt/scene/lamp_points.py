"""Points spread evenly over each lamp, at which its surroundings are looked at before a render."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.surface import shining_surface
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA

# Points looked at: of each lamp, of all lamps, of each at least.
POINTS, MOST_POINTS, FEWEST_POINTS = 256, 2**16, 16
# Three directions at right angles, none along an axis: a surface through a point crosses one.
ACROSS = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0


def points_of_lamps(
    scene: CompiledScene, lights: Sequence[int]
) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Return points of lamps (n, 3), and vectors to their dark side, by row in the light table.

    There are 256 of each lamp, fewer if there are many lamps; of a lamp without area its place, with vectors in
    three directions at right angles; of a plane none. The vectors are as long as the lamp.
    """
    n = min(max(MOST_POINTS // max(len(lights), 1), FEWEST_POINTS), POINTS)
    found = {int(light): _points(scene, int(light), n) for light in lights}
    return {light: points for light, points in found.items() if points is not None}


def size_by_camera(scene: CompiledScene) -> float:
    """Return the largest coordinate of the camera."""
    return float(np.abs(scene.camera.look_from).max()) + scene.camera.reach


def _points(scene: CompiledScene, light: int, n: int) -> tuple[FloatArray, FloatArray] | None:
    lights, side = scene.lights, math.isqrt(n)
    # Not on the lines through the middle, where a scene's walls may stand.
    grid = (np.arange(side) + 0.381966) / side
    xi = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    if lights.kind[light] in WITHOUT_AREA:
        point = np.repeat(lights.origin[[light]], 3, axis=0)
        return point, (max(size_by_camera(scene), float(np.abs(point).max())) or 1.0) * ACROSS
    surface = scene.surfaces[scene.surface_of_light[light]]
    chooser = scene.shining.get(light) or shining_surface(surface)
    if chooser is None:  # a plane
        return None
    points = chooser.points(xi)
    is_on = points.pdf_area > 0.0  # of trimmed surfaces some are outside the loops
    if not is_on.any():
        points, is_on = chooser.one_point(), np.ones(1, np.bool_)
    place, normal = points.position[is_on], points.normal[is_on]
    return place, -normal * (float(np.ptp(place, axis=0).max()) or surface.size)
