"""The interface of kinds of surfaces, and the buffers of a batch that they fill."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from operator import attrgetter
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from meshing.checks import shown
from meshing.kernels.stored_calls import StoredCall


class Finished(NamedTuple):
    """The part of a `HitRecord` that each kind of surface fills for its own rows."""

    patch_id: Any
    u: Any
    v: Any
    position: Any
    normal: Any
    flags: Any
    residual: Any


_FINISHED = attrgetter(*Finished._fields)


class OneRow(NamedTuple):
    """The memory of a ray that is traced alone."""

    rays: Rays  # of one row, with ``known``; its origin is locked, as in batches
    best: Nearest  # of one row
    out: Finished  # of one row
    work: FloatArray  # as `Kind.trace` takes it


class Bottom(NamedTuple):
    """The calls that trace one ray through a tree, or a table, and the box of what is in it."""

    box: FloatArray  # (2, 3), see `hybrid_rt.intersection.members.box_of`
    first: list[StoredCall]
    any_hit: list[StoredCall]


class Single(NamedTuple):
    """The calls that trace one ray; see `Kind.single`."""

    bottoms: list[Bottom]
    describe: list[StoredCall]


class Kind(Protocol):
    """One kind of surface: finds roots for a slice of rays, and describes the first hits."""

    @property
    def n_trees(self) -> int:
        """Number of trees that a ray may walk through; 0: `trace` is all there is, but for single rays."""

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots on all surfaces of this kind.

        Parameters
        ----------
        rays : Rays of n rows
        guess : (n,) int32, optional
            Initial guesses, from `CurvedKind.guesses`; only for kinds with coarse hits.
        best : Nearest of n rows, changed
        any_hit : bool
            Any root will do (shadow rays): rays that have one are skipped.
        work : (counters,) float64, changed
            Tally of `hybrid_rt.intersection.kernels.search.counters.COUNTER_NAMES`.
        """

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Fill ``out`` for the rows whose object is of this kind.

        Parameters
        ----------
        rays : Rays of n rows
        best : Nearest of n rows
            ``tangent`` is set for grazing rays.
        kind_of : (objects,) int32
        kind : int
            Index of this kind in ``kind_of``.
        out : Finished of n rows, changed
        """

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """Return the calls that do the work of `trace`, without a guess, and of `finish` for one ray.

        Bounds of t are left as they are found.
        """
        ...


class CurvedKind(Kind, Protocol):
    """A kind that goes to Embree as triangles first."""

    def guesses(self, coarse: Any, hits: CoarseHits) -> IntArray:
        """Return the initial guess for `trace` of each ray, (n,) int32; -1 for none.

        ``hits``, CoarseHits of n rows.
        """

    def refine(
        self,
        coarse: Any,
        hits: CoarseHits,
        rows: NDArray[np.int64],
        rays: Rays,
        best: Nearest,
        accepted: BoolArray,
    ) -> None:
        """Refine coarse hits of this kind and lower ``best[rows]`` to them.

        ``hits``, CoarseHits of k rows, none of them a miss; ``rays``, Rays of n rows; ``best``,
        Nearest of n rows, changed.
        ``rows`` (k,) int64: indices of the hits' rays.
        ``accepted`` (k,) bool, changed: set where a root was accepted.
        """


def widen_bounds(
    moved: FloatArray, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
) -> None:
    """Add to bounds of t what lies between a surface as it is traced and as it was given.

    ``moved`` (primitives,): bound on their distance, world units.
    ``rays``, ``best``, ``kind_of``, ``kind``, ``out``: as for `Kind.finish`, after it.
    """
    rows = np.flatnonzero(best.object_id >= 0)
    rows = rows[kind_of[best.object_id[rows]] == kind]
    rows = rows[moved[best.primitive[rows]] > 0.0]
    slope = np.abs(np.einsum("ij,ij->i", out.normal[rows], rays.direction[rows]))
    with np.errstate(divide="ignore"):
        best.t_bound[rows] += moved[best.primitive[rows]] / slope


def bottom(box: FloatArray, calls: Callable[[bool], list[StoredCall]]) -> Bottom:
    """Return a bottom, given what stores its calls for first hits (False) and for any hits (True)."""
    return Bottom(box, calls(False), calls(True))


def calls_of(kinds: Sequence[Single]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the addresses of all calls, and where those of each kind for each purpose begin, (k, 4)."""
    lists = [
        some
        for bottoms, describe in kinds
        for some in (
            [call for one in bottoms for call in one.first],
            [call for one in bottoms for call in one.any_hit],
            describe,
        )
    ]
    addresses, ends = addresses_of(lists)
    begins = np.array([ends[3 * k : 3 * k + 4] for k in range(len(kinds))], np.int64)
    return addresses, begins.reshape(-1, 4)


def addresses_of(
    lists: Sequence[Sequence[StoredCall]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the addresses of the calls of all lists, and where those of each begin, (lists + 1,)."""
    addresses = np.array([call.address for some in lists for call in some], np.int64)
    return addresses, np.cumsum([0, *map(len, lists)])


def new_nearest(t_max: FloatArray) -> Nearest:
    """Allocate buffers without roots; ``t_max`` is not copied but becomes their t."""
    n = len(t_max)
    return Nearest(
        t=t_max,
        t_bound=np.zeros(n),
        object_id=_filled(n, -1, np.int32),
        primitive=np.zeros(n, np.int32),
        a=np.zeros(n),
        b=np.zeros(n),
        tangent=np.zeros(n, np.uint8),
        doubt=_filled(n, np.inf, np.float64),
    )


def new_record(n: int) -> HitRecord:
    """Allocate a record of n rows; no flag is set."""
    return HitRecord(
        t=np.empty(n),
        object_id=np.empty(n, np.int32),
        patch_id=np.empty(n, np.int32),
        u=np.empty(n),
        v=np.empty(n),
        position=np.empty((n, 3)),
        normal=np.empty((n, 3)),
        front_face=np.empty(n, np.bool_),
        status=np.empty(n, np.uint8),
        flags=np.zeros(n, np.uint8),
        t_bound=np.empty(n),
        residual=np.empty(n),
        instance_id=_filled(n, -1, np.int32),
    )


def finished_part(record: HitRecord) -> Finished:
    """Return the columns that kinds fill."""
    return Finished(*_FINISHED(record))


def cleared_record(record: HitRecord, n: int) -> HitRecord:
    """Return a record of n rows that a caller passes to be written to, as `new_record` returns one.

    Raises
    ------
    TypeError, ValueError
        If it is not such a record; the first column that does not fit is named.
    """
    if not isinstance(record, HitRecord):
        raise TypeError(f"out is {shown(record)}: pass a HitRecord of {n} rows, or None")
    for name, like in vars(new_record(0)).items():
        column, shape = getattr(record, name), (n, *like.shape[1:])
        fits = (
            isinstance(column, np.ndarray) and column.dtype == like.dtype and column.shape == shape
        )
        if not (fits and column.flags.c_contiguous and column.flags.writeable):
            raise ValueError(
                f"out.{name} is {getattr(column, 'dtype', '')} {np.shape(column)}: pass {like.dtype} {shape} that is "
                f"writable and in C order, such as a result of intersect for {n} rays"
            )
    record.flags.fill(0)
    record.instance_id.fill(-1)
    return record


def _filled(n: int, value: float, dtype: type) -> NDArray[Any]:
    """Return n equal numbers, as `numpy.full` does in twice the time where n is small."""
    array: NDArray[Any] = np.empty(n, dtype)
    array.fill(value)
    return array


def rows_of(batch: Any, begin: int, end: int) -> Any:
    """Return a named tuple of views of the rows; empty arrays stay empty."""
    if begin == 0 and end == len(batch[0]):
        return batch
    return type(batch)(*(x[begin:end] if len(x) else x for x in batch))
