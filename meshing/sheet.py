"""Sheets: Bezier patches side by side as one surface, with one (u, v) across all of them."""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from meshing.bezier import BezierPatches
from meshing.checks import FloatArray, IdArray, as_floats, freeze, shown, whole
from meshing.parametric import ParametricSurface
from meshing.spans import within_patch


class PatchSheet(ParametricSurface):
    """Bezier patches that share one pair of parameters (u, v).

    The (u, v) of the sheet fill the unit square, and patch p covers the rectangle ``spans[p]`` of
    it. Hits, textures and `point` use the parameters of the sheet. If ``patch_id`` is left out, the
    patch is the one that holds (u, v); on a shared border it is the one with the larger parameters.

    Parameters
    ----------
    pieces : BezierPatches
        k patches.
    spans : (k, 4) array
        u0, u1, v0, v1 of each patch. Together they are a grid that fills the unit square; the order
        does not matter.

    Raises
    ------
    TypeError, ValueError
        If ``pieces`` are other surfaces, or the spans are no such grid.
    """

    flip_of_uv = "swapped"

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
        self._patch_of_cell = np.full((len(self._from_u), len(self._from_v)), -1)
        self._patch_of_cell[i, j] = np.arange(len(pieces))
        until_u, until_v = np.append(self._from_u, 1.0)[i + 1], np.append(self._from_v, 1.0)[j + 1]
        is_grid = self._from_u[0] == self._from_v[0] == 0.0 and self._patch_of_cell.min() >= 0
        is_grid &= len(pieces) == self._patch_of_cell.size
        if not (is_grid and (array[:, 1] == until_u).all() and (array[:, 3] == until_v).all()):
            raise ValueError(
                f"PatchSheet spans {shown(array.tolist())} are no grid: pass u0, u1, v0, v1 of each "
                "patch that fill the unit square, rows and columns side by side"
            )

    @classmethod
    def grid(cls, patches: BezierPatches, rows: int, columns: int) -> PatchSheet:
        """Return patches as one sheet, so that a texture is stretched over all of them.

        Parameters
        ----------
        patches : BezierPatches
        rows, columns : int
            Number of patches along u, and along v: patch p is in row ``p // columns`` and column
            ``p % columns``. All cover equal parts of the unit square.

        Raises
        ------
        ValueError, TypeError
            If the number of patches is not ``rows * columns``.
        """
        whole(rows, "PatchSheet rows", at_least=1)
        whole(columns, "PatchSheet columns", at_least=1)
        if rows * columns != len(patches):
            raise ValueError(
                f"PatchSheet of {rows} x {columns} for {len(patches)} patches: pass rows and columns "
                f"whose product is {len(patches)}"
            )
        i, j = np.divmod(np.arange(len(patches)), columns)
        spans = [i / rows, (i + 1) / rows, j / columns, (j + 1) / columns]
        return PatchSheet(patches, np.stack(spans, axis=1))

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

    @cached_property
    def closes(self) -> tuple[bool, bool]:
        """Whether the first and the last patches along u meet bit for bit, and those along v.

        They meet if the control points of u = 0 and u = 1 are equal, and their weights up to a
        common power of two.
        """
        first, last = self._patch_of_cell[[0, -1]]
        low, high = self._patch_of_cell[:, [0, -1]].T
        return (
            all(self._pieces.meet(a, b, 0) for a, b in zip(first, last, strict=True)),
            all(self._pieces.meet(a, b, 1) for a, b in zip(low, high, strict=True)),
        )

    @property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch, scene units."""
        return self._pieces.patch_bounds

    def transformed(self, matrix: ArrayLike) -> Self:
        """Return the image under an affine map, with the same (u, v); see `BezierPatches`."""
        return type(self)(self._pieces.transformed(matrix), self._spans)

    def flipped(self) -> Self:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        return type(self)(self._pieces.flipped(), self._spans[:, [2, 3, 0, 1]])

    def _patch_at(self, u: ArrayLike, v: ArrayLike) -> ArrayLike:
        # Parameters a little outside belong to the patch on that side.
        i = np.searchsorted(self._from_u, as_floats(u, "u"), side="right") - 1
        j = np.searchsorted(self._from_v, as_floats(v, "v"), side="right") - 1
        try:
            return self._patch_of_cell[np.maximum(i, 0), np.maximum(j, 0)]
        except IndexError:
            return 0  # shapes that do not broadcast: refused by the caller, in its words

    def _derivatives(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray, order_u: int, order_v: int
    ) -> FloatArray:
        u, v = within_patch(self._spans, u, v, patch_id)
        u0, u1, v0, v1 = self._spans[patch_id].T
        widths: FloatArray = (u1 - u0) ** order_u * (v1 - v0) ** order_v
        slopes = self._pieces._derivatives(u, v, patch_id, order_u, order_v)
        return slopes / widths[:, None]

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        return self._pieces._normals(*within_patch(self._spans, u, v, patch_id), patch_id)
