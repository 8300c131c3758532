"""The definition of a wrong first hit of an approximate method.

A first hit is wrong if it is a false miss (missed), a false hit (phantom), or on another sheet
(farther): on another object, or nearer to another crossing of its ray than to the first. All others
are correct, with an error in t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray


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
