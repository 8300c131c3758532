"""Infinite planes."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.rectangle import exact_cross, near_one
from meshing.checks import IdArray, as_affine, freeze
from meshing.double_double import pair_of, rounded_image, stretched
from meshing.surface import Surface


class Plane(Surface):
    """An infinite plane: all points x with (x - point) . normal = 0.

    u and v are the fractional parts of two world coordinates: of those that follow, in the order x, y, z,
    x, y, the one in which the normal is largest; exchanged if the normal is negative there (`axes`).

    Parameters
    ----------
    point : (3,) scene units
        Any point of the plane.
    normal : (3,) direction of any length

    Raises
    ------
    ValueError, TypeError
        For vectors that are not finite numbers, or a zero normal.
    """

    is_bounded = False
    is_flat = True
    size = rounding_reach = 0.0
    #: Bound on the angle by which rounding has turned an image; besides, `moved` is that of `origin`.
    tilt = 0.0

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        self.origin = checks.as_vector(point, "Plane point", up_to=checks.FARTHEST)
        self.unit_normal = checks.as_direction(normal, "Plane normal")
        given = checks.as_vector(normal, "Plane normal")
        _, exponent = np.frexp(np.abs(given).max())
        #: (3,) The normal as given, times the power of 2 that brings its largest coordinate into
        #: [1, 2). `unit_normal` is rounded: far along a ray nearly within the plane that shows.
        self.exact_normal = freeze(np.ldexp(given, 1 - exponent))

    @property
    def axes(self) -> tuple[int, int]:
        """The two coordinates that give u and v, in the order in which S_u x S_v is along the normal."""
        across = int(np.abs(self.unit_normal).argmax())
        first, second = (across + 1) % 3, (across + 2) % 3
        return (first, second) if self.unit_normal[across] > 0.0 else (second, first)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): -inf and inf."""
        return np.stack([np.full(3, -np.inf), np.full(3, np.inf)])

    @property
    def middle(self) -> FloatArray:
        """(3,): ``point``."""
        return self.origin

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        """Return the points with coordinates (u, v) along `axes`."""
        del patch_id
        first, second = self.axes
        across = 3 - first - second
        points = np.empty((len(u), 3))
        points[:, first], points[:, second] = u, v
        n, o = self.unit_normal, self.origin
        points[:, across] = (
            o[across] - ((u - o[first]) * n[first] + (v - o[second]) * n[second]) / n[across]
        )
        return points

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del v, patch_id
        axes = self.axes
        across = 3 - sum(axes)
        edges = np.zeros((2, len(u), 3))
        for edge, axis in zip(edges, axes, strict=True):
            edge[:, axis] = 1.0
            edge[:, across] = -self.unit_normal[axis] / self.unit_normal[across]
        return edges[0], edges[1]

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del v, patch_id
        return np.tile(self.unit_normal, (len(u), 1))

    def transformed(self, matrix: ArrayLike) -> Plane:
        """Return the image under an affine map; see `meshing.surface.Surface.transformed`."""
        linear, shift = as_affine(matrix, "Plane")
        point, off = rounded_image(linear, shift, pair_of(self.origin))
        # The cofactors are the inverse transpose times the determinant, whose sign keeps S_u x S_v on its
        # side. The length of the normal is free: near one, nothing overflows.
        plain, _ = near_one(linear)
        rows = [exact_cross(plain[i - 2], plain[i - 1]) for i in range(3)]
        given = [Fraction(x) for x in self.exact_normal.tolist()]
        exact = [sum((a * b for a, b in zip(row, given, strict=True)), Fraction(0)) for row in rows]
        unit = Fraction(2) ** math.frexp(float(max(map(abs, exact))))[1]
        normal = np.array([float(x / unit) for x in exact])
        left = [float(x / unit - Fraction(a)) for x, a in zip(exact, normal.tolist(), strict=True)]
        image = Plane(point, normal)
        image.moved = off + stretched(linear, self.moved)
        image.tilt = float(np.linalg.norm(left) / np.linalg.norm(normal)) * (1.0 + 2.0**-40)
        if self.tilt > 0.0:
            image.tilt += self.tilt * 1.01 * float(np.linalg.cond(linear))
        return image

    def flipped(self) -> Plane:
        """Return the same plane with its normal reversed."""
        image = Plane(self.origin, -self.exact_normal)
        image.moved, image.tilt = self.moved, self.tilt
        return image

    def __repr__(self) -> str:
        """Say which plane this is."""
        return f"Plane(point={self.origin.tolist()}, normal={self.exact_normal.tolist()})"
