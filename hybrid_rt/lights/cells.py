"""Shining surfaces cut into cells, and the tree by which points of them are chosen as seen."""

import math

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.shading.kernels.cell_tree import (
    MOST_LEVELS,
    MOST_NODES,
    CellTree,
    density_of_cells,
    sample_cells,
)
from meshing.area import CELLS, CellSampler, Grid, Triangles, Weighted
from meshing.checks import IdArray
from meshing.surface import Surface
from meshing.trimmed_area import TrimmedCells

# A surface other than a mesh is cut into about so many cells; one of many patches into 256 for each,
# and one of very many into about MOST_CELLS, or one a patch (200 MiB of them, twice that while they are made).
FEWEST_CELLS = 4096
MOST_CELLS = 2**19
# Levels of the cube's octree along which cells are put in order: 3 * 20 bits.
OCTREE_LEVELS = 20
# Parameters of a cell's corners, around it.
CORNERS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
# A cell is flat if its middle, and that of its corners, lie within this part of its size.
FLAT = 1e-9


class Cells:
    """A bounded surface as a tree of cells, see `hybrid_rt.shading.kernels.cell_tree`.

    ``uneven`` are cells with their brightness over the mean as weights; None: it shines evenly.
    """

    def __init__(self, surface: Surface, uneven: Weighted | None = None) -> None:
        sampler = cells_of(surface) if uneven is None else uneven
        is_triangle = isinstance(surface.area_sampler(), Triangles)
        self._sampler = sampler
        corner, is_bent = _corners(surface, sampler, is_triangle)
        order = _along_a_curve(corner.mean(axis=1))
        self._cell_at, self._place_of = order, np.argsort(order)
        area = sampler.share * sampler.area
        glow = np.ones(area.size) if uneven is None else uneven.weight
        self._tree = _tree(corner[order], area[order], glow[order], is_triangle, is_bent)

    def choose(
        self, seen_from: FloatArray, xi: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v, pdf per area) of points sampled as seen from others (n, 3)."""
        n = len(seen_from)
        cell, place, density = np.empty(n, dtype=np.int64), np.empty((n, 2)), np.empty(n)
        sample_cells(self._tree, seen_from, xi, *_scratch(), cell, place, density)
        cell = self._cell_at[cell]
        patch, u, v = self._sampler.within(cell, place[:, 0], place[:, 1])
        return patch, u, v, density * self._by_area(cell, patch, u, v)

    def pdf_area(
        self, seen_from: FloatArray, patch_id: IdArray, u: FloatArray, v: FloatArray
    ) -> FloatArray:
        """Return the pdf per area with which `choose` samples points, seen from others."""
        cell, xi, eta = self._sampler.cell_of(patch_id, u, v)
        density = np.empty(u.size)
        density_of_cells(
            self._tree, seen_from, self._place_of[cell], np.stack([xi, eta], axis=-1), *_scratch(),
            density,
        )  # fmt: skip
        return density * self._by_area(cell, patch_id, u, v)

    def _by_area(
        self, cell: IdArray, patch_id: IdArray, u: FloatArray, v: FloatArray
    ) -> FloatArray:
        """Return the unit square of each cell over its area, at points of it."""
        share = self._sampler.share[cell]
        return np.divide(
            self._sampler.pdf_area(patch_id, u, v), share, out=np.zeros_like(u), where=share > 0.0
        )


def cells_of(surface: Surface, at_least: int = 1) -> CellSampler:
    """Return the cells of a surface; of one that is no mesh and not trimmed so many a side, at least."""
    sampler = surface.area_sampler()
    if isinstance(sampler, Triangles | TrimmedCells):
        return sampler
    return Grid(surface, max(cells_a_side(len(surface)), at_least))


def cells_a_side(n_patches: int) -> int:
    """Return into how many cells the sides of each patch are cut."""
    fewest, most = (math.isqrt(n // n_patches) for n in (FEWEST_CELLS, MOST_CELLS))
    return max(fewest, min(most, CELLS), 1)


def _scratch() -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    return (
        np.empty(MOST_LEVELS, dtype=np.int64),
        np.empty(MOST_NODES, dtype=np.int64),
        np.empty(MOST_NODES),
    )


def _corners(surface: Surface, sampler: CellSampler, is_triangle: bool) -> tuple[FloatArray, bool]:
    """Return the points of cells for a `CellTree`, and whether some cells are bent."""
    cell = np.arange(sampler.share.size)

    def place(xi: float, eta: float) -> FloatArray:
        patch, u, v = sampler.within(cell, np.full(cell.size, xi), np.full(cell.size, eta))
        return np.asarray(surface.point(u, v, patch))

    corner = np.stack([place(*at) for at in CORNERS], axis=1)
    if is_triangle:
        return corner, False
    nine = np.stack([place(0.5 * i, 0.5 * j) for i in range(3) for j in range(3)], axis=1)
    size = np.linalg.norm(np.ptp(corner, axis=1), axis=1)
    off = np.linalg.norm(corner.mean(axis=1) - nine[:, 4], axis=1)
    across = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1])
    out = np.abs(np.einsum("ij,ij->i", corner[:, 1] - corner[:, 0], across))
    is_bent = bool(((off > FLAT * size) | (out > FLAT * size**3)).any())
    return (nine if is_bent else corner), is_bent


def _along_a_curve(middle: FloatArray) -> IdArray:
    """Return the order of points along Morton's curve: near ones follow each other."""
    low, high = middle.min(axis=0), middle.max(axis=0)
    scale = (2.0**OCTREE_LEVELS - 1.0) / max(float((high - low).max()), 1e-300)
    steps = ((middle - low) * scale).astype(np.uint64)
    code = np.zeros(len(middle), dtype=np.uint64)
    for bit in range(OCTREE_LEVELS):
        for axis in range(3):
            digit = (steps[:, axis] >> np.uint64(bit)) & np.uint64(1)
            code |= digit << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def _tree(
    corner: FloatArray, area: FloatArray, glow: FloatArray, is_triangle: bool, is_bent: bool
) -> CellTree:
    """Build the tree level by level, over cells in an order in which neighbours are near."""
    first_leaf = 1 << max(int(len(area) - 1).bit_length(), 0)
    low = np.full((2 * first_leaf, 3), np.inf)
    high = np.full((2 * first_leaf, 3), -np.inf)
    total, lean = np.zeros(2 * first_leaf), np.zeros((2 * first_leaf, 3))
    leaves = slice(first_leaf, first_leaf + len(area))
    low[leaves], high[leaves], total[leaves] = corner.min(axis=1), corner.max(axis=1), area
    a, b, c, d = (corner[:, k] for k in ((0, 6, 8, 2) if is_bent else range(4)))
    across = np.cross(c - a, d - b)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    lean[leaves] = area[:, None] * np.divide(across, length, where=length > 0.0, out=across)
    first = first_leaf
    while first > 1:
        first //= 2
        left, right = slice(2 * first, 4 * first, 2), slice(2 * first + 1, 4 * first, 2)
        own = slice(first, 2 * first)
        low[own] = np.minimum(low[left], low[right])
        high[own] = np.maximum(high[left], high[right])
        total[own] = total[left] + total[right]
        lean[own] = lean[left] + lean[right]
    lean /= np.maximum(total, 1e-300)[:, None]
    used = total > 0.0
    middle, square = np.zeros_like(low), np.zeros_like(total)
    middle[used] = 0.5 * (low[used] + high[used])
    square[used] = 0.25 * np.square(high[used] - low[used]).sum(axis=1)
    return CellTree(
        corner=np.ascontiguousarray(corner),
        is_triangle=is_triangle,
        is_bent=is_bent,
        middle=middle,
        square=square,
        area=total,
        glow=glow,
        lean=lean,
    )
