"""Lenses given by a prescription: their surfaces, the light that passes them in order, their focus.

Distances and heights are in the unit of the prescription. Light travels along the z axis, and the
first vertex is at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.shading.snell import refract

# The parabasal rays of `focus` run this part of the first aperture beside the axis: aberrations of third
# order change the focal length by its square, and rounding by its inverse.
BESIDE = 1e-4


@dataclass(frozen=True)
class LensSurface:
    """One line of a lens prescription.

    Attributes
    ----------
    radius : float
        Radius of curvature at the vertex, positive if the surface is convex towards the incoming
        light; inf is a plane.
    thickness : float
        Distance from this vertex to the next one.
    index : float
        Index of refraction behind this surface.
    aperture : float
        Clear diameter.
    conic : float
        Conic constant.
    coefficients : tuple of float
        a_2, a_4, ... as for `Asphere`.
    """

    radius: float
    thickness: float
    index: float
    aperture: float
    conic: float = 0.0
    coefficients: tuple[float, ...] = ()


class Focus(NamedTuple):
    """Where light that arrives along the axis comes together.

    Attributes
    ----------
    focal_length, back_focal_distance : float
        Distances to the focus from the rear principal plane, and from the last vertex.
    """

    focal_length: float
    back_focal_distance: float


@dataclass(frozen=True)
class Traced:
    """Rays behind the last surface of a lens.

    Attributes
    ----------
    position, direction : (n, 3) float64
        The point on the last surface, and the unit direction behind it; nan if a ray does not get
        through.
    passed : (n,) bool
        Whether a ray gets through.
    path : (n,) float64
        Optical path length from the origin of the ray to the last surface: lengths times indices.
    t_bound : (n,) float64
        The largest bound on the error of any hit of the ray.
    """

    position: FloatArray
    direction: FloatArray
    passed: BoolArray
    path: FloatArray
    t_bound: FloatArray

    def at(self, z: float) -> FloatArray:
        """Return the points (n, 2) at which the rays meet the plane across the axis at z."""
        way = (z - self.position[:, 2]) / self.direction[:, 2]
        points: FloatArray = self.position[:, :2] + way[:, None] * self.direction[:, :2]
        return points


class Lens:
    """A sequence of surfaces about the z axis.

    Parameters
    ----------
    prescription : sequence of LensSurface
        The surfaces in the order in which the light meets them. A surface with the same index on
        both sides is a stop.
    index : float
        Index of refraction of the medium in front.
    """

    def __init__(self, prescription: Sequence[LensSurface], index: float = 1.0) -> None:
        self.prescription, self.index = tuple(prescription), index
        steps = [surface.thickness for surface in self.prescription]
        self.vertices = np.concatenate([[0.0], np.cumsum(steps[:-1])])
        self.surfaces = [
            Asphere(s.radius, s.conic, s.coefficients, s.aperture, (0.0, 0.0, z), (0.0, 0.0, 1.0))
            for s, z in zip(self.prescription, self.vertices.tolist(), strict=True)
        ]
        self._tracers = [Intersector(surface) for surface in self.surfaces]

    def trace(self, origins: FloatArray, directions: FloatArray) -> Traced:
        """Refract rays at one surface after the other.

        Rays that miss an aperture, or are totally reflected, do not get through.

        Parameters
        ----------
        origins, directions : (n, 3) float64
            Rays in front of the first surface. Directions may have any length but zero.

        Returns
        -------
        Traced
        """
        n = len(origins)
        position, direction = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
        path, bound, rows = np.zeros(n), np.zeros(n), np.arange(n)
        o = np.array(origins, dtype=np.float64)
        d = np.array(directions, dtype=np.float64)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        index = self.index
        for tracer, surface in zip(self._tracers, self.prescription, strict=True):
            hits = tracer.intersect(o, d)
            found = hits.hit
            rows, hits, d = rows[found], hits[found], d[found]
            path[rows] += index * hits.t
            bound[rows] = np.maximum(bound[rows], hits.t_bound)
            d = refract(d, hits.normal, index, surface.index)
            o, index = hits.position, surface.index
            goes_on = ~np.isnan(d[:, 0])
            rows, o, d = rows[goes_on], o[goes_on], d[goes_on]
        position[rows], direction[rows] = o, d
        passed = np.zeros(n, np.bool_)
        passed[rows] = True
        return Traced(position, direction, passed, np.where(passed, path, np.nan), bound)

    def focus(self) -> Focus:
        """Find the focus of rays close to the axis, by tracing one.

        Raises
        ------
        ValueError
            If the ray does not get through.
        """
        height = BESIDE * self.prescription[0].aperture
        start = -abs(self.surfaces[0].bounds[:, 2]).max() - height
        ray = self.trace(np.array([[height, 0.0, start]]), np.array([[0.0, 0.0, 1.0]]))
        if not ray.passed[0]:
            raise ValueError("a ray beside the axis does not pass the lens: check its apertures")
        x, dx, dz = ray.position[0, 0], ray.direction[0, 0], ray.direction[0, 2]
        crosses = ray.position[0, 2] - x * dz / dx
        return Focus(float(-height * dz / dx), float(crosses - self.vertices[-1]))

    def paraxial_focus(self) -> Focus:
        """Return the focus from the product of paraxial matrices (Gaussian optics), without rays."""
        system, before = np.eye(2), self.index
        last = len(self.prescription) - 1
        for k, s in enumerate(self.prescription):
            a2 = s.coefficients[0] if s.coefficients else 0.0
            curvature = 1.0 / s.radius + 2.0 * a2
            system = (
                np.array([[1.0, 0.0], [(before - s.index) * curvature / s.index, before / s.index]])
                @ system
            )
            if k < last:
                system = np.array([[1.0, s.thickness], [0.0, 1.0]]) @ system
            before = s.index
        height, slope = system @ (1.0, 0.0)
        return Focus(float(-1.0 / slope), float(-height / slope))

    def spot(
        self, field: float, z: float, pupil: float, n: int = 64
    ) -> tuple[FloatArray, FloatArray, float]:
        """Trace parallel light through the lens to a plane.

        Parameters
        ----------
        field : float
            Angle to the axis, degrees, in the y-z plane.
        z : float
            Position of the plane.
        pupil : float
            Diameter of the disc, in the plane of the first vertex, that the light fills.
        n : int
            Number of rays across that disc, on a square grid.

        Returns
        -------
        points : (k, 2) float64
            (x, y) of the rays that get through.
        chief : (2,) float64
            The mean of these points.
        rms : float
            Root mean square distance of the points from their mean.

        Raises
        ------
        ValueError
            If no ray gets through.
        """
        rays = self._parallel(field, pupil, n)
        if not rays.passed.any():
            raise ValueError(
                f"no light from {field:g} degrees passes the lens: check its apertures"
            )
        met = rays.at(z)[rays.passed]
        chief = met.mean(axis=0)
        return met, chief, float(np.sqrt(((met - chief) ** 2).sum(axis=1).mean()))

    def plane_of_least_spread(self, z: float, pupil: float, n: int = 64) -> float:
        """Return the z, near a given one, where the spot of light along the axis is smallest (rms).

        Parameters are those of `spot`.
        """
        rays = self._parallel(0.0, pupil, n)
        points = rays.at(z)[rays.passed]
        slopes = (rays.direction[:, :2] / rays.direction[:, 2:])[rays.passed]
        return z - float((points * slopes).sum() / (slopes * slopes).sum())

    def _parallel(self, field: float, pupil: float, n: int) -> Traced:
        """Trace parallel light that fills a disc in front."""
        side = (np.arange(n) + 0.5) / n - 0.5
        x, y = (pupil * one.ravel() for one in np.meshgrid(side, side))
        inside = np.hypot(x, y) <= 0.5 * pupil
        angle = math.radians(field)
        way = np.array([0.0, math.sin(angle), math.cos(angle)])
        points = np.stack([x[inside], y[inside], np.zeros(int(inside.sum()))], axis=1)
        # From a plane across the light, so far in front that it meets no surface.
        front = (pupil + abs(self.surfaces[0].bounds[0, 2])) / way[2]
        origins = points - (front + points @ way)[:, None] * way
        return self.trace(origins, np.broadcast_to(way, origins.shape))
