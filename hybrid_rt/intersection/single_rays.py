"""What kernels trace single rays with: the tables and calls of all kinds of a scene, and a ray's memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.box import box_table
from hybrid_rt.intersection.kernels.plane import plane_table
from hybrid_rt.intersection.kernels.rectangle import rectangle_table
from hybrid_rt.intersection.kernels.search.counters import COUNTER_NAMES
from hybrid_rt.intersection.kernels.search.nearest import Rays
from hybrid_rt.intersection.kernels.search.rays import Record
from hybrid_rt.intersection.kernels.single_rays import OneRay, SingleRays
from hybrid_rt.intersection.kernels.sphere import sphere_table
from hybrid_rt.intersection.kind import (
    OneRow,
    Single,
    calls_of,
    finished_part,
    new_nearest,
    new_record,
)
from hybrid_rt.intersection.ray_batch import FARTHEST, POINT_ROUNDING, locked
from meshing.surface import Surface, box_around

# Tables of kinds that are asked without a call, in the order of their numbers.
ALONE: dict[str, Callable[..., Any]] = {
    "spheres": sphere_table,
    "rectangles": rectangle_table,
    "planes": plane_table,
    "boxes": box_table,
}
# The box of a kind is wider by this part of its size; the band is far narrower.
WIDER = 2.0**-20


class SingleRayTracer:
    """First hits and shadows of one ray at a time, by kernels that take its ``tables`` and ``ray``.

    ``kind_of`` (objects,) int32: index of each object's kind; ``reach`` (objects,): the ``rounding_reach`` of each.
    ``calls_nothing``: all surfaces are closed forms that are asked without a call.
    ``work``: what was counted, see `hybrid_rt.intersection.kernels.search.counters.COUNTER_NAMES`.
    """

    def __init__(
        self,
        kinds: Sequence[Any],
        kind_of: IntArray,
        surfaces: Sequence[Surface],
        reach: FloatArray,
    ) -> None:
        self.ray, self.work = new_ray(), np.zeros(len(COUNTER_NAMES))
        rays = self.ray.rays
        row = OneRow(
            rays._replace(origin=locked(rays.origin)), self.ray.best, self.ray.out, self.work
        )
        tables = {name: make([], np.zeros(0, np.int32)) for name, make in ALONE.items()}
        row_of, number_of = np.zeros(kind_of.size, np.int64), np.zeros(kind_of.size, np.int64)
        self._others: list[Single] = []  # what they hold has to live
        boxes: list[FloatArray] = []
        for k, kind in enumerate(kinds):
            name = getattr(kind, "alone", "")
            if name:
                tables[name] = kind.table
                row_of[kind.table.object_id] = np.arange(kind.table.object_id.size)
                number_of[kind_of == k] = list(ALONE).index(name)
            else:
                number_of[kind_of == k] = len(ALONE) + len(self._others)
                self._others.append(kind.single(row, kind_of, k))
                boxes.append(
                    _box_of([s for s, of in zip(surfaces, kind_of, strict=True) if of == k])
                )
        self.calls_nothing = not self._others
        call, first_call = calls_of(self._others)
        self.tables = SingleRays(
            **tables,
            kind_of=number_of,
            row_of=row_of,
            call=call,
            first_call=first_call,
            box=np.array(boxes).reshape(-1, 2, 3),
            reach=reach,
            rounding=POINT_ROUNDING,
            most=FARTHEST,
        )


def no_single_rays() -> SingleRayTracer:
    """Return a tracer of no surfaces."""
    return SingleRayTracer([], np.zeros(0, np.int32), [], np.zeros(0))


def new_ray() -> OneRay:
    """Allocate what one ray is traced with."""
    record = new_record(1)
    return OneRay(
        rays=Rays(np.empty((1, 3)), np.empty((1, 3)), np.zeros(1), np.empty((1, 6))),
        best=new_nearest(np.empty(1)),
        record=Record(*(getattr(record, name) for name in Record._fields)),
        out=finished_part(record),
    )


def _box_of(surfaces: Sequence[Surface]) -> FloatArray:
    """Return what surrounds some surfaces by a distance, (2, 3)."""
    bounds = np.array([surface.bounds for surface in surfaces])
    low, high = box_around(bounds)
    away = WIDER * float(np.linalg.norm(high - low)) + 2.0 * max(s.moved for s in surfaces)
    away += POINT_ROUNDING * float(np.abs(bounds).max())
    return np.array([low - away, high + away])
