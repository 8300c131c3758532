"""First hits of an approximate method against certified ones on the same rays.

A first hit is wrong if it is a false miss (missed), a false hit (phantom), or on another sheet
(farther): on another object, or nearer to another crossing of its ray than to the first. All others
are correct, with an error in t.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray, Status
from hybrid_rt.intersection.intersector import Intersector


class WrongHits(NamedTuple):
    """Masks of the wrong first hits of n rays by kind; each (n,) bool."""

    missed: BoolArray
    phantom: BoolArray
    farther: BoolArray
    right: BoolArray  # hits only

    @property
    def counts(self) -> dict[str, int]:
        """Number of rays by kind."""
        kinds = ("missed", "phantom", "farther")
        return {kind: int(np.count_nonzero(getattr(self, kind))) for kind in kinds}

    @property
    def wrong(self) -> int:
        """Number of wrong rays of all kinds."""
        return sum(self.counts.values())

    @property
    def rays(self) -> int:
        """Number of rays that meet something by either method."""
        return self.wrong + int(np.count_nonzero(self.right))


@dataclass(frozen=True)
class Certified:
    """Certified hits of n rays, and the next crossing of each ray."""

    directions: FloatArray  # (n, 3)
    hits: HitRecord  # HitRecord of n rows
    next_t: FloatArray  # (n,): inf if there is none

    def __getitem__(self, rows: BoolArray) -> Certified:
        """Return some of the rays."""
        return Certified(self.directions[rows], self.hits[rows], self.next_t[rows])


@dataclass(frozen=True)
class Errors:
    """First hits of one method against certified ones."""

    wrong_hits: WrongHits  # without rays of status TANGENT
    # |t - exact t| over the correct hits, scene units
    mean: float
    worst: float

    @property
    def wrong(self) -> float:
        """Fraction of wrong hits among the rays that hit something by either method."""
        return self.wrong_hits.wrong / max(self.wrong_hits.rays, 1)


def certified_hits(tracer: Intersector, origins: ArrayLike, directions: ArrayLike) -> Certified:
    """Return the certified hits of rays, and the next crossing of each."""
    hits: HitRecord = tracer.intersect(origins, directions)
    t_min = np.where(hits.hit, hits.t, 0.0)
    beyond = tracer.intersect(origins, directions, t_min=t_min, source=hits)
    shape = (len(hits), 3)
    given = np.broadcast_to(np.asarray(directions, dtype=np.float64), shape)
    return Certified(given, hits, beyond.t)


def compare(exact: Certified, t: FloatArray, object_id: IntArray) -> Errors:
    """Compare the t (n,) and objects (n,; -1: none) of first hits with certified ones."""
    hits = exact.hits
    elsewhere = is_nearer(t, exact.next_t, hits.t)
    sorted_out = wrong_hits(hits.object_id, object_id, elsewhere, hits.status != Status.TANGENT)
    right = np.flatnonzero(sorted_out.right)
    length = np.linalg.norm(exact.directions[right], axis=1)
    error = np.abs(t[right] - hits.t[right]) * length
    mean = float(error.mean()) if len(error) else 0.0
    return Errors(sorted_out, mean, float(error.max(initial=0.0)))


def wrong_hits(
    exact_object: IntArray, found_object: IntArray, is_elsewhere: BoolArray, judged: BoolArray
) -> WrongHits:
    """Classify first hits; -1 is a miss.

    ``is_elsewhere`` tells, where both meet something, whether the found t is nearer to another crossing than
    to the first. Rays that are not ``judged``, as rounding decides their exact answer, are left out.
    """
    exists, found = exact_object >= 0, found_object >= 0
    both = judged & exists & found
    farther = both & ((exact_object != found_object) | is_elsewhere)
    return WrongHits(judged & exists & ~found, judged & ~exists & found, farther, both & ~farther)


def is_nearer(found_t: FloatArray, next_t: FloatArray, exact_t: FloatArray) -> BoolArray:
    """Tell which t are nearer to the second crossing, inf if there is none, than to the first, (n,) bool."""
    with np.errstate(invalid="ignore"):  # inf - inf where both miss
        nearer: BoolArray = np.abs(found_t - next_t) < np.abs(found_t - exact_t)
    return nearer
