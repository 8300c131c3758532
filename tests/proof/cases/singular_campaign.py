"""Tests certified first hits of rays aimed at singular sets against exact crossings, cell by cell.

A cell is one singular set, at one distance, in one placement. Its rays depend only on its name and
the seed, so any cell can be rerun by itself.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.intersection import Intersector
from proof.cases.placed import placed
from proof.cases.singular_rays import away, size_of
from proof.cases.singular_sets import DISTANCES, PLACEMENTS, SETS
from proof.exact.judge import BatchVerdict, ExactJudge

# Rays that leave hits need hits to leave: so many tries for each.
TRIES = 4
# Of the rays of a campaign, this share may be left open.
MOST_OPEN = 0.01


@dataclass(frozen=True)
class Cell:
    """Rays of one cell, and their hits.

    Attributes
    ----------
    origins, directions : (m, 3) float64
    distance : float
        From the singular set, scene units.
    source : HitRecord of m rows, or None
        The hits that the rays leave.
    hits : HitRecord of m rows
    """

    origins: FloatArray
    directions: FloatArray
    distance: float
    source: HitRecord | None
    hits: HitRecord


@dataclass(frozen=True)
class SetResult:
    """Results of one singular set.

    Attributes
    ----------
    name, kind : str
    cells : dict
        `BatchVerdict` by distance and placement.
    examples : list of (fault, distance, placement, row)
        The first rows of each fault; `trace_cell` with the same number of rays reproduces them.
    refused : str
        The tracer's error message if it does not accept the surface, or which cell had no ray to judge;
        else "".
    """

    name: str
    kind: str
    cells: dict[tuple[float, str], BatchVerdict]
    examples: list[tuple[str, float, str, int]]
    refused: str = ""

    @property
    def total(self) -> BatchVerdict:
        """The sum over all cells."""
        return sum(self.cells.values(), BatchVerdict())

    def at(self, distance: float) -> BatchVerdict:
        """Return the sum over all places."""
        return sum((v for key, v in self.cells.items() if key[0] == distance), BatchVerdict())

    def in_place(self, placement: str) -> BatchVerdict:
        """Return the sum over all distances."""
        return sum((v for key, v in self.cells.items() if key[1] == placement), BatchVerdict())


def placed_surfaces(name: str, placement: str) -> list[Any]:
    """Return the surfaces of a singular set where a placement puts them."""
    surfaces = SETS[name].surfaces()
    matrix = PLACEMENTS[placement].matrix(size_of(surfaces[0]))
    if placement == "home":
        return surfaces
    return [placed(surface, matrix) for surface in surfaces]


def trace_cell(
    tracer: Intersector, name: str, distance: float, placement: str, n: int, seed: int
) -> Cell:
    """Trace the rays of one cell: n, or fewer where rays leave hits and hits are few."""
    entry = SETS[name]
    rng = np.random.default_rng(
        [seed, zlib.crc32(name.encode()), zlib.crc32(placement.encode()), _exponent(distance)]
    )
    surfaces = tracer.surfaces
    if not entry.leaving:
        targets = entry.find(surfaces, n, rng)
        rays = entry.aim(targets, distance, rng)
        hits = tracer.intersect(rays.origins, rays.directions)
        return Cell(rays.origins, rays.directions, rays.distance, None, hits)
    targets = entry.find(surfaces, TRIES * n, rng)
    # Rays that leave at a cosine of the distance come from anywhere.
    first = entry.aim(targets, distance if entry.leaving == "beside" else 0.1, rng)
    source = tracer.intersect(first.origins, first.directions)
    source = source[np.flatnonzero(source.hit)[:n]]
    if entry.leaving == "beside":
        directions = unit(rng.normal(size=(len(source), 3)))
    else:
        directions = away(source.normal, distance, rng)
    origins = np.array(source.position)
    hits = tracer.intersect(origins, directions, source=source)
    return Cell(origins, directions, distance * targets.size, source, hits)


def judge_cell(judge: ExactJudge, cell: Cell) -> BatchVerdict:
    """Judge the hits of one cell."""
    near = np.full(len(cell.hits), cell.distance)
    leaves = None if cell.source is None else cell.source.object_id
    return judge.judge(cell.hits, cell.origins, cell.directions, distance=near, leaves=leaves)


def run_set(
    name: str,
    n: int,
    seed: int,
    *,
    distances: Sequence[float] = DISTANCES,
    placements: Sequence[str] = tuple(PLACEMENTS),
    coarse: str = "none",
) -> SetResult:
    """Judge n rays of one singular set at each distance, shared by the placements.

    Parameters
    ----------
    name : str, one of `SETS`
    n, seed : int
    distances : sequence of float
        Relative to the size of the surface.
    placements : sequence of str, some of `PLACEMENTS`
    coarse : as for `Intersector`
    """
    cells: dict[tuple[float, str], BatchVerdict] = {}
    examples: list[tuple[str, float, str, int]] = []
    each = max(n // len(placements), 1)
    for placement in placements:
        surfaces = placed_surfaces(name, placement)
        try:
            tracer = Intersector(surfaces, coarse=coarse, threads=1)
        except ValueError as error:
            return SetResult(name, SETS[name].kind, cells, examples, str(error))
        judge = ExactJudge(surfaces)
        for distance in distances:
            cell = trace_cell(tracer, name, distance, placement, each, seed)
            if not len(cell.hits):
                words = f"{placement}, {distance:g}: no hit that rays could leave"
                return SetResult(name, SETS[name].kind, cells, examples, words)
            verdict = judge_cell(judge, cell)
            examples += [
                (fault, distance, placement, row)
                for fault, rows in verdict.examples.items()
                for row in rows[:1]
            ]
            cells[distance, placement] = verdict
    return SetResult(name, SETS[name].kind, cells, examples)


def run_sets(
    names: Sequence[str], n: int, seed: int, jobs: int = 1, **options: Any
) -> Iterator[SetResult]:
    """Run some singular sets, in order, by some processes."""
    if jobs == 1:
        for name in names:
            yield run_set(name, n, seed, **options)
        return
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor

    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context) as pool:
        tasks = [pool.submit(run_set, name, n, seed, **options) for name in names]
        try:
            for task in tasks:
                yield task.result()
        finally:  # sets that have not begun when Ctrl-C comes
            pool.shutdown(wait=False, cancel_futures=True)


def _exponent(distance: float) -> int:
    """Return a whole number that tells distances apart."""
    return round(-1000.0 * float(np.log10(distance)))
