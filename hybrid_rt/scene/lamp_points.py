"""Points spread evenly over each lamp, at which its surroundings are looked at before a render."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.surface import shining_surface
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE, SPHERE, SURFACE, WITHOUT_AREA

# Points looked at: of each lamp, of all lamps, of each at least.
POINTS, MOST_POINTS, FEWEST_POINTS = 256, 2**16, 16
# Three directions at right angles, none along an axis: a surface through a point crosses one.
ACROSS = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0


class LampPoints(NamedTuple):
    """Points of all lamps, those of a lamp side by side."""

    light: NDArray[np.intp]  # (n,), row in the light table
    place: FloatArray  # (n, 3)
    inward: FloatArray  # (n, 3), to the dark side; as long as the lamp


def points_of_lamps(scene: CompiledScene) -> LampPoints:
    """Return points of all lamps, and vectors to their dark side.

    There are 256 of each lamp, fewer if there are many lamps; of a lamp without area its place, with vectors in
    three directions at right angles; of a plane none.
    """
    return scene.once("points of lamps", lambda: _find_points(scene))


def size_by_camera(scene: CompiledScene) -> float:
    """Return the largest coordinate of the camera."""
    return float(np.abs(scene.camera.look_from).max()) + scene.camera.reach


def _find_points(scene: CompiledScene) -> LampPoints:
    lights = scene.lights
    n = min(max(MOST_POINTS // max(scene.n_lights, 1), FEWEST_POINTS), POINTS)
    side = math.isqrt(n)
    # Not on the lines through the middle, where a scene's walls may stand.
    grid = (np.arange(side) + 0.381966) / side
    xi = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    rectangles, spheres = (np.flatnonzero(lights.kind == kind) for kind in (RECTANGLE, SPHERE))
    others = np.flatnonzero(lights.kind == SURFACE).tolist()
    parts = [
        _of_places(scene, np.flatnonzero(np.isin(lights.kind, WITHOUT_AREA))),
        _of_rectangles(scene, rectangles, xi),
        _of_spheres(scene, spheres, xi),
        *(_of_surface(scene, light, xi) for light in others),
    ]
    light = np.concatenate([part.light for part in parts])
    order = np.argsort(light, kind="stable")
    place, inward = (np.concatenate([part[k] for part in parts])[order] for k in (1, 2))
    return LampPoints(light[order], place, inward)


def _of_places(scene: CompiledScene, lights: NDArray[np.intp]) -> LampPoints:
    place = scene.lights.origin[lights]
    size = np.maximum(np.abs(place).max(axis=1, initial=0.0), size_by_camera(scene))
    inward = np.where(size > 0.0, size, 1.0)[:, None, None] * ACROSS
    return _rows(lights, np.broadcast_to(place[:, None], inward.shape), inward)


def _of_rectangles(scene: CompiledScene, lights: NDArray[np.intp], xi: FloatArray) -> LampPoints:
    along_u, along_v = scene.lights.edge_u[lights], scene.lights.edge_v[lights]
    offset = xi[:, :1] * along_u[:, None] + xi[:, 1:] * along_v[:, None]
    normal = np.array([scene.surfaces[i].unit_normal for i in scene.surface_of_light[lights]])
    size = np.ptp(offset, axis=1).max(axis=1, initial=0.0)[:, None, None]
    inward = np.broadcast_to(-size * normal.reshape(-1, 1, 3), offset.shape)
    return _rows(lights, scene.lights.origin[lights, None] + offset, inward)


def _of_spheres(scene: CompiledScene, lights: NDArray[np.intp], xi: FloatArray) -> LampPoints:
    z, turn = 1.0 - 2.0 * xi[:, 0], 2.0 * np.pi * xi[:, 1]
    ring = np.sqrt(1.0 - z * z)
    offset = scene.lights.edge_u[lights, :1, None] * np.stack(
        [ring * np.cos(turn), ring * np.sin(turn), z], axis=-1
    )
    return _rows(lights, scene.lights.origin[lights, None] + offset, -2.0 * offset)


def _of_surface(scene: CompiledScene, light: int, xi: FloatArray) -> LampPoints:
    surface = scene.surfaces[scene.surface_of_light[light]]
    chooser = scene.shining.get(light) or shining_surface(surface)
    if chooser is None:  # a plane
        return LampPoints(np.zeros(0, np.intp), np.zeros((0, 3)), np.zeros((0, 3)))
    points = chooser.points(xi)
    is_on = points.pdf_area > 0.0  # of trimmed surfaces some are outside the loops
    if not is_on.any():
        points, is_on = chooser.one_point(), np.ones(1, np.bool_)
    place, normal = points.position[is_on], points.normal[is_on]
    length = float(np.ptp(place, axis=0).max()) or surface.size
    return LampPoints(np.full(len(place), light), place, -normal * length)


def _rows(lights: NDArray[np.intp], place: FloatArray, inward: FloatArray) -> LampPoints:
    """Return points (lamps, n, 3) row by row."""
    light = np.repeat(lights, place.shape[1])
    return LampPoints(light, place.reshape(-1, 3), inward.reshape(-1, 3))
