"""Boxes along the coordinate axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing.area import Squares
from meshing.checks import as_affine, as_vector, broadcast_parameters
from meshing.surface import Surface


class Box(Surface):
    """A solid with faces along the axes; its normals point outward, unless flipped.

    ``patch_id`` counts the faces -x, +x, -y, +y, -z, +z. On each, (u, v) run from 0 to 1 along the
    two other axes, in the order (y, z), (z, x), (x, y); on the lower faces, and on the upper ones
    of a flipped box, in the opposite order, so that S_u x S_v is the normal.

    Parameters
    ----------
    lo, hi : (3,) scene units, lo < hi in every coordinate

    Raises
    ------
    ValueError
        For corners that are not finite or out of order.
    """

    def __init__(self, lo: ArrayLike, hi: ArrayLike) -> None:
        self.lo, self.hi = as_vector(lo, "Box lo"), as_vector(hi, "Box hi")
        if not (self.lo < self.hi).all():
            raise ValueError(
                f"Box lo is {self.lo.tolist()}, not below hi, {self.hi.tolist()}: "
                "pass the lower corner first (for a flat face, use Rectangle)"
            )
        self.orientation = 1

    def __len__(self) -> int:
        """Return the number of faces."""
        return 6

    @property
    def rounding_reach(self) -> float:
        """0: a hit lies in its face exactly."""
        return 0.0

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner."""
        return np.stack([self.lo, self.hi])

    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the points (n, 3) float64 at (u, v) of faces, scene units.

        Parameters
        ----------
        u, v : floats that broadcast with each other and with ``patch_id``
        patch_id : whole numbers
            Faces, 0 to 5.

        Raises
        ------
        ValueError, TypeError
            If they do not broadcast, or there is no such face.
        """
        u, v, face, _ = broadcast_parameters(u, v, patch_id, 6, "patch_id")
        axis, upper = face // 2, face % 2 == 1
        swap = self._is_swapped(face)
        rows = np.arange(len(u))
        weight = np.empty((len(u), 3))
        weight[rows, axis] = upper
        weight[rows, (axis + 1) % 3] = np.where(swap, v, u)
        weight[rows, (axis + 2) % 3] = np.where(swap, u, v)
        points: FloatArray = self.lo * (1.0 - weight) + self.hi * weight
        return points

    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0
    ) -> tuple[FloatArray, FloatArray]:
        """Return the edges S_u and S_v (n, 3) float64 of faces.

        Arguments and errors are those of `point`.
        """
        u, _, face, _ = broadcast_parameters(u, v, patch_id, 6, "patch_id")
        swap, rows, size = self._is_swapped(face), np.arange(len(u)), self.hi - self.lo
        edges = np.zeros((2, len(u), 3))
        for k in range(2):
            axis = (face // 2 + np.where(swap, 2 - k, 1 + k)) % 3
            edges[k, rows, axis] = size[axis]
        return edges[0], edges[1]

    def _is_swapped(self, face: NDArray[np.int64]) -> BoolArray:
        """Tell on which faces v, not u, runs along the first of the two other axes."""
        swapped: BoolArray = (face % 2 == 1) != (self.orientation > 0)
        return swapped

    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the unit normals (n, 3) float64 of faces.

        Arguments and errors are those of `point`.
        """
        u, _, face, _ = broadcast_parameters(u, v, patch_id, 6, "patch_id")
        normals = np.zeros((len(u), 3))
        normals[np.arange(len(u)), face // 2] = np.where(face % 2 == 1, 1.0, -1.0)
        return self.orientation * normals

    def area_sampler(self) -> Squares:
        """Return what chooses points evenly by area."""
        x, y, z = self.hi - self.lo
        return Squares(np.array([y * z, y * z, z * x, z * x, x * y, x * y]))

    def transformed(self, matrix: ArrayLike) -> Box:
        """Return the image under a scaling and translation along the axes.

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1): diagonal but for its last column; no zero scale.

        Raises
        ------
        ValueError, TypeError
            For any other matrix.
        """
        linear, shift = as_affine(matrix, "Box")
        if (linear != np.diag(np.diag(linear))).any():
            raise ValueError(
                "Box matrix turns the axes: pass a scaling or translation along them (or use "
                "TriangleMesh, or six rectangles)"
            )
        a, b = linear @ self.lo + shift, linear @ self.hi + shift
        image = Box(np.minimum(a, b), np.maximum(a, b))
        image.orientation = self.orientation
        return image

    def flipped(self) -> Box:
        """Return the same box with its normals reversed."""
        image = Box(self.lo, self.hi)
        image.orientation = -self.orientation
        return image

    def __repr__(self) -> str:
        """Say which box this is."""
        return f"Box(lo={self.lo.tolist()}, hi={self.hi.tolist()})"
