"""Area sampling of trimmed surfaces.

Each patch is a quadtree of cells in its parameters: cells outside the loops are left out, cells that
an edge crosses are cut finer. A point sampled outside the loops in such a cell counts for nothing, so
the density is that of the cells, and no area inside the loops needs to be known exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from meshing.area import CELLS, CellSampler, Patches, Place, stretch_of
from meshing.checks import BoolArray, FloatArray, IdArray
from meshing.kernels.trims import CROSSED, OUTSIDE
from meshing.spans import across, within_patch

# Cells of a whole surface at least, as of surfaces without loops, and cells of a small part of one.
FEWEST_WHOLE, FEWEST = 4096, 1024
# Cells are cut at edges until those crossed are this part of all by area, or cells are many. Of points
# sampled by area 1 % are then outside the loops; of a strip as wide as 1e-3 of the unit square 16 %,
# of one of 1e-4 55 %.
MOST_CROSSED, MOST = 1.0 / 16.0, 16384
# Halvings of u and v: the numbers of cells and those of 2^18 patches fit into 63 bits.
DEEPEST = 22
# Points along u and v of a cell, by which its area inside the loops is estimated.
POINTS = 4
# A crossed cell counts at least this part as inside: half of one of its points.
LEAST_INSIDE = 0.5 / POINTS**2


class Trimmed(Patches, Protocol):
    """What is asked of a trimmed surface besides its patches."""

    def sides(self, boxes: FloatArray) -> NDArray[np.uint8]:
        """Tell on which side of the loops boxes (k, 4) u0, u1, v0, v1 are."""

    def contains(self, u: FloatArray, v: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Tell which (u, v) are inside the loops, and which are undecided."""


class _Cells(NamedTuple):
    """Cells of a patch, 2^level along u and v; k rows."""

    patch: IdArray
    i: IdArray
    j: IdArray
    level: IdArray
    is_crossed: BoolArray

    def at(self, rows: IdArray | BoolArray) -> _Cells:
        """Return the cells of some rows."""
        return _Cells(
            self.patch[rows], self.i[rows], self.j[rows], self.level[rows], self.is_crossed[rows]
        )


class TrimmedCells(CellSampler):
    """The part of a surface inside loops, in cells that are finer at edges.

    `choose` also returns points outside the loops, in cells that an edge crosses: these are to be
    given up, and counted as sampled.
    """

    def __init__(self, surface: Trimmed) -> None:
        self._spans, self._surface = surface.spans, surface.pieces
        cells = _cells(surface)
        if not cells.patch.size:
            raise ValueError("has no area inside its loops: leave it out, it cannot shine")
        up = DEEPEST - cells.level
        first = _code(cells.patch, cells.i << up, cells.j << up)
        order = np.argsort(first)
        self._cells = cells = cells.at(order)
        self._first = first[order]
        self._end = self._first + (1 << 2 * (DEEPEST - cells.level))
        whole, inside = self._areas(surface)
        # Of N points in a cell of area A the part f counts, so its variance goes with A^2 f / N. The
        # sum over cells is the least if N goes with A sqrt(f).
        seen = np.maximum(inside, LEAST_INSIDE * whole)
        super().__init__(np.sqrt(whole * seen))
        self.area = float(inside.sum()) or float(seen.sum())

    def _areas(self, surface: Trimmed) -> tuple[FloatArray, FloatArray]:
        """Return the approximate areas of cells, and of their parts inside the loops."""
        every, crossed = np.arange(self._first.size), np.flatnonzero(self._cells.is_crossed)
        whole, inside = np.zeros((2, every.size))
        for i in range(POINTS):
            for j in range(POINTS):
                xi, eta = (np.full(every.size, (k + 0.5) / POINTS) for k in (i, j))
                part = stretch_of(self._surface, *self._within(every, xi, eta))
                part /= 4.0**self._cells.level * POINTS**2
                whole += part
                _, u, v = self.within(crossed, xi[crossed], eta[crossed])
                part[crossed] *= surface.contains(u, v)[0]
                inside += part
        return whole, inside

    def _within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """Return (patch_id, u, v) of points in cells, in the parameters of their patches."""
        side = 2.0 ** -self._cells.level[cell]
        u, v = (self._cells.i[cell] + xi) * side, (self._cells.j[cell] + eta) * side
        return self._cells.patch[cell], u, v

    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """Return (patch_id, u, v) of points chosen within cells."""
        patch, u, v = self._within(cell, xi, eta)
        return (patch, u, v) if self._spans is None else (patch, *across(self._spans, u, v, patch))

    def cell_of(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> Place:
        """Return (cell, xi, eta) of points: what `within` takes. Points in no cell get another."""
        cell, _, u, v = self._find(patch_id, u, v)
        side = 2.0 ** self._cells.level[cell]
        return (
            cell,
            np.clip(u * side - self._cells.i[cell], 0.0, 1.0),
            np.clip(v * side - self._cells.j[cell], 0.0, 1.0),
        )

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the density per area with which points are chosen; 0 for those in no cell."""
        cell, is_in, u, v = self._find(patch_id, u, v)
        stretch = stretch_of(self._surface, patch_id, u, v)
        # Where the surface collapses to a point there is no area to be found.
        return np.where(
            is_in & (stretch > 0.0),
            self._share[cell] * 4.0 ** self._cells.level[cell] / np.maximum(stretch, 1e-300),
            0.0,
        )

    def _find(
        self, patch_id: IdArray, u: FloatArray, v: FloatArray
    ) -> tuple[IdArray, BoolArray, FloatArray, FloatArray]:
        """Return the cells of points, whether they are in these, and their (u, v) on the patch."""
        if self._spans is not None:
            u, v = within_patch(self._spans, u, v, patch_id)
        u, v = np.clip(u, 0.0, 1.0), np.clip(v, 0.0, 1.0)
        n = 1 << DEEPEST
        i = np.minimum((u * n).astype(np.int64), n - 1)
        j = np.minimum((v * n).astype(np.int64), n - 1)
        code = _code(patch_id, i, j)
        cell = np.maximum(np.searchsorted(self._first, code, side="right") - 1, 0)
        return cell, (self._first[cell] <= code) & (code < self._end[cell]), u, v


def _cells(surface: Trimmed) -> _Cells:
    """Cut the patches of a surface into cells that are not outside the loops."""
    n = len(surface)
    zero = np.zeros(n, np.int64)
    cells = _Cells(np.arange(n), zero, zero, zero, np.ones(n, np.bool_))
    levels = math.ceil(math.log2(max(CELLS, math.isqrt(FEWEST_WHOLE // n))))
    while cells.patch.size and (levels > 0 or cells.patch.size < FEWEST):
        if cells.level[0] == DEEPEST:
            break
        levels -= 1
        cells = _quartered(surface, cells, np.ones(cells.patch.size, np.bool_))
    while cells.is_crossed.any() and cells.patch.size < MOST and cells.level.max() < DEEPEST:
        side = 0.5 ** (cells.level + 1)
        middle = (2 * cells.i + 1) * side, (2 * cells.j + 1) * side
        area = stretch_of(surface.pieces, cells.patch, *middle) * side**2
        if area[cells.is_crossed].sum() <= MOST_CROSSED * area.sum():
            break
        cells = _quartered(surface, cells, cells.is_crossed)
    return cells


def _quartered(surface: Trimmed, cells: _Cells, chosen: BoolArray) -> _Cells:
    """Cut chosen cells into four; leave out those outside the loops."""
    quarter = np.tile(np.arange(4), chosen.sum())
    patch, i, j, level, is_crossed = cells.at(np.repeat(np.flatnonzero(chosen), 4))
    i, j, level = 2 * i + quarter // 2, 2 * j + quarter % 2, level + 1
    # Inside a cell that no edge crosses there is none either.
    asked = np.flatnonzero(is_crossed)
    side = 0.5 ** level[asked]
    u0, u1 = i[asked] * side, (i[asked] + 1) * side
    v0, v1 = j[asked] * side, (j[asked] + 1) * side
    if surface.spans is not None:
        u0, v0 = across(surface.spans, u0, v0, patch[asked])
        u1, v1 = across(surface.spans, u1, v1, patch[asked])
    state = surface.sides(np.stack([u0, u1, v0, v1], axis=1))
    keeps = np.ones(patch.size, np.bool_)
    keeps[asked] = state != OUTSIDE
    is_crossed[asked] = state == CROSSED
    old, new = cells.at(~chosen), _Cells(patch, i, j, level, is_crossed).at(keeps)
    return _Cells(
        np.concatenate([old.patch, new.patch]),
        np.concatenate([old.i, new.i]),
        np.concatenate([old.j, new.j]),
        np.concatenate([old.level, new.level]),
        np.concatenate([old.is_crossed, new.is_crossed]),
    )


def _code(patch: IdArray, i: IdArray, j: IdArray) -> IdArray:
    """Return the place of cells of the deepest level along Morton's curve through all patches."""
    return (patch.astype(np.int64) << 2 * DEEPEST) | (_spread(i) << 1) | _spread(j)


def _spread(x: IdArray) -> IdArray:
    """Put a zero before each of 32 bits."""
    for shift, mask in (
        (16, 0x0000FFFF0000FFFF),
        (8, 0x00FF00FF00FF00FF),
        (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333),
        (1, 0x5555555555555555),
    ):
        x = (x | (x << shift)) & mask
    return x
