"""The oracle: slow, reliable first hits, to test the intersector, with which it shares no code.

Patches and profiles are bisected; spheres and flat faces have closed forms; all roots end in
double-double. Roots that displacing the ray by 64 eps x scale could create or remove are reported
as doubtful: an answer with a doubtful root and one without it are both right.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.core.threads import available_threads
from proof.judges.kernels import events
from proof.judges.surface_judge import Worker, judge_of, new_events

# Rays per job: enough to hide the call, few enough to keep all threads busy.
CHUNK = 2048
# Events per ray for which room is made at first.
ROOM = 8


@dataclass(frozen=True)
class Roots:
    """All roots of a batch, sorted by t within each ray; those of ray i are a run.

    Attributes
    ----------
    offsets : (n + 1,) int64
        Ray i has the rows ``offsets[i]`` to ``offsets[i + 1]``.
    t : (m,) float64
        In lengths of the given direction.
    object_id, patch_id : (m,) int32
    u, v : (m,) float64
        On patches and surfaces of revolution; elsewhere 0.
    cosine : (m,) float64
        |n.d| / |d|.
    band : (m,) float64
        64 eps x scale, scene units.
    kind : (m,) uint8
        0 certain; 1 certain, its t known to the band only; 2 doubtful, either decision is right;
        3 the oracle gave up.
    """

    offsets: NDArray[np.int64]
    t: FloatArray
    object_id: IntArray
    patch_id: IntArray
    u: FloatArray
    v: FloatArray
    cosine: FloatArray
    band: FloatArray
    kind: NDArray[np.uint8]

    @property
    def ray(self) -> NDArray[np.int64]:
        """(m,) int64: the ray of each row."""
        return np.repeat(np.arange(len(self.offsets) - 1), np.diff(self.offsets))


@dataclass(frozen=True)
class Truth:
    """The first certain root of each ray, and the doubtful ones before it.

    Attributes
    ----------
    t, object_id, patch_id, u, v, cosine : (n,)
        inf, -1, -1, nan, nan, nan where there is none.
    band : (n,) float64
        64 eps x scale of that root; nan where there is none.
    surfaces : sequence
    origins, directions : (n, 3) float64
        What was asked.
    length : (n,) float64
        Length of the ray's direction.
    t_min, t_max : (n,) float64
        A hit needs a t between them.
    left : (n,) int32
        Object whose crossing at the origin, the point of departure, was left out; -1 for none.
    departure : (n,) float64
        Up to this t a hit on that object is the point of departure; -inf for none.
    exact : (n,) bool
        t of that root is right to the last bit.
    ambiguous : (n,) bool
        A doubtful root lies before the first certain one: other answers are right too.
    undecided : (n,) bool
        The oracle gave up on this ray.
    roots : Roots
    """

    t: FloatArray
    object_id: IntArray
    patch_id: IntArray
    u: FloatArray
    v: FloatArray
    cosine: FloatArray
    band: FloatArray
    surfaces: Sequence[Any]
    origins: FloatArray
    directions: FloatArray
    length: FloatArray
    t_min: FloatArray
    t_max: FloatArray
    left: IntArray
    departure: FloatArray
    exact: BoolArray
    ambiguous: BoolArray
    undecided: BoolArray
    roots: Roots

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.t)


def first_hits(
    surfaces: Sequence[Any],
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike = 0.0,
    t_max: ArrayLike = np.inf,
    *,
    departing: bool = False,
    threads: int | None = None,
) -> Truth:
    """Find all roots of rays on surfaces, and the first of each ray.

    Parameters
    ----------
    surfaces : sequence of surfaces, as `Intersector` takes them
    origins, directions : (n, 3)
        Scene units; directions of any length but zero.
    t_min, t_max : scalar or (n,)
        Only roots between them count; those at a limit, up to the band, are doubtful.
    departing : bool
        The rays leave from a surface: a single root at the origin, up to the band, is left out.
    threads : int, optional
        Default: all processors that the process may use.

    Returns
    -------
    Truth of n rays

    Raises
    ------
    TypeError
        For a surface that the oracle does not know, by name.
    """
    origin = np.ascontiguousarray(origins, dtype=np.float64).reshape(-1, 3)
    direction = np.ascontiguousarray(directions, dtype=np.float64).reshape(-1, 3)
    n = len(origin)
    low = np.ascontiguousarray(np.broadcast_to(np.asarray(t_min, dtype=np.float64), (n,)))
    high = np.ascontiguousarray(np.broadcast_to(np.asarray(t_max, dtype=np.float64), (n,)))
    workers = workers_of(surfaces)

    def run(begin: int) -> events.Events:
        rows = slice(begin, min(begin + CHUNK, n))
        room = ROOM * CHUNK
        while True:
            found = new_events(room)
            for worker in workers:
                worker(begin, origin[rows], direction[rows], low[rows], found)
            if found.count[0] <= room:
                return found
            room = int(found.count[0])

    begins = range(0, n, CHUNK)
    n_threads = threads or available_threads()
    with ThreadPoolExecutor(n_threads) as pool:
        parts = list(pool.map(run, begins))
    columns = {
        name: np.concatenate(
            [getattr(part, name)[: part.count[0]] for part in parts] or [np.empty(0)]
        )
        for name in events.Events._fields[1:]
    }
    return truth_of(columns, surfaces, origin, direction, low, high, departing)


def workers_of(surfaces: Sequence[Any]) -> list[Worker]:
    """Return the functions that find all roots on each surface.

    Raises
    ------
    TypeError
        For a surface that the oracle does not know, by name.
    """
    return [judge_of(surface).worker(i) for i, surface in enumerate(surfaces)]


def truth_of(
    columns: dict[str, Any],
    surfaces: Sequence[Any],
    origins: FloatArray,
    directions: FloatArray,
    t_min: FloatArray,
    t_max: FloatArray,
    departing: bool = False,
    departures: Departures | None = None,
) -> Truth:
    """Return the truth about n rays from their events.

    Parameters
    ----------
    columns : dict of (m,) arrays
        See `events.Events`; rows in any order.
    surfaces, origins, directions, t_min, t_max, departing
        As `first_hits` takes them, one of each per ray.
    departures : Departures, optional
        Those that ``columns`` lack already.
    """
    length = np.linalg.norm(directions, axis=1)
    columns = _merge(columns, length)
    columns, found = _limit(columns, length, t_min, t_max, departing)
    return _first(columns, surfaces, origins, directions, length, t_min, t_max, departures or found)


Columns = dict[str, Any]


class Departures(NamedTuple):
    """Crossings at the origins of n rays that were left out; see `Truth`."""

    left: IntArray
    reach: FloatArray

    @classmethod
    def none(cls, n: int) -> Departures:
        """Return those of n rays that leave nothing."""
        return cls(np.full(n, -1, np.int32), np.full(n, -np.inf))


def _merge(columns: Columns, length: FloatArray) -> Columns:
    """Keep one of the events that neighbouring patches note at a shared edge."""
    ray, t, slack = columns["ray"], columns["t"], _tolerance(columns, length)
    order = np.lexsort((t, columns["at_edge"], columns["object_id"], ray))
    one, two = order[:-1], order[1:]
    same = (ray[one] == ray[two]) & (columns["object_id"][one] == columns["object_id"][two])
    same &= (columns["at_edge"][one] == 1) & (columns["at_edge"][two] == 1)
    same &= t[two] - t[one] <= 2.0 * np.maximum(slack[one], slack[two])
    # All of a group are as near to its first: what lies between does not join two edges.
    first = 0
    for k in np.flatnonzero(same):
        if k == 0 or not same[k - 1]:
            first = order[k]
        if t[two[k]] - t[first] > 2.0 * max(slack[first], slack[two[k]]):
            same[k], first = False, two[k]
    group = np.concatenate([[0], np.cumsum(~same)]) if len(order) else np.empty(0, np.int64)
    # Of each group the event that is most certain, then the nearest, then that of the first patch.
    best = np.lexsort((columns["patch_id"][order], t[order], columns["kind"][order], group))
    _, first = np.unique(group[best], return_index=True)
    rows = order[best[first]]
    return {name: values[rows] for name, values in columns.items()}


def _tolerance(columns: Columns, length: FloatArray) -> FloatArray:
    """Return how far the band moves a root, in t."""
    floor = np.maximum(columns["cosine"], events.LEAST_COSINE)
    moved: FloatArray = columns["band"] / (floor * length[columns["ray"].astype(np.int64)])
    return moved


def _limit(
    columns: Columns, length: FloatArray, low: FloatArray, high: FloatArray, departing: bool
) -> tuple[Columns, Departures]:
    """Drop what lies outside the limits of t, or at the point of departure; return also the latter."""
    ray = columns["ray"].astype(np.int64)
    t, kind, slack = columns["t"], columns["kind"].copy(), _tolerance(columns, length)
    given_up = kind == events.UNDECIDED
    keep = given_up | ((t > low[ray] - slack) & (t < high[ray] + slack))
    at_limit = (np.abs(t - low[ray]) <= slack) | (np.abs(t - high[ray]) <= slack)
    departures = Departures.none(len(low))
    if departing:
        at_start = keep & ~given_up & (np.abs(t) <= slack)
        alone = np.bincount(ray[at_start], minlength=len(low)) == 1
        dropped = np.flatnonzero(at_start & alone[ray])
        keep[dropped] = False
        departures.left[ray[dropped]] = columns["object_id"][dropped]
        departures.reach[ray[dropped]] = t[dropped] + slack[dropped]
    kind[at_limit & ~given_up] = events.DOUBTFUL
    columns = {**columns, "kind": kind}
    return {name: values[keep] for name, values in columns.items()}, departures


def _first(
    columns: Columns,
    surfaces: Sequence[Any],
    origins: FloatArray,
    directions: FloatArray,
    length: FloatArray,
    t_min: FloatArray,
    t_max: FloatArray,
    departures: Departures,
) -> Truth:
    n = len(length)
    order = np.lexsort((columns["object_id"], columns["t"], columns["ray"]))
    columns = {name: values[order] for name, values in columns.items()}
    ray = columns["ray"].astype(np.int64)
    offsets = np.searchsorted(ray, np.arange(n + 1)).astype(np.int64)
    certain = np.flatnonzero(columns["kind"] <= events.COVERED)
    owners, where = np.unique(ray[certain], return_index=True)
    row = np.full(n, -1, np.int64)
    row[owners] = certain[where]
    t = np.full(n, np.inf)
    t[owners] = columns["t"][row[owners]]
    doubtful = columns["kind"] == events.DOUBTFUL
    before = doubtful & (columns["t"] <= t[ray] + _tolerance(columns, length))
    given_up = columns["kind"] == events.UNDECIDED

    def pick(name: str, missing: Any, dtype: Any) -> Any:
        values = np.full(n, missing, dtype)
        values[owners] = columns[name][row[owners]]
        return values

    return Truth(
        t=t,
        object_id=pick("object_id", -1, np.int32),
        patch_id=pick("patch_id", -1, np.int32),
        u=pick("u", np.nan, np.float64),
        v=pick("v", np.nan, np.float64),
        cosine=pick("cosine", np.nan, np.float64),
        band=pick("band", np.nan, np.float64),
        surfaces=surfaces,
        origins=origins,
        directions=directions,
        length=length,
        t_min=t_min,
        t_max=t_max,
        left=departures.left,
        departure=departures.reach,
        exact=pick("kind", events.UNDECIDED, np.uint8) == events.ROOT,
        ambiguous=np.bincount(ray[before], minlength=n) > 0,
        undecided=np.bincount(ray[given_up], minlength=n) > 0,
        roots=Roots(
            offsets,
            *(
                columns[name]
                for name in (
                    "t", "object_id", "patch_id", "u", "v", "cosine", "band", "kind",
                )
            ),
        ),
    )  # fmt: skip
