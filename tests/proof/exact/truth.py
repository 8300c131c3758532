"""All crossings of rays with any surfaces: class by class, from `proof.surface`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from proof.exact.crossings import (
    POINT,
    Crossing,
    norm,
    rational,
    rationals,
)
from proof.kernels.bands import AROUND, BAND
from proof.surface import judged_of

# A crossing that moves by more than this many times what the angle accounts for is another one.
MOST_MOVED = 8.0
# Flatter than this, far below rounding, a crossing says nothing about where its neighbours are.
FLATTEST = 1e-18
# Where a ray grazes, a band moves t by no more than its square root, in parts of the scale.
LEAST_SLOPE = 1.2e-7
# A point of departure lies so many bands, and so many eps of its coordinates, beside its surface.
AT_START, ROUNDED = 1.0, 8.0
# Up to so many eps it is certainly the point of departure. Farther away it may as well be another
# crossing, such as the other side of a ridge.
SURELY_ROUNDED = 3.0


@dataclass(frozen=True)
class Placed:
    """A crossing with its object.

    ``band``: 64 eps x scale of the object and ray, scene units.
    """

    object_id: int
    crossing: Crossing
    t: float
    band: float

    @property
    def cosine(self) -> float:
        """|n.d| / |d|, or what is left of it beyond rounding."""
        return max(self.crossing.cosine, FLATTEST)


class ExactScene:
    """All crossings of rays with a list of surfaces.

    Raises TypeError for a surface that is not known.
    """

    def __init__(self, surfaces: Sequence[Any]) -> None:
        self.surfaces = list(surfaces)
        self.exact = [judged_of(surface) for surface in self.surfaces]
        self._crossers = [exact.crosser() for exact in self.exact]
        self._balls = [exact.ball() for exact in self.exact]

    def crossings(
        self, origin: FloatArray, direction: FloatArray, shift: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> list[Placed]:
        """Return all crossings of a ray moved by ``shift``, of any t, in order of t."""
        o = [rational(x) + rational(s) for x, s in zip(origin, shift, strict=True)]
        d = rationals(direction)
        found = []
        for number, crosser in enumerate(self._crossers):
            for crossing in crosser(o, d):
                t = float(crossing.t)
                found.append(Placed(number, crossing, t, self.band(number, origin, direction, t)))
        found.sort(key=lambda one: (one.t, one.object_id))
        return found

    @property
    def size(self) -> float:
        """Diameter of the largest surface; of planes alone, 1."""
        return max((size for _, size in self._balls if size is not None), default=1.0)

    def narrow_band(self, number: int) -> float:
        """Return 64 eps x size of an object, wherever the ray begins; 0 for a plane."""
        return BAND * (self._balls[number][1] or 0.0)

    def band(self, number: int, origin: FloatArray, direction: FloatArray, t: float) -> float:
        """Return 64 eps x scale of an object and a ray."""
        middle, size = self._balls[number]
        away = math.dist(middle, origin)
        if size is None:  # a plane: as far as the point that is met
            size = abs(t) * norm(direction) if math.isfinite(t) else 0.0
        return BAND * max(away, size)

    def shifts(self, direction: FloatArray, radius: float) -> list[list[float]]:
        """Return eight vectors of a length across a direction."""
        d = np.asarray(direction) / np.linalg.norm(direction)
        helper = np.eye(3)[np.abs(d).argmin()]
        p = np.cross(d, helper)
        p /= np.linalg.norm(p)
        q = np.cross(d, p)
        return [(radius * (c * p + s * q)).tolist() for c, s in AROUND]

    def around(
        self, origin: FloatArray, direction: FloatArray, bands: float, narrow: bool = False
    ) -> list[list[Placed]]:
        """Return the crossings of eight rays moved by some (narrow) bands, object by object."""
        rings: list[list[Placed]] = [[] for _ in AROUND]
        for number in range(len(self.surfaces)):
            radius = bands * (
                self.narrow_band(number) if narrow else self.band(number, origin, direction, 0.0)
            )
            for ring, shift in zip(rings, self.shifts(direction, radius), strict=True):
                o = [rational(x) + rational(s) for x, s in zip(origin, shift, strict=True)]
                for crossing in self._crossers[number](o, rationals(direction)):
                    t = float(crossing.t)
                    band = self.band(number, origin, direction, t)
                    ring.append(Placed(number, crossing, t, band))
        for ring in rings:
            ring.sort(key=lambda one: (one.t, one.object_id))
        return rings


def same_place(one: Placed, two: Placed, moved: float, length: float) -> bool:
    """Tell whether two crossings of rays that are some length apart are the same one."""
    cosines = [each.cosine for each in (one, two) if each.crossing.cosine > 0.0]
    if not cosines:
        return False
    # Where the normal is lost it says nothing: the angle of the other one does.
    reach = MOST_MOVED * moved / min(cosines)
    # From afar the last place of t is more than that: the difference is taken of exact numbers.
    apart = abs(float(one.crossing.t - two.crossing.t))
    return apart * length <= reach


def departures(
    crossings: list[Placed],
    leaves: int,
    origin: FloatArray,
    length: float,
    bands: float = 0.0,
    roundings: float = ROUNDED,
) -> list[Placed]:
    """Return the crossings of an object at which a ray leaves it, nearest first.

    The origin is a point of the surface, rounded: by some eps of its coordinates and by some of the
    scale; and moved by some bands.
    """
    if leaves < 0:
        return []
    rounded = roundings * 2.0**-52 * float(np.abs(origin).max())
    found = [
        one
        for one in crossings
        if one.object_id == leaves
        and abs(one.t) * length * _slope_at_start(one) <= (AT_START + bands) * one.band + rounded
    ]
    return sorted(found, key=lambda one: abs(one.t))


def departure_reach(one: Placed, length: float) -> float:
    """Return up to which t a hit is the point of departure, from the crossing there."""
    return 2.0 * abs(one.t) + one.band / ((one.crossing.cosine or LEAST_SLOPE) * length)


def _slope_at_start(one: Placed) -> float:
    """Return |n.d| / |d|; that of a touch where the normal is lost, which may be far away."""
    is_lost = one.crossing.cosine == 0.0 and one.crossing.kind == POINT
    return LEAST_SLOPE if is_lost else one.cosine
