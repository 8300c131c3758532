"""Rows C01 to C03: spheres that are large, near or far away."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Sphere
from proof.stability.measure_exact import catalogue, plotted
from proof.stability.row import Effort, Outcome, Plot, row

ORIGIN = (0.0, 0.0, 0.0)


def _wall(radius: float, n: int, rng: np.random.Generator) -> tuple[Sphere, FloatArray, FloatArray]:
    targets = rng.uniform(-1.0, 1.0, (n, 3)) * (1.0, 1.0, 0.0)
    back = unit(rng.normal(size=(n, 3)) + np.array([0.0, 0.0, 1.5]))
    return Sphere((0.0, 0.0, -radius), radius), targets + back, -back


def _ground(
    height: float, n: int, rng: np.random.Generator
) -> tuple[Sphere, FloatArray, FloatArray]:
    """Rays mostly along the ground."""
    directions = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.1)
    directions[:, 2] = -np.abs(directions[:, 2])
    return Sphere((0.0, 0.0, -1000.0), 1000.0), np.tile((0.0, 0.0, height), (n, 1)), directions


def _afar(
    distance: float, n: int, rng: np.random.Generator
) -> tuple[Sphere, FloatArray, FloatArray]:
    """A fifth of the rays pass by."""
    origins = distance * unit(rng.normal(size=(n, 3)))
    return Sphere(ORIGIN, 1.0), origins, unit(rng.uniform(-1.0, 1.0, (n, 3)) - origins)


Rays = Callable[[float, int, np.random.Generator], tuple[Sphere, FloatArray, FloatArray]]
# Id, title, what the distance is, its powers of ten, and what makes the sphere and rays at it.
SERIES: tuple[tuple[str, str, str, Sequence[int], Rays], ...] = (
    ("C01", "wall: a sphere of radius 1e5 nearby", "radius of the sphere, met one unit away",
     range(10), _wall),
    ("C02", "ground: a sphere of radius 1000 below the eye",
     "height of the eye above a sphere of radius 1000", range(-6, 1), _ground),
    ("C03", "unit sphere seen from 1e8", "distance of the eye / radius", range(1, 11), _afar),
)  # fmt: skip


def _register(row_id: str, title: str, against: str, powers: Sequence[int], make: Rays) -> None:
    @row(row_id, title, "high precision; exact roots")
    def run(effort: Effort) -> Outcome:
        total, plot = catalogue(row_id, effort), Plot(against, "sphere", unit="scene units")
        for power in powers:
            rays = make(10.0**power, effort.count(1000, 12), effort.rng(abs(power)))
            total += plotted(plot, 10.0**power, *rays, unit=1.0)
        return replace(total, curves=(plot,))


for _series in SERIES:
    _register(*_series)
