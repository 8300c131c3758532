"""Judges spheres: the quadratic in double-double, and to many digits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Sphere
from proof.judges.kernels import closed_forms
from proof.judges.surface_judge import Number, Solver, SurfaceJudge, Vector, Worker


class SphereJudge(SurfaceJudge, of=Sphere):
    """What is known of a sphere."""

    surface: Sphere

    def worker(self, object_id: int) -> Worker:
        """Return a function that solves the quadratic."""
        center = np.array(self.surface.center, dtype=np.float64)
        radius = float(self.surface.radius)
        return lambda first, o, d, _low, out: closed_forms.sphere_events(
            center, radius, object_id, first, o, d, out
        )

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return azimuth and polar angle of points, as parts of a whole and of half a turn."""
        x, y, z = self.surface.frame @ (points - self.surface.center).T
        return np.arctan2(y, x) / (2.0 * np.pi) % 1.0, np.arctan2(np.hypot(x, y), -z) / np.pi

    def solver(self) -> Solver:
        """Return a function that solves the quadratic to many digits."""
        import mpmath

        from proof.judges.digits import dot, numbers

        center, radius = numbers(self.surface.center), mpmath.mpf(float(self.surface.radius))

        def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
            w = [a - b for a, b in zip(o, center, strict=True)]
            a, b, c = dot(d, d), dot(d, w), dot(w, w) - radius * radius
            square = b * b - a * c
            if square < 0:
                return mpmath.nan
            roots = [(-b + sign * mpmath.sqrt(square)) / a for sign in (-1, 1)]
            return min(roots, key=lambda root: abs(root - t))

        return solve

    def gap(
        self,
        origins: FloatArray,
        along: FloatArray,
        u: FloatArray,
        v: FloatArray,
        patch_id: NDArray[Any],
    ) -> FloatArray:
        """Return how far points lie from the sphere: its (u, v) may round more than that."""
        del u, v, patch_id
        away: FloatArray = np.linalg.norm(origins - self.surface.center + along, axis=1)
        return np.abs(away - self.surface.radius)
