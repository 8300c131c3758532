"""Tensor Bezier patches: input checks, evaluation, bounds, transformations, files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.bpt import read_patches, write_patches
from meshing.checks import (
    BoolArray,
    FloatArray,
    as_affine,
    as_floats,
    as_path,
    freeze,
    shown,
    whole,
)
from meshing.kernels import bernstein, subdivision
from meshing.parametric import ParametricSurface

if TYPE_CHECKING:
    from meshing.sheet import PatchSheet


class BezierPatches(ParametricSurface):
    """One or more tensor product Bezier patches, polynomial or rational, as one surface.

    A point of patch p is the sum of B_i(u) B_j(v) times its control point (i, j): u follows the
    row index of the net, v the column index. With weights it is the weighted mean, weights
    B_i(u) B_j(v) w_ij: cylinders, spheres and other quadrics are such surfaces exactly. The normal
    is along S_u x S_v.

    Parameters
    ----------
    control : (k, m + 1, n + 1, 3) array, or a sequence of (m + 1, n + 1, 3) arrays
        Control points in scene units, any real dtype; degrees m and n from 1 to 30, in a
        sequence each patch may have its own.
    weights : (k, m + 1, n + 1) array, or a sequence of (m + 1, n + 1) arrays, optional
        Of the control points: positive, the smallest of a patch at least 1e-6 of its largest. Only
        their ratios within a patch count; where all are equal the patches are polynomial.

    Raises
    ------
    ValueError, TypeError
        For a wrong shape, a degree outside 1 to 30, NaN or infinity, a patch without area, and
        weights that are not positive or too far apart.

    References
    ----------
    Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, chapters 13 and 16.
    """

    def __new__(
        cls,
        control: ArrayLike | Iterable[ArrayLike],
        weights: ArrayLike | Sequence[ArrayLike] | None = None,
    ) -> Self:
        """Make `RationalPatches` where weights differ."""
        del control
        from meshing.rational import RationalPatches, is_rational

        kind: Any = RationalPatches if cls is BezierPatches and is_rational(weights) else cls
        made: Self = super().__new__(kind)
        return made

    def __init__(
        self,
        control: ArrayLike | Iterable[ArrayLike],
        weights: ArrayLike | Sequence[ArrayLike] | None = None,
    ) -> None:
        self._set_control(control)
        if weights is not None:
            from meshing.rational import as_weights

            as_weights(weights, self._degrees)
        self._check_area(self._control, None)

    def _set_control(self, control: ArrayLike | Iterable[ArrayLike]) -> None:
        nets = _as_nets(control)
        shapes = np.array([net.shape[:2] for net in nets], dtype=np.int64).reshape(-1, 2)
        self._degrees: NDArray[np.int64] = shapes - 1
        self._starts = np.concatenate(([0], np.cumsum(shapes.prod(axis=1))))
        if isinstance(nets, np.ndarray):
            self._control = freeze(nets.reshape(-1, 3).copy())
        else:
            self._control = freeze(np.concatenate([net.reshape(-1, 3) for net in nets]))
        _check_finite(self._control, self._starts, self._degrees)
        for array in (self._degrees, self._starts):
            array.setflags(write=False)

    def _check_area(self, nets: FloatArray, rational: bool | None) -> None:
        reach = np.maximum.reduceat(np.abs(self._control).max(axis=1), self._starts[:-1])
        collapsed = bernstein.first_collapsed_patch(
            nets, self._starts, self._degrees, reach, rational
        )
        if collapsed >= 0:
            raise ValueError(
                f"BezierPatches patch {collapsed} has no area (a curve or a point is left): remove it"
            )

    @classmethod
    def read(cls, path: str | Path) -> BezierPatches:
        """Read a .bpt file.

        Raises
        ------
        FileNotFoundError, ValueError
            If the file is missing or malformed; the message names file and line, and what was
            expected there.
        """
        file = as_path(path, "BezierPatches file")
        if not file.is_file():
            raise FileNotFoundError(f"BezierPatches file is {str(path)!r}: there is no such file")
        return cls(read_patches(file))

    def write(self, path: str | Path) -> None:
        """Write a .bpt file; `read` gives back the same float64 control points."""
        write_patches(as_path(path, "BezierPatches file"), self.patches)

    @cached_property
    def patches(self) -> tuple[FloatArray, ...]:
        """Control nets, each (m + 1, n + 1, 3) float64, read-only."""
        starts, degrees = self._starts.tolist(), self._degrees.tolist()
        return tuple(
            self._control[start:stop].reshape(m + 1, n + 1, 3)
            for start, stop, (m, n) in zip(starts[:-1], starts[1:], degrees, strict=True)
        )

    @property
    def control(self) -> FloatArray:
        """(total, 3) float64: the control points of all patches, one after the other, read-only."""
        return self._control

    @property
    def weights(self) -> tuple[FloatArray, ...] | None:
        """Weights of each patch, (m + 1, n + 1) float64, read-only; None: polynomial patches."""
        return None

    @property
    def starts(self) -> NDArray[np.int64]:
        """(k + 1,) int64: patch p holds the rows ``starts[p]`` to ``starts[p + 1]`` of `control`."""
        return self._starts

    @property
    def degrees(self) -> NDArray[np.int64]:
        """(k, 2) int64: degrees in u and in v."""
        return self._degrees

    def __len__(self) -> int:
        """Return the number of patches."""
        return len(self._degrees)

    def __repr__(self) -> str:
        """Name the number of patches and their degrees."""
        low, high = self._degrees.min(), self._degrees.max()
        degrees = f"degree {low}" if low == high else f"degrees {low} to {high}"
        return f"BezierPatches({len(self)} of {degrees})"

    def __reduce__(self) -> tuple[type[BezierPatches], tuple[list[FloatArray], ...]]:
        """Pickle the control nets; loading checks them again."""
        return type(self), ([np.array(net) for net in self.patches],)

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch, read-only."""
        boxes = np.empty((len(self), 2, 3))
        subdivision.patch_boxes(self._control, self._starts, self._degrees, None, boxes)
        return freeze(boxes)

    def transformed(self, matrix: ArrayLike) -> BezierPatches:
        """Return the image under an affine map, with the same (u, v).

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1); last row (0, 0, 0, 1); not singular. It is applied to
            the control points, so the image is exact up to their rounding; weights stay. A
            reflection turns the normal, which stays along S_u x S_v, to the other side.
        """
        linear, shift = as_affine(matrix, "BezierPatches")
        # Term by term rather than by a matrix product: equal points must get equal images, which
        # blocked products do not promise.
        x, y, z = self._control.T
        image = np.empty_like(self._control)
        for axis, row in enumerate(linear):
            image[:, axis] = row[0] * x + row[1] * y + row[2] * z + shift[axis]
        return self._with_control(image)

    def flipped(self) -> BezierPatches:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        return BezierPatches([net.transpose(1, 0, 2) for net in self.patches])

    def as_sheet(self, rows: int, columns: int) -> PatchSheet:
        """Return the patches as one sheet, over which one (u, v) runs.

        Parameters
        ----------
        rows, columns : int
            How many patches lie side by side along u, and along v: patch p is number
            ``p % columns`` of row ``p // columns``. Each takes an equal part of the sheet's
            parameters, so that a texture is stretched across all of them.

        Raises
        ------
        ValueError, TypeError
            If there are not as many patches.
        """
        from meshing.sheet import PatchSheet

        whole(rows, "BezierPatches sheet rows", at_least=1)
        whole(columns, "BezierPatches sheet columns", at_least=1)
        if rows * columns != len(self):
            raise ValueError(
                f"BezierPatches sheet of {rows} x {columns} for {len(self)} patches: pass rows and "
                f"columns whose product is {len(self)}"
            )
        i, j = np.divmod(np.arange(len(self)), columns)
        spans = [i / rows, (i + 1) / rows, j / columns, (j + 1) / columns]
        return PatchSheet(self, np.stack(spans, axis=1))

    def _nets_of(self, control: FloatArray) -> list[FloatArray]:
        sizes = self._degrees.tolist()
        pieces = np.split(control, self._starts[1:-1])
        return [piece.reshape(m + 1, n + 1, 3) for piece, (m, n) in zip(pieces, sizes, strict=True)]

    def _with_control(self, control: FloatArray) -> BezierPatches:
        return BezierPatches(self._nets_of(control))

    def _fill(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        order_u: int,
        order_v: int,
        out: FloatArray,
    ) -> None:
        bernstein.evaluate_patches(
            self._control, self._starts, self._degrees, ids, u, v, order_u, order_v, None, out
        )

    def _fill_normals(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        out: FloatArray,
        is_degenerate: BoolArray,
    ) -> None:
        bernstein.normals_of_patches(
            self._control, self._starts, self._degrees, ids, u, v, None, out, is_degenerate
        )


def _as_nets(control: ArrayLike | Iterable[ArrayLike]) -> FloatArray | list[FloatArray]:
    if isinstance(control, np.ndarray) and control.dtype != object:
        stack = as_floats(control, "BezierPatches control")
        if stack.ndim != 4 or stack.shape[3] != 3:
            raise ValueError(
                f"BezierPatches control has shape {control.shape}: pass (patches, m + 1, n + 1, 3)"
                + (", put one net into a list" if stack.ndim == 3 else "")
            )
        if stack.shape[0] == 0:
            raise ValueError("BezierPatches control holds no patches: pass at least one")
        _check_shape(stack.shape[1:], "BezierPatches: each patch")
        return stack
    if isinstance(control, str | bytes) or not isinstance(control, Iterable):
        raise TypeError(f"BezierPatches control is {shown(control)}: pass a sequence of nets")
    nets = [as_floats(net, f"BezierPatches patch {p}") for p, net in enumerate(control)]
    if not nets:
        raise ValueError("BezierPatches control holds no patches: pass at least one")
    for p, net in enumerate(nets):
        _check_shape(net.shape, f"BezierPatches patch {p}")
    return nets


def _check_shape(shape: tuple[int, ...], name: str) -> None:
    if len(shape) != 3 or shape[2] != 3:
        raise ValueError(f"{name} has shape {shape}: pass (m + 1, n + 1, 3)")
    for degree, direction in ((shape[0] - 1, "u"), (shape[1] - 1, "v")):
        if not 1 <= degree <= bernstein.MAX_DEGREE:
            raise ValueError(
                f"{name} has degree {degree} in {direction}: pass 1 to {bernstein.MAX_DEGREE}"
                + (" (degree 0 would make it a curve)" if degree == 0 else "")
            )


def _check_finite(
    control: FloatArray, starts: NDArray[np.int64], degrees: NDArray[np.int64]
) -> None:
    bad = np.flatnonzero(~np.isfinite(control).all(axis=1))
    if bad.size:
        p = int(np.searchsorted(starts, bad[0], side="right")) - 1
        i, j = divmod(int(bad[0] - starts[p]), int(degrees[p, 1]) + 1)
        raise ValueError(
            f"BezierPatches patch {p}, control point ({i}, {j}) is {control[bad[0]].tolist()}: "
            "pass finite numbers"
        )
