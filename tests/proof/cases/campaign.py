"""Judges certified first hits on any number of rays: hard ones, ordinary ones, and at singular sets.

A run consists of groups: a scene with hard rays, one with ordinary rays in all placements, or a singular
set in all placements and at all distances. Each has rays of its own, which follow from its name and the
seed of the run. Results of runs with different seeds add up.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.analysis.ray_sets import RaySet, at_box, camera, unit
from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.intersection import Intersector
from proof.cases.placed import placed
from proof.cases.rays import chords, hard_rays
from proof.cases.scenes import SCENES
from proof.cases.singular_rays import away, size_of
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS, SETS
from proof.exact.judge import BatchVerdict
from proof.judge import Judge

# Rays per step: enough to keep all threads busy, few enough for a lively progress line.
STEP = 20_000
HARD, ORDINARY, SINGULAR = SORTS = "hard", "ordinary", "singular"
# How many rows of each fault are kept.
MOST_EXAMPLES = 5
# Rays that leave hits need hits to leave: so many tries for each.
TRIES = 4
# Of the rays of a run, this share may be left open.
MOST_OPEN = 0.01


@dataclass
class Group:
    """Results of one group.

    ``sort``, ``name``, ``kind``: one of `SORTS`; a scene or a singular set; one of `KINDS`, or "scene".
    ``count``: its ``seconds`` are those of the tracer and of the judge.
    ``examples``: a ray is its batch and row, its origin and direction as hex, and the hit.
    """

    sort: str
    name: str
    kind: str
    seed: int
    count: BatchVerdict = field(default_factory=BatchVerdict)
    examples: list[tuple[str, dict[str, Any]]] = field(default_factory=list)


class Batch(NamedTuple):
    """Rays and their hits, in words that say how to make them again."""

    words: str
    hits: HitRecord
    origins: FloatArray
    directions: FloatArray
    near: float = 0.0  # distance from the singular set, scene units
    source: HitRecord | None = None  # the hits that the rays leave

    @property
    def leaves(self) -> IntArray | None:
        """The objects that the rays leave."""
        return None if self.source is None else self.source.object_id


def run(
    sort: str, name: str, n: int, seed: int, *, tangent_every: int = 1, marks: bool = False,
    coarse: str = "none", threads: int | None = 1, distances: Sequence[float] = DISTANCES,
    placements: Sequence[str] = tuple(PLACEMENTS),
) -> Iterator[Group]:  # fmt: skip
    """Judge n rays of a group; yield it after each batch.

    ``tangent_every``, ``marks``: as in `Judge`.
    ``coarse``, ``threads``: as for `Intersector`.
    ``distances``, ``placements``: of singular sets, which share the rays; ordinary rays are shared by
    placements as well.
    """
    group = Group(sort, name, _kind_of(sort, name), seed)
    for placement in placements if sort != HARD else ("home",):
        surfaces = placed_surfaces(name, placement, sort)
        tracer = Intersector(surfaces, coarse=coarse, threads=threads)
        judge = Judge(surfaces, tangent_every, marks)
        batches: Iterator[Batch]
        if sort == SINGULAR:
            each = max(n // (len(placements) * len(distances)), 1)
            batches = (
                trace_cell(tracer, name, distance, placement, each, seed) for distance in distances
            )
        else:
            each = n if sort == HARD else max(n // len(placements), 1)
            batches = _batches(tracer, sort, f"{name} {placement}", each, seed)
        began = time.perf_counter()
        for batch in batches:
            if not len(batch.hits):
                raise ValueError(f"{name}: {batch.words} has no hit that rays could leave")
            _judge(judge, group, batch)
            group.count.seconds += time.perf_counter() - began
            yield group
            began = time.perf_counter()


def result(*of: Any, **options: Any) -> Group:
    """Return a group when it is complete; see `run`."""
    *_, group = run(*of, **options)
    return group


def _judge(judge: Judge, group: Group, batch: Batch) -> None:
    """Judge some hits, and add to the figures of a group."""
    hits = batch.hits
    verdict = judge.judge(hits, batch.origins, batch.directions, batch.leaves, batch.near)
    for fault, rows in verdict.examples.items():
        known = sum(name == fault for name, _ in group.examples)
        group.examples += [
            (fault, {
                "batch": batch.words, "row": i,
                "origin": [float(x).hex() for x in batch.origins[i]],
                "direction": [float(x).hex() for x in batch.directions[i]],
                "t": float(hits.t[i]).hex(), "t_bound": float(hits.t_bound[i]),
                "object_id": int(hits.object_id[i]), "status": int(hits.status[i]),
            })
            for i in rows[: max(MOST_EXAMPLES - known, 0)]
        ]  # fmt: skip
    group.count += verdict


# --- singular sets


def trace_cell(
    tracer: Intersector, name: str, distance: float, placement: str, n: int, seed: int
) -> Batch:
    """Trace n rays at a singular set, or fewer where rays leave hits and hits are few.

    They depend on the arguments alone, so any cell can be run again by itself.
    """
    entry, words = SETS[name], f"trace_cell({name!r}, {distance:g}, {placement!r}, {n}, {seed})"
    rng = np.random.default_rng(
        [seed, zlib.crc32(name.encode()), zlib.crc32(placement.encode()),
         round(-1000.0 * float(np.log10(distance)))]
    )  # fmt: skip
    surfaces = tracer.surfaces
    if not entry.leaving:
        targets = entry.find(surfaces, n, rng)
        rays = entry.aim(targets, distance, rng)
        hits = tracer.intersect(rays.origins, rays.directions)
        return Batch(words, hits, rays.origins, rays.directions, rays.distance)
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
    return Batch(words, hits, origins, directions, distance * targets.size, source)


# --- hard and ordinary rays


def _aside(surfaces: list[Any], shift: tuple[float, float, float]) -> list[Any]:
    matrix = np.eye(4)
    matrix[:3, 3] = shift
    return [placed(surface, matrix) for surface in surfaces]


def _turned_surfaces() -> list[Any]:
    """Return a cone, an egg, a lens and a diamond beside each other."""
    found = []
    for k, name in enumerate(("cone tip", "egg poles", "lens tips", "joint, sharp")):
        found += _aside(SETS[name].surfaces(), (2.7 * k, 0.4 * k, -0.3 * k))
    return found


ORDINARY_SCENES: dict[str, tuple[str, Callable[[], list[Any]]]] = {
    "vase": ("turned", SCENES["vase"]),
    "cone, egg, lens, diamond": ("turned", _turned_surfaces),
    "teapot": ("patches", SCENES["teapot"]),
    "patches of mixed degrees": ("patches", SCENES["patches"]),
    "spheres, box, rectangle, plane": ("closed", SCENES["closed forms"]),
    **{
        scene: (SETS[name].kind, SETS[name].surfaces)
        for scene, name in (
            ("turned torus", "torus, tangents"), ("spindle", "spindle"),
            ("bent sheet", "patch tangents"), ("octants of a sphere", "rational poles"),
            ("torn NURBS", "breaks and creases of NURBS"),
            ("closed torus", "closed torus, tangents"),
            ("skew box", "skew box, edges and corners"),
            ("ellipsoid", "mesh edges and vertices"), ("fan", "open mesh, edges"),
        )
    },
}  # fmt: skip


def names_of(sort: str, kinds: Sequence[str] = KINDS) -> list[str]:
    """Return the groups of a sort, of some kinds; scenes with hard rays are of every kind."""
    if sort == HARD:
        return list(SCENES)
    entries = SETS if sort == SINGULAR else ORDINARY_SCENES
    return [name for name in entries if _kind_of(sort, name) in kinds]


def _kind_of(sort: str, name: str) -> str:
    if sort == HARD:
        return "scene"
    return SETS[name].kind if sort == SINGULAR else ORDINARY_SCENES[name][0]


def placed_surfaces(name: str, placement: str, sort: str = SINGULAR) -> list[Any]:
    """Return the surfaces of a group where a placement puts them."""
    if sort == HARD:
        return SCENES[name]()
    surfaces = (SETS[name].surfaces if sort == SINGULAR else ORDINARY_SCENES[name][1])()
    if placement == "home":
        return surfaces
    sizes = [size_of(surface) for surface in surfaces if surface.is_bounded]
    # Singular sets are those of the first surface.
    size = size_of(surfaces[0]) if sort == SINGULAR else max(sizes)
    return [placed(surface, PLACEMENTS[placement].matrix(size)) for surface in surfaces]


def ordinary_rays(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Return chords of the sphere around everything, rays at its box, and a camera's."""
    third = n // 3
    parts = [
        chords(surfaces, n - 2 * third, seed),
        at_box(surfaces, third, seed + 1),
        camera(surfaces, third, seed + 2),
    ]
    return RaySet(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _batches(tracer: Intersector, sort: str, name: str, n: int, seed: int) -> Iterator[Batch]:
    make = hard_rays if sort == HARD else ordinary_rays
    for begin in range(0, n, STEP):
        count = min(STEP, n - begin)
        ray_seed = zlib.crc32(f"{name} {seed} {begin}".encode())
        rays = make(tracer.surfaces, count, ray_seed)
        hits = tracer.intersect(rays.origins, rays.directions)
        words = f"{make.__name__}({name!r}, {count}, {ray_seed})"
        yield Batch(words, hits, rays.origins, rays.directions)


def added(groups: Sequence[Group]) -> dict[tuple[str, str], BatchVerdict]:
    """Return the sums by sort of rays and kind of surfaces.

    Raises ValueError if two groups hold the same rays.
    """
    table: dict[tuple[str, str], BatchVerdict] = {}
    seen = set()
    for group in sorted(groups, key=lambda group: SORTS.index(group.sort)):
        key = group.sort, group.name, group.seed
        if key in seen:
            raise ValueError(
                f"{group.sort} rays of {group.name!r} with seed {group.seed} are there twice: "
                "add up runs with different seeds"
            )
        seen.add(key)
        place = group.sort, group.kind
        table[place] = table.get(place, BatchVerdict()) + group.count
    return table
