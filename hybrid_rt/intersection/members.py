"""Which surfaces of one kind share a frame, and trees over many of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing.surface import Surface, box_around

if TYPE_CHECKING:
    from hybrid_rt.intersection.kernels.search.members import Members
    from hybrid_rt.intersection.kernels.search.tree import Tree

# Surfaces so much larger than the usual one would fill the tree's boxes: they are asked by all rays.
# A room may have more walls than things in it, so the usual one is not the median.
LARGE, USUAL = 32.0, 0.25
LEAF_SIZE = 2
# In a frame 4096 times as large as a teapot a ray takes a tenth longer, in one 1e5 times 19 times as long.
SMALL = 2.0**-12
# Parts of one surface: boxes are then widened by a sixteenth of the part.
SMALL_PART = 2.0**-15
# Clusters are told apart on a grid of so many cells a side. A ray asks kinds one after the other, some 50 ns
# each; trees of a kind, where there are many of them, by a tree over these (`search.bottoms`).
CELLS, MOST_CELLS, MOST_FRAMES, MOST_TREES = 64, 4096, 16, 1024
# Fewer things are as well told apart by their own tests as by a tree.
FEW = 8


def in_frames(
    bounds: FloatArray, smallest: float = SMALL, most: int = MOST_FRAMES, few: int = 1
) -> list[NDArray[np.int64]]:
    """Sort boxes into groups, each of which has a frame of its own.

    A frame cannot tell apart what is small beside it: its trees are of float32. So what is small lies in
    frames of its own, one for each cluster, if few clusters hold all of it.

    ``bounds`` (n, 2, 3).
    ``smallest``: what is smaller, over the extent of all, is small.
    ``most`` groups; a cluster of less than ``few`` is no group.
    Returns list of index arrays, the rows of each group in rising order.
    """
    todo, groups = [np.arange(len(bounds))], list[NDArray[np.int64]]()
    size = np.linalg.norm(bounds[:, 1] - bounds[:, 0], axis=1)
    while todo:
        rows = todo.pop(0)
        low, high = box_around(bounds[rows])
        extent = float(np.linalg.norm(high - low))
        is_small = size[rows] < smallest * extent
        small = rows[is_small]
        middle = 0.5 * (bounds[small, 0] - low) + 0.5 * (bounds[small, 1] - low)
        parts = [small[k] for k in _clusters(middle, extent / CELLS)] if small.size else []
        parts = [part for part in parts if len(part) >= few]
        rest = np.setdiff1d(rows, np.concatenate([*parts, rows[:0]]))
        n = len(todo) + len(groups) + len(parts) + (rest.size > 0)
        if not parts or n > most or (len(parts) == 1 and not rest.size):
            groups.append(rows)
            continue
        todo += parts
        if rest.size:
            groups.append(rest)
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


def by_size(size: FloatArray, many: int) -> list[NDArray[np.int64]]:
    """Sort surfaces by size: rows of those that are asked by all rays; of those that share trees, largest first.

    ``size`` (n,) is as `meshing.surface.Surface.size`; fewer than ``many`` have no tree.
    """
    large, groups = np.arange(len(size)), list[NDArray[np.int64]]()
    while len(large) >= many:
        is_large = size[large] > LARGE * np.quantile(size[large], USUAL)
        if np.count_nonzero(~is_large) < many:
            break
        groups.insert(0, large[~is_large])
        large = large[is_large]
    return [large, *groups]


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
    plain, *sizes = by_size(np.array([surface.size for surface in surfaces]), many)
    if not sizes:
        return plain, len(plain), []
    bounds = _boxes_of(surfaces)
    groups = [
        some[rows] for some in sizes for rows in in_frames(bounds[some], most=MOST_TREES, few=FEW)
    ]
    begins = len(plain) + np.cumsum([0, *map(len, groups)])
    trees = [tree_over(bounds[rows], int(n)) for rows, n in zip(groups, begins, strict=False)]
    return np.concatenate([plain, *groups]), len(plain), trees


def tree_over(bounds: FloatArray, begin: int, leaf_size: int = LEAF_SIZE) -> Members:
    """Return a tree over boxes (n, 2, 3), which stand for the rows of a table from ``begin`` on."""
    from hybrid_rt.intersection.kernels.search.members import Members
    from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree

    middle, to_frame = frame_of(*box_around(bounds))
    lower, upper = (bounds[:, 0] - middle) * to_frame, (bounds[:, 1] - middle) * to_frame
    return Members(Tree(*build_tree(lower, upper, leaf_size)), begin, middle, to_frame)


def around(surfaces: Sequence[Surface]) -> FloatArray:
    """Return a box (2, 3) around some surfaces, and by how much they may be off; without end for none."""
    if not surfaces:
        return np.stack([np.full(3, np.inf), np.full(3, -np.inf)])
    return box_around(_boxes_of(surfaces))


def _boxes_of(surfaces: Sequence[Surface]) -> FloatArray:
    """Return boxes (n, 2, 3) around each of some surfaces, and by how much it may be off."""
    bounds = np.array([surface.bounds for surface in surfaces])
    moved = np.array([surface.moved for surface in surfaces])
    boxes: FloatArray = bounds + 2.0 * moved[:, None, None] * np.array([-1.0, 1.0])[:, None]
    return boxes


def box_of(tree: Tree, middle: FloatArray, to_frame: float) -> FloatArray:
    """Return a box (2, 3) around what is in a tree, given its frame: wider by the margin of its boxes."""
    sides = np.stack([tree.rows[0, :3].min(axis=1), tree.rows[0, 3:6].max(axis=1)])
    return middle + sides.astype(np.float64) / to_frame


def frame_of(low: FloatArray, high: FloatArray) -> tuple[FloatArray, float]:
    """Return the middle of a box (3,) (3,), and the power of two that brings all of it within 1 of it."""
    radius = np.linalg.norm(0.5 * high - 0.5 * low)
    return 0.5 * low + 0.5 * high, float(2.0 ** -np.ceil(np.log2(radius)))
