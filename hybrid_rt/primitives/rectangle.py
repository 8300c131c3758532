"""Rectangles and parallelograms."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from meshing.area import Squares
from meshing.checks import as_affine, as_direction, as_vector, broadcast_parameters
from meshing.double_double import pair_of, rounded_image, stretched
from meshing.surface import Surface


class Rectangle(Surface):
    """A rectangle or parallelogram, the points ``corner + u edge_u + v edge_v``, u and v in [0, 1].

    The normal is along edge_u x edge_v. The edges need not be perpendicular.

    Parameters
    ----------
    corner, edge_u, edge_v : (3,) scene units

    Raises
    ------
    ValueError, TypeError
        For vectors that are not finite numbers, and edges that span no area or are shorter than 1e-60
        or longer than 1e60.
    """

    is_flat = True
    flip_of_uv = "swapped"

    def __init__(self, corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike) -> None:
        self.corner = as_vector(corner, "Rectangle corner")
        self.edge_u = checks.edge(edge_u, "Rectangle edge_u")
        self.edge_v = checks.edge(edge_v, "Rectangle edge_v")
        # Each brought near one by a power of two, so that no product of large components overflows or vanishes.
        (u, by_u), (v, by_v) = near_one(self.edge_u), near_one(self.edge_v)
        across = np.array([float(x) for x in exact_cross(u, v)])
        if np.linalg.norm(across) <= 1e-12 * np.linalg.norm(u) * np.linalg.norm(v):
            raise ValueError(
                f"Rectangle edges are {self.edge_u.tolist()} and {self.edge_v.tolist()}, of no area: "
                "pass two edges in different directions"
            )
        self.unit_normal = as_direction(across, "Rectangle normal")
        #: Scene units squared.
        self.area = float(np.ldexp(np.linalg.norm(across), by_u + by_v))

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner."""
        corners = self.point([0, 1, 0, 1], [0, 0, 1, 1])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def rounding_reach(self) -> float:
        """0: a hit rounds as its coordinates do."""
        return 0.0

    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the points (..., 3) float64 at (u, v), scene units.

        Parameters
        ----------
        u, v : floats that broadcast with each other and with ``patch_id``
        patch_id : whole numbers
            0: there is one piece.

        Raises
        ------
        ValueError, TypeError
            If they do not broadcast, or there is no such piece.
        """
        u, v, _, shape = broadcast_parameters(u, v, patch_id, 1, "patch_id")
        points: FloatArray = self.corner + u[:, None] * self.edge_u + v[:, None] * self.edge_v
        return points.reshape(*shape, 3)

    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0
    ) -> tuple[FloatArray, FloatArray]:
        """Return the edges, S_u and S_v, (..., 3) float64.

        Arguments and errors are those of `point`.
        """
        *_, shape = broadcast_parameters(u, v, patch_id, 1, "patch_id")
        return np.tile(self.edge_u, (*shape, 1)), np.tile(self.edge_v, (*shape, 1))

    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the unit normals (..., 3) float64.

        Arguments and errors are those of `point`.
        """
        return np.zeros_like(self.point(u, v, patch_id)) + self.unit_normal

    def area_sampler(self) -> Squares:
        """Return the area sampler."""
        return Squares(np.array([self.area]))

    def transformed(self, matrix: ArrayLike) -> Rectangle:
        """Return the image under an affine map.

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1); last row (0, 0, 0, 1); not singular.

        Raises
        ------
        ValueError, TypeError
            For any other matrix.
        """
        linear, shift = as_affine(matrix, "Rectangle")
        corner, off = rounded_image(linear, shift, pair_of(self.corner))
        edges = pair_of(np.stack([self.edge_u, self.edge_v]))
        turned, turned_off = rounded_image(linear, np.zeros(3), edges)
        image = Rectangle(corner, *turned)
        image.moved = off + 2.0 * turned_off + stretched(linear, self.moved)
        return image

    def flipped(self) -> Rectangle:
        """Return the rectangle with u and v swapped, and so with its normal reversed."""
        image = Rectangle(self.corner, self.edge_v, self.edge_u)
        image.moved = self.moved
        return image

    def __repr__(self) -> str:
        """Say which rectangle this is."""
        return (
            f"Rectangle(corner={self.corner.tolist()}, edge_u={self.edge_u.tolist()}, "
            f"edge_v={self.edge_v.tolist()})"
        )


def near_one(edge: FloatArray) -> tuple[FloatArray, int]:
    """Return an edge (3,) over a power of two that brings it near one, and the exponent."""
    exponent = int(np.frexp(np.abs(edge).max())[1])
    return np.ldexp(edge, -exponent), exponent


def exact_cross(a: FloatArray, b: FloatArray) -> list[Fraction]:
    """Return a x b: of nearly parallel edges no digit is lost."""
    x, y = ([Fraction(number) for number in vector.tolist()] for vector in (a, b))
    turns = ((1, 2), (2, 0), (0, 1))
    return [x[i] * y[j] - x[j] * y[i] for i, j in turns]
