"""First hits of rays on a list of surfaces, each proven, with an error bound.

Spheres, rectangles, planes, boxes and tori have kernels of their own. Patches and surfaces of
revolution go through three stages: Embree finds coarse hits on their triangles; Newton iteration
refines these on the true surface; a search in float64, bounded by the refined hit, proves which hit
is first. The accuracies "mesh", "refined" and "certified" stop after one, two and three stages.
Two things skip Embree if hits are to be certified: triangle meshes, as the search in float64 alone is
twice as fast, and shadow rays, which need no place to begin, only a yes or a no.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import cut
from hybrid_rt.core.precompile import Task, want
from hybrid_rt.core.progress import warn_of_compilation
from hybrid_rt.core.records import (
    BoolArray,
    FloatArray,
    HitRecord,
    IntArray,
    NamedPoints,
    Status,
)
from hybrid_rt.core.threads import Pool
from hybrid_rt.core.timing import Stopwatch
from hybrid_rt.intersection.crossings import Crossings, find_crossings
from hybrid_rt.intersection.kernels.search.counters import COUNTER_NAMES, MOST_PIECES
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.rays import Record, complete_rows
from hybrid_rt.intersection.kind import (
    Finished,
    cleared_record,
    finished_part,
    new_nearest,
    new_record,
    rows_of,
)
from hybrid_rt.intersection.kinds.registry import (
    ACCURACIES,
    by_entry,
    check_surfaces,
    count_by_kind,
    make_kinds,
)
from hybrid_rt.intersection.limits import Limit
from hybrid_rt.intersection.margins import Probing, settle
from hybrid_rt.intersection.ray_batch import Batch, make_batch
from hybrid_rt.intersection.walks import MANY_TREES, Walks
from meshing.surface import Surface

if TYPE_CHECKING:
    from hybrid_rt.intersection.coarse.proposals import Coarse
    from hybrid_rt.intersection.single_rays import SingleRayTracer

# What is counted of each slice besides the work.
COUNTED = ("rays", "hits", "tangent", "coarse_hits")
COARSE_STAGES = ("embree", "none")
_COLUMNS = attrgetter(*Record._fields)


class Intersector:
    """First-hit and shadow queries on a list of surfaces.

    Parameters
    ----------
    surfaces : Surface, or sequence of Surface
        Any mix of the surfaces of `meshing` and of `hybrid_rt` (`Sphere`, `TriangleMesh` and so
        on). The ``object_id`` of a hit is the index in this sequence.
    accuracy : {"certified", "refined", "mesh"}
        "mesh" returns Embree's hits on the triangles. "refined" moves each of them onto the true
        surface by Newton iteration. "certified" also proves that nothing lies in front.
        Closed forms (`Sphere`, `Torus`, `Asphere`, `Rectangle`, `Plane`, `Box`) have no triangles:
        their hits are the same in all three.
    coarse : {"embree", "none"}
        "none" skips tessellation and Embree. The hits are the same. Only for "certified".
    tolerance : float, optional
        Chordal tolerance of the coarse triangles, scene units. By default it is chosen for each
        surface.
    threads : int, optional
        Default: all cores that the process may use. The number changes no result.

    Attributes
    ----------
    coarse_build_seconds : float
        Time that the tessellation and Embree's tree took.
    coarse_seconds : float
        Time that coarse hits have taken so far, summed over threads.
    now : callable
        The clock of ``coarse_seconds``; returns seconds.

    Raises
    ------
    TypeError, ValueError
        If an item is not a surface, a setting is unknown, the tolerance is not positive, or a surface is
        so small beside the others that Embree's single precision cannot give an accuracy of "mesh" or
        "refined".

    References
    ----------
    Toth, "On ray tracing parametric surfaces", SIGGRAPH 1985 (Newton from a coarse hit).
    """

    def __init__(
        self,
        surfaces: Surface | Sequence[Surface],
        accuracy: str = "certified",
        coarse: str = "embree",
        tolerance: float | None = None,
        threads: int | None = None,
    ) -> None:
        began = time.perf_counter()
        check_settings(accuracy, coarse, tolerance)
        several = (
            (surfaces,) if isinstance(surfaces, Surface) else checks.items(surfaces, "surfaces")
        )
        self.surfaces = check_surfaces(several)
        self.accuracy, self.coarse = accuracy, coarse
        want(self._rehearsals)
        warn_of_compilation()
        self._pool = Pool(threads)
        # Points of closed forms lie on them up to the rounding of their own coordinates, those of
        # curved surfaces and triangles up to that of the figures they are computed from.
        self._reach = np.array([surface.rounding_reach for surface in self.surfaces])
        self._farthest = float(self._reach.max(initial=0.0))
        self._direct, self._curved, self._kind_of, members, self.plan = make_kinds(
            self.surfaces, accuracy, self._pool
        )
        self._instances: Any = next((k for k in self._direct if hasattr(k, "for_slice")), None)
        self._coarse: Coarse | None = None
        self.now: Callable[[], float] = time.perf_counter
        self.coarse_seconds = self.coarse_build_seconds = 0.0
        if members and coarse == "embree":
            from hybrid_rt.intersection.coarse.proposals import (
                GUESS_TOLERANCE,
                MESH_TOLERANCE,
                Coarse,
            )

            relative = GUESS_TOLERANCE if accuracy == "certified" else MESH_TOLERANCE
            with Stopwatch(self.now) as watch:
                self._coarse = Coarse(members, tolerance, relative)
            if accuracy != "certified":
                self._coarse.check_sizes(accuracy)
            self.coarse_build_seconds = watch.seconds
            self.plan["used"]["embree"] = (
                f"{self._coarse.n_triangles} triangles for {len(members)} surface(s)"
            )
        elif members:
            self.plan["left_out"]["embree"] = 'coarse="none"'
        elif any(surface.is_triangular for surface in self.surfaces):
            self.plan["left_out"]["embree"] = (
                "nothing to tessellate; certified hits on meshes come from a tree in float64"
            )
        else:
            self.plan["left_out"]["embree"] = "nothing to tessellate and no triangle mesh"
        self._number_kinds()
        # Guesses serve kinds that trace by themselves, unless they have so many trees that a walk is better.
        walkable = [
            (number, kind)
            for number, kind in enumerate([*self._direct, *self._curved])
            if number < len(self._direct)
            or self._coarse is None
            or (accuracy == "certified" and kind.n_trees >= MANY_TREES)
        ]
        self._walks = Walks(walkable, self._kind_of)
        self.counters: dict[str, int] = dict.fromkeys(
            (
                "rays", "single_rays", "shadow_rays", "hits", "tangent", "misses", "coarse_hits",
                *COUNTER_NAMES,
            ),
            0,
        )  # fmt: skip
        self.build_seconds = time.perf_counter() - began

    def __repr__(self) -> str:
        """Say what it holds: surfaces by kind, accuracy, coarse stage, and what is left out."""
        held = ", ".join(f"{kind}: {n}" for kind, n in count_by_kind(self.surfaces).items())
        words = [held or "no surface", self.accuracy]
        if self._coarse is None:
            words.append(f"without Embree: {self.plan['left_out']['embree']}")
        else:
            words.append(f"Embree with {self.n_triangles:,} triangles")
        return cut(f"Intersector({'; '.join(words)})", "...)")

    @property
    def threads(self) -> int:
        """Number of threads that share a batch."""
        return self._pool.threads

    @property
    def n_triangles(self) -> int:
        """Number of coarse triangles; 0 without Embree."""
        return 0 if self._coarse is None else self._coarse.n_triangles

    def with_own_counters(self) -> Intersector:
        """Return a tracer of the same surfaces with counters of its own that start at 0."""
        own = copy.copy(self)
        own.counters = dict.fromkeys(self.counters, 0)
        own.coarse_seconds = 0.0
        return own

    def single_rays(self) -> SingleRayTracer | None:
        """Return what traces one ray at a time, in one thread; None if hits are not certified."""
        if self.accuracy != "certified" and (self._curved or self._coarse is not None):
            return None
        from hybrid_rt.intersection.single_rays import SingleRayTracer

        kinds = [*self._direct, *self._curved]
        return SingleRayTracer(kinds, self._kind_of, self._reach)

    def count_single_rays(
        self, status: IntArray, hits: IntArray, shadow: IntArray, work: FloatArray
    ) -> None:
        """Count rays by their status, hits and shadow rays of `single_rays`, and set ``work`` to 0."""
        counters = self.counters
        counters["rays"] += int(status.sum())
        counters["single_rays"] += int(status.sum())
        counters["hits"] += int(hits[0])
        counters["tangent"] += int(status[Status.TANGENT])
        counters["shadow_rays"] += int(shadow[0])
        counters["misses"] = counters["rays"] - counters["hits"]
        self._add_work([work], [])
        work[:] = 0.0

    def forget_counters(self) -> None:
        """Set all counters, and the seconds of coarse hits, to 0."""
        self.counters.update(dict.fromkeys(self.counters, 0))
        self.coarse_seconds = 0.0

    def intersect(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
        source: HitRecord | NamedPoints | None = None,
        unseen: IntArray | None = None,
        out: HitRecord | None = None,
    ) -> HitRecord:
        """Find the first hit of each ray.

        Parameters
        ----------
        origins, directions : (n, 3), (3,) or (h, w, 3) array-like
            Scene units, world frame, any float type. Directions may have any length but zero.
        t_min, t_max : scalar, (n,) or (h, w)
            A hit needs ``t_min < t < t_max``, in lengths of the given direction. A row says `TANGENT` if
            ``t_bound`` of a root allows both answers: a hit whose bound reaches across a limit, or a miss
            where the bound of a root beyond one reaches within.
        source : HitRecord or NamedPoints of n rows, optional
            The hits, or points of objects, that the rays leave: those of a lamp that is an object, say.
            These points are excluded, also as points of adjoining patches, seams, poles or mesh edges.
            Rows that are misses exclude nothing. They are hits of
            this tracer: those of another one are not told apart if their ``object_id`` exist here.
        unseen : (n,) int, optional
            ``object_id`` of an object that each ray ignores; -1 for none. Where the ray passes that object
            within rounding, the row may still say `TANGENT`.
        out : HitRecord of n rows, optional
            Receives the hits and is returned: a result of this method that nobody needs any more, or rows
            ``[begin:end]`` of one. Long batches save the time for new memory. Not the ``source``.

        Returns
        -------
        HitRecord of n rows, in the order of the rays

        Raises
        ------
        ValueError, TypeError
            If shapes do not match, directions are zero or not finite, origins are not finite,
            arrays are not real, ``source`` is not a hit record of these surfaces, or ``out`` is not one
            of n rows.
        """
        self._check_places(source, "source")
        batch = make_batch(
            origins, directions, t_min, t_max, source, None, self._reach, self._pool, unseen
        )
        return self._first_hits(batch, out)

    def _check_places(self, record: HitRecord | NamedPoints | None, name: str) -> None:
        if self._instances is not None and isinstance(record, HitRecord):
            self._instances.check_places(record, name)

    def _first_hits(self, batch: Batch, out: HitRecord | None = None) -> HitRecord:
        """Find the first hit of each ray of a checked batch."""
        n = len(batch)
        record = new_record(n) if out is None else cleared_record(out, n)
        columns, slots = Record(*_COLUMNS(record)), finished_part(record)
        tallies: list[FloatArray] = []
        watches: list[Stopwatch] = []

        def work(begin: int, end: int) -> None:
            watches.append(watch := Stopwatch(self.now))
            tally, totals = np.zeros(len(COUNTER_NAMES)), np.zeros(2, np.int64)
            rays, t_max, unit = batch.rows(begin, end)
            limit = Limit(t_max, rays, self._farthest, batch.is_limited(begin, end))
            best, found = new_nearest(limit.searched), np.zeros(end - begin, np.bool_)
            direct = self._direct_kinds(end - begin)
            self._first_roots(direct, rays, best, False, tally, found, watch)
            described = rows_of(slots, begin, end)
            self._finish(direct, rays, best, described)
            for number, kind in self._probing:
                settle(kind, number, self._kind_of, rays, best, described, tally)
            limit.apply(best, described.flags)
            complete_rows(rays.direction, unit, best, rows_of(columns, begin, end), totals)
            tallies.append(tally)
            rows.append((end - begin, *totals.tolist(), int(found.sum())))

        rows: list[tuple[int, ...]] = []
        self._pool.run(work, n)
        self._add_work(tallies, watches)
        for counted in rows:
            for name, number in zip(COUNTED, counted, strict=True):
                self.counters[name] += number
        self.counters["misses"] = self.counters["rays"] - self.counters["hits"]
        if self._instances is not None:
            self._instances.name_instances(record)
        return record

    def occluded(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        t_max: ArrayLike = np.inf,
        *,
        t_min: ArrayLike = 0.0,
        source: HitRecord | NamedPoints | None = None,
        target: HitRecord | NamedPoints | None = None,
    ) -> BoolArray:
        """Tell for each ray whether anything lies between ``t_min`` and ``t_max``.

        Parameters and errors are those of `intersect`. ``target`` holds the hits, n rows, that the
        rays lead to; these do not occlude them. The answer is that of ``intersect(...).hit``.

        Returns
        -------
        (n,) bool
        """
        self._check_places(source, "source")
        self._check_places(target, "target")
        batch = make_batch(
            origins, directions, t_min, t_max, source, target, self._reach, self._pool
        )
        blocked = np.empty(len(batch), np.bool_)
        tallies: list[FloatArray] = []
        watches: list[Stopwatch] = []

        def work(begin: int, end: int) -> None:
            watches.append(watch := Stopwatch(self.now))
            tally = np.zeros(len(COUNTER_NAMES))
            rays, highest, _ = batch.rows(begin, end)
            best = new_nearest(highest)
            direct, found = self._direct_kinds(end - begin), np.zeros(end - begin, np.bool_)
            self._first_roots(direct, rays, best, True, tally, found, watch)
            blocked[begin:end] = best.object_id >= 0
            tallies.append(tally)

        self._pool.run(work, len(batch))
        self._add_work(tallies, watches)
        self.counters["shadow_rays"] += len(batch)
        return blocked

    def intersect_all(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        *,
        t_min: ArrayLike = 0.0,
        t_max: ArrayLike = np.inf,
    ) -> Crossings:
        """Find every crossing of each ray. A shared edge, a seam or a pole counts once.

        So does a place where the surfaces of two objects coincide within the bounds of both: one of them
        is named. But of two faces back to back, as of bodies that touch, and of two within the gap of an edge (`EDGE`),
        one met from in front and one from behind, both are there. Where a ray grazes a surface both crossings are there, however near each other, unless
        moving the ray by the band or so could take them away: then they may count as one, or be left out,
        and a ray that passes by may count one. A row that stands for such a pair says TANGENT. No row tells
        of a pair that was left out, nor of a crossing that rounding alone puts beyond ``t_max``;
        `intersect` marks such a ray as TANGENT if it would come first.

        Parameters and errors are those of `intersect`, which can also leave a point of departure out
        (``source``). Here a ray that starts on a surface may or may not cross it there.

        Returns
        -------
        Crossings
            ``hits`` are sorted by ray and then by t.
        """

        def step(
            o: FloatArray, d: FloatArray, low: FloatArray, high: FloatArray, last: FloatArray | None
        ) -> HitRecord:
            return self._first_hits(
                make_batch(o, d, low, high, last, None, self._reach, self._pool)
            )

        return find_crossings(step, self._reach, origins, directions, t_min, t_max)

    def _direct_kinds(self, n: int) -> list[Any]:
        """Return the kinds without a coarse stage; that of instances as it traces one slice of n rays."""
        if self._instances is None:
            return self._direct
        return [k.for_slice(n) if k is self._instances else k for k in self._direct]

    def _first_roots(
        self,
        direct: Sequence[Any],
        rays: Rays,
        best: Nearest,
        any_hit: bool,
        tally: FloatArray,
        found: BoolArray,
        watch: Stopwatch,
    ) -> None:
        """Lower ``best`` for a slice of rays, by the stages of the accuracy."""
        walks, coarse = self._walks, self._coarse
        curved = [kind for kind in self._curved if kind not in walks.kinds]
        if coarse is None or (any_hit and self.accuracy == "certified"):
            direct, curved = [*direct, *curved], []
        for kind in direct:
            if kind not in walks.kinds:
                kind.trace(rays, None, best, any_hit, tally)
        if walks.kinds:
            walks.trace(rays, best, any_hit, tally)
        if coarse is None or not (curved or self.accuracy == "mesh"):
            return
        if self.accuracy == "certified":
            guesses = coarse.propose(curved, rays, best, found, watch)
            for kind, guess in zip(curved, guesses, strict=True):
                kind.trace(rays, guess, best, any_hit, tally)
        else:
            coarse.refine(curved, rays, best, tally, found, watch)

    def _describe_none(self) -> None:
        """Call the kernels that describe hits, of no rays."""
        none = np.empty((0, 3))
        rays, _, _ = make_batch(none, none, 0.0, np.inf, None, None, self._reach, self._pool).rows(
            0, 0
        )
        best, out = new_nearest(np.empty(0)), finished_part(new_record(0))
        self._finish(self._direct_kinds(0), rays, best, out)

    def _finish(self, direct: Sequence[Any], rays: Rays, best: Nearest, out: Finished) -> None:
        """Describe the hits of a slice, whose kinds without a coarse stage are these."""
        for number, kind in enumerate([*direct, *self._finishing[len(direct) :]]):
            kind.finish(rays, best, self._kind_of, number, out)

    def _number_kinds(self) -> None:
        """Set what describes the hits of each kind, by its number, and which of these settle hits."""
        self._finishing: list[Any] = [*self._direct, *self._curved]
        if self.accuracy == "mesh" and self._coarse is not None:
            self._finishing = [*self._direct, self._coarse]
        # Of hits that are not certified nothing is known to begin with.
        self._probing: list[tuple[int, Probing]] = [
            (number, kind)
            for number, kind in enumerate(self._finishing)
            if self.accuracy == "certified" and isinstance(kind, Probing)
        ]

    def _rehearsals(self) -> Iterator[Task]:
        """Yield what calls the kernels of each kind, the search's before those of triangles."""
        kinds = by_entry(self.surfaces)[::-1]
        if self.accuracy == "certified":
            yield from ((rehearse, (surfaces, "certified", "none")) for surfaces in kinds)
        if self.coarse == "embree":
            yield from ((rehearse, (surfaces, "mesh", "embree")) for surfaces in kinds)

    def _add_work(self, tallies: list[FloatArray], watches: list[Stopwatch]) -> None:
        self.coarse_seconds += sum(watch.seconds for watch in watches)
        for tally in tallies:
            for name, value in zip(COUNTER_NAMES, tally.tolist(), strict=True):
                if value and name == COUNTER_NAMES[MOST_PIECES]:
                    self.counters[name] = max(self.counters[name], int(value))
                elif value:
                    self.counters[name] += int(value)


def rehearse(surfaces: Sequence[Surface], accuracy: str, coarse: str) -> None:
    """Ask for first hits and shadows in all forms that kernels tell apart."""
    tracer = Intersector(surfaces, accuracy, coarse, threads=1)
    low, high = np.clip(surfaces[0].bounds, -1e3, 1e3)
    rng = np.random.default_rng(1)
    start = 0.5 * (low + high) + np.linalg.norm(high - low) * rng.normal(size=(20_000, 3))
    to = low + (high - low) * rng.random(start.shape) - start
    # First what describes hits: others begin with what finds them.
    tracer._describe_none()
    tracer.occluded(start, to)
    hits = tracer.intersect(start, to)
    found = hits[hits.hit]
    tracer.intersect(found.position, to[hits.hit], source=found)


def check_settings(accuracy: str, coarse: str = "embree", tolerance: float | None = None) -> None:
    """Check the settings of `Intersector`."""
    checks.choice(accuracy, "accuracy", ACCURACIES)
    checks.choice(coarse, "coarse", COARSE_STAGES)
    if coarse == "none" and accuracy != "certified":
        raise ValueError(
            f'coarse="none" leaves no triangles for accuracy={accuracy!r}: '
            'pass coarse="embree", or accuracy="certified"'
        )
    if tolerance is not None:
        checks.number(tolerance, "tolerance", above=0.0, hint="in scene units, or None")
