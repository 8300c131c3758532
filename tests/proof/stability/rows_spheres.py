"""Rows C01 to C03 and C06 to C13: spheres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Sphere
from proof.exact.truth import ExactScene
from proof.stability.measure_exact import by_exact, catalogue, exact_errors
from proof.stability.row import Effort, Outcome, Plot, row

ORIGIN = (0.0, 0.0, 0.0)


def _judged(
    plot: Plot, x: float, sphere: Sphere, origins: FloatArray, directions: FloatArray, unit: float
) -> Outcome:
    """Judge rays on one sphere by exact roots, and add a point to a curve, in units of a length."""
    outcome = by_exact([sphere], origins, directions)
    hits = Intersector([sphere]).intersect(origins, directions)
    error, expected = exact_errors(ExactScene([sphere]), hits, origins, directions)
    return outcome + plot.add(x, error / unit, expected / unit)


@row("C01", "wall: a sphere of radius 1e5 nearby", "high precision; exact roots")
def walls(effort: Effort) -> Outcome:
    """Spheres of radius 1 to 1e9, met from one unit away: the error there, in scene units."""
    total = catalogue("C01", effort)
    plot = Plot("radius of the sphere, met one unit away", "sphere", unit="scene units")
    n = effort.count(1000, 12)
    for exponent in range(10):
        radius, rng = 10.0**exponent, effort.rng(exponent)
        targets = rng.uniform(-1.0, 1.0, (n, 3)) * (1.0, 1.0, 0.0)
        origins = targets + unit(rng.normal(size=(n, 3)) + np.array([0.0, 0.0, 1.5]))
        sphere = Sphere((0.0, 0.0, -radius), radius)
        total += _judged(plot, radius, sphere, origins, targets - origins, 1.0)
    return replace(total, curves=(plot,))


@row("C02", "ground: a sphere of radius 1000 below the eye", "high precision; exact roots")
def grounds(effort: Effort) -> Outcome:
    """The eye 1e-6 to 1 above it, rays mostly along it."""
    total = catalogue("C02", effort)
    plot = Plot("height of the eye above a sphere of radius 1000", "sphere", unit="scene units")
    ground, n = Sphere((0.0, 0.0, -1000.0), 1000.0), effort.count(1000, 12)
    for exponent in range(-6, 1):
        rng, height = effort.rng(-exponent), 10.0**exponent
        origins = np.tile((0.0, 0.0, height), (n, 1))
        directions = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.1)
        directions[:, 2] = -np.abs(directions[:, 2])
        total += _judged(plot, height, ground, origins, directions, 1.0)
    return replace(total, curves=(plot,))


@row("C03", "unit sphere seen from 1e8", "high precision; exact roots")
def from_afar(effort: Effort) -> Outcome:
    """From 1 to 1e10 away, a fifth of the rays pass by."""
    total = catalogue("C03", effort)
    plot = Plot("distance of the eye / radius", "unit sphere", unit="radius")
    n = effort.count(1000, 12)
    for exponent in range(1, 11):
        rng, distance = effort.rng(exponent), 10.0**exponent
        origins = distance * unit(rng.normal(size=(n, 3)))
        targets = rng.uniform(-1.0, 1.0, (n, 3))
        total += _judged(plot, distance, Sphere(ORIGIN, 1.0), origins, unit(targets - origins), 1.0)
    return replace(total, curves=(plot,))


@row("C09", "ray exactly tangent", "closed form")
def tangent(effort: Effort) -> Outcome:
    """A hit or a miss marked TANGENT within the band; clear of it neither mark nor nan."""
    del effort
    total, tracer = Outcome(), Intersector([Sphere(ORIGIN, 1)])
    for beside in (0.0, 1e-16, -1e-16, 1e-9, -1e-9, 1e-12, -1e-12):
        hits = tracer.intersect((1 + beside, 0, -5), (0, 0, 1))
        marked = hits.status[0] == Status.TANGENT
        if abs(beside) > 1e-13:
            wrong = bool(hits.hit[0] != (beside < 0)) or marked
        else:
            wrong = not marked or not (np.isinf(hits.t[0]) or abs(hits.t[0] - 5) < 1e-7)
        total += Outcome(rays=1, wrong=int(wrong), undecided=int(marked))
    return total


@row("C12", "radius 1e-9 and 1e9 in one scene", "high precision; exact roots")
def both_ends(effort: Effort) -> Outcome:
    """Aimed at the small one from 3 units away, and at both at once."""
    total = catalogue("C12", effort)
    n, rng = effort.count(500, 12), effort.rng()
    spheres = [Sphere(ORIGIN, 1e-9), Sphere((0, 0, -2e9), 1e9)]
    targets = 5e-10 * unit(rng.normal(size=(n, 3)))
    directions = unit(rng.normal(size=(n, 3)))
    return total + by_exact(spheres, targets - 1e-8 * directions, directions)


@row("C13", "1e5 spheres", "counts of work; the same without a tree")
def many(effort: Effort) -> Outcome:
    """Each ray asks a few nodes of a tree; a few rays are compared with all spheres in turn."""
    m, n, rng = effort.count(100_000, 4000), effort.count(20_000, 1000), effort.rng()
    centers, radius = rng.random((m, 3)), 0.003
    tracer = Intersector([Sphere(c, radius) for c in centers])
    origins, directions = rng.random((n, 3)) * 3 - 1, unit(rng.normal(size=(n, 3)))
    hits = tracer.intersect(origins, directions)
    nodes = tracer.counters["nodes"]
    wrong = 0
    for i in range(min(n, 200)):
        away = origins[i] - centers
        b = away @ directions[i]
        rest = radius**2 - (away**2).sum(axis=1) + b * b
        root = np.sqrt(np.maximum(rest, 0.0))
        t = np.stack([-b - root, -b + root])[:, rest > 0]
        first = t[t > 0].min(initial=np.inf)
        near = (np.abs(rest) < 1e-12).any()
        t = hits.t[i]
        same = t == first or abs(t - min(first, 1e9)) <= 1e-9
        wrong += int(not same and not near)
    outcome = Outcome(rays=n, wrong=wrong, notes=(f"{m} spheres, {nodes / n:.1f} nodes per ray",))
    return outcome.checked(nodes < 60 * n, f"{nodes / n:.1f} nodes per ray")
