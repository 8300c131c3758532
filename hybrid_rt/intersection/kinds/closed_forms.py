"""Kinds without a coarse stage: a table, a kernel that traces it, a kernel that describes hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.tree import new_stack
from hybrid_rt.intersection.kind import Finished, OneRow, Single, bottom
from hybrid_rt.intersection.members import around, box_of, in_order
from hybrid_rt.intersection.trims import trim_of_single, trimmed_of, whole_of
from meshing.kernels.stored_calls import StoredCall

if TYPE_CHECKING:
    from hybrid_rt.intersection.kernels.search.members import Members


# Roots on trimmed surfaces take longer, so what a tree leaves out is worth more: of 113 and 130 trimmed rectangles
# two parts of NIST are asked in 0.37 and 0.68 us a ray, without a tree in 0.58 and 1.01.
MANY_TRIMMED = 64


class ClosedForm:
    """First hits on a kind without a coarse stage; many members are put into a tree.

    Parameters
    ----------
    members : sequence of (object id, surface)
        All of them trimmed, or none; else TypeError.
    make_table : callable
        Makes the table of a list of surfaces and their object ids (k,) int32, and of the loops
        (``trim``) if they are trimmed.
    trace : kernel of table, number of its rows to ask, `Rays`, `Nearest` and whether any hit will do
    finish : kernel of table, `Rays`, `Nearest`, row of each object or -1, and `Finished`
    trace_tree : kernel of table, `Members`, `Rays`, `Nearest`, whether any hit will do, `Stack` and
        counters; None: the surfaces are unbounded
    many : int
        Number of surfaces from which on a tree is used.
    alone : str
        The field of `hybrid_rt.intersection.kernels.single_rays.SingleRays` that takes the table of
        surfaces that are neither trimmed nor in a tree; "": single rays call ``trace``.
    """

    def __init__(
        self,
        members: Sequence[tuple[int, Any]],
        make_table: Callable[..., Any],
        trace: Callable[..., None],
        finish: Callable[..., None],
        trace_tree: Callable[..., None] | None = None,
        many: int = 0,
        *,
        alone: str = "",
    ) -> None:
        self._trace, self._finish, self._trace_tree = trace, finish, trace_tree
        trimmed, whole = trimmed_of(members), [surface for _, surface in whole_of(members)]
        object_id = np.array([i for i, _ in members], np.int32)
        order, self._n_plain = np.arange(len(members)), len(members)
        self._in_trees: list[Members] = []
        if trace_tree is not None:
            many = min(many, MANY_TRIMMED) if trimmed else many
            order, self._n_plain, self._in_trees = in_order(whole, many)
        self._plain_box = around([whole[k] for k in order[: self._n_plain]])
        if trimmed:
            make_table = partial(make_table, trim=trim_of_single([trimmed[k] for k in order]))
        self.table = make_table([whole[k] for k in order], object_id[order])
        self._row_of = np.full(int(object_id.max()) + 1, -1, np.int64)
        self._row_of[object_id[order]] = np.arange(len(object_id))
        self.alone = "" if trimmed or self._in_trees else alone

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots; ``guess`` is not used."""
        del guess
        if self._n_plain:
            self._trace(self.table, self._n_plain, rays, best, any_hit)
        for members in self._in_trees:
            assert self._trace_tree is not None
            stack = new_stack(members.tree)
            self._trace_tree(self.table, members, rays, best, any_hit, stack, work)

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits on this kind."""
        self._finish(self.table, rays, best, self._rows(kind_of, kind), out)

    def _rows(self, kind_of: IntArray, kind: int) -> NDArray[np.int64]:
        """Return the row of each object in the table, -1 for those of other kinds."""
        if len(self._row_of) != len(kind_of):
            row_of = np.full(len(kind_of), -1, np.int64)
            row_of[: len(self._row_of)] = self._row_of
            row_of[kind_of != kind] = -1
            self._row_of = row_of
        return self._row_of

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        rays, best, out, work = ray

        def plain(any_hit: bool) -> list[StoredCall]:
            return [StoredCall(self._trace, self.table, self._n_plain, rays, best, any_hit)]

        def in_tree(members: Members, any_hit: bool) -> list[StoredCall]:
            stack = new_stack(members.tree)
            return [
                StoredCall(self._trace_tree, self.table, members, rays, best, any_hit, stack, work)
            ]

        bottoms = [bottom(self._plain_box, plain)] if self._n_plain else []
        bottoms += [
            bottom(box_of(members.tree, *members[2:]), partial(in_tree, members))
            for members in self._in_trees
        ]
        finish = StoredCall(self._finish, self.table, rays, best, self._rows(kind_of, kind), out)
        return Single(bottoms, [finish])

    @property
    def n_trees(self) -> int:
        """Number of trees."""
        return len(self._in_trees)
