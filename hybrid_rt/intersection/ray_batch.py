"""Checks the rays that a caller passes, and converts them to the kernels' format."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.kernels.search import rays as kernels
from hybrid_rt.intersection.kernels.search.nearest import PASSED, Rays
from meshing.checks import as_floats, refuse_mask, shown

IdArray = NDArray[np.int64]

# A point named by a hit record lies on its surface up to the rounding of three coordinates, and
# the ray's origin may have been rounded once more on its way: 4 ulp in all, as a length.
POINT_ROUNDING = 8 * 2.0**-53
# Farther from the ray than this the caller means another point.
FARTHEST = 64 * 2.0**-52
# Coordinates up to here leave room for the squares of their differences.
LARGEST = 1e150


@dataclass(frozen=True)
class Batch:
    """Checked rays of a caller; `rows` converts a slice to the kernels' format."""

    # (n, 3)
    origin: FloatArray
    direction: FloatArray
    # (n,) or (1,): in lengths of the given directions
    t_min: FloatArray
    t_max: FloatArray
    # NamedPoints of n rows, or None: points that rays leave and lead to; they are excluded as hits.
    # Or ``source`` is (n,) float64, the t of a crossing of each ray: the search goes on behind it,
    # to no target.
    source: NamedPoints | FloatArray | None
    target: NamedPoints | None
    reach: FloatArray  # (objects,): see `make_batch`
    unseen: IntArray | None  # (n,) int32, or None: an object that each ray ignores; -1: none

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.origin)

    def rows(self, begin: int, end: int) -> tuple[Rays, FloatArray, FloatArray]:
        """Return rays, their t_max, and the factors that convert their t to the caller's units."""
        n = end - begin
        origin, direction = self.origin[begin:end], self.direction[begin:end]
        scaled, unit = np.empty((n, 3)), np.empty(n)
        t_min, t_max = np.empty(n), np.empty(n)
        kernels.scale_rays(
            direction, _rows(self.t_min, begin, end), _rows(self.t_max, begin, end), scaled, unit,
            t_min, t_max,
        )  # fmt: skip
        known = self._known(origin, scaled, unit, begin, end)
        return Rays(origin, scaled, t_min, known), t_max, unit

    def is_limited(self, begin: int, end: int) -> bool:
        """Tell whether any ray of a slice has an upper limit."""
        if self.t_max is NO_LIMIT:
            return False
        return bool(_rows(self.t_max, begin, end).min(initial=np.inf) < np.inf)

    def _known(
        self, origin: FloatArray, direction: FloatArray, unit: FloatArray, begin: int, end: int
    ) -> FloatArray:
        """Return t and rounding of the points that rays leave from and go to (see `is_known`)."""
        if self.source is None and self.target is None and self.unseen is None:
            return np.empty((0, 6))
        known = np.empty((end - begin, 6))
        for column, record in ((0, self.source), (2, self.target)):
            if isinstance(record, np.ndarray):
                known[:, 0], known[:, 2] = record[begin:end, 0] / unit, record[begin:end, 1]
                known[:, 1], known[:, 3:] = 0.0, (PASSED, -1.0, np.nan)
                return known
            if record is None:
                known[:, column : column + 2] = 0.0, -1.0
                if column == 0:
                    known[:, 4:] = -1.0, np.nan
                continue
            kernels.name_points(
                origin,
                direction,
                np.ascontiguousarray(record.object_id[begin:end]),
                np.ascontiguousarray(record.position[begin:end]),
                self.reach,
                column,
                POINT_ROUNDING,
                FARTHEST,
                known,
            )
        if self.unseen is not None:
            known[:, 4] = self.unseen[begin:end]
        return known


def _rows(limits: FloatArray, begin: int, end: int) -> FloatArray:
    """Return the limits of a slice of rays; one that holds for all stays one."""
    return limits if len(limits) == 1 else limits[begin:end]


def make_batch(
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
    source: HitRecord | NamedPoints | FloatArray | None,
    target: HitRecord | NamedPoints | None,
    reach: FloatArray,
    pool: Pool,
    unseen: IntArray | None = None,
) -> Batch:
    """Return checked rays.

    ``origins``, ``directions``, ``t_min``, ``t_max``, ``source``, ``unseen``: as
    `Intersector.intersect` takes them; ``source`` also as `Batch` does.
    ``target``, HitRecord or NamedPoints of n rows: the points that rays lead to.
    ``reach`` (objects,): the ``rounding_reach`` of each surface.
    ``pool``: shares the work of checking.
    Raises ValueError or TypeError: As `Intersector.intersect` does.
    """
    origin, direction, shape = as_rays(origins, directions)
    origin, direction = locked(origin), locked(direction)
    n = len(origin)
    bad: list[tuple[int, IdArray, IdArray]] = []

    def check(begin: int, end: int) -> None:
        first_bad, n_bad = np.zeros((2, len(kernels.COMPLAINTS)), np.int64)
        rows = origin[begin:end], direction[begin:end]
        if kernels.check_rays(*rows, LARGEST, first_bad, n_bad):
            bad.append((begin, first_bad + begin, n_bad))

    pool.run(check, n)
    if bad:
        _refuse(origin, direction, bad)
    lowest, highest = as_limit(t_min, "t_min", shape), as_limit(t_max, "t_max", shape)
    leave = (
        source
        if isinstance(source, np.ndarray)
        else _checked_points(source, "source", n, len(reach))
    )
    reached = _checked_points(target, "target", n, len(reach))
    hidden = None if unseen is None else _checked_ids(unseen, "unseen", n, len(reach))
    return Batch(origin, direction, lowest, highest, leave, reached, reach, hidden)


def as_rays(
    origins: ArrayLike, directions: ArrayLike
) -> tuple[FloatArray, FloatArray, tuple[int, ...]]:
    """Return origins (n, 3), directions (n, 3) and the shape of their batch: (n,) or (h, w).

    A single vector is broadcast against a batch of the other.

    Raises TypeError or ValueError if the arrays are not real, or the shapes do not match.
    """
    origin, direction = _vectors(origins, "origins"), _vectors(directions, "directions")
    shape, other = origin.shape[:-1], direction.shape[:-1]
    origin, direction = origin.reshape(-1, 3), direction.reshape(-1, 3)
    if len(origin) == 1 and len(direction) != 1:
        origin, shape = np.repeat(origin, len(direction), axis=0), other
    elif len(direction) == 1 and len(origin) != 1:
        direction = np.repeat(direction, len(origin), axis=0)
    elif shape != other and not len(origin) == len(direction) == 1:
        raise ValueError(
            f"{len(origin)} origins but {len(direction)} directions, of shapes {(*shape, 3)} and "
            f"{(*other, 3)}: pass one of each per ray, in equal shapes"
        )
    return origin, direction, shape or (1,)


def as_limit(value: ArrayLike, name: str, shape: tuple[int, ...]) -> FloatArray:
    """Return one limit per ray, (n,) float64, for a batch of a shape; (1,): one for all.

    Raises ValueError or TypeError if ``value`` is neither one number nor one per ray, or holds nan;
    ``name`` is named.
    """
    if type(value) is float and value in _USUAL:
        return _USUAL[value]
    if value is None:
        raise TypeError(f"{name} is None: pass a number, or inf for no limit")
    array, n = as_floats(value, name), math.prod(shape)
    if array.shape not in {(), (1,), (n,), shape}:
        wanted = " or ".join(str(possible) for possible in dict.fromkeys([(n,), shape]))
        raise ValueError(
            f"{name} has shape {array.shape} for rays of shape {(*shape, 3)}: pass one number, or "
            f"one per ray, {wanted}"
        )
    if math.isnan(array.sum() if array.size == 1 else array.max(initial=0.0)):
        raise ValueError(f"{name} holds nan: pass numbers, or inf for no limit")
    return locked(array.reshape(-1))


def locked(array: FloatArray) -> FloatArray:
    """Return a view that cannot be written; if some could, numba would compile each kernel twice."""
    view = array.view()
    view.flags.writeable = False
    return view


NO_LIMIT = locked(np.array([np.inf]))
_USUAL = {0.0: locked(np.zeros(1)), np.inf: NO_LIMIT}


def _vectors(values: ArrayLike, name: str) -> FloatArray:
    array = as_floats(values, name)
    if array.ndim not in (1, 2, 3) or array.shape[-1] != 3:
        raise ValueError(
            f"{name} has shape {array.shape}: pass (n, 3), one vector (3,), or an image (h, w, 3)"
        )
    return array


def _refuse(
    origin: FloatArray, direction: FloatArray, bad: list[tuple[int, IdArray, IdArray]]
) -> None:
    n_bad = np.sum([part[2] for part in bad], axis=0)
    what = int(np.flatnonzero(n_bad)[0])
    is_origin = what < kernels.DIRECTION_NOT_FINITE
    name, rows = ("origins", origin) if is_origin else ("directions", direction)
    _, first_bad, _ = min((part for part in bad if part[2][what]), key=lambda part: part[0])
    i = int(first_bad[what])
    raise ValueError(
        f"{name}[{i}] = {rows[i].tolist()} {kernels.COMPLAINTS[what]} ({n_bad[what]} such ray(s)): "
        "leave such rays out"
    )


def _checked_points(
    record: HitRecord | NamedPoints | None, name: str, n: int, n_objects: int
) -> NamedPoints | None:
    """Convert a hit record that names points to the kernels' types."""
    if record is None:
        return None
    if not isinstance(record, HitRecord | NamedPoints):
        raise TypeError(
            f"{name} is {shown(record)}: pass hits of this intersector, for instance "
            f"{name}=hits[mask], or None"
        )
    ids = _checked_ids(record.object_id, name, n, n_objects)
    position = as_floats(record.position, f"{name} position")
    if position.shape != (n, 3):
        raise ValueError(f"{name} position has shape {position.shape} for {n} rays: pass ({n}, 3)")
    return NamedPoints(ids, position)


def _checked_ids(values: IntArray, name: str, n: int, n_objects: int) -> IntArray:
    """Return indices of objects, one per ray; -1 names none."""
    refuse_mask(values, name)
    try:
        ids = np.asarray(values)
    except ValueError:  # rows of different lengths
        ids = np.empty((0, 0), np.int32)
    if ids.shape != (n,):
        raise ValueError(
            f"{name} has shape {ids.shape} for {n} rays: pass one row per ray, ({n},), for instance "
            f"{name}=hits[mask]"
        )
    if ids.dtype.kind not in "iu":
        raise TypeError(f"{name} names objects by {ids.dtype}: pass whole numbers")
    if ids.size and not (ids.min() >= -1 and ids.max() < n_objects):
        bad = ids[(ids < -1) | (ids >= n_objects)][0]
        raise ValueError(
            f"{name} names object {bad} of {n_objects}: pass 0 to {n_objects - 1}, or -1 for none"
        )
    return np.ascontiguousarray(ids, dtype=np.int32)
