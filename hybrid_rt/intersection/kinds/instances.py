"""Instances: rays are brought into the frames of places, where the kinds of their surfaces trace them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.intersection.kernels import instances as kernels
from hybrid_rt.intersection.kernels.instances import Pairs, Places, Walks
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.members import Members
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import (
    Finished,
    OneRow,
    Single,
    bottom,
    calls_of,
    finished_part,
    new_nearest,
    new_record,
    rows_of,
)
from hybrid_rt.intersection.margins import Probing, settle
from hybrid_rt.intersection.members import box_of, in_frames, tree_over
from hybrid_rt.intersection.ray_batch import locked
from hybrid_rt.primitives.instances import Instances
from meshing.kernels.stored_calls import StoredCall
from meshing.sheet import PatchSheet
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface

Make: TypeAlias = Callable[[list[Surface]], Any]

# A round costs as much as tracing some hundred rays: few rays come to several places in one, up to MOST.
FEW, MOST = 512, 8
# As fast as one place a leaf, with a sixth of the nodes.
LEAF_SIZE = 4
# By how much rounding moves a ray that starts near a place, of the largest coordinate there: that of
# `kernels.instances.ROUNDING`, over ways as long as the surfaces and their distance from 0.
NEAR = 2.0**-50


class _Model:
    """The surfaces of a place, in their own frame: the kinds that trace them.

    By what their frame rounds of a ray they are taken to be ``moved``, as images are.
    """

    def __init__(
        self, surfaces: Sequence[Surface], origin: FloatArray, moved: float, make: Make
    ) -> None:
        if origin.any():
            shift = np.eye(4)
            shift[:3, 3] = -origin
            surfaces = [surface.transformed(shift) for surface in surfaces]
        made = make([_moved_by(surface, moved) for surface in surfaces])
        self.kinds: list[Any] = [*made.direct, *made.curved]
        self._kind_of = made.kind_of
        self.first_patch = np.cumsum([0, *map(len, surfaces)])[:-1].astype(np.int64)

    def trace(self, rays: Rays, best: Nearest, any_hit: bool, work: FloatArray) -> None:
        for kind in self.kinds:
            kind.trace(rays, None, best, any_hit, work)

    def single(self, ray: OneRow) -> Single:
        calls = [kind.single(ray, self._kind_of, number) for number, kind in enumerate(self.kinds)]
        return Single(
            *([one for some in lists for one in some] for lists in zip(*calls, strict=True))
        )

    def finish(self, rays: Rays, best: Nearest, out: Finished, work: FloatArray) -> None:
        for number, kind in enumerate(self.kinds):
            kind.finish(rays, best, self._kind_of, number, out)
        for number, kind in enumerate(self.kinds):
            if isinstance(kind, Probing):
                settle(kind, number, self._kind_of, rays, best, out, work)


class InstanceKind:
    """First hits on surfaces in many places.

    ``members``, sequence of (object id, Instances).
    ``make``: checks surfaces, and returns their `hybrid_rt.intersection.kinds.registry.Kinds`.
    """

    def __init__(self, members: Sequence[tuple[int, Instances]], make: Make) -> None:
        numbers: dict[tuple[object, ...], int] = {}
        self.models: list[_Model] = []
        model: list[int] = []
        origin, box = list[FloatArray](), list[FloatArray]()
        for _, item in members:
            origin.append(_origin_of(item.box))
            box.append(item.box - origin[-1])
            moved = NEAR * float(np.abs(box[-1]).max()) + item.moved / float(item.scale.min())
            key = (moved, *map(id, item.surfaces))
            if key not in numbers:
                numbers[key] = len(self.models)
                self.models.append(_Model(item.surfaces, origin[-1], moved, make))
            model.append(numbers[key])
        counts = [len(item.matrices) for _, item in members]
        matrices = [item.matrices for _, item in members]
        boxes = np.concatenate([item.boxes for _, item in members])
        low, high = np.swapaxes(box, 0, 1)
        self.trees = [_tree_of(boxes, rows) for rows in in_frames(boxes)]
        self.places = Places(
            matrix=matrices[0] if len(matrices) == 1 else np.concatenate(matrices),
            block=np.repeat(np.arange(len(members), dtype=np.int32), counts),
            first=np.cumsum([0, *counts[:-1]]).astype(np.int64),
            object_id=np.array([i for i, _ in members], np.int32),
            origin=np.array(origin),
            box=np.ascontiguousarray(
                np.stack([0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low], axis=1)
            ),
            n_patches=np.array([item.n_patches for _, item in members], np.int64),
            model=np.array(model, np.int32),
        )

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        del kind_of, kind
        rays, best, out, work = ray
        pairs, found = _new_pairs(1, True), new_nearest(np.empty(1))
        local = finished_part(new_record(1))
        inside = OneRow(_rays_of(pairs), found, local, work)
        calls = [model.single(inside) for model in self.models]
        call, first_call = calls_of(calls)
        one = kernels.OnePlace(
            pairs, found, local, np.empty(1, np.int32), np.empty(1, np.int32), np.zeros(1, np.int64),
            call, first_call, np.concatenate([model.first_patch for model in self.models]),
            np.cumsum([0, *(len(model.first_patch) for model in self.models)]),
        )  # fmt: skip

        def in_tree(members: Members, any_hit: bool) -> list[StoredCall]:
            return [
                StoredCall(
                    kernels.trace_one, self.places, members, rays, best, any_hit,
                    _new_walks(1, members.tree.stack), one, work,
                )
            ]  # fmt: skip

        describe = StoredCall(kernels.describe_one, self.places, rays, best, one, out)
        describe.keep(calls)
        bottoms = [
            bottom(box_of(members.tree, *members[2:]), partial(in_tree, members))
            for members in self.trees
        ]
        return Single(bottoms, [describe])

    # Slices remember what they hit.
    n_trees = 0

    def for_slice(self, n: int) -> InstanceSlice:
        """Return what traces one slice of n rays: it remembers what they hit."""
        return InstanceSlice(self, n)

    def check_places(self, hits: HitRecord, name: str) -> None:
        """Refuse hits in places that there are not."""
        places, most = self.places, np.iinfo(np.int64).max
        n = max(int(places.object_id.max()), int(hits.object_id.max(initial=0))) + 2
        counts = np.diff(places.first, append=len(places.block))
        limit = np.full(n, most)
        limit[places.object_id] = counts * places.n_patches
        bad = np.flatnonzero(hits.patch_id >= limit[hits.object_id])  # of a miss the last
        if len(bad):
            own = int(hits.object_id[bad[0]])
            row = int(np.flatnonzero(places.object_id == own)[0])
            raise ValueError(
                f"{name} names place {hits.patch_id[bad[0]] // places.n_patches[row]} of surface {own}, which has "
                f"{counts[row]}: pass hits of this intersector"
            )

    def name_instances(self, hits: HitRecord) -> None:
        """Fill ``instance_id`` of the rows that hit instances."""
        row = np.full(
            max(int(self.places.object_id.max()), int(hits.object_id.max(initial=0))) + 2, -1
        )
        row[self.places.object_id] = np.arange(len(self.places.object_id))
        block = row[hits.object_id]  # of a miss the last
        rows = np.flatnonzero(block >= 0)
        hits.instance_id[rows] = hits.patch_id[rows] // self.places.n_patches[block[rows]]


class InstanceSlice:
    """The kind of instances for one slice of rays; see `InstanceKind.for_slice`."""

    def __init__(self, kind: InstanceKind, n: int) -> None:
        self._kind = kind
        self._member, self._primitive = np.empty(n, np.int32), np.empty(n, np.int32)
        self._work = np.empty(0)

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the first hits in all places."""
        del guess
        self._work = work
        for members in self._kind.trees:
            self._walk(members, rays, best, any_hit, work)

    def _walk(
        self, members: Any, rays: Rays, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Walk through one tree: in each round each ray comes to its next places, and is traced there."""
        n, places = len(best.t), self._kind.places
        room = members.tree.stack
        walks = _new_walks(n, room)
        active, pairs = np.arange(n), _new_pairs(max(n, FEW), len(rays.known) > 0)
        n_active = n
        while n_active:
            most = min(max(FEW // n_active, 1), MOST)
            n_active, n_pairs, nodes = kernels.next_places(
                places, members, rays, best, any_hit, walks, active, n_active, most, pairs
            )
            work[NODES] += nodes
            for number, some in self._by_model(rows_of(pairs, 0, n_pairs)):
                found = new_nearest(some.t)
                self._kind.models[number].trace(_rays_of(some), found, any_hit, work)
                kernels.keep_nearest(places, some, found, rays, best, self._member, self._primitive)

    def _by_model(self, pairs: Pairs) -> list[tuple[int, Pairs]]:
        """Return the rows of each model."""
        if not len(pairs.row):
            return []
        if len(self._kind.models) == 1:
            return [(0, pairs)]
        places = self._kind.places
        model = places.model[places.block[pairs.place]]
        order = np.argsort(model, kind="stable")
        pairs, numbers = (
            Pairs(*(x[order] if len(x) else x for x in pairs)),
            np.arange(model.max() + 2),
        )
        ends = np.searchsorted(model[order], numbers)
        return [
            (int(k), rows_of(pairs, int(ends[k]), int(ends[k + 1])))
            for k in numbers[:-1][np.diff(ends) > 0]
        ]

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits in places, and decide about those that are `SUSPECT`."""
        rows = np.flatnonzero(best.object_id >= 0)
        rows = rows[kind_of[best.object_id[rows]] == kind]
        if not len(rows):
            return
        places = self._kind.places
        model = places.model[places.block[best.primitive[rows]]]
        for number in np.unique(model):
            self._describe(self._kind.models[number], rows[model == number], rays, best, out)

    def _describe(
        self, model: _Model, rows: NDArray[np.int64], rays: Rays, best: Nearest, out: Finished
    ) -> None:
        m, places = len(rows), self._kind.places
        pairs, found = _new_pairs(m, len(rays.known) > 0), new_nearest(np.empty(m))
        kernels.enter_again(places, rays, best, self._member, self._primitive, rows, pairs, found)
        local = finished_part(new_record(m))
        model.finish(_rays_of(pairs), found, local, self._work)
        kernels.leave_places(places, pairs, found, model.first_patch, local, rays, best, out)


def _origin_of(box: FloatArray) -> FloatArray:
    """Return the origin of the frame of surfaces: 0 along axes on which they are near 0.

    Elsewhere a number of few bits, by which they are shifted without rounding, or with one of their size.
    """
    middle, size = 0.5 * box[0] + 0.5 * box[1], float(np.linalg.norm(box[1] - box[0]))
    step = 2.0 ** np.floor(np.log2(size))
    return np.where(np.abs(middle) > size, np.round(middle / step) * step, 0.0)


def _tree_of(boxes: FloatArray, rows: NDArray[np.int64]) -> Members:
    """Return a tree over some of the boxes, whose primitives are their rows."""
    members = tree_over(boxes[rows], 0, LEAF_SIZE)
    order = rows[members.tree.order].astype(np.int32)
    return members._replace(tree=members.tree._replace(order=order))


def _new_walks(n: int, room: int) -> Walks:
    return Walks(
        np.full(n, -1, np.int32), np.zeros(n, np.int32), np.zeros(n, np.int32),
        np.empty((n, room), np.int32), np.empty((n, room), np.uint32),
    )  # fmt: skip


def _new_pairs(n: int, has_known: bool) -> Pairs:
    return Pairs(
        row=np.empty(n, np.int64),
        place=np.empty(n, np.int32),
        unit=np.empty(n),
        origin=np.empty((n, 3)),
        direction=np.empty((n, 3)),
        t_min=np.empty(n),
        t=np.empty(n),
        known=np.empty((n if has_known else 0, 6)),
    )


def _rays_of(pairs: Pairs) -> Rays:
    return Rays(locked(pairs.origin), pairs.direction, pairs.t_min, pairs.known)


def _moved_by(surface: Surface, distance: float) -> Any:
    """Return a surface that is taken to be moved by so much more."""
    # Not by `copy.copy`: where a surface is pickled in parts that would check it again.
    image: Any = object.__new__(type(surface))
    image.__dict__.update(surface.__dict__)
    if isinstance(image, TrimmedSurface):
        image.surface = _moved_by(image.surface, distance)
    elif isinstance(image, PatchSheet):
        image._pieces = _moved_by(image._pieces, distance)
    else:
        image.moved += distance
    return image
