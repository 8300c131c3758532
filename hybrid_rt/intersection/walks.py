"""Walks of batches of rays through the trees of several kinds; see `kernels.search.bottoms`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.bottoms import trace_bottoms
from hybrid_rt.intersection.kernels.search.counters import COUNTER_NAMES, MOST_PIECES
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.single_rays import NOTHING_KNOWN, bottoms_of, new_ray, row_of_ray

# From so many trees on one walk is faster than one call after the other: a tree that a ray does not come to costs
# it 40 ns in a call of its own, one that it comes to 0.1 to 0.5 us in a walk.
MANY_TREES = 16


class Walks:
    """What traces slices of rays through the trees of ``kinds``, all at once; of no kinds if these are few.

    ``kinds``: those that may be walked through, with their numbers in ``kind_of`` (objects,) int32.
    """

    def __init__(self, kinds: Sequence[tuple[int, Any]], kind_of: IntArray) -> None:
        is_many = sum(kind.n_trees for _, kind in kinds) >= MANY_TREES
        self._numbered = [item for item in kinds if item[1].n_trees] if is_many else []
        self.kinds, self._kind_of = [kind for _, kind in self._numbered], kind_of
        self._idle: list[_Walk] = []  # one for each thread, when it needs one

    def __getstate__(self) -> dict[str, Any]:
        """Return what can be pickled: stored calls know addresses."""
        return {**vars(self), "_idle": []}

    def trace(self, rays: Rays, best: Nearest, any_hit: bool, work: FloatArray) -> None:
        """Lower ``best`` to the nearest roots; see `hybrid_rt.intersection.kind.Kind.trace`."""
        try:
            walk = self._idle.pop()
        except IndexError:
            walk = _Walk(self._numbered, self._kind_of)
        own = walk.work
        walk.ray.rays.known[:] = NOTHING_KNOWN
        trace_bottoms(walk.bottoms, rays, best, any_hit, walk.ray.rays, walk.ray.best, own)
        most = max(work[MOST_PIECES], own[MOST_PIECES])
        work += own
        work[MOST_PIECES], own[:] = most, 0.0
        self._idle.append(walk)


class _Walk:
    """The calls of all kinds, stored for a ray."""

    def __init__(self, kinds: Sequence[tuple[int, Any]], kind_of: IntArray) -> None:
        self.ray, self.work = new_ray(), np.zeros(len(COUNTER_NAMES))
        row = row_of_ray(self.ray, self.work)
        # What they hold has to live.
        self._calls = [kind.single(row, kind_of, number) for number, kind in kinds]
        self.bottoms = bottoms_of(self._calls)
