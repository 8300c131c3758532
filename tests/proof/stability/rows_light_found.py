"""Row L12: work and memory where nothing ends a path."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid_rt.lights import SphereLight
from hybrid_rt.materials import Dielectric, Lambertian, Mirror
from hybrid_rt.primitives import Box, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    INTEGRATORS,
    WHITE_SKY,
    finite,
    floor,
    measured,
    mirrors,
    picture,
    same,
)
from proof.stability.row import Effort, Outcome, row

FLOOR = floor(Lambertian(0.5))
# MiB beyond what there was before, of pictures of a few pixels.
LITTLE_MEMORY = 400.0


@row("L12", "work and memory where nothing ends a path", "bounds; what is lost is said")
def bounded_work(effort: Effort) -> Outcome:
    """Render closed white rooms, mirrors and nested shells with the default max_depth."""
    shells = [
        Object(Sphere((0, 0, 0), 3.0 - 0.3 * k), Dielectric(1.2 + 0.1 * k), f"shell {k}")
        for k in range(8)
    ]
    white = Object(Box((-4, -4, -4), (4, 4, 4)).flipped(), Lambertian(1.0), "room")
    lamp = SphereLight((3, 3, 3), 0.2, 10.0)
    camera = Camera((0, -3.8, 0), (0, 1, 0), (0, 0, 1), 40, 8, 8)
    inside = [*mirrors(1.0), Object(Sphere((0, 0, 1), 0.5), Mirror(1.0), "ball")]
    scenes = {
        "white room": Scene(camera, [white], [lamp]),
        "shells in a white room": Scene(camera, [white, *shells], [lamp]),
        "mirrors": Scene(Camera((0, -3, 1), (0, 0, 1), (0, 0, 1), 40, 8, 8), inside, [lamp]),
        "shells": Scene(camera, shells, [], WHITE_SKY),
    }
    outcome, most, longest = Outcome(), 0.0, 0.0
    for title, scene in scenes.items():
        for integrator in INTEGRATORS:
            result, mib, seconds = measured(
                partial(picture, effort, scene, integrator, 2, n_photons=effort.count(2000, 200))
            )
            name = f"{integrator}, {title}"
            most, longest = max(most, mib), max(longest, seconds)
            outcome += finite(name, result) + Outcome(rays=sum(result.report.rays.values()))
            outcome = outcome.checked(mib < LITTLE_MEMORY, f"{name}: {mib:.0f} MiB")
            given_up = result.report.geometry.given_up
            outcome = outcome.checked(not given_up, f"{name}: {given_up} rays given up")
            power = (result.report.get("photons") or {}).get("power_of_all_passes")
            if power and any(power["emitted"]):
                parts = np.sum([power[k] for k in ("escaped", "absorbed", "lost")], axis=0)
                outcome += same(f"{name}, accounts", parts, power["emitted"], 1e-9)
    note = f"at most {most:.0f} MiB and {longest:.1f} s each, with the kernels compiled"
    return outcome + Outcome(notes=(note,))
