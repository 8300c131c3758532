"""Tori."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.axial import AxialSurface
from meshing.checks import IdArray, as_similarity, freeze, number, still_unit
from meshing.double_double import misfit, pair_of, rounded_image, rounding_of_product, stretched


class Torus(AxialSurface):
    """A torus. Its normal points outward unless it is flipped.

    S(u, v) = origin + (R + r cos 2 pi v) (cos 2 pi u radial + sin 2 pi u binormal)
    + r sin 2 pi v axis, with R and r the two radii and binormal = axis x radial: u runs about the
    axis, right-handed, and v about the tube, from the outer rim toward ``axis``. On a flipped torus
    v runs the other way, so that S_u x S_v, and with it the normal, points into the tube.

    Parameters
    ----------
    origin : (3,) scene units
        The centre.
    axis : (3,) direction of any length
    major_radius : positive number, scene units
        Radius of the tube's centre line.
    minor_radius : positive number, scene units
        Radius of the tube; less than ``major_radius``.
    reference : (3,) direction of any length, optional
        u is 0 along this vector, projected onto the plane across the axis. Default: the coordinate
        axis least aligned with ``axis``.

    Raises
    ------
    ValueError, TypeError
        For radii that are not positive and finite, a tube that reaches the axis, vectors that are
        not finite numbers, and a reference along the axis.

    Attributes
    ----------
    origin, axis, radial, binormal : (3,) float64, read-only
        The last three are unit vectors.
    major_radius, minor_radius : float
    """

    is_closed = True
    flip_of_uv = "v reversed"
    closes = (True, True)

    def __init__(
        self,
        origin: ArrayLike,
        axis: ArrayLike,
        major_radius: float,
        minor_radius: float,
        reference: ArrayLike | None = None,
    ) -> None:
        self._set_frame(origin, axis, reference)
        self.major_radius = number(major_radius, "Torus major_radius", above=0.0)
        self.minor_radius = number(
            minor_radius, "Torus minor_radius", above=0.0, hint="for the inside, use .flipped()"
        )
        if not self.minor_radius < self.major_radius:
            raise ValueError(
                f"Torus minor_radius is {self.minor_radius:g}, major_radius {self.major_radius:g}: "
                "pass a smaller minor_radius (a tube that reaches the axis meets itself)"
            )

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner."""
        # Of all circles about the axis the widest part along a coordinate is as long as that
        # coordinate's own part across the axis.
        across = np.hypot(self.radial, self.binormal)
        half = self.major_radius * across + self.minor_radius
        return np.stack([self.origin - half, self.origin + half])

    @property
    def size(self) -> float:
        """The diameter, scene units."""
        return 2.0 * (self.major_radius + self.minor_radius)

    @property
    def carrier(self) -> tuple[float, ...]:
        """Equal for equal tori; other tori share no area with it."""
        # Of an axis and its opposite, which make the same torus, one.
        sign = 1.0 if self.axis[np.abs(self.axis).argmax()] > 0.0 else -1.0
        radii = self.major_radius, self.minor_radius
        return (*self.origin.tolist(), *(sign * self.axis + 0.0).tolist(), *radii)

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        cos_u, sin_u, cos_v, sin_v = self._turns(u, v)
        ring = self.major_radius + self.minor_radius * cos_v
        return self.origin + self._world(ring * cos_u, ring * sin_u, self.minor_radius * sin_v)

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del patch_id
        cos_u, sin_u, cos_v, sin_v = self._turns(u, v)
        ring = 2.0 * np.pi * (self.major_radius + self.minor_radius * cos_v)
        tube = 2.0 * np.pi * self.orientation * self.minor_radius
        # `_turns` has turned v with the orientation: its derivative has that sign once more.
        along_v = self._world(-sin_v * cos_u, -sin_v * sin_u, cos_v)
        return self._world(-ring * sin_u, ring * cos_u, np.zeros_like(ring)), tube * along_v

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        cos_u, sin_u, cos_v, sin_v = self._turns(u, v)
        return self.orientation * self._world(cos_v * cos_u, cos_v * sin_u, sin_v)

    @property
    def bend(self) -> tuple[float, float, float]:
        """Bounds on |S_uu|, |S_uv| and |S_vv|."""
        tube = 4.0 * np.pi**2 * self.minor_radius
        return tube + 4.0 * np.pi**2 * self.major_radius, tube, tube

    def _turns(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, ...]:
        """Return cosine and sine of both angles; that about the tube counts toward the axis."""
        a, b = 2.0 * np.pi * u, 2.0 * np.pi * self.orientation * v
        return np.cos(a), np.sin(a), np.cos(b), np.sin(b)

    def transformed(self, matrix: ArrayLike) -> Torus:
        """Return the image under a similarity; see `meshing.surface.Surface.transformed`."""
        turn, shift, scale, is_reflection = as_similarity(matrix, "Torus")
        # A mirrored angle runs the other way about a mirrored axis: the axis is turned round.
        sign = -1 if is_reflection else 1
        image = copy.copy(self)
        linear = np.asarray(matrix, np.float64)[:3, :3]
        origin, off = rounded_image(linear, shift, pair_of(self.origin))
        image.origin = freeze(origin)
        image.axis = freeze(still_unit(sign * (turn @ self.axis), "axis"))
        radial = turn @ self.radial
        image.radial = freeze(still_unit(radial - (radial @ image.axis) * image.axis, "radial"))
        image.major_radius = scale * self.major_radius
        image.minor_radius = scale * self.minor_radius
        image.orientation = sign * self.orientation
        off += 0.5 * self.size * misfit(linear, scale, self.axis, sign * image.axis)
        off += rounding_of_product(scale, self.major_radius)
        off += rounding_of_product(scale, self.minor_radius)
        image.moved = off + stretched(linear, self.moved)
        return image

    def __repr__(self) -> str:
        """Say which torus this is."""
        return (
            f"Torus(origin={self.origin.tolist()}, axis={self.axis.tolist()}, "
            f"major_radius={self.major_radius}, minor_radius={self.minor_radius})"
        )
