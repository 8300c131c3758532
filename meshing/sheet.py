"""Sheets: Bezier patches side by side as one surface, with one (u, v) across all of them."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.area import AreaSampler, Grid, IdArray
from meshing.bezier import BezierPatches
from meshing.checks import BoolArray, FloatArray, as_floats, freeze, shown
from meshing.parametric import ParametricSurface


class PatchSheet(ParametricSurface):
    """Bezier patches with parameters of their own across all of them.

    Patch p holds ``spans[p]`` of the sheet's (u, v), which fill the unit square. Hits, textures and
    `point` take and give these; where ``patch_id`` is left out it is the patch that holds (u, v),
    on a shared border the one beyond.

    Parameters
    ----------
    pieces : BezierPatches
    spans : (k, 4) array
        u0, u1, v0, v1 of each patch: together a grid that fills the unit square, in any order.

    Raises
    ------
    TypeError, ValueError
        For other surfaces, and spans that are no such grid.
    """

    def __init__(self, pieces: BezierPatches, spans: ArrayLike) -> None:
        if not isinstance(pieces, BezierPatches):
            raise TypeError(f"PatchSheet pieces is {shown(pieces)}: pass BezierPatches")
        array = as_floats(spans, "PatchSheet spans")
        if array.shape != (len(pieces), 4):
            raise ValueError(
                f"PatchSheet spans has shape {array.shape} for {len(pieces)} patches: pass "
                f"({len(pieces)}, 4)"
            )
        self._pieces, self._spans = pieces, freeze(array.copy())
        self._from_u, self._from_v = np.unique(array[:, 0]), np.unique(array[:, 2])
        i, j = (
            np.searchsorted(self._from_u, array[:, 0]),
            np.searchsorted(self._from_v, array[:, 2]),
        )
        self._patch_at = np.full((len(self._from_u), len(self._from_v)), -1)
        self._patch_at[i, j] = np.arange(len(pieces))
        until_u, until_v = np.append(self._from_u, 1.0)[i + 1], np.append(self._from_v, 1.0)[j + 1]
        is_grid = self._from_u[0] == self._from_v[0] == 0.0 and self._patch_at.min() >= 0
        is_grid &= len(pieces) == self._patch_at.size
        if not (is_grid and (array[:, 1] == until_u).all() and (array[:, 3] == until_v).all()):
            raise ValueError(
                f"PatchSheet spans {shown(array.tolist())} are no grid: pass u0, u1, v0, v1 of each "
                "patch that fill the unit square, rows and columns side by side"
            )

    @property
    def pieces(self) -> BezierPatches:
        """The patches, each with (u, v) of its own in the unit square."""
        return self._pieces

    @property
    def spans(self) -> FloatArray:
        """(k, 4) float64: u0, u1, v0, v1 of each patch, read-only."""
        return self._spans

    def __len__(self) -> int:
        """Return the number of patches."""
        return len(self._pieces)

    def __repr__(self) -> str:
        """Name the patches."""
        return f"{type(self).__name__}({self._pieces!r})"

    @property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch."""
        return self._pieces.patch_bounds

    def transformed(self, matrix: ArrayLike) -> Self:
        """Return the image under an affine map, with the same (u, v); see `BezierPatches`."""
        return type(self)(self._pieces.transformed(matrix), self._spans)

    def flipped(self) -> Self:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        return type(self)(self._pieces.flipped(), self._spans[:, [2, 3, 0, 1]])

    def area_sampler(self) -> AreaSampler:
        """Return the area sampler of the surface."""
        return _SheetGrid(self)

    def within_patch(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[np.integer]
    ) -> tuple[FloatArray, FloatArray]:
        """Convert parameters of the sheet to those of its patches."""
        u0, u1, v0, v1 = np.moveaxis(self._spans[patch_id], -1, 0)
        return (u - u0) / (u1 - u0), (v - v0) / (v1 - v0)

    def across(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[np.integer]
    ) -> tuple[FloatArray, FloatArray]:
        """Convert parameters of patches to those of the sheet; borders stay where they are."""
        u0, u1, v0, v1 = np.moveaxis(self._spans[patch_id], -1, 0)
        return (
            np.where(u == 1.0, u1, u0 + u * (u1 - u0)),
            np.where(v == 1.0, v1, v0 + v * (v1 - v0)),
        )

    def _piece_of(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None) -> ArrayLike:
        if patch_id is not None:
            return patch_id
        # Parameters a little outside belong to the patch on that side.
        i = np.searchsorted(self._from_u, as_floats(u, "u"), side="right") - 1
        j = np.searchsorted(self._from_v, as_floats(v, "v"), side="right") - 1
        try:
            return self._patch_at[np.maximum(i, 0), np.maximum(j, 0)]
        except IndexError:
            return 0  # shapes that do not broadcast: refused by the caller, in its words

    def _fill(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        order_u: int,
        order_v: int,
        out: FloatArray,
    ) -> None:
        u, v = self.within_patch(u, v, ids)
        self._pieces._fill(ids, u, v, order_u, order_v, out)
        u0, u1, v0, v1 = self._spans[ids].T
        out /= ((u1 - u0) ** order_u * (v1 - v0) ** order_v)[:, None]

    def _fill_normals(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        out: FloatArray,
        is_degenerate: BoolArray,
    ) -> None:
        u, v = self.within_patch(u, v, ids)
        self._pieces._fill_normals(ids, u, v, out, is_degenerate)


class _SheetGrid(Grid):
    """Samples the patches of a sheet by area."""

    def __init__(self, sheet: PatchSheet) -> None:
        super().__init__(sheet.pieces)
        self._sheet = sheet

    def within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v) of points chosen within cells."""
        patch, u, v = super().within(cell, xi, eta)
        return patch, *self._sheet.across(u, v, patch)

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the density per area with which points are chosen."""
        return super().pdf_area(patch_id, *self._sheet.within_patch(u, v, patch_id))
