"""Kinds without a coarse stage: a table, a kernel that traces it, a kernel that describes hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import Finished
from hybrid_rt.intersection.members import in_order
from hybrid_rt.intersection.ray_batch import FARTHEST, POINT_ROUNDING
from hybrid_rt.intersection.trims import trim_of_single, trimmed_of, whole_of

if TYPE_CHECKING:
    from hybrid_rt.intersection.kernels.closed_forms import ClosedForms
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
        The field of `hybrid_rt.intersection.kernels.closed_forms.ClosedForms` that takes the table of
        surfaces that are neither trimmed nor in a tree; "": single rays cannot be traced.
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
            from hybrid_rt.intersection.kernels.search.tree import new_stack

            assert self._trace_tree is not None
            stack = new_stack(members.tree)
            self._trace_tree(self.table, members, rays, best, any_hit, stack, work)

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits on this kind."""
        if len(self._row_of) != len(kind_of):
            row_of = np.full(len(kind_of), -1, np.int64)
            row_of[: len(self._row_of)] = self._row_of
            row_of[kind_of != kind] = -1
            self._row_of = row_of
        self._finish(self.table, rays, best, self._row_of, out)


def closed_forms(kinds: Sequence[Any], kind_of: IntArray, reach: FloatArray) -> ClosedForms | None:
    """Return the tables by which single rays are traced; None if a kind needs batches.

    ``kind_of`` (objects,) int32: index of each object's kind.
    ``reach`` (objects,): the ``rounding_reach`` of each surface.
    """
    names = [getattr(kind, "alone", "") for kind in kinds]
    if not all(names):
        return None
    from hybrid_rt.intersection.kernels import closed_forms as kernels
    from hybrid_rt.intersection.kernels.box import box_table
    from hybrid_rt.intersection.kernels.plane import plane_table
    from hybrid_rt.intersection.kernels.rectangle import rectangle_table
    from hybrid_rt.intersection.kernels.sphere import sphere_table

    make: dict[str, Callable[..., Any]] = {
        "spheres": sphere_table,
        "rectangles": rectangle_table,
        "planes": plane_table,
        "boxes": box_table,
    }
    tables = {name: make_table([], np.zeros(0, np.int32)) for name, make_table in make.items()}
    row_of, number_of = np.zeros(kind_of.size, np.int64), np.zeros(kind_of.size, np.int64)
    for name, kind in zip(names, kinds, strict=True):
        tables[name] = kind.table
        row_of[kind.table.object_id] = np.arange(kind.table.object_id.size)
        number_of[kind.table.object_id] = kernels.ClosedForms._fields.index(name)
    return kernels.ClosedForms(
        **tables,
        kind_of=number_of,
        row_of=row_of,
        reach=reach,
        rounding=POINT_ROUNDING,
        most=FARTHEST,
    )
