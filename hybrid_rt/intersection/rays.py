"""Checks what a caller passes as rays, and brings it into the form that the kernels take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.intersection.pool import Pool
from hybrid_rt.kernels import rays as kernels
from hybrid_rt.kernels.nearest import Rays
from hybrid_rt.records import FloatArray, HitRecord, IntArray, NamedPoints

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
    """Rays as a caller gave them, checked; `rows` brings a slice into the kernels' form."""

    origin: FloatArray
    direction: FloatArray
    t_min: FloatArray
    t_max: FloatArray
    source: HitRecord | NamedPoints | None
    target: HitRecord | NamedPoints | None
    reach: FloatArray
    unseen: IntArray | None

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.origin)

    def rows(self, begin: int, end: int) -> tuple[Rays, FloatArray, FloatArray]:
        """Return rays, their t_max, and the units that bring their t into the caller's lengths."""
        n = end - begin
        origin, direction = self.origin[begin:end], self.direction[begin:end]
        scaled, unit = np.empty((n, 3)), np.empty(n)
        t_min, t_max = np.empty(n), np.empty(n)
        kernels.scale_rays(
            direction, self.t_min[begin:end], self.t_max[begin:end], scaled, unit, t_min, t_max
        )
        known = self._known(origin, scaled, begin, end)
        return Rays(origin, scaled, t_min, known), t_max, unit

    def _known(self, origin: FloatArray, direction: FloatArray, begin: int, end: int) -> FloatArray:
        """Return t and rounding of the points that rays leave from and go to (see `is_known`)."""
        if self.source is None and self.target is None and self.unseen is None:
            return np.empty((0, 4))
        known = np.empty((end - begin, 4 if self.unseen is None else 5))
        if self.unseen is not None:
            known[:, 4] = self.unseen[begin:end]
        for column, record in ((0, self.source), (2, self.target)):
            if record is None:
                known[:, column : column + 2] = 0.0, -1.0
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
        return known


def make_batch(
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
    source: HitRecord | NamedPoints | None,
    target: HitRecord | NamedPoints | None,
    reach: FloatArray,
    pool: Pool,
    unseen: IntArray | None = None,
) -> Batch:
    """Return checked rays; see `Intersector.intersect` for the forms that are taken.

    ``reach`` (objects,) is the largest number from which each object's points are computed: their
    rounding is relative to it.
    """
    origin, direction = _vectors(origins, "origins"), _vectors(directions, "directions")
    if len(origin) == 1 and len(direction) > 1:
        origin = np.repeat(origin, len(direction), axis=0)
    if len(direction) == 1 and len(origin) > 1:
        direction = np.repeat(direction, len(origin), axis=0)
    n = len(origin)
    if len(direction) != n:
        raise ValueError(f"{n} origins but {len(direction)} directions: pass one of each per ray")
    bad: list[tuple[int, IdArray, IdArray]] = []

    def check(begin: int, end: int) -> None:
        first_bad, n_bad = np.full(4, -1), np.zeros(4, np.int64)
        kernels.check_rays(origin[begin:end], direction[begin:end], LARGEST, first_bad, n_bad)
        if n_bad.any():
            bad.append((begin, first_bad + begin, n_bad))

    pool.run(check, n)
    if bad:
        _refuse(origin, direction, bad)
    lowest, highest = _limit(t_min, "t_min", n), _limit(t_max, "t_max", n)
    for record, name in ((source, "source"), (target, "target")):
        _check_points(record, name, n, len(reach))
    return Batch(origin, direction, lowest, highest, source, target, reach, unseen)


def _vectors(values: ArrayLike, name: str) -> FloatArray:
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        array = np.asarray(values, dtype=np.float64)
    if array.ndim not in (1, 2, 3) or array.shape[-1] != 3:
        raise ValueError(
            f"{name} has shape {array.shape}: pass (n, 3), one vector (3,), or an image (h, w, 3)"
        )
    return np.ascontiguousarray(array.reshape(-1, 3), dtype=np.float64)


def _limit(value: ArrayLike, name: str, n: int) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 2 and array.size == n:
        array = array.reshape(n)
    if array.shape not in ((), (1,), (n,)):
        raise ValueError(f"{name} has shape {array.shape}: pass one number, or one per ray ({n},)")
    if np.isnan(array).any():
        raise ValueError(f"{name} holds nan: pass a number, or inf for no limit")
    return np.broadcast_to(array, (n,))


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


def _check_points(
    record: HitRecord | NamedPoints | None, name: str, n: int, n_objects: int
) -> None:
    if record is None:
        return
    if record.object_id.max(initial=-1) >= n_objects:
        raise ValueError(
            f"{name} names object {record.object_id.max()} of {n_objects}: "
            "pass hits of this intersector"
        )
    if len(record) != n:
        raise ValueError(
            f"{name} has {len(record)} rows for {n} rays: pass one row per ray, "
            f"for instance {name}=hits[mask]"
        )
