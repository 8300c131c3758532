"""Error of caustics at equal time: floors under glass, against a long light-traced reference.

Errors are measured on pixels that see only floor, in one case through a pane. The noise of the
reference is known from its two halves; it is reported, and subtracted from the errors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.renderer import render
from hybrid_rt.sensor.image_metrics import relative_mse
from proof.light.light_tracer import BALL, BEHIND_PANE, CAMERA, Bench

CELLS = 1024
# Images of the lamp in the pane are points of radiance 100 on some pixels, which the count does not
# have: this share of the worst values is left out there.
LAMP_IMAGES = 2e-3


@dataclass(frozen=True)
class Row:
    """One measurement: floor, seconds, radiance of the light, error."""

    name: str
    bench: Bench
    seconds: float
    measure: str
    target: float
    leave_out: float = 0.0


ROWS = (
    Row("ball, relMSE", BALL, 3.0, "relmse", 7e-4),
    Row("ball at radiance 1000, RMSE", replace(BALL, radiance=1000.0), 20.0, "rmse", 0.010),
    Row("ball behind a pane, relMSE", BEHIND_PANE, 8.0, "relmse", 3.4e-3, LAMP_IMAGES),
)


def floor_pixels(bench: Bench) -> BoolArray:
    """Return the pixels (height, width) whose corners and centres see the floor, or a pane."""
    scene = bench.scene(CAMERA)
    tracer = Intersector([item.surface for item in scene.objects])
    passes = [k for k, item in enumerate(scene.objects) if item.name in ("floor", "pane")]
    seen = np.ones(CAMERA.height * CAMERA.width, dtype=np.bool_)
    row, column = np.divmod(np.arange(seen.size), CAMERA.width)
    for down in (0.0, 0.5, 1.0):
        for across in (0.0, 0.5, 1.0):
            hits = tracer.intersect(*CAMERA.rays(column + across, row + down))
            seen &= np.isin(hits.object_id, passes)
    return seen.reshape(CAMERA.height, CAMERA.width)


def measure_rows(
    n_photons: int, photons_per_pass: int, threads: int | None = None
) -> Iterator[dict[str, Any]]:
    """Render each row within its seconds; compare with a reference of ``n_photons``."""
    halves: dict[tuple[Any, ...], list[NDArray[np.int64]]] = {}
    for row in ROWS:
        bench = row.bench
        if bench.slabs not in halves:
            halves[bench.slabs] = [
                bench.floor_light(n_photons // 2, CELLS, seed, threads) for seed in (1, 2)
            ]
        pictures = [bench.picture(counts, n_photons // 2, CAMERA) for counts in halves[bench.slabs]]
        seen = floor_pixels(bench)
        if bench.slabs:
            seen &= pictures[0] > 0.0
        scene = bench.scene(CAMERA)
        options = PPMOptions(photons_per_pass)
        render(scene, "ppm", 1, threads=threads, options=PPMOptions(1000))  # compiles
        result = render(scene, "ppm", time_budget=row.seconds, threads=threads, options=options)
        image = result.image[:, :, 0][seen].astype(np.float64)
        a, b = (picture[seen] for picture in pictures)
        # The mean of the halves is off by half of what they differ.
        own = _error(row, 0.5 * (a + b), 0.5 * (a + b) + 0.5 * (a - b))
        error = _error(row, image, 0.5 * (a + b))
        report = result.report
        yield {
            "row": row.name,
            "error": _without(row, error, own),
            "of_reference": own,
            "target": row.target,
            "seconds": report.total_seconds,
            "passes": report.passes,
            "photons_per_second": report["photons"]["emitted"] / report.total_seconds,
            "gather_seconds": report.seconds["gather"],
            "blur_root_mean_square": report["photons"]["blur_root_mean_square"],
            "blur_at_most": report["photons"]["blur_root_mean_square_at_most"],
        }


def _error(row: Row, image: FloatArray, truth: FloatArray) -> float:
    if row.measure == "relmse":
        return relative_mse(image, truth, row.leave_out)
    return math.sqrt(float(np.square(image - truth).mean()))


def _without(row: Row, error: float, own: float) -> float:
    """Take the reference's own noise off an error."""
    if row.measure == "relmse":
        return max(error - own, 0.0)
    return math.sqrt(max(error * error - own * own, 0.0))
