"""What a picture may hold beside radiance: what lies behind the middle of each pixel, and errors.

The geometric channels come from one ray through the middle of each pixel and of the lens: they
have no noise and no border between two objects is blurred.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import HitRecord
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import SurfaceLight
from hybrid_rt.sensor.channel_names import OF_PASSES, PARTS
from hybrid_rt.sensor.film import Film

# Pixels looked through at a time.
ROWS_AT_ONCE = 2**18


def compute_channels(
    names: Sequence[str], context: RenderContext, film: Film
) -> dict[str, NDArray[np.float32]]:
    """Return the channels asked for.

    Returns
    -------
    dict
        By name, (height, width) or (height, width, parts) float32, row 0 at the top. Where nothing
        is behind a pixel depth is inf, object_id -1, albedo 0 and the rest nan; the errors of a
        single pass are nan.
    """
    channels: dict[str, NDArray[np.float32]] = {}
    camera = context.scene.camera
    shape = (camera.height, camera.width)
    geometric = [name for name in names if name not in OF_PASSES]
    for name in geometric:
        channels[name] = np.empty(_shape(name, shape), np.float32)
    if geometric:
        light = SurfaceLight(context)
        at_once = max(ROWS_AT_ONCE // camera.width, 1)
        for first in range(0, camera.height, at_once):
            rows = np.arange(first, min(first + at_once, camera.height))
            hits = _hits_behind(rows, context)
            for name in geometric:
                part = channels[name][rows[0] : rows[-1] + 1]
                part[...] = _values(name, hits, light, context).reshape(part.shape)
    if "samples" in names:
        channels["samples"] = np.full(shape, film.n_passes, np.float32)
    if "standard_error" in names:
        channels["standard_error"] = film.standard_error.astype(np.float32)
    if "half_interval" in names:
        channels["half_interval"] = film.half_interval.astype(np.float32)
    return {name: channels[name] for name in names}


def _shape(name: str, shape: tuple[int, int]) -> tuple[int, ...]:
    return (*shape, len(PARTS[name])) if PARTS[name] else shape


def _hits_behind(rows: NDArray[np.intp], context: RenderContext) -> HitRecord:
    camera = context.scene.camera
    row, column = np.meshgrid(rows + 0.5, np.arange(camera.width) + 0.5, indexing="ij")
    origins, directions = camera.rays(column.ravel(), row.ravel())
    with context.ledger.stage("channels"):
        hits: HitRecord = context.tracer.intersect(origins, directions)
    context.ledger.rays["channels"] += len(hits)
    return hits


def _values(
    name: str, hits: HitRecord, light: SurfaceLight, context: RenderContext
) -> NDArray[np.float64]:
    if name == "depth":
        return hits.t
    if name == "position":
        return hits.position
    if name == "normal":
        return hits.normal
    if name == "uv":
        return np.stack([hits.u, hits.v], axis=1)
    if name == "object_id":
        return hits.object_id.astype(np.float64)
    material = light.material(hits)
    albedo = np.zeros((len(hits), 3))
    met = np.flatnonzero(material >= 0)
    first = context.scene.lobes.first
    colors = light.colors(material[met], hits[met])
    for slot in range(light.n_slots):
        has_lobe = np.diff(first)[material[met]] > slot
        albedo[met] += np.where(has_lobe[:, None], colors[:, slot], 0.0)
    return albedo
