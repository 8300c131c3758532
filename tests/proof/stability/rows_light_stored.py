"""Row D31: renders that stop and go on, with other numbers of threads."""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np

from hybrid_rt.lights import PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import INTEGRATORS, floor, own_options
from proof.stability.row import Effort, Outcome, row

MOST_PASSES, PARTS = 50, 6


def room() -> Scene:
    """Return a glass ball over a floor, with a point light and a lamp with an area."""
    return Scene(
        Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 16, 12),
        [floor(Lambertian(0.5)), Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5), "glass")],
        [PointLight((2, 0, 4), 9.0), RectangleLight((-2, -1, 4), (1, 0, 0), (0, 1, 0), 5.0)],
    )


@row("D31", "stop and continue, another number of threads", "the render in one go")
def stopped_and_continued(effort: Effort) -> Outcome:
    """Cut at random passes; the bits and the stated errors are those of one go."""
    total, rng = Outcome(), effort.rng()
    for integrator in INTEGRATORS:
        settings: dict[str, Any] = {
            "integrator": integrator,
            "seed": effort.seed,
            "options": own_options(integrator, effort.count(4000, 300)),
        }
        last = effort.count(MOST_PASSES, 18)
        whole = render(room(), passes=last, threads=2, **settings)
        cuts = np.unique(rng.integers(1, last, effort.count(PARTS, 3))).tolist()
        with tempfile.TemporaryDirectory() as folder:
            for k, passes in enumerate([*cuts, last]):
                part = render(
                    room(), passes=passes, threads=1 + k % 2, store=folder, resume=True, **settings
                )
        wrong = int((part.image != whole.image).sum())
        total += Outcome(rays=whole.image.size * last, wrong=wrong).checked(
            part.report.relative_error == whole.report.relative_error,
            f"{integrator}: other errors are stated than in one go",
        )
    return total
