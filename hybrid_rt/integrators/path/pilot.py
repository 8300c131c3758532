"""A pilot: whether connections alone find the light between diffuse surfaces with less work.

A few camera rays are followed both ways. The work is counted in rays, not in seconds, so the choice
is the same on every machine.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from hybrid_rt.integrators.integrator import PIXEL_BITS, Integrator
from hybrid_rt.sensor.passes import group_of

# Passes that no render reaches.
PASSES = range(2**32 - 16, 2**32 - 12)
# Smaller pictures are done before a pilot pays.
FEWEST_PIXELS = 64 * 64
# Few samples do not show rare bright ones, which much noise may be: on the Cornell box 0.55 is found
# where a whole render takes 0.95 times the work; on teapot_room 0.74 and 0.7.
CLEARLY_LESS = 0.85
# Where nothing throws caustics: 0.08 to 0.2 where a lamp shines on a surface close by, 0.38 to 0.49 in an
# ordinary room. That has the same noise either way, and by connections a mean that is ten times less sure.
FAR_LESS = 0.25
# Of each pass. The ratio of the two works varies by 0.03 (standard deviation).
PILOT_PIXELS, PILOT_LIGHT_PATHS = 512, 1024


def work_times_noise(integrator: Integrator, n_light_paths: int) -> float:
    """Return rays for each camera ray times the relative squared error of a pass.

    ``integrator`` traces the light paths of a pass, and follows camera rays; its counts are left alone.
    ``n_light_paths``: those of a pass of the picture.
    """
    camera = integrator.context.scene.camera
    n_pixels, pixels = camera.width * camera.height, PILOT_PIXELS
    place = ((np.arange(pixels) + 0.5) * (n_pixels / pixels)).astype(np.uint64)
    with _left_alone(integrator) as rays:
        integrator.take(integrator.gather(PASSES, [integrator.prepare(PASSES, 0)]))
        of_lights = rays() / (PILOT_LIGHT_PATHS * len(PASSES))
        # All at once: short batches would cost more between two intersections than in them.
        group, sample = group_of(np.repeat(np.array(PASSES, dtype=np.uint64), pixels))
        pixel = np.tile(place, len(PASSES)) + (group << PIXEL_BITS)
        found = integrator.radiance_through(pixel, sample).reshape(len(PASSES), pixels, 3)
        of_camera = rays() / (pixels * len(PASSES)) - of_lights * PILOT_LIGHT_PATHS / pixels
    mean, variance = found.mean(axis=0), found.var(axis=0, ddof=1)
    noise = float((variance / (mean * mean + 0.01)).mean())
    return noise * (of_camera + of_lights * n_light_paths / n_pixels)


@contextmanager
def _left_alone(integrator: Integrator) -> Iterator[Callable[[], int]]:
    """Hand out a count of rays since the beginning; undo all counts at the end."""
    ledger, tracer = integrator.context.ledger, integrator.context.tracer
    kept, counters = copy.deepcopy(vars(ledger)), dict(tracer.counters)
    try:
        yield lambda: sum(tracer.counters[k] - counters[k] for k in ("rays", "shadow_rays"))
    finally:
        vars(ledger).update(kept)
        tracer.counters.update(counters)
