"""What meshes, and hits that are not certified, do to a picture."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.analysis.bias import shared_error
from hybrid_rt.analysis.methods import Method, curved_surfaces, finds_all_light
from hybrid_rt.analysis.reference import Image, run_method, short_render, stated_error
from hybrid_rt.core.progress import Say
from hybrid_rt.core.timing import timed
from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import DARK

# The method for meshes is chosen by short renders of so many passes.
FEWEST_PASSES, MOST_PASSES, PROBE_SEED = 4, 256, 40_000


def steadiest(scene: Scene, methods: Sequence[Method], threads: int | None) -> Method:
    """Return the method, of those that find all light if any does, with the least noise in as much time."""
    complete = [m for m in methods if finds_all_light(scene, m.integrator, m.options)]
    methods = complete or methods

    def squared_error_times_seconds(method: Method) -> float:
        probe = short_render(scene, method, FEWEST_PASSES, MOST_PASSES, PROBE_SEED, threads)
        assert probe is not None
        report, _ = probe
        work = report.seconds_of_passes * stated_error(report, "both_trimmed") ** 2
        return math.inf if math.isnan(work) else work

    return methods[0] if len(methods) == 1 else min(methods, key=squared_error_times_seconds)


def mesh_errors(
    scene: Scene,
    truth: Image,
    certified: Method,
    methods: Sequence[Method],
    passes: int,
    trimmed: bool,
    threads: int | None,
    say: Say,
) -> list[dict[str, Any]]:
    """Measure what meshes, and hits that are not certified, do to a picture.

    The differences between such pictures and certified ones, made with the same random numbers, still hold
    noise; but that of one seed is independent of that of another. The ``error`` is 0 if it is not seen above
    the noise; ``error_at_most`` is its upper 95 % limit.
    """
    surfaces = curved_surfaces(scene)
    say("pictures of meshes, each twice, with the random numbers of certified ones")
    exact = [run_method(scene, certified, passes, seed, threads).image for seed in (1, 2)]
    # Not by the certified pictures: where these happen to be dark, both differences are positive.
    weight = truth.astype(np.float64) ** 2 + DARK
    rows = []
    for method in methods:
        one, other = (
            run_method(scene, method, passes, seed, threads).image.astype(np.float64)
            - exact[seed - 1]
            for seed in (1, 2)
        )
        error, at_most = shared_error(one, other, weight, trimmed)
        tracer, seconds = timed(
            partial(Intersector, surfaces, method.accuracy, tolerance=method.tolerance, threads=1)
        )
        rows.append({
            "method": method.name, "accuracy": method.accuracy, "tolerance": method.tolerance,
            "triangles": float(tracer.n_triangles), "build_seconds": seconds, "error": error,
            "error_at_most": at_most,
        })  # fmt: skip
    return rows
