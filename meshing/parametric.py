"""What parametric surfaces share: points, partial derivatives and normals at (u, v)."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import BoolArray, FloatArray, broadcast_parameters
from meshing.surface import Surface


class ParametricSurface(Surface):
    """A surface of one or more pieces, each a map S(u, v) of the unit square."""

    is_freeform = True

    @abstractmethod
    def __len__(self) -> int:
        """Return the number of pieces."""

    @property
    @abstractmethod
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each piece."""

    @abstractmethod
    def _fill(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        order_u: int,
        order_v: int,
        out: FloatArray,
    ) -> None:
        """Fill ``out`` (n, 3) with partial derivatives of the given orders."""

    @abstractmethod
    def _fill_normals(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        out: FloatArray,
        is_degenerate: BoolArray,
    ) -> None:
        """Fill ``out`` (n, 3) with unit normals, and where S_u x S_v vanishes."""

    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None) -> FloatArray:
        """Return points of the surface.

        Parameters
        ----------
        u, v : float array-like, broadcast with each other and with ``patch_id``
            Parameters. They may lie slightly outside [0, 1].
        patch_id : int array-like, optional
            Patch, or profile segment, of each (u, v). Default: the first, or on a sheet of patches
            the one that holds (u, v).

        Returns
        -------
        (..., 3) float64
            Scene units; the leading axes are those of the broadcast arguments: (3,) for scalars.

        Raises
        ------
        ValueError, TypeError
            If the arguments do not broadcast, or there is no such piece.
        """
        return self._evaluate(u, v, patch_id, 0, 0)

    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the first partials S_u and S_v, each shaped like `point`.

        Arguments and errors are those of `point`.
        """
        return self._evaluate(u, v, patch_id, 1, 0), self._evaluate(u, v, patch_id, 0, 1)

    def second_partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the second partials S_uu, S_uv and S_vv, each shaped like `point`.

        Arguments and errors are those of `point`.
        """
        return (
            self._evaluate(u, v, patch_id, 2, 0),
            self._evaluate(u, v, patch_id, 1, 1),
            self._evaluate(u, v, patch_id, 0, 2),
        )

    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None) -> FloatArray:
        """Return unit normals along S_u x S_v, shaped like `point`.

        Where S_u x S_v vanishes (a collapsed edge, a cusp, a pole), this is its limit from inside.
        Arguments and errors are those of `point`.
        """
        patch = self._piece_of(u, v, patch_id)
        u, v, ids, shape = broadcast_parameters(u, v, patch, len(self), "patch_id")
        out, is_degenerate = np.empty((u.size, 3)), np.empty(u.size, dtype=np.bool_)
        self._fill_normals(ids, u, v, out, is_degenerate)
        return out.reshape(*shape, 3)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner of a box around the surface.

        The box is conservative: it exceeds the tight box by about 1/256 of what the box of the
        control points exceeds it by.
        """
        boxes = self.patch_bounds
        return np.stack((boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)))

    def _piece_of(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None) -> ArrayLike:
        """Return the pieces that parameters belong to."""
        del u, v
        return 0 if patch_id is None else patch_id

    def _evaluate(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None, order_u: int, order_v: int
    ) -> FloatArray:
        patch = self._piece_of(u, v, patch_id)
        u, v, ids, shape = broadcast_parameters(u, v, patch, len(self), "patch_id")
        out = np.empty((u.size, 3))
        self._fill(ids, u, v, order_u, order_v, out)
        return out.reshape(*shape, 3)
