"""Which surfaces of one kind share a frame, and trees over many of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing.surface import Surface, box_around

if TYPE_CHECKING:
    from hybrid_rt.intersection.kernels.search.members import Members

# Surfaces so much larger than the usual one would fill the tree's boxes: they are asked by all rays.
# A room may have more walls than things in it, so the usual one is not the median.
LARGE, USUAL = 32.0, 0.25
LEAF_SIZE = 2
# In a frame 4096 times as large as a teapot a ray takes a tenth longer, in one 1e5 times 19 times as long.
SMALL = 2.0**-12
# Parts of one surface: boxes are then widened by a sixteenth of the part.
SMALL_PART = 2.0**-15
# Clusters are told apart on a grid of so many cells a side. Each frame costs each ray some 50 ns.
CELLS, MOST_CELLS, MOST_FRAMES = 64, 4096, 16


def in_frames(bounds: FloatArray, smallest: float = SMALL) -> list[NDArray[np.int64]]:
    """Sort boxes into groups, each of which has a frame of its own.

    A frame cannot tell apart what is small beside it: its trees are of float32. So what is small lies in
    frames of its own, one for each cluster, if few clusters hold all of it.

    ``bounds`` (n, 2, 3).
    ``smallest``: what is smaller, over the extent of all, is small.
    Returns list of index arrays, the rows of each group in rising order.
    """
    todo, groups = [np.arange(len(bounds))], list[NDArray[np.int64]]()
    size = np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1)
    while todo:
        rows = todo.pop(0)
        low, high = bounds[rows, 0].min(axis=0), bounds[rows, 1].max(axis=0)
        extent = float(np.linalg.norm(high - low))
        is_small = size[rows] < smallest * extent
        small, large = rows[is_small], rows[~is_small]
        middle = 0.5 * (bounds[small, 0] - low) + 0.5 * (bounds[small, 1] - low)
        parts = [small[k] for k in _clusters(middle, extent / CELLS)] if small.size else []
        n = len(todo) + len(groups) + len(parts) + (large.size > 0)
        if not parts or n > MOST_FRAMES or (len(parts) == 1 and not large.size):
            groups.append(rows)
            continue
        todo += parts
        if large.size:
            groups.append(large)
    return groups


def _clusters(points: FloatArray, pitch: float) -> list[NDArray[np.int64]]:
    """Sort points (n, 3) into clusters with empty cells of a grid between them."""
    from meshing.kernels.joining import join_points

    cells, cell = np.unique(np.floor(points / pitch), axis=0, return_inverse=True)
    if len(cells) > MOST_CELLS:
        return [np.arange(len(points))]
    label = join_points(cells, np.arange(len(cells)), np.ascontiguousarray(cells[:, 0]), 1.0)
    of_point = label[cell.ravel()]
    return [np.flatnonzero(of_point == k) for k in np.unique(of_point)]


def asked_by_all(size: FloatArray, many: int) -> BoolArray:
    """Tell which surfaces are asked by all rays, (n,) bool; the others go into a tree.

    ``size`` (n,) is as `meshing.surface.Surface.size`; fewer than ``many`` others are asked as well.
    """
    is_large: BoolArray = size > LARGE * np.quantile(size, USUAL)
    if np.count_nonzero(~is_large) < many:
        is_large[:] = True
    return is_large


def in_order(
    surfaces: Sequence[Surface], many: int
) -> tuple[NDArray[np.int64], int, list[Members]]:
    """Return the order in which surfaces stand in a table, and what of it is in trees.

    ``surfaces``: bounded ones.
    ``many``: number of surfaces from which on a tree is used.
    Returns ``order`` (n,) int64: those first that are asked by all rays.
    ``n_plain``: how many these are.
    ``in_trees``: the others, a tree for each frame.
    """
    is_plain = asked_by_all(np.array([surface.size for surface in surfaces]), many)
    order, n_plain = np.argsort(~is_plain, kind="stable"), int(np.count_nonzero(is_plain))
    if n_plain == len(surfaces):
        return order, n_plain, []
    bounds = np.array([surfaces[k].bounds for k in order[n_plain:]])
    moved = np.array([surfaces[k].moved for k in order[n_plain:]])
    bounds += 2.0 * moved[:, None, None] * np.array([-1.0, 1.0])[:, None]
    groups = in_frames(bounds)
    begins = n_plain + np.cumsum([0, *map(len, groups)])
    trees = [tree_over(bounds[rows], int(n)) for rows, n in zip(groups, begins, strict=False)]
    order[n_plain:] = order[n_plain:][np.concatenate(groups)]
    return order, n_plain, trees


def tree_over(bounds: FloatArray, begin: int, leaf_size: int = LEAF_SIZE) -> Members:
    """Return a tree over boxes (n, 2, 3), which stand for the rows of a table from ``begin`` on."""
    from hybrid_rt.intersection.kernels.search.members import Members
    from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree

    middle, to_frame = frame_of(*box_around(bounds))
    lower, upper = (bounds[:, 0] - middle) * to_frame, (bounds[:, 1] - middle) * to_frame
    return Members(Tree(*build_tree(lower, upper, leaf_size)), begin, middle, to_frame)


def frame_of(low: FloatArray, high: FloatArray) -> tuple[FloatArray, float]:
    """Return the middle of a box (3,) (3,), and the power of two that brings all of it within 1 of it."""
    radius = np.linalg.norm(0.5 * high - 0.5 * low)
    return 0.5 * low + 0.5 * high, float(2.0 ** -np.ceil(np.log2(radius)))
