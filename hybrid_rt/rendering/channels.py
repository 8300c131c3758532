"""Output channels (AOVs): geometry at pixel centres, and error estimates.

The geometric channels come from one ray through the centre of each pixel and of the lens: they have
no noise and are not antialiased.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import SurfaceLight
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.sensor.film import Film

# Pixels looked through at a time.
ROWS_AT_ONCE = 2**18


@dataclass(frozen=True)
class Behind:
    """The first hits behind the centres of pixels, and what gives materials and colours there."""

    hits: HitRecord
    scene: CompiledScene
    light: SurfaceLight


OfPixels = Callable[[Behind], NDArray[Any]]


@dataclass(frozen=True)
class Output:
    """One output: values (n, parts) from `Behind`, or (height, width, parts) from a `Film`."""

    parts: tuple[str, ...]  # names of its components; (): one number per pixel
    of_pixels: OfPixels | None = None
    of_passes: Callable[[Film], FloatArray] | None = None


def _albedo(behind: Behind) -> FloatArray:
    """Return the sum of the colours of all lobes; 0 on a miss."""
    hits, light = behind.hits, behind.light
    material = light.material(hits)
    total = np.zeros((len(hits), 3))
    met = np.flatnonzero(material >= 0)
    n_lobes = np.diff(behind.scene.lobes.first)[material[met]]
    colors = light.colors(material[met], hits[met])
    for slot in range(light.n_slots):
        has_lobe = n_lobes > slot
        total[met] += np.where(has_lobe[:, None], colors[:, slot], 0.0)
    return total


OUTPUTS = {
    "depth": Output((), lambda behind: behind.hits.t),
    "position": Output(("X", "Y", "Z"), lambda behind: behind.hits.position),
    "normal": Output(("X", "Y", "Z"), lambda behind: behind.hits.normal),
    "uv": Output(("U", "V"), lambda behind: np.stack([behind.hits.u, behind.hits.v], axis=1)),
    "object_id": Output((), lambda behind: behind.hits.object_id),
    "instance_id": Output((), lambda behind: behind.hits.instance_id),
    "albedo": Output(("R", "G", "B"), _albedo),
    "samples": Output(
        (), of_passes=lambda film: np.full(film.image.shape[:2], float(film.n_passes))
    ),
    "standard_error": Output(("R", "G", "B"), of_passes=lambda film: film.standard_error),
    "half_interval": Output(("R", "G", "B"), of_passes=lambda film: film.half_interval),
}


def check_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return the names of outputs, each once; raise ValueError for an unknown one."""
    given = checks.items(names, "outputs")
    for name in given:
        if isinstance(name, str) and name.startswith("denoise"):
            raise ValueError(
                f"output is {name!r}: a denoised picture is no output, pass --denoise, or from Python "
                "render(..., outputs=['albedo', 'normal']).denoised()"
            )
        checks.choice(name, "output", OUTPUTS)
    return tuple(dict.fromkeys(given))


def numbers_per_pixel(names: Sequence[str]) -> int:
    """Return the number of values per pixel of these outputs."""
    return sum(max(len(OUTPUTS[name].parts), 1) for name in names)


def compute_channels(
    names: Sequence[str], context: RenderContext, film: Film
) -> dict[str, NDArray[np.float32]]:
    """Return the channels asked for by name, (height, width) or (height, width, parts), row 0 at the top.

    On a miss depth is inf, object_id and instance_id -1, albedo 0 and the rest nan. Errors are nan after a single pass.
    """
    outputs = {name: OUTPUTS[name] for name in names}
    of_pixels = {name: o.of_pixels for name, o in outputs.items() if o.of_pixels is not None}
    channels = _of_pixels(of_pixels, context) if of_pixels else {}
    for name, output in outputs.items():
        if output.of_passes is not None:
            channels[name] = output.of_passes(film).astype(np.float32)
    return {name: channels[name] for name in names}


def _of_pixels(
    functions: dict[str, OfPixels], context: RenderContext
) -> dict[str, NDArray[np.float32]]:
    """Return geometric channels, found some rows of the picture at a time."""
    camera, light = context.scene.camera, SurfaceLight(context)
    channels: dict[str, NDArray[np.float32]] = {}
    at_once = max(ROWS_AT_ONCE // camera.width, 1)
    for first in range(0, camera.height, at_once):
        rows = np.arange(first, min(first + at_once, camera.height))
        row, column = np.meshgrid(rows + 0.5, np.arange(camera.width) + 0.5, indexing="ij")
        origins, directions = camera.rays(column.ravel(), row.ravel())
        with context.ledger.stage("channels"):
            hits = context.tracer.intersect(origins, directions)
        context.ledger.rays["channels"] += len(hits)
        behind = Behind(hits, context.scene, light)
        for name, function in functions.items():
            values = function(behind)
            if name not in channels:
                shape = (camera.height, camera.width, *values.shape[1:])
                channels[name] = np.empty(shape, np.float32)
            part = channels[name][rows[0] : rows[-1] + 1]
            part[...] = values.reshape(part.shape)
    return channels
