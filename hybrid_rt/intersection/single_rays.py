"""What kernels trace single rays with: the tables and calls of all kinds of a scene, and a ray's memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.box import box_table
from hybrid_rt.intersection.kernels.plane import plane_table
from hybrid_rt.intersection.kernels.rectangle import rectangle_table
from hybrid_rt.intersection.kernels.search.bottoms import Bottoms
from hybrid_rt.intersection.kernels.search.counters import COUNTER_NAMES
from hybrid_rt.intersection.kernels.search.nearest import Rays
from hybrid_rt.intersection.kernels.search.rays import Record
from hybrid_rt.intersection.kernels.search.tree import new_stack
from hybrid_rt.intersection.kernels.single_rays import OneRay, SingleRays
from hybrid_rt.intersection.kernels.sphere import sphere_table
from hybrid_rt.intersection.kind import (
    OneRow,
    Single,
    addresses_of,
    finished_part,
    new_nearest,
    new_record,
)
from hybrid_rt.intersection.members import tree_over
from hybrid_rt.intersection.ray_batch import FARTHEST, POINT_ROUNDING, locked

# Tables of kinds that are asked without a call, in the order of their numbers.
ALONE: dict[str, Callable[..., Any]] = {
    "spheres": sphere_table,
    "rectangles": rectangle_table,
    "planes": plane_table,
    "boxes": box_table,
}
# A box is wider by this part of its size; the band is far narrower.
WIDER = 2.0**-20
# `Rays.known` of a ray that names no point.
NOTHING_KNOWN = (0.0, -1.0, 0.0, -1.0, -1.0, np.nan)


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
        reach: FloatArray,
    ) -> None:
        self.ray, self.work = new_ray(), np.zeros(len(COUNTER_NAMES))
        row = row_of_ray(self.ray, self.work)
        tables = {name: make([], np.zeros(0, np.int32)) for name, make in ALONE.items()}
        row_of, number_of = np.zeros(kind_of.size, np.int64), np.zeros(kind_of.size, np.int64)
        self._others: list[Single] = []  # what they hold has to live
        for k, kind in enumerate(kinds):
            name = getattr(kind, "alone", "")
            if name:
                tables[name] = kind.table
                row_of[kind.table.object_id] = np.arange(kind.table.object_id.size)
                number_of[kind_of == k] = list(ALONE).index(name)
            else:
                number_of[kind_of == k] = len(ALONE) + len(self._others)
                self._others.append(kind.single(row, kind_of, k))
        self.calls_nothing = not self._others
        call, first_call = addresses_of([single.describe for single in self._others])
        self.tables = SingleRays(
            **tables,
            kind_of=number_of,
            row_of=row_of,
            call=call,
            first_call=first_call,
            bottoms=bottoms_of(self._others),
            reach=reach,
            rounding=POINT_ROUNDING,
            most=FARTHEST,
        )


def no_single_rays() -> SingleRayTracer:
    """Return a tracer of no surfaces."""
    return SingleRayTracer([], np.zeros(0, np.int32), np.zeros(0))


def new_ray() -> OneRay:
    """Allocate what one ray is traced with."""
    record = new_record(1)
    return OneRay(
        rays=Rays(np.empty((1, 3)), np.empty((1, 3)), np.zeros(1), np.empty((1, 6))),
        best=new_nearest(np.empty(1)),
        record=Record(*(getattr(record, name) for name in Record._fields)),
        out=finished_part(record),
    )


def row_of_ray(ray: OneRay, work: FloatArray) -> OneRow:
    """Return a ray's memory as kinds take it, and where its work is counted."""
    return OneRow(ray.rays._replace(origin=locked(ray.rays.origin)), ray.best, ray.out, work)


def bottoms_of(kinds: Sequence[Single]) -> Bottoms:
    """Return what is in all kinds, which have to live as long."""
    found = [one for single in kinds for one in single.bottoms]
    box = np.array([one.box for one in found]).reshape(-1, 2, 3)
    away = WIDER * np.linalg.norm(box[:, 1] - box[:, 0], axis=1)
    away += POINT_ROUNDING * np.abs(box).max(axis=(1, 2), initial=0.0)
    box += away[:, None, None] * np.array([-1.0, 1.0])[:, None]
    lists = [some for calls in zip(*found, strict=True) for some in calls][len(found) :]
    call, ends = addresses_of(lists)
    # A tree of nothing cannot be built.
    members = tree_over(box if found else np.array([[(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)]]), 0, 1)
    return Bottoms(
        box=box,
        call=call,
        begin=np.stack([ends[: len(found) + 1], ends[len(found) :]]),
        members=members,
        stack=new_stack(members.tree),
    )
