"""Judges tori: the quartic in exact fractions, all its roots isolated (needs python-flint).

With x = o + t d - c, axis a and radii R and r a torus is where F(t) = (|x|^2 + R^2 - r^2)^2 - 4 R^2
(|x|^2 - (x.a)^2 / |a|^2) vanishes. Moving a ray by at most the band does no more than making the tube
thicker or thinner by that much. So the roots of three quartics, for tubes of r + band, r and r -
band, tell what is certain: a root of the second right between one of the first and one of the third.
All else is doubtful: both decisions are right.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.torus import Torus
from meshing.surface import Surface
from proof.judges.kernels import events
from proof.judges.near_rays import near_rays
from proof.judges.precision import bits
from proof.judges.surface_judge import (
    Number,
    Solver,
    SurfaceJudge,
    Vector,
    Worker,
    about_axis,
    about_origin,
)

# Bits of roots: twice as many where two of them are not told apart.
BITS = 128
# By what the tubes of the three quartics differ from the torus, in bands, from the outside in.
OUTER, TRUE, INNER = range(3)


class TorusJudge(SurfaceJudge, of=Torus):
    """What is known of a torus."""

    surface: Torus
    examples: ClassVar = {
        "tori": lambda: [
            Torus((0, 0, 0), (0.3, -0.2, 1.0), 1.0, 0.4),
            Torus((0.9, 0.4, 0.1), (1, 0, 0), 0.8, 0.05).flipped(),
        ]
    }

    def worker(self, object_id: int) -> Worker:
        """Return a function that isolates the roots of the three quartics, ray by ray."""
        quartics = self._quartics()
        center, size = np.array(self.surface.origin), self.surface.size

        def work(
            first: int, o: FloatArray, d: FloatArray, _low: FloatArray, out: events.Events
        ) -> None:
            for i, band, length in near_rays(center, size, o, d):
                with bits(BITS):
                    for t, flatness, kind in _passages(quartics(o[i], d[i], band), band, length):
                        is_sure = kind == events.ROOT
                        cosine = self._cosine(o[i], d[i], t) if is_sure else flatness
                        events.note(
                            out, first + i, float(t), object_id, 0, 0.0, 0.0, cosine, band, kind, 0
                        )

        return work

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both angles of points, in whole turns."""
        u, from_axis, z = about_axis(self.surface, points)
        height = self.surface.orientation * z
        return u, np.arctan2(height, from_axis - self.surface.major_radius) / (2.0 * np.pi) % 1.0

    def about_itself(self) -> tuple[Surface, FloatArray]:
        """Return it about its centre."""
        return about_origin(self.surface)

    def _quartics(self) -> Callable[[FloatArray, FloatArray, float], list[Any]]:
        """Return a function from origin, direction and band of a ray to its three quartics."""
        import flint

        def exact(values: Any) -> list[Any]:
            return [flint.fmpq(*float(x).as_integer_ratio()) for x in values]

        center, axis = exact(self.surface.origin), exact(self.surface.axis)
        major, minor = exact((self.surface.major_radius, self.surface.minor_radius))
        axis_square = _dot(axis, axis)

        def quartics(o: FloatArray, d: FloatArray, band: float) -> list[Any]:
            w = [a - b for a, b in zip(exact(o), center, strict=True)]
            v, (delta,) = exact(d), exact((band,))
            square = flint.fmpq_poly([_dot(w, w), 2 * _dot(w, v), _dot(v, v)])
            height = flint.fmpq_poly([_dot(w, axis), _dot(v, axis)])
            across = square - height * height / axis_square
            found = []
            for tube in (minor + delta, minor, minor - delta):
                whole = square + (major * major - tube * tube)
                quartic = whole * whole - 4 * major * major * across
                found.append(quartic.numer() if tube > 0 else flint.fmpz_poly([1]))
            return found

        return quartics

    def _cosine(self, o: FloatArray, d: FloatArray, t: Any) -> float:
        """Return |n.d| / |d| at a root."""
        axis = self.surface.axis / np.linalg.norm(self.surface.axis)
        # The point in many digits: the ray may come from far away.
        x = np.array([
            float(t * float(b) + float(a) - float(c))
            for a, b, c in zip(o, d, self.surface.origin, strict=True)
        ])  # fmt: skip
        ring = x - (x @ axis) * axis
        tube = x - self.surface.major_radius * ring / np.linalg.norm(ring)
        return float(abs(tube @ d) / (np.linalg.norm(tube) * np.linalg.norm(d)))

    def solver(self) -> Solver:
        """Return Newton's method on the quartic."""
        import mpmath

        from proof.judges.digits import MOST_STEPS, SMALL, dot, numbers

        center, axis = numbers(self.surface.origin), numbers(self.surface.axis)
        major, minor = numbers((self.surface.major_radius, self.surface.minor_radius))

        def solve(_patch: int, _u: float, _v: float, t: float, o: Vector, d: Vector) -> Number:
            w = [a - b for a, b in zip(o, center, strict=True)]
            x = mpmath.mpf(t)
            for _ in range(MOST_STEPS):
                point = [a + x * b for a, b in zip(w, d, strict=True)]
                height, climb = dot(point, axis), dot(d, axis)
                square, slope = dot(point, point), 2 * dot(point, d)
                whole = square + major**2 - minor**2
                f = whole**2 - 4 * major**2 * (square - height**2 / dot(axis, axis))
                f_t = 2 * whole * slope
                f_t -= 4 * major**2 * (slope - 2 * height * climb / dot(axis, axis))
                if f_t == 0:
                    return x if f == 0 else mpmath.nan
                x -= f / f_t
                if abs(f) <= SMALL * abs(f_t * x):
                    return x
            return mpmath.nan

        return solve


def _passages(quartics: list[Any], band: float, length: float) -> list[tuple[Any, float, int]]:
    """Return t, kind, and |cos| where it is not that of the surface, of what a ray meets."""
    met = _sorted_roots(quartics)
    levels = [level for _, level in met]
    rows: list[tuple[Any, float, int]] = []
    for j, (t, level) in enumerate(met):
        if level == TRUE:
            # The tubes lie within each other: so the ray goes right in, or right out.
            if sorted(levels[max(j - 1, 0) : j + 2]) == [OUTER, TRUE, INNER]:
                rows.append((t, 0.0, events.ROOT))
            else:
                rows.append((t, _flatness(met, j, band, length), events.DOUBTFUL))
        elif levels[j + 1 : j + 2] == [level]:
            # Between two tubes, coming from outside or from inside, and back again?
            is_within = levels[: j + 1].count(level) % 2 == 1
            if is_within == (level == OUTER):
                wide = max(float(met[j + 1][0] - t) * 0.5 * length, band)
                rows.append(((t + met[j + 1][0]) / 2, band / wide, events.DOUBTFUL))
    return rows


def _flatness(met: list[tuple[Any, int]], j: int, band: float, length: float) -> float:
    """Return the |cos| of which the band makes the whole stretch around a doubtful root."""
    around = [float(met[k][0] - met[j][0]) for k in range(len(met)) if met[k][1] != TRUE]
    before = max((t for t in around if t < 0.0), default=0.0)
    behind = min((t for t in around if t > 0.0), default=0.0)
    return band / max(max(-before, behind) * length, band)


def _sorted_roots(quartics: list[Any]) -> list[tuple[Any, int]]:
    """Return where the quartics change their sign, in order, each with its level."""
    number = BITS
    while True:
        with bits(number):
            found: list[tuple[Any, int]] = []
            for level, quartic in enumerate(quartics):
                if level > OUTER and not found:
                    break  # inside of a tube that the ray does not meet
                for root, times in quartic.complex_roots():
                    if root.imag == 0 and times % 2:
                        found.append((root.real, level))
            found.sort(key=lambda item: item[0].mid())
            if not any(one[0].overlaps(two[0]) for one, two in pairwise(found)):
                return found
        number *= 2


def _dot(a: list[Any], b: list[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
