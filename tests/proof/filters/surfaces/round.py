"""The filters of spheres and tori."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.primitives import Sphere
from hybrid_rt.primitives.torus import Torus
from proof.filters.kernels import sphere, torus
from proof.filters.kernels.first import N_COLUMNS
from proof.filters.surface_filter import (
    SurfaceFilter,
    crossings_scratch,
    solver_scratch,
)


class SphereFilter(SurfaceFilter, of=Sphere):
    """Solves the quadratic."""

    surface: Sphere

    def __init__(self, surface: Sphere) -> None:
        super().__init__(surface)
        self._table = sphere.Ball(np.array(surface.center), float(surface.radius))
        self._scratch = sphere.SphereScratch(np.zeros((3, 3)), crossings_scratch())

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Solve the quadratic of each ray."""
        out = np.zeros((len(origins), N_COLUMNS))
        sphere.first_on_sphere(self._table, origins, directions, leaves, hit_t, self._scratch, out)
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the sphere itself."""
        del u, v, patch
        away = origins - self.surface.center + along
        distance: FloatArray = np.abs(np.linalg.norm(away, axis=1) - self.surface.radius)
        return distance

    def ball(self) -> tuple[FloatArray, float]:
        """Return the centre and the diameter."""
        return np.array(self.surface.center), 2.0 * float(self.surface.radius)


class TorusFilter(SurfaceFilter, of=Torus):
    """Solves the quartic."""

    surface: Torus

    def __init__(self, surface: Torus) -> None:
        super().__init__(surface)
        middle, size = self.ball()
        self._table = torus.Ring(
            centre=np.array(surface.origin),
            axis=np.array(surface.axis),
            major=float(surface.major_radius),
            minor=float(surface.minor_radius),
            middle=middle,
            size=size,
        )
        self._scratch = torus.TorusScratch(
            **solver_scratch(4), away=np.zeros((3, 3)), crossings=crossings_scratch()
        )

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Solve the quartic of each ray."""
        out = np.zeros((len(origins), N_COLUMNS))
        torus.first_on_torus(self._table, origins, directions, leaves, hit_t, self._scratch, out)
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the torus itself."""
        del u, v, patch
        surface = self.surface
        away = origins - surface.origin + along
        height = away @ surface.axis
        ring = np.linalg.norm(away - height[:, None] * surface.axis, axis=1)
        distance: FloatArray = np.abs(
            np.hypot(ring - surface.major_radius, height) - surface.minor_radius
        )
        return distance

    def ball(self) -> tuple[FloatArray, float]:
        """Return the middle of the ring and the outer diameter."""
        surface = self.surface
        return np.array(surface.origin), 2.0 * (surface.major_radius + surface.minor_radius)
