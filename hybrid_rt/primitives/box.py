"""Axis-aligned boxes, and parallelepipeds."""

from __future__ import annotations

import copy
from fractions import Fraction
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.primitives.rectangle import exact_cross, near_one
from meshing.area import Squares
from meshing.checks import IdArray, as_affine, as_vector, freeze, unit
from meshing.double_double import Pair, exact_sum, pair_of, rounded_image, stretched
from meshing.surface import Surface


class Box(Surface):
    """An axis-aligned box. Its normals point outward unless it is flipped.

    `transformed` returns a `TurnedBox`, a parallelepiped, where the image is not axis-aligned.

    ``patch_id`` counts the faces -x, +x, -y, +y, -z, +z. On each face u and v run from 0 to 1 along
    the two other axes, in the order (y, z), (z, x), (x, y). On the lower faces the order is
    reversed, so that the normal is along S_u x S_v; on a flipped box it is reversed on the upper
    faces instead.

    Parameters
    ----------
    lo, hi : (3,) scene units
        Lowest and highest corner: lo < hi in every coordinate.

    Attributes
    ----------
    lo, hi : (3,) float64
        Lowest and highest corner.
    edges : (3, 3) float64
        Rows: the edges from ``lo`` along x, y and z.
    is_upright : bool
        Whether the box is axis-aligned.
    orientation : int
        1, or -1 if flipped.

    Raises
    ------
    ValueError, TypeError
        For corners that are not finite numbers, or not in order, and edges shorter than 1e-60 or
        longer than 1e60.
    """

    is_upright: ClassVar[bool] = True
    handedness = 1
    is_closed = True
    rounding_reach = 0.0

    def __init__(self, lo: ArrayLike, hi: ArrayLike) -> None:
        self.lo = checks.as_vector(lo, "Box lo", up_to=checks.FARTHEST)
        self.hi = checks.as_vector(hi, "Box hi", up_to=checks.FARTHEST)
        if not (self.lo < self.hi).all():
            raise ValueError(
                f"Box lo is {self.lo.tolist()}, not below hi, {self.hi.tolist()}: "
                "pass the lower corner first (for a flat face, use Rectangle)"
            )
        self.edges = freeze(np.diag(self.hi - self.lo))
        for axis, edge in zip("xyz", self.edges, strict=True):
            checks.edge(edge, f"Box edge along {axis}")
        self.orientation = 1

    def __len__(self) -> int:
        """Return the number of faces."""
        return 6

    @property
    def areas(self) -> FloatArray:
        """(6,): areas of the faces."""
        x, y, z = self.hi - self.lo
        return np.array([y * z, y * z, z * x, z * x, x * y, x * y])

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner."""
        return np.stack([self.lo, self.hi])

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        weight = self._weights(u, v, patch_id)
        return self.lo * (1.0 - weight) + self.hi * weight

    def _weights(self, u: FloatArray, v: FloatArray, face: IdArray) -> FloatArray:
        """Return how far along each of the three axes points lie, (n, 3) from 0 to 1."""
        axis, swap, rows = face // 2, self._is_swapped(face), np.arange(len(u))
        weight = np.empty((len(u), 3))
        weight[rows, axis] = face % 2 == 1
        weight[rows, (axis + 1) % 3] = np.where(swap, v, u)
        weight[rows, (axis + 2) % 3] = np.where(swap, u, v)
        return weight

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del u, v
        axis, first = patch_id // 2, np.where(self._is_swapped(patch_id), 2, 1)
        return self.edges[(axis + first) % 3], self.edges[(axis + 3 - first) % 3]

    def _is_swapped(self, face: IdArray) -> BoolArray:
        """Tell on which faces v, not u, runs along the first of the two other axes."""
        return (face % 2 == 1) != (self.orientation * self.handedness > 0)

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del v
        normals = np.zeros((len(u), 3))
        normals[np.arange(len(u)), patch_id // 2] = np.where(patch_id % 2 == 1, 1.0, -1.0)
        return self.orientation * normals

    def area_sampler(self) -> Squares:
        """Return the area sampler."""
        return Squares(self.areas)

    def transformed(self, matrix: ArrayLike) -> Box:
        """Return the image under an affine map: a `Box` if the matrix is diagonal, else a `TurnedBox`.

        A quarter turn makes a `TurnedBox`, too, though its faces are across the axes. A `Box` numbers
        its faces along the axes again. In a `TurnedBox` faces and (u, v) stay with their points, except
        that a reflection swaps u and v, since normals stay outward. See `meshing.surface.Surface.transformed`.
        """
        linear, shift = as_affine(matrix, "Box")
        if (linear != np.diag(np.diag(linear))).any():
            high, low = exact_sum(self.hi, -self.lo)
            return self._turned(linear, shift, (np.diag(high), np.diag(low)))
        (a, b), off = rounded_image(linear, shift, pair_of(np.stack([self.lo, self.hi])))
        image = Box(np.minimum(a, b), np.maximum(a, b))
        image.orientation = self.orientation
        image.moved = off + stretched(linear, self.moved)
        return image

    def _turned(self, linear: FloatArray, shift: FloatArray, edges: Pair) -> TurnedBox:
        """Return the image as a parallelepiped of the edges' images."""
        corner, off = rounded_image(linear, shift, pair_of(self.lo))
        turned, turned_off = rounded_image(linear, np.zeros(3), edges)
        image = TurnedBox(corner, turned, self.orientation)
        image.moved = off + 3.0 * turned_off + stretched(linear, self.moved)
        return image

    def flipped(self) -> Self:
        """Return the same box with its normals reversed."""
        image = copy.copy(self)
        image.orientation = -self.orientation
        return image

    def __repr__(self) -> str:
        """Say which box this is."""
        return f"Box(lo={self.lo.tolist()}, hi={self.hi.tolist()})"


class TurnedBox(Box):
    """A parallelepiped, as `Box.transformed` makes it: a corner, and its three edges as rows.

    Faces and (u, v) are those of `Box` along its own edges. If these are left-handed (`handedness` -1), u and
    v are swapped, as normals stay outward, or with an orientation of -1 inward. `across` (3, 3) has the unit
    normals of the upper faces, away from the lower ones, `depths` (3,) the distances between both.
    """

    is_upright = False

    def __init__(self, corner: ArrayLike, edges: ArrayLike, orientation: int = 1) -> None:
        self.lo = as_vector(corner, "Box corner")
        rows = [checks.edge(edge, "Box edge") for edge in np.asarray(edges)]
        self.edges = freeze(np.stack(rows))
        self.hi = as_vector(self.lo + self.edges.sum(axis=0), "Box corner")
        if not np.abs(self.edges).max(axis=1).all():
            raise ValueError(f"Box edges are {self.edges.tolist()}: pass edges longer than zero")
        # Near one, so that nothing overflows, and exact: flat boxes would lose digits.
        (x, by_x), (y, by_y), (z, by_z) = (near_one(edge) for edge in self.edges)
        sides = [exact_cross(a, b) for a, b in ((y, z), (z, x), (x, y))]
        volume = sum(Fraction(a) * b for a, b in zip(x.tolist(), sides[0], strict=True))
        if volume == 0:
            raise ValueError(
                f"Box edges are {self.edges.tolist()}, in one plane: pass edges that span a volume"
            )
        self.handedness = 1 if volume > 0 else -1
        rounded = np.array([[float(number) for number in side] for side in sides])
        normals = np.stack([unit(side, "Box normal") for side in rounded])
        self.across = freeze(self.handedness * normals)
        lengths = np.linalg.norm(rounded, axis=1)
        powers = np.array([by_x, by_y, by_z])
        self.depths = freeze(np.ldexp(abs(float(volume)) / lengths, powers))
        self._areas = np.ldexp(lengths, powers.sum() - powers)
        self.orientation = orientation

    @property
    def areas(self) -> FloatArray:
        """(6,): areas of the faces."""
        return np.repeat(self._areas, 2)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner of a box along the axes."""
        steps = np.stack(np.meshgrid(*3 * [(0.0, 1.0)]), axis=-1).reshape(-1, 3)
        corners = self.lo + steps @ self.edges
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        return self.lo + self._weights(u, v, patch_id) @ self.edges

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del u, v
        side = self.orientation * np.where(patch_id % 2 == 1, 1.0, -1.0)
        return side[:, None] * self.across[patch_id // 2]

    def transformed(self, matrix: ArrayLike) -> TurnedBox:
        """Return the image under an affine map; faces stay with their points."""
        linear, shift = as_affine(matrix, "Box")
        return self._turned(linear, shift, pair_of(self.edges))

    def __repr__(self) -> str:
        """Say which box this is."""
        return f"Box at {self.lo.tolist()} with edges {self.edges.tolist()}"
