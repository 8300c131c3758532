"""Tests certified hits against the oracle on any number of hard rays, scene by scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.demo import teapot, vase
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from proof.cases.placed import placed
from proof.cases.rational_surfaces import octants, torn_nurbs, weighted_petal
from proof.cases.rays import hard_rays
from proof.cases.singular_surfaces import rational_torus
from proof.cases.trimmed_surfaces import (
    cut_lens,
    drilled_plate,
    trimmed_patch,
    trimmed_sheet,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)
from proof.judges.judge import Verdict, compare
from proof.judges.oracle import first_hits
from proof.judges.surface_judge import all_judges

# Rays per step: enough to keep all threads busy, few enough for a lively progress line.
STEP = 20_000
# Bounds of the bins of |cos|.
COSINES = np.array([0.0, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0 + 1e-9])


def patches_of_mixed_degrees() -> BezierPatches:
    """Twelve random patches of degrees 1 to 7, turned and strewn about."""
    rng = np.random.default_rng(3)
    nets = []
    for _ in range(12):
        m, n = rng.integers(1, 8, 2)
        x, y = np.meshgrid(np.linspace(-1, 1, m + 1), np.linspace(-1, 1, n + 1), indexing="ij")
        net = np.stack([x, y, np.zeros_like(x)], axis=-1)
        net += rng.normal(0.0, 0.35, (m + 1, n + 1, 3))
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        nets.append(net @ turn + rng.normal(0.0, 1.2, 3))
    return BezierPatches(nets)


def torus() -> SurfaceOfRevolution:
    """Four cubic arcs about a skew axis."""
    k, arcs = 0.5522847498307936, []
    # Whole numbers, not sines: the profile closes to the last bit.
    turns = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)])
    for p, q in pairwise(turns):
        f, g = np.array([p[1], -p[0]]), np.array([q[1], -q[0]])
        arcs.append(np.array([0.0, 1.0]) + 0.4 * np.array([p, p + k * f, q - k * g, q]))
    return SurfaceOfRevolution(arcs, (0.0, 0.0, 0.0), (0.3, -0.2, 1.0))


def ellipsoid() -> TriangleMesh:
    """Return a closed mesh of 1280 triangles."""
    import trimesh

    ball = trimesh.creation.icosphere(3, 1.0)
    squeezed = ball.vertices * (1.0, 0.8, 1.2)
    return TriangleMesh(trimesh.Trimesh(squeezed, ball.faces, process=False))


def closed_forms() -> list[Any]:
    """Spheres up to a radius of 1e5, a box, a rectangle and a plane."""
    return [
        Sphere((0, 0, 0), 1),
        Sphere((0.5, 0.2, 0.3), 0.7),
        Sphere((0, 0, -1e5 - 1), 1e5),
        Sphere((0.2, -1.5, 0.3), 0.3),
        Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7)),
        Rectangle((-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2)),
        Plane((0, 0, -1.3), (0.1, 0.2, 1)),
    ]


def trimmed() -> list[Any]:
    """Return surfaces of seven kinds cut by loops, three of them across seams, and one with a gap."""
    return [
        _aside(surface, k)
        for k, surface in enumerate(
            (
                trimmed_patch(),
                trimmed_sheet(),
                windowed_cylinder(),
                drilled_plate(),
                windowed_ball(),
                windowed_torus(),
                cut_lens(),
                TrimmedSurface(trimmed_patch().surface, trimmed_patch().loops, gap=1e-3),
            )
        )
    ]


def rational() -> list[Any]:
    """Return patches, a NURBS surface and turned profiles with weights, and parts of turns."""
    cone = SurfaceOfRevolution([(0, 1), (1, 0.2)], (0, 0, 0), (0.2, -0.1, 1), u_range=(0.1, 0.8))
    surfaces = (
        octants(), weighted_petal(), torn_nurbs(), rational_torus(), rational_torus((0.9, 1.3)), cone,
    )  # fmt: skip
    return [_aside(surface, k) for k, surface in enumerate(surfaces)]


def _aside(surface: Any, number: int) -> Any:
    """Return a surface moved to its place in two rows that overlap."""
    matrix = np.eye(4)
    matrix[:3, 3] = 1.5 * (number % 4), 1.5 * (number // 4), 0.3 * number
    return placed(surface, matrix)


def mixed() -> list[Any]:
    """Return some of everything."""
    aside = np.eye(4)
    aside[:3, 3] = -3.0, 3.0, 1.5
    return [
        teapot(),
        vase(3.5, 3.0, 4.3),
        Sphere((2.7, -2.4, 1.0), 1.0),
        Box((-5, -5, 0), (-4, -3, 2)),
        Rectangle((-10, -10, 0), (20, 0, 0), (0, 20, 0)),
        ellipsoid().transformed(aside),
    ]


SCENES: dict[str, Callable[[], list[Any]]] = {
    "teapot": lambda: [teapot()],
    "patches": lambda: [patches_of_mixed_degrees()],
    "vase": lambda: [vase(0.0, 0.0, 5.0)],
    "torus": lambda: [torus()],
    "mesh": lambda: [ellipsoid()],
    "closed forms": closed_forms,
    "trimmed": trimmed,
    "rational": rational,
    "mixed": mixed,
}
# Judges of single classes bring examples of their own.
for _judge in all_judges().values():
    SCENES.update(_judge.examples)


@dataclass
class Tally:
    """Results of one scene.

    Attributes
    ----------
    verdict : Verdict, summed over all rays
    generators : dict of int, rays of each
    hits : int
    cosines : (9,) int64, rays with a certain first root by |cos|, see `COSINES`
    counters : dict of int, work of the intersector
    wrong : list of (seed, ray, kind), the first few
    seconds, oracle_seconds : float
    """

    verdict: Verdict
    generators: dict[str, int]
    hits: int
    cosines: NDArray[np.int64]
    counters: dict[str, int]
    wrong: list[tuple[int, int, str]]
    seconds: float
    oracle_seconds: float


def steps(
    surfaces: Sequence[Any], n: int, seed: int, coarse: str = "embree", threads: int | None = None
) -> Iterator[Tally]:
    """Test n hard rays, `STEP` at a time; yield the totals after each step.

    Parameters
    ----------
    surfaces : sequence of surfaces
    n : number of rays
    seed : int
        Step k takes the rays of ``hard_rays(surfaces, STEP, seed + k)``.
    coarse, threads : as for `Intersector`
    """
    tracer = Intersector(surfaces, coarse=coarse, threads=threads)
    total: Tally | None = None
    for k, begin in enumerate(range(0, n, STEP)):
        rays = hard_rays(surfaces, min(STEP, n - begin), seed + k)
        began = time.perf_counter()
        hits = tracer.intersect(rays.origins, rays.directions)
        between = time.perf_counter()
        truth = first_hits(surfaces, rays.origins, rays.directions, threads=threads)
        after = time.perf_counter()
        verdict = compare(hits, truth)
        names, counts = np.unique(rays.names, return_counts=True)
        part = Tally(
            verdict,
            dict(zip(names.tolist(), counts.tolist(), strict=True)),
            int(hits.hit.sum()),
            np.histogram(truth.cosine[truth.object_id >= 0], COSINES)[0],
            dict(tracer.counters),
            [(seed + k, int(i), kind) for kind, rows in verdict.rows.items() for i in rows],
            between - began,
            after - between,
        )
        total = part if total is None else _add(total, part)
        yield total


def _add(a: Tally, b: Tally) -> Tally:
    return Tally(
        a.verdict + b.verdict,
        {
            name: a.generators.get(name, 0) + b.generators.get(name, 0)
            for name in {**a.generators, **b.generators}
        },
        a.hits + b.hits,
        a.cosines + b.cosines,
        b.counters,  # the intersector counts on
        (a.wrong + b.wrong)[:20],
        a.seconds + b.seconds,
        a.oracle_seconds + b.oracle_seconds,
    )
