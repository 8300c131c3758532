"""The filter of aspheres: rays that pass the ball around one miss it; the rest is left to the judge."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.primitives.asphere import Asphere
from proof.filters.kernels.first import N_COLUMNS, UNSURE_FROM
from proof.filters.surface_filter import SurfaceFilter

# Far beyond the rounding of a distance in float64.
CLEAR = 1e-6


class AsphereFilter(SurfaceFilter, of=Asphere):
    """Asks for exact arithmetic wherever a ray meets the ball around the vertex."""

    surface: Asphere

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Measure the distance of each ray from the vertex."""
        del leaves, hit_t
        out = np.zeros((len(origins), N_COLUMNS))
        away = origins - self.surface.origin
        length = np.linalg.norm(directions, axis=1)
        across = np.linalg.norm(np.cross(away, directions), axis=1) / length
        reach = (1.0 + CLEAR) * self.surface.ball_radius + CLEAR * np.linalg.norm(away, axis=1)
        out[:, UNSURE_FROM] = np.where(across > reach, np.inf, -np.inf)
        return out

    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Measure from the point of the hit, about the vertex."""
        surface = self.surface
        local = surface.transformed(np.eye(4) - np.outer([*surface.origin, 0.0], [0, 0, 0, 1.0]))
        points = local.point(u, v, patch)
        distance: FloatArray = np.linalg.norm(points - (origins - surface.origin) - along, axis=1)
        return distance

    def ball(self) -> tuple[FloatArray, float]:
        """Return the vertex and the diameter of the ball about it."""
        return self.surface.origin, self.surface.size
