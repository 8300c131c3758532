"""Rows A35 and A36: the work of rays at collapsed edges of patches, and the normals beside them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.rational_surfaces import nurbs_sphere, octants
from proof.stability.measure import EPS, Plot
from proof.stability.patch_nets import elevated
from proof.stability.row import Effort, Outcome, row

DISTANCES = (0.0, *(10.0**-k for k in range(16, 2, -1)))
# An ordinary ray meets some ten boxes. A piece is as much work as ten of them.
PIECE = 10.0
MOST = 100.0


def _raised_lid() -> BezierPatches:
    return BezierPatches([elevated(net, 2) for net in teapot().patches[20:28]])


POLES: tuple[tuple[str, Callable[[], Any], tuple[float, float, float]], ...] = (
    ("NURBS sphere", nurbs_sphere, (0.0, 0.0, 1.0)),
    ("octants of a sphere", octants, (0.0, 0.0, 1.0)),
    ("lid of the teapot", teapot, (0.0, 0.0, 3.15)),
    ("lid, degree 5", _raised_lid, (0.0, 0.0, 3.15)),
)


def _beside(distance: float, n: int, rng: np.random.Generator) -> FloatArray:
    """Return vectors of a length across the z axis."""
    aside = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.0)
    return distance * unit(aside)


@row("A35", "pencil beams at collapsed edges", "counted work, over that of ordinary rays")
def work_at_poles(effort: Effort) -> Outcome:
    """Boxes and pieces, with those of displaced rays, for rays at and beside a closed pole."""
    total, n = Outcome(), effort.count(200, 12)
    for number, (name, make, pole) in enumerate(POLES):
        tracer, rng = Intersector([make()], coarse="none"), effort.rng(330 + number)
        above = np.array(pole) + np.array([0.0, 0.0, 3.0])
        ordinary = _work(tracer, above + _beside(0.13, n, rng))
        for distance in DISTANCES:
            times = _work(tracer, above + _beside(distance, n, rng)) / ordinary
            total = total.checked(
                times <= MOST, f"{name}: {times:.0f} times as much work at {distance:.0e}"
            )
            total += Outcome(rays=n)
    return total


def _work(tracer: Intersector, origins: FloatArray) -> float:
    tracer.forget_counters()
    tracer.intersect(origins, (0.0, 0.0, -1.0))
    count = tracer.counters
    return float(count["nodes"] + count["cells"] + PIECE * count["slow_pieces"]) / len(origins)


@row("A36", "normals beside collapsed edges", "closed form")
def normals_beside_poles(effort: Effort) -> Outcome:
    """A unit sphere's normal is the point: of hits, within rounding of them, and of (u, v)."""
    total, plot = Outcome(), Plot("distance from the pole / radius", "sphere", unit="radians")
    n = effort.count(200, 12)
    surface = nurbs_sphere()
    tracer = Intersector([surface], coarse="none")
    for k, distance in enumerate(DISTANCES[1:]):
        aside = _beside(distance, n, effort.rng(340 + k))
        hits = tracer.intersect(aside + np.array([0.0, 0.0, 5.0]), (0.0, 0.0, -1.0))
        truth = aside + np.array([0.0, 0.0, np.sqrt(1.0 - distance**2)])
        error = np.linalg.norm(np.abs(hits.normal) - np.abs(truth), axis=1)
        # A point is right to some 22 roundings of its size and three of the ray's length.
        total += plot.add(distance, error, np.full(n, 128 * EPS))
        u, v = effort.rng(360 + k).random(n), np.full(n, 1.0 - distance)
        point = surface.point(u, v)
        apart = np.linalg.norm(np.abs(surface.normal(u, v)) - np.abs(point), axis=1)
        total += Outcome(rays=n, error=float(apart.max() / (32 * EPS)))
    return Outcome(curves=(plot.curve,)) + total
