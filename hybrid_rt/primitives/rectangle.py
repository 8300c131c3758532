"""Rectangles and parallelograms."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from meshing.area import Squares
from meshing.checks import IdArray, as_affine, as_direction, as_vector
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
    rounding_reach = 0.0
    flip_of_uv = "swapped"
    bend = (0.0, 0.0, 0.0)

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
        along_u = self.corner + self.edge_u
        corners = np.stack([self.corner, along_u, self.corner + self.edge_v, along_u + self.edge_v])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        return self.corner + u[:, None] * self.edge_u + v[:, None] * self.edge_v

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del v, patch_id
        return np.tile(self.edge_u, (len(u), 1)), np.tile(self.edge_v, (len(u), 1))

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del v, patch_id
        return np.tile(self.unit_normal, (len(u), 1))

    def area_sampler(self) -> Squares:
        """Return the area sampler."""
        return Squares(np.array([self.area]))

    def transformed(self, matrix: ArrayLike) -> Rectangle:
        """Return the image under an affine map; see `meshing.surface.Surface.transformed`."""
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
