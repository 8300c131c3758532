"""Kinds without a coarse stage: a table, a kernel that traces it, a kernel that describes hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import Finished
from hybrid_rt.intersection.ray_batch import FARTHEST, POINT_ROUNDING
from hybrid_rt.intersection.trims import trim_of_single, trimmed_of, whole_of

if TYPE_CHECKING:
    from hybrid_rt.intersection.kernels.closed_forms import ClosedForms


class ClosedForm:
    """First hits on a kind without a coarse stage.

    Parameters
    ----------
    members : sequence of (object id, surface)
    make_table : callable
        Makes the table of a list of surfaces and their object ids (k,) int32.
    trace : kernel of table, `Rays`, `Nearest` and whether any hit will do
    finish : kernel of table, `Rays`, `Nearest`, row of each object or -1, and `Finished`
    alone : str
        The field of `hybrid_rt.intersection.kernels.closed_forms.ClosedForms` that takes the table;
        "": single rays cannot be traced.
    """

    def __init__(
        self,
        members: Sequence[tuple[int, Any]],
        make_table: Callable[[list[Any], IntArray], Any],
        trace: Callable[..., None],
        finish: Callable[..., None],
        alone: str = "",
    ) -> None:
        self.alone = alone
        self._trace, self._finish = trace, finish
        object_id = np.array([i for i, _ in members], np.int32)
        self.table = make_table([surface for _, surface in members], object_id)
        self._row_of = np.full(int(object_id.max()) + 1, -1, np.int64)
        self._row_of[object_id] = np.arange(len(object_id))

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots; ``guess`` and ``work`` are not used."""
        del guess, work
        self._trace(self.table, rays, best, any_hit)

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


# From so many spheres on a tree is faster than asking all of them.
MANY = 8
# Spheres so much larger than the usual one would fill the tree's boxes: they are asked by all rays.
# A room may have more walls than things in it, so the usual one is not the median.
LARGE, USUAL = 32.0, 0.25
LEAF_SIZE = 2


def asked_by_all(radius: FloatArray, many: int = MANY) -> BoolArray:
    """Tell which spheres are asked by all rays, (n,) bool; the others go into a tree."""
    is_large: BoolArray = radius > LARGE * np.quantile(radius, USUAL)
    if np.count_nonzero(~is_large) < many:
        is_large[:] = True
    return is_large


class Spheres(ClosedForm):
    """First hits on spheres; many of them are put into a bounding volume hierarchy.

    Parameters
    ----------
    members : sequence of (object id, Sphere or TrimmedSurface of one)
        All of them trimmed, or none; else TypeError.
    many : int
        Number of spheres from which on the hierarchy is used.
    """

    def __init__(self, members: Sequence[tuple[int, Any]], many: int = MANY) -> None:
        from hybrid_rt.intersection.kernels.sphere import (
            finish_spheres,
            sphere_table,
            trace_spheres,
        )

        trimmed, members = trimmed_of(members), whole_of(members)
        radius = np.array([sphere.radius for _, sphere in members])
        is_large = asked_by_all(radius, many)
        order = np.argsort(~is_large, kind="stable")
        members = [members[k] for k in order]
        make_table: Callable[..., Any] = sphere_table
        if trimmed:
            make_table = partial(sphere_table, trim=trim_of_single([trimmed[k] for k in order]))
        alone = "" if trimmed else "spheres"
        super().__init__(members, make_table, trace_spheres, finish_spheres, alone)
        self._n_plain = int(np.count_nonzero(is_large))
        self._tree: Any = None
        if self._n_plain < len(members):
            self._build_tree()
            self.alone = ""

    def _build_tree(self) -> None:
        from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree

        center = self.table.center[self._n_plain :]
        radius = self.table.radius[self._n_plain :, None]
        low, high = (center - radius).min(axis=0), (center + radius).max(axis=0)
        self._middle = 0.5 * low + 0.5 * high
        self._to_frame = float(2.0 ** -np.ceil(np.log2(np.linalg.norm(0.5 * high - 0.5 * low))))
        at, size = (center - self._middle) * self._to_frame, radius * self._to_frame
        self._tree = Tree(*build_tree(at - size, at + size, LEAF_SIZE))

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the nearest roots."""
        del guess
        if self._n_plain:
            self._trace(self.table, self._n_plain, rays, best, any_hit)
        if self._tree is not None:
            from hybrid_rt.intersection.kernels.search.tree import new_stack
            from hybrid_rt.intersection.kernels.sphere import trace_sphere_tree

            trace_sphere_tree(
                self.table, self._tree, self._n_plain, self._middle, self._to_frame,
                rays, best, any_hit, new_stack(self._tree), work,
            )  # fmt: skip


def closed_forms(kinds: Sequence[Any], kind_of: IntArray, reach: FloatArray) -> ClosedForms | None:
    """Return the tables by which single rays are traced; None if a kind needs batches.

    Parameters
    ----------
    kinds : sequence of Kind
    kind_of : (objects,) int32
        Index of each object's kind.
    reach : (objects,) float64
        The ``rounding_reach`` of each surface.
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
