"""Judges certified first hits on very many rays: filters first, exact arithmetic on what they leave.

A run consists of groups: a singular set, or a scene with ordinary rays. Each has rays of its own
that follow from its name and the seed of the run. Results of runs with different seeds add up.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import RaySet, at_box, camera
from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, Status
from hybrid_rt.intersection import Intersector
from proof.cases.campaign import SCENES
from proof.cases.placed import placed
from proof.cases.rays import chords
from proof.cases.singular_campaign import placed_surfaces, trace_cell
from proof.cases.singular_rays import size_of
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS, SETS
from proof.exact.judge import ExactJudge
from proof.filters.screen import Screen

# Ordinary rays per step: some per placement and generator.
STEP = 20_000
SINGULAR, ORDINARY = "singular", "ordinary"
# How many rows of each fault are kept.
MOST_EXAMPLES = 5


@dataclass
class Count:
    """Figures of one group of rays, or of a sum of groups.

    Attributes
    ----------
    rays, hits, tangent : int
        TANGENT says the tracer.
    asked : int
        Rays that the filters do not confirm: exact arithmetic judges these.
    wrong, wrong_tangent, bounds_broken, off_ray, off_ray_tangent, unmarked, left_open : int
        As in `BatchVerdict`: wrong first hits of rows without and with TANGENT, broken bounds of t,
        points off their rays without and with TANGENT, rows without TANGENT whose decision is that of
        a ray within the band and not of the exact one, and rays that exact arithmetic leaves open.
    passed_over : int
        Rows that say TANGENT, that the filters do not confirm, and that exact arithmetic is not
        asked about: no decision of theirs is guaranteed.
    seconds, filter_seconds, exact_seconds : float
        Of the tracer, the filters, and exact arithmetic.
    """

    rays: int = 0
    hits: int = 0
    tangent: int = 0
    asked: int = 0
    wrong: int = 0
    wrong_tangent: int = 0
    bounds_broken: int = 0
    off_ray: int = 0
    off_ray_tangent: int = 0
    unmarked: int = 0
    left_open: int = 0
    passed_over: int = 0
    seconds: float = 0.0
    filter_seconds: float = 0.0
    exact_seconds: float = 0.0

    @property
    def faults(self) -> int:
        """Number of rows against what is guaranteed."""
        return self.wrong + self.bounds_broken + self.off_ray + self.off_ray_tangent + self.unmarked

    def __add__(self, other: Count) -> Count:
        """Add up."""
        return Count(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))


@dataclass
class Group:
    """Results of one group.

    Attributes
    ----------
    name : str
        A singular set, or a scene.
    kind : str
        One of `KINDS`.
    rays : str
        `SINGULAR` or `ORDINARY`.
    seed : int
    count : Count
    examples : list of (fault, ray)
        A ray is its batch and row, its origin and direction as hex, and the hit.
    """

    name: str
    kind: str
    rays: str
    seed: int
    count: Count = field(default_factory=Count)
    examples: list[tuple[str, dict[str, Any]]] = field(default_factory=list)


class Checker:
    """Filters and exact judge of one list of surfaces.

    Parameters
    ----------
    surfaces : sequence of surfaces
    tangent_every : int
        Of the rows with TANGENT that filters do not confirm each so-manyth is judged.
    """

    def __init__(self, surfaces: Sequence[Any], tangent_every: int = 1) -> None:
        self._every, self._seen = tangent_every, 0
        self._screen, self._surfaces = Screen(surfaces), list(surfaces)
        self._exact: ExactJudge | None = None

    def check(
        self,
        group: Group,
        batch: str,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        leaves: IntArray | None,
    ) -> None:
        """Judge some hits, and add to the figures of a group."""
        start = time.perf_counter()
        confirmed = self._screen.confirmed(hits, origins, directions, leaves)
        between = time.perf_counter()
        is_tangent = hits.status == Status.TANGENT
        marked = np.flatnonzero(~confirmed & is_tangent)
        kept = marked[(self._seen + np.arange(len(marked))) % self._every == 0]
        self._seen += len(marked)
        rows = np.union1d(np.flatnonzero(~confirmed & ~is_tangent), kept)
        count = Count(
            rays=len(hits),
            hits=int(hits.hit.sum()),
            tangent=int(is_tangent.sum()),
            asked=len(rows),
            passed_over=len(marked) - len(kept),
        )
        if len(rows):
            if self._exact is None:
                self._exact = ExactJudge(self._surfaces)
            left = None if leaves is None else np.asarray(leaves)[rows]
            verdict = self._exact.judge(
                hits[rows], origins[rows], directions[rows], leaves=left, marks=False
            )
            count.wrong, count.wrong_tangent = verdict.n_wrong, verdict.wrong_tangent
            count.bounds_broken, count.off_ray = verdict.bounds_broken, verdict.off_ray
            count.off_ray_tangent = verdict.off_ray_tangent
            count.unmarked, count.left_open = verdict.unmarked, verdict.left_open
            for fault, found in verdict.examples.items():
                known = sum(name == fault for name, _ in group.examples)
                for k in found[: max(MOST_EXAMPLES - known, 0)]:
                    i = int(rows[k])
                    ray = _described(batch, i, hits, origins, directions)
                    group.examples.append((fault, ray))
        count.filter_seconds = between - start
        count.exact_seconds = time.perf_counter() - between
        group.count += count


def _described(
    batch: str, i: int, hits: HitRecord, origins: FloatArray, directions: FloatArray
) -> dict[str, Any]:
    return {
        "batch": batch,
        "row": i,
        "origin": [float(x).hex() for x in origins[i]],
        "direction": [float(x).hex() for x in directions[i]],
        "t": float(hits.t[i]).hex(),
        "t_bound": float(hits.t_bound[i]),
        "object_id": int(hits.object_id[i]),
        "status": int(hits.status[i]),
    }


def run_singular(name: str, n: int, seed: int, tangent_every: int = 1) -> Iterator[Group]:
    """Judge n rays of one singular set, shared by all placements and distances."""
    group = Group(name, SETS[name].kind, SINGULAR, seed)
    each = max(n // (len(PLACEMENTS) * len(DISTANCES)), 1)
    for placement in PLACEMENTS:
        surfaces = placed_surfaces(name, placement)
        tracer = Intersector(surfaces, coarse="none", threads=1)
        checker = Checker(surfaces, tangent_every)
        for distance in DISTANCES:
            start = time.perf_counter()
            cell = trace_cell(tracer, name, distance, placement, each, seed)
            group.count.seconds += time.perf_counter() - start
            leaves = None if cell.source is None else cell.source.object_id
            batch = f"trace_cell({name!r}, {distance:g}, {placement!r}, {each}, {seed})"
            checker.check(group, batch, cell.hits, cell.origins, cell.directions, leaves)
        yield group


# --- ordinary rays


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


def _of_set(name: str) -> Callable[[], list[Any]]:
    return SETS[name].surfaces


ORDINARY_SCENES: dict[str, tuple[str, Callable[[], list[Any]]]] = {
    "vase": ("turned", SCENES["vase"]),
    "turned torus": ("turned", _of_set("torus, tangents")),
    "spindle": ("turned", _of_set("spindle")),
    "cone, egg, lens, diamond": ("turned", _turned_surfaces),
    "teapot": ("patches", SCENES["teapot"]),
    "patches of mixed degrees": ("patches", SCENES["patches"]),
    "bent sheet": ("patches", _of_set("patch tangents")),
    "octants of a sphere": ("rational", _of_set("rational poles")),
    "torn NURBS": ("rational", _of_set("breaks and creases of NURBS")),
    "spheres, box, rectangle, plane": ("closed", SCENES["closed forms"]),
    "closed torus": ("closed", _of_set("closed torus, tangents")),
    "skew box": ("closed", _of_set("skew box, edges and corners")),
    "ellipsoid": ("mesh", _of_set("mesh edges and vertices")),
    "fan": ("mesh", _of_set("open mesh, edges")),
}


def ordinary_rays(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Return chords of the sphere around everything, rays at its box, and a camera's."""
    third = n // 3
    parts = [
        chords(surfaces, n - 2 * third, seed),
        at_box(surfaces, third, seed + 1),
        camera(surfaces, third, seed + 2),
    ]
    return RaySet(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def run_ordinary(name: str, n: int, seed: int) -> Iterator[Group]:
    """Judge n ordinary rays of one scene, shared by all placements."""
    kind, make = ORDINARY_SCENES[name]
    group = Group(name, kind, ORDINARY, seed)
    each = max(n // len(PLACEMENTS), 1)
    for number, placement in enumerate(PLACEMENTS):
        surfaces = _placed(make(), placement)
        tracer, checker = Intersector(surfaces, coarse="none", threads=1), Checker(surfaces)
        for begin in range(0, each, STEP):
            m = min(STEP, each - begin)
            ray_seed = zlib.crc32(f"{name} {seed} {number} {begin}".encode())
            rays = ordinary_rays(surfaces, m, ray_seed)
            start = time.perf_counter()
            hits = tracer.intersect(rays.origins, rays.directions)
            group.count.seconds += time.perf_counter() - start
            batch = f"ordinary_rays({name!r} {placement!r}, {m}, {ray_seed})"
            checker.check(group, batch, hits, rays.origins, rays.directions, None)
            yield group


def _placed(surfaces: list[Any], placement: str) -> list[Any]:
    if placement == "home":
        return surfaces
    bounded = [surface for surface in surfaces if surface.is_bounded]
    matrix = PLACEMENTS[placement].matrix(max(size_of(surface) for surface in bounded))
    return [placed(surface, matrix) for surface in surfaces]


def added(groups: Sequence[Group]) -> dict[tuple[str, str], Count]:
    """Return the sums by kind of rays and of surfaces.

    Raises
    ------
    ValueError
        If two groups hold the same rays.
    """
    seen = set()
    for group in groups:
        key = group.rays, group.name, group.seed
        if key in seen:
            raise ValueError(
                f"{group.rays} rays of {group.name!r} with seed {group.seed} are there twice: "
                "add up runs with different seeds"
            )
        seen.add(key)
    table: dict[tuple[str, str], Count] = {}
    for rays in (SINGULAR, ORDINARY):
        for kind in KINDS:
            counts = [g.count for g in groups if g.rays == rays and g.kind == kind]
            if counts:
                table[rays, kind] = sum(counts, Count())
    return table
