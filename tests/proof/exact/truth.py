"""The exact oracle: all crossings of rays with any surfaces, in the format of the fast oracle.

Crossings come from `proof.exact.exact_surface`, class by class. As in the fast oracle
(`proof.judges.kernels.events`), a crossing is certain if eight rays around, displaced by
1.3 bands, cross the surface there too; else either answer is right. "There" means: no farther than
the displacement accounts for at the angle of either crossing, or of the displaced one where a normal
is lost; then the displaced rays say how far t goes. Crossings of displaced rays only are doubtful. So
one judge (`judge.compare`) serves both oracles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from proof.exact.crossings import (
    ALONG,
    OPEN,
    POINT,
    Crossing,
    norm,
    rational,
    rationals,
)
from proof.exact.exact_surface import exact_of
from proof.judges.kernels.events import (
    AROUND,
    BAND,
    DOUBTFUL,
    ROOT,
    SHIFT,
    UNDECIDED,
)
from proof.judges.oracle import Departures, Truth, truth_of

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

    Attributes
    ----------
    object_id : int
    crossing : Crossing
    t : float
    band : float
        64 eps x scale of the object and ray, scene units.
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

    Parameters
    ----------
    surfaces : sequence of surfaces, as `Intersector` takes them

    Raises
    ------
    TypeError
        For a surface that is not known.
    """

    def __init__(self, surfaces: Sequence[Any]) -> None:
        self.surfaces = list(surfaces)
        self.exact = [exact_of(surface) for surface in self.surfaces]
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


def exact_hits(
    scene: ExactScene,
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike = 0.0,
    t_max: ArrayLike = np.inf,
    *,
    leaves: ArrayLike | None = None,
) -> Truth:
    """Find all crossings of rays, what is certain of them, and the first of each ray.

    Parameters are those of `oracle.first_hits`, but for the last. Rays of which a crossing is left
    open are undecided where that matters.

    Parameters
    ----------
    leaves : (n,) integers, optional
        Objects that the rays leave, -1 for none: the crossing at the origin is left out. Where
        there are several, up to rounding, all are doubtful.
    """
    origin = np.ascontiguousarray(origins, dtype=np.float64).reshape(-1, 3)
    direction = np.ascontiguousarray(directions, dtype=np.float64).reshape(-1, 3)
    n = len(origin)
    low = np.ascontiguousarray(np.broadcast_to(np.asarray(t_min, dtype=np.float64), (n,)))
    high = np.ascontiguousarray(np.broadcast_to(np.asarray(t_max, dtype=np.float64), (n,)))
    left = np.broadcast_to(-1 if leaves is None else np.asarray(leaves), (n,))
    rows: list[tuple[Any, ...]] = []
    again = Departures.none(n)
    for i in range(n):
        found, reach = _events(scene, i, origin[i], direction[i], int(left[i]))
        rows += found
        if reach > -math.inf:
            again.left[i], again.reach[i] = left[i], reach
    names = (
        ("ray", np.int64), ("t", np.float64), ("object_id", np.int32), ("patch_id", np.int32),
        ("u", np.float64), ("v", np.float64), ("cosine", np.float64), ("band", np.float64),
        ("kind", np.uint8), ("at_edge", np.uint8),
    )  # fmt: skip
    columns = {
        name: np.array([row[k] for row in rows], dtype=dtype)
        for k, (name, dtype) in enumerate(names)
    }
    return truth_of(columns, scene.surfaces, origin, direction, low, high, departures=again)


def _events(
    scene: ExactScene, ray: int, origin: FloatArray, direction: FloatArray, leaves: int
) -> tuple[list[tuple[Any, ...]], float]:
    """Return the events of one ray, as rows of `kernels.events.Events`, and what was left out.

    That is up to which t a hit is the point of departure; -inf where it may be another crossing.
    """
    length = norm(direction)
    own = scene.crossings(origin, direction)
    rings = scene.around(origin, direction, SHIFT)
    at_start = departures(own, leaves, origin, length)
    reach = -math.inf
    if len({one.t for one in at_start}) == 1:
        if departures(own, leaves, origin, length, roundings=SURELY_ROUNDED):
            reach = departure_reach(at_start[0], length)
        own = [one for one in own if one not in at_start]
        at_start = []
        for k, ring in enumerate(rings):
            left = departures(ring, leaves, origin, length, SHIFT)
            rings[k] = [one for one in ring if one not in left]
    rows = []
    for one in own:
        kind, cosine = ROOT, one.crossing.cosine
        if one.crossing.kind == OPEN and not _is_short(one, length):
            kind = UNDECIDED
        elif one.crossing.kind != POINT or one in at_start:
            kind = DOUBTFUL
        else:
            same = [_nearest(one, ring, length) for ring in rings]
            there = [t for t in same if t is not None]
            if len(there) < len(rings):
                kind = DOUBTFUL
            else:
                steep = (max(there) - min(there)) * length / one.band
                spread = 1.0 / math.hypot(1.0, steep)
                if one.crossing.to_edge <= SHIFT * one.band and cosine > 0.0:
                    # On which side of the edge it is met is open, and so is t, as far as both go.
                    cosine = min(cosine, spread)
                else:
                    # Where it bends, and where the normal is lost, the angle says too little.
                    cosine = max(cosine, spread)
        rows.append(_event(ray, one, kind, cosine))
    for ring in rings:
        for other in ring:
            if not any(
                one.object_id == other.object_id
                and (same_place(one, other, SHIFT * one.band, length) or one.crossing.kind == ALONG)
                for one in own
            ):
                rows.append(_event(ray, other, DOUBTFUL, other.crossing.cosine))
    return rows, reach


def _nearest(one: Placed, ring: list[Placed], length: float) -> float | None:
    """Return where another ray has the same crossing; None if it has not."""
    same = [
        other.t
        for other in ring
        if one.object_id == other.object_id
        and other.crossing.kind == POINT
        and same_place(one, other, SHIFT * one.band, length)
    ]
    return min(same, key=lambda t: abs(t - one.t), default=None)


def _is_short(one: Placed, length: float) -> bool:
    """Tell whether what was left open is within what a touch within the band leaves open."""
    end = one.crossing.t_end
    assert end is not None
    return (float(end) - one.t) * length <= math.sqrt(one.band * one.band / BAND)


def _event(ray: int, one: Placed, kind: int, cosine: float) -> tuple[Any, ...]:
    crossing = one.crossing
    if kind == DOUBTFUL:
        # Where it touches curvature ends the contact: the root of the band, relative to the scale.
        cosine = max(cosine, math.sqrt(2.0 * BAND))
    return (
        ray, one.t, one.object_id, crossing.patch_id, crossing.u, crossing.v, cosine, one.band,
        kind, crossing.to_edge <= SHIFT * one.band,
    )  # fmt: skip
