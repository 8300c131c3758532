"""Area sampling of surfaces.

The parameter domain is cut into cells. A cell is sampled by its area, then (u, v) uniformly in it,
so the pdf per area is P(cell) / (cell size |S_u x S_v|). It is exact even where the areas of the
cells are approximate.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol, TypeAlias

import numpy as np

from meshing.checks import FloatArray, IdArray
from meshing.spans import across, within_patch

# Cells along u and v of one patch. The density within a cell varies as |S_u x S_v| does there:
# by a few percent for a bicubic patch.
CELLS = 16

Place: TypeAlias = tuple[IdArray, FloatArray, FloatArray]
"""(patch_id, u, v) of points, or (cell, xi, eta): their cells, and two numbers in [0, 1] within these."""


class Patches(Protocol):
    """What is asked of a surface: how many patches it has, and its partials."""

    @property
    def pieces(self) -> Patches:
        """The patches, each with (u, v) in the unit square."""

    @property
    def spans(self) -> FloatArray | None:
        """(k, 4): u0, u1, v0, v1 of each patch on a sheet; None: they are `pieces` themselves."""

    def __len__(self) -> int:
        """Return the number of patches."""

    def partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return S_u and S_v, each (n, 3)."""


class AreaSampler(ABC):
    """Samples points of a surface by area: cells of ``areas``, whose sum is `area`, and points in them."""

    def __init__(self, areas: FloatArray) -> None:
        self.area = float(areas.sum())
        if not (np.isfinite(self.area) and self.area > 0.0):
            raise ValueError(f"has area {self.area:g}: leave it out, it cannot shine")
        self._share = areas / self.area
        self._before = np.concatenate([[0.0], np.cumsum(self._share)])

    def choose(self, xi: FloatArray) -> Place:
        """Return (patch_id, u, v) of points sampled by random numbers (n, 2) in [0, 1)."""
        cell = np.searchsorted(self._before, xi[:, 0], side="right") - 1
        # Rounded sums may end below 1: what lies beyond is of the last cell that has a share.
        last = np.searchsorted(self._before, self._before[-1]) - 1
        cell = np.minimum(cell, last)
        rest = np.clip((xi[:, 0] - self._before[cell]) / self._share[cell], 0.0, 1.0)
        return self.within(cell, rest, xi[:, 1])

    @abstractmethod
    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """Return (patch_id, u, v) of points chosen within cells."""

    @property
    def share(self) -> FloatArray:
        """(cells,) float64: with which probability `choose` samples each cell."""
        return self._share

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the pdf per area of points; the same if `within` is uniform and areas are exact."""
        del patch_id, v
        return np.full(u.size, 1.0 / self.area)


class CellSampler(AreaSampler):
    """A sampler that also tells the cell of a point."""

    @abstractmethod
    def cell_of(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> Place:
        """Return (cell, xi, eta) of points: what `within` takes."""


class Weighted(CellSampler):
    """The cells of another sampler, each chosen by its area times a weight above 0.

    `weight` has them over their mean by area.
    """

    def __init__(self, sampler: CellSampler, weight: FloatArray) -> None:
        super().__init__(sampler.share * weight)
        self.area = sampler.area
        self._sampler = sampler
        self.weight: FloatArray = weight / float((sampler.share * weight).sum())

    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """See `CellSampler`."""
        return self._sampler.within(cell, xi, eta)

    def cell_of(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> Place:
        """See `CellSampler`."""
        return self._sampler.cell_of(patch_id, u, v)

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """See `CellSampler`."""
        weight = self.weight[self.cell_of(patch_id, u, v)[0]]
        return weight * self._sampler.pdf_area(patch_id, u, v)


class Squares(AreaSampler):
    """Parallelograms, each a cell: (u, v) in the unit square is uniform in area."""

    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """See `CellSampler`."""
        return cell, xi, eta


class Triangles(CellSampler):
    """Triangles, each a cell: (u, v) are the barycentric weights of two corners."""

    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """See `CellSampler`."""
        root = np.sqrt(xi)
        return cell, root * (1.0 - eta), root * eta

    def cell_of(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> Place:
        """See `CellSampler`."""
        root = u + v
        eta = np.divide(v, root, out=np.zeros_like(v), where=root > 0.0)
        return patch_id, np.clip(root, 0.0, 1.0) ** 2, np.clip(eta, 0.0, 1.0)


class Grid(CellSampler):
    """Any surface with partials: a grid of ``cells`` along u and v on each of its patches."""

    def __init__(self, surface: Patches, cells: int = CELLS) -> None:
        self._spans, surface, self._cells = surface.spans, surface.pieces, cells
        self._surface = surface
        middle = (np.arange(cells) + 0.5) / cells
        u, v = np.meshgrid(middle, middle, indexing="ij")
        patch = np.repeat(np.arange(len(surface)), cells * cells)
        u, v = np.tile(u.ravel(), len(surface)), np.tile(v.ravel(), len(surface))
        # Three by three points in each cell: even one that vanishes in the middle gets its share.
        areas = np.zeros(patch.size)
        for i in (-0.4, 0.0, 0.4):
            for j in (-0.4, 0.0, 0.4):
                areas += stretch_of(surface, patch, u + i / cells, v + j / cells)
        super().__init__(areas / (9.0 * cells * cells))

    def within(self, cell: IdArray, xi: FloatArray, eta: FloatArray) -> Place:
        """See `CellSampler`."""
        patch, place = np.divmod(cell, self._cells**2)
        i, j = np.divmod(place, self._cells)
        u, v = (i + xi) / self._cells, (j + eta) / self._cells
        return (patch, u, v) if self._spans is None else (patch, *across(self._spans, u, v, patch))

    def cell_of(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> Place:
        """See `CellSampler`."""
        n = self._cells
        if self._spans is not None:
            u, v = within_patch(self._spans, u, v, patch_id)
        i = np.clip((u * n).astype(np.int64), 0, n - 1)
        j = np.clip((v * n).astype(np.int64), 0, n - 1)
        return (
            (patch_id * n + i) * n + j,
            np.clip(u * n - i, 0.0, 1.0),
            np.clip(v * n - j, 0.0, 1.0),
        )

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """See `CellSampler`."""
        cell, _, _ = self.cell_of(patch_id, u, v)
        if self._spans is not None:
            u, v = within_patch(self._spans, u, v, patch_id)
        stretch = stretch_of(self._surface, patch_id, u, v)
        # Where the surface collapses to a point there is no area to be found.
        return np.where(
            stretch > 0.0, self._share[cell] * self._cells**2 / np.maximum(stretch, 1e-300), 0.0
        )


def stretch_of(surface: Patches, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return |S_u x S_v|."""
    s_u, s_v = surface.partials(u, v, patch_id)
    return np.linalg.norm(np.cross(s_u, s_v), axis=1)
