"""Points on shining surfaces of any shape, for kernels: lights of kind `SURFACE`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.lights.surface import ShiningSurface
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.light_kinds import LightPoints


def leaving_points(scene: CompiledScene, light_id: IntArray, xi: FloatArray) -> LightPoints:
    """Sample points by area, where photons and light paths begin.

    ``light_id`` (n,) int32; ``xi`` (n, 2) in [0, 1).
    Returns LightPoints of n rows: zero for lights of other kinds; no rows if the scene has no light
    of kind `SURFACE`.
    """
    return _points(scene, light_id, lambda light, rows: light.points(xi[rows]))


def seen_points(
    scene: CompiledScene,
    seen_from: FloatArray,
    material: IntArray,
    light_id: IntArray,
    xi: FloatArray,
) -> LightPoints:
    """Sample points as seen from hits, for next-event estimation; else as `leaving_points`.

    ``seen_from`` (n, 3).
    ``material`` (n,) int32: hits of material `NOTHING`, misses as well, get no point.
    """
    asked = np.where(material == NOTHING, np.int32(NOTHING), light_id)
    return _points(scene, asked, lambda light, rows: light.seen_points(seen_from[rows], xi[rows]))


def pdf_area_of_hits(
    scene: CompiledScene,
    hits: HitRecord,
    light_id: IntArray,
    seen_from: FloatArray,
    is_asked: NDArray[np.bool_],
    has_left: NDArray[np.bool_],
) -> FloatArray:
    """Return the pdf per area of hits on lights, to weigh them against other techniques.

    ``hits``, HitRecord of n rows; ``light_id`` (n,) int32.
    ``seen_from`` (n, 3): origins of the rays.
    ``is_asked``, ``has_left`` (n,) bool: which hits to weigh as `seen_points`, and which as
    `leaving_points`.
    Returns (n,): 0 for other rows; no rows if the scene has no light of kind `SURFACE`.
    """
    density = np.zeros(light_id.size if scene.shining else 0)
    for number in np.intersect1d(light_id, list(scene.shining)).tolist():
        light, is_met = scene.shining[number], light_id == number
        rows = np.flatnonzero(is_met & is_asked)
        if rows.size:
            density[rows] = light.seen_pdf_area(seen_from[rows], hits[rows])
        rows = np.flatnonzero(is_met & has_left)
        if rows.size:
            met = hits[rows]
            density[rows] = light.pdf_area(met.patch_id.astype(np.int64), met.u, met.v)
    return density


def new_light_points(n: int) -> LightPoints:
    """Allocate n light points; no rows if no light is of kind `SURFACE`."""
    return LightPoints(*(np.zeros((n, 3)), np.zeros((n, 3)), np.zeros(n), np.zeros(n), np.zeros(n)))


def _points(
    scene: CompiledScene,
    light_id: IntArray,
    chosen: Callable[[ShiningSurface, NDArray[np.intp]], LightPoints],
) -> LightPoints:
    """Return chosen points in the rows of each light of kind `SURFACE`."""
    points = new_light_points(light_id.size if scene.shining else 0)
    for number in np.intersect1d(light_id, list(scene.shining)).tolist():
        rows = np.flatnonzero(light_id == number)
        for column, values in zip(points, chosen(scene.shining[number], rows), strict=True):
            column[rows] = values
    return points
