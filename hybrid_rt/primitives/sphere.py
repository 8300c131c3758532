"""Spheres."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from meshing.area import AreaSampler
from meshing.checks import IdArray, as_direction, as_similarity, as_vector, number
from meshing.double_double import misfit, pair_of, rounded_image, rounding_of_product, stretched
from meshing.surface import Surface


class Sphere(Surface):
    """A sphere. Its normal points outward unless it is flipped.

    ``u`` is the azimuth over 2 pi from ``meridian``, right-handed about ``pole``; ``v`` is the
    polar angle over pi, 0 at the south pole and 1 at ``pole``. On a flipped sphere the azimuth runs
    the other way, so that S_u x S_v, and with it the normal, points inward.

    Parameters
    ----------
    center : (3,) scene units
    radius : positive number, scene units
    pole, meridian : (3,) directions of any length, not parallel
        The axis of the parameters, and where u is 0: ``meridian`` is projected onto the plane
        across ``pole``.

    Raises
    ------
    ValueError, TypeError
        For a radius that is not positive and finite, vectors that are not finite numbers, and a
        meridian along the pole.
    """

    is_closed = True
    flip_of_uv = "u reversed"
    closes = (True, False)
    poles = (True, True)
    rounding_reach = 0.0

    def __init__(
        self,
        center: ArrayLike,
        radius: float,
        pole: ArrayLike = (0, 0, 1),
        meridian: ArrayLike = (1, 0, 0),
    ) -> None:
        self.center = as_vector(center, "Sphere center")
        self.radius = number(
            radius, "Sphere radius", above=0.0, hint="for the inside, use .flipped()"
        )
        self.pole = as_direction(pole, "Sphere pole")
        given = as_direction(meridian, "Sphere meridian")
        across = given - (given @ self.pole) * self.pole
        if np.linalg.norm(across) < 1e-6:
            if not np.array_equal(np.asarray(meridian), (1, 0, 0)):
                raise ValueError(
                    f"Sphere meridian is {given.tolist()}, along the pole: pass another direction"
                )
            across = np.cross(self.pole, (0.0, 1.0, 0.0))  # the default, beside a pole along x
        self.meridian = as_direction(across, "Sphere meridian")
        self.orientation = 1

    @property
    def frame(self) -> FloatArray:
        """(3, 3): rows along azimuth 0, along azimuth 90 degrees, and along the pole."""
        quarter = self.orientation * np.cross(self.pole, self.meridian)
        return np.stack([self.meridian, quarter, self.pole])

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner."""
        return np.stack([self.center - self.radius, self.center + self.radius])

    # There may be many: no array where a number will do.
    @property
    def middle(self) -> FloatArray:
        """(3,): the centre."""
        return self.center

    @property
    def size(self) -> float:
        """The diameter, scene units."""
        return 2.0 * self.radius

    @property
    def reach(self) -> float:
        """Largest absolute coordinate of its points, scene units."""
        return float(max(map(abs, self.center.tolist()))) + self.radius

    @property
    def ball(self) -> tuple[FloatArray, float]:
        """Centre and radius."""
        return self.center, self.radius

    @property
    def carrier(self) -> tuple[float, ...]:
        """A key that is equal for equal spheres; other spheres share no area with this one."""
        return (*self.center.tolist(), self.radius)

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        from hybrid_rt.core.kernels.sphere_points import settle_on_sphere

        del patch_id
        points: FloatArray = self.center + self.radius * self._outward(u, v)
        settle_on_sphere(points, *self.center.tolist(), self.radius)
        return points

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        return self.orientation * self._outward(u, v)

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del patch_id
        azimuth, polar = 2.0 * np.pi * u, np.pi * v
        ring, height = np.sin(polar), np.cos(polar)
        x, y, zero = np.cos(azimuth), np.sin(azimuth), np.zeros_like(u)
        along_u = 2.0 * np.pi * np.stack([-ring * y, ring * x, zero], axis=-1)
        along_v = np.pi * np.stack([height * x, height * y, ring], axis=-1)
        return self.radius * (along_u @ self.frame), self.radius * (along_v @ self.frame)

    def area_sampler(self) -> AreaSampler:
        """Return the area sampler."""
        return _Bands(np.array([4.0 * np.pi * self.radius**2]))

    @property
    def bend(self) -> tuple[float, float, float]:
        """Bounds on |S_uu|, |S_uv| and |S_vv|."""
        square = np.pi**2 * self.radius
        return 4.0 * square, 2.0 * square, square

    def _outward(self, u: FloatArray, v: FloatArray) -> FloatArray:
        azimuth, polar = 2.0 * np.pi * u, np.pi * v
        ring = np.sin(polar)
        local = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), -np.cos(polar)], axis=-1)
        return local @ self.frame

    def transformed(self, matrix: ArrayLike) -> Sphere:
        """Return the image under a similarity; see `meshing.surface.Surface.transformed`."""
        turn, shift, scale, is_reflection = as_similarity(matrix, "Sphere")
        linear = np.asarray(matrix, np.float64)[:3, :3]
        center, off = rounded_image(linear, shift, pair_of(self.center))
        image = Sphere(center, scale * self.radius, turn @ self.pole, turn @ self.meridian)
        image.orientation = self.orientation * (-1 if is_reflection else 1)
        off += self.radius * misfit(linear, scale) + rounding_of_product(scale, self.radius)
        image.moved = off + stretched(linear, self.moved)
        return image

    def flipped(self) -> Sphere:
        """Return the same sphere with its normal reversed."""
        image = copy.copy(self)
        image.orientation = -self.orientation
        return image

    def __repr__(self) -> str:
        """Say which sphere this is."""
        return f"Sphere(center={self.center.tolist()}, radius={self.radius})"


class _Bands(AreaSampler):
    """Even in the azimuth and in the height: between planes of equal distance lie equal areas."""

    def within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        return cell, eta, np.arccos(np.clip(1.0 - 2.0 * xi, -1.0, 1.0)) / np.pi
