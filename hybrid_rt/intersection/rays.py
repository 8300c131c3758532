"""Checks what a caller passes as rays, and brings it into the form that the kernels take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.kernels import rays as kernels
from hybrid_rt.kernels.nearest import Rays
from hybrid_rt.records import FloatArray, HitRecord

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
    """Rays for the kernels; ``unit`` brings their t back into the caller's lengths."""

    rays: Rays
    t_max: FloatArray
    unit: FloatArray

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.t_max)


def make_batch(
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
    source: HitRecord | None,
    target: HitRecord | None,
    reach: FloatArray,
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
    scaled, unit = np.empty_like(direction), np.empty(n)
    first_bad, n_bad = np.full(4, -1), np.zeros(4, np.int64)
    kernels.scale_rays(origin, direction, scaled, unit, LARGEST, first_bad, n_bad)
    if n_bad.any():
        _refuse(origin, direction, first_bad, n_bad)
    lowest, highest = _limit(t_min, "t_min", n) / unit, _limit(t_max, "t_max", n) / unit
    known = _known(origin, scaled, source, target, reach)
    return Batch(Rays(origin, scaled, lowest, known), highest, unit)


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
    return np.ascontiguousarray(np.broadcast_to(array, (n,)))


def _refuse(origin: FloatArray, direction: FloatArray, first_bad: IdArray, n_bad: IdArray) -> None:
    what = int(np.flatnonzero(n_bad)[0])
    is_origin = what < kernels.DIRECTION_NOT_FINITE
    name, rows = ("origins", origin) if is_origin else ("directions", direction)
    i = int(first_bad[what])
    raise ValueError(
        f"{name}[{i}] = {rows[i].tolist()} {kernels.COMPLAINTS[what]} ({n_bad[what]} such ray(s)): "
        "leave such rays out"
    )


def _known(
    origin: FloatArray,
    direction: FloatArray,
    source: HitRecord | None,
    target: HitRecord | None,
    reach: FloatArray,
) -> FloatArray:
    """Return t and rounding of the points that a ray leaves from and goes to (see `is_known`)."""
    n = len(origin)
    if source is None and target is None:
        return np.empty((0, 4))
    known = np.empty((n, 4))
    for column, record, name in ((0, source, "source"), (2, target, "target")):
        if record is None:
            known[:, column : column + 2] = 0.0, -1.0
            continue
        if record.object_id.max(initial=-1) >= len(reach):
            raise ValueError(
                f"{name} names object {record.object_id.max()} of {len(reach)}: "
                "pass hits of this intersector"
            )
        if len(record) != n:
            raise ValueError(
                f"{name} has {len(record)} rows for {n} rays: pass one row per ray, "
                f"for instance {name}=hits[mask]"
            )
        kernels.name_points(
            origin,
            direction,
            np.ascontiguousarray(record.object_id),
            np.ascontiguousarray(record.position),
            reach,
            column,
            POINT_ROUNDING,
            FARTHEST,
            known,
        )
    return known
