"""Judges aspheres: the roots of a polynomial in exact fractions (needs python-flint)."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.asphere import Asphere
from meshing.surface import Surface
from proof.judges.asphere_roots import AsphereRoots
from proof.judges.kernels import events
from proof.judges.near_rays import near_rays
from proof.judges.surface_judge import (
    Number,
    Solver,
    SurfaceJudge,
    Vector,
    Worker,
    about_axis,
    about_origin,
)

# Over the root of the band: the flattest contact that still counts as one with a doubtful root.
FLATTEST = 0.1


class AsphereJudge(SurfaceJudge, of=Asphere):
    """What is known of an asphere."""

    surface: Asphere
    examples: ClassVar = {
        "aspheres": lambda: [
            Asphere(2.0, -0.6, [0.0, 0.02, -0.01], 2.4, (0, 0, 0), (0.3, -0.2, 1.0)),
            Asphere(-1.5, 0.4, [0.05, -0.04], 1.6, (0.9, 0.4, 0.8), (1, 0, 0)).flipped(),
        ]
    }

    def worker(self, object_id: int) -> Worker:
        """Return a function that isolates the roots of the polynomial, ray by ray."""
        import flint

        roots = AsphereRoots(self.surface)
        center, size = np.array(self.surface.origin), self.surface.size

        def work(
            first: int, o: FloatArray, d: FloatArray, _low: FloatArray, out: events.Events
        ) -> None:
            for i, band, _ in near_rays(center, size, o, d):
                exact = [
                    [flint.fmpq(*float(x).as_integer_ratio()) for x in row] for row in (o[i], d[i])
                ]
                found = roots(*exact)
                for place in found:
                    if (place.beyond > 0.0 and place.from_rim > band) or place.gap > band:
                        continue
                    # Moving the ray by the band makes or loses what touches, or is at the rim.
                    is_sure = place.times == 1 and min(place.depth, place.from_rim) > band
                    kind = events.ROOT if is_sure else events.DOUBTFUL
                    widest = 0.0 if is_sure else FLATTEST * math.sqrt(band / size)
                    events.note(
                        out, first + i, float(place.t.mid()), object_id, 0, 0.0, 0.0,
                        max(place.cosine, widest), band, kind, 0,
                    )  # fmt: skip

        return work

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the angle of points, and their distance from the axis over half the aperture."""
        u, from_axis, _ = about_axis(self.surface, points)
        v = 2.0 * from_axis / self.surface.aperture
        return u, v if self.surface.orientation > 0 else 1.0 - v

    def about_itself(self) -> tuple[Surface, FloatArray]:
        """Return it about its vertex."""
        return about_origin(self.surface)

    def solver(self) -> Solver:
        """Return Newton's method on the sag, to many digits."""
        import mpmath

        from proof.judges.digits import MOST_STEPS, SMALL, dot, numbers

        surface = self.surface
        center, axis = numbers(surface.origin), numbers(surface.axis)
        conic, coefficients = mpmath.mpf(surface.conic), numbers(surface.coefficients)
        c = mpmath.mpf(0) if math.isinf(surface.radius) else 1 / mpmath.mpf(surface.radius)
        length = mpmath.sqrt(dot(axis, axis))
        axis = [x / length for x in axis]

        def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
            away = [a - b for a, b in zip(o, center, strict=True)]
            x = mpmath.mpf(t)
            for _ in range(MOST_STEPS):
                point = [a + x * b for a, b in zip(away, d, strict=True)]
                z, climb = dot(point, axis), dot(d, axis)
                w = dot(point, point) - z**2
                rate = 2 * (dot(point, d) - z * climb)
                root = mpmath.sqrt(1 - (1 + conic) * c**2 * w)
                f = z - c * w / (1 + root) - sum(a * w**k for k, a in enumerate(coefficients, 1))
                f_w = c / (2 * root) + sum(
                    k * a * w ** (k - 1) for k, a in enumerate(coefficients, 1)
                )
                f_t = climb - f_w * rate
                if f_t == 0 or mpmath.im(root) != 0:
                    return x if f == 0 else mpmath.nan
                x -= f / f_t
                if abs(f) <= SMALL * abs(f_t * x):
                    return x
            return mpmath.nan

        return solve
