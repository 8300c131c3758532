"""Spheres: the quadratic in t; in exact arithmetic only the root of its discriminant is a ball."""

from __future__ import annotations

import math
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Sphere
from proof.exact.crossings import (
    Crosser,
    Crossing,
    RationalVector,
    along_frame,
    bits,
    dot,
    is_narrow,
    norm,
    precisions,
    rational,
    rationals,
    share,
    turns,
)
from proof.filters.kernels import sphere
from proof.surface import Gap, IsTouched, Judged, Locate, scratch

# What a float64 distance may add to a reach.
ROUNDED = 1.01


class JudgedSphere(Judged, of=Sphere):
    """Crossings with a sphere, given by centre and radius, floats taken as exact."""

    surface: Sphere
    kernel = staticmethod(sphere.first_on_sphere)

    def crosser(self) -> Crosser:
        """Return a function that finds both crossings."""
        center, radius = rationals(self.surface.center), rational(self.surface.radius)

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            w = [x - c for x, c in zip(o, center, strict=True)]
            a, b, c = dot(d, d), dot(d, w), dot(w, w) - radius * radius
            square = b * b - a * c
            if square < 0:
                return []
            scale = (norm([float(x) for x in w]) + float(radius)) / norm([float(x) for x in d])
            cosine = math.sqrt(float(square / (a * radius * radius)))
            if square == 0:
                return [Crossing(flint.arb(-b / a), 0, 0.0, 0.0, 0.0, to_edge=math.inf)]
            for number in precisions():
                with bits(number):
                    root = flint.arb(square).sqrt()
                    ts = [(-b - root) / a, (-b + root) / a]
                if all(is_narrow(t, scale) for t in ts):
                    return [Crossing(t, 0, 0.0, 0.0, cosine, to_edge=math.inf) for t in ts]
            raise ArithmeticError("t that cannot be narrowed")

        return crossings

    def locate(self) -> Locate:
        """Return a function that takes the angles of a point."""
        center, frame = rationals(self.surface.center), self.surface.frame

        def locate(point: list[Any]) -> tuple[float, float]:
            with bits(256):
                x, y, z = along_frame(frame, center, point)
                polar = 2 * turns((x * x + y * y).sqrt(), -z)
                return share(turns(y, x)), float(polar.mid())

        return locate

    def gap(self) -> Gap:
        """Return a function that measures from the sphere itself."""
        center, radius = rationals(self.surface.center), rational(self.surface.radius)

        def gap(_patch: int, _u: float, _v: float, point: list[Any]) -> float:
            away = [x - c for x, c in zip(point, center, strict=True)]
            with bits(256):
                return abs(float(flint.arb(dot(away, away)).sqrt() - radius))

        return gap

    def touch(self) -> IsTouched:
        """Return a function that compares the distances of ray and origin from the centre."""
        center, radius = np.asarray(self.surface.center), float(self.surface.radius)

        def is_touched(origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
            away = center - origin
            foot = float(np.linalg.norm(away - (away @ d) * d))
            begins = abs(float(np.linalg.norm(away)) - radius) <= reach
            grazes = abs(foot - radius) <= ROUNDED * reach and float(away @ d) > -reach
            return grazes or (begins and not leaves)

        return is_touched

    def ball(self) -> tuple[list[float], float | None]:
        """Return the centre and the diameter."""
        return self.surface.center.tolist(), 2.0 * float(self.surface.radius)

    def tables(self) -> tuple[Any, Any]:
        """Return the ball."""
        ball = sphere.Ball(np.array(self.surface.center), float(self.surface.radius))
        return ball, scratch()
