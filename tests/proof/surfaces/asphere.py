"""Even aspheres: the roots of a polynomial with rational coefficients; the screen knows the ball around one."""

from __future__ import annotations

import math
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.primitives.asphere import Asphere
from proof.exact.asphere_roots import AsphereRoots
from proof.exact.crossings import (
    Crosser,
    Crossing,
    RationalVector,
    along_frame,
    bits,
    dot,
    rational,
    rationals,
    share,
    turns,
)
from proof.filters.kernels.first import N_COLUMNS, UNSURE_FROM
from proof.surface import Gap, IsTouched, Judged, Locate

# Far beyond the rounding of a distance in float64.
CLEAR = 1e-6


class JudgedAsphere(Judged, of=Asphere):
    """Crossings with an asphere; the screen leaves rays that meet the ball around the vertex to exact arithmetic."""

    surface: Asphere

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots within the rim; a double root is a touch."""
        roots = AsphereRoots(self.surface)

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            return [
                Crossing(
                    root.t, 0, 0.0, 0.0, root.cosine if root.times % 2 else 0.0,
                    to_edge=root.from_rim,
                )
                for root in roots(list(o), list(d))
                if root.times > 0 and root.beyond <= 0.0
            ]  # fmt: skip

        return crossings

    def locate(self) -> Locate:
        """Return a function that takes the angle of a point and its distance from the axis."""
        surface, center = self.surface, rationals(self.surface.origin)
        frame = surface.radial, surface.binormal, surface.axis

        def locate(point: list[Any]) -> tuple[float, float]:
            with bits(256):
                x, y, _ = along_frame(frame, center, point)
                v = 2 * (x * x + y * y).sqrt() / rational(surface.aperture)
                return share(turns(y, x)), float((v if surface.orientation > 0 else 1 - v).mid())

        return locate

    def gap(self) -> Gap:
        """Return a function that measures from the sag itself, along its gradient, or from the rim."""
        roots, surface = AsphereRoots(self.surface), self.surface
        rim = rational(surface.aperture) / 2

        def gap(_patch: int, _u: float, _v: float, point: list[Any]) -> float:
            away = [x - c for x, c in zip(point, roots.centre, strict=True)]
            height = dot(away, roots.axis)
            square = dot(away, away) - height * height
            with bits(256):
                w, c = flint.arb(square), flint.arb(0)
                beyond = w.sqrt() - rim
                if beyond > 0:
                    w = flint.arb(rim * rim)
                if not math.isinf(surface.radius):
                    c = 1 / flint.arb(surface.radius)
                root = (1 - (1 + flint.arb(surface.conic)) * c * c * w).sqrt()
                sag, rate = c * w / (1 + root), c / (2 * root)
                for k, a in enumerate(surface.coefficients.tolist(), start=1):
                    sag += flint.arb(a) * w**k
                    rate += k * flint.arb(a) * w ** (k - 1)
                along = abs(float(((height - sag) / (1 + 4 * w * rate * rate).sqrt()).mid()))
                return math.hypot(along, float(beyond.mid())) if beyond > 0 else along

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for near misses, contacts and the rim within a reach."""
        roots, surface = AsphereRoots(self.surface), self.surface

        def is_touched(origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
            for place in roots(rationals(origin), rationals(d)):
                if float(place.t.mid()) < -reach:
                    continue
                is_near = place.gap <= reach and (place.beyond <= 0.0 or place.from_rim <= reach)
                if is_near and (place.times != 1 or min(place.depth, place.from_rim) <= reach):
                    return True
            away = origin - surface.origin
            height = float(away @ surface.axis)
            r = float(np.linalg.norm(away - height * surface.axis))
            if leaves or r > 0.5 * surface.aperture + reach:
                return False
            r = min(r, 0.5 * surface.aperture)
            slope = float(2.0 * r * surface.sag.at(np.array([r * r]))[1][0])
            return abs(height - float(surface.sag_at(r))) <= reach * math.hypot(1.0, slope)

        return is_touched

    def ball(self) -> tuple[list[float], float | None]:
        """Return the vertex and the diameter of the ball about it."""
        return self.surface.origin.tolist(), self.surface.size

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
