"""What a wrong first hit of an approximate method is: the one definition.

It is wrong if there is nothing where there is something (missed), something where there is nothing
(phantom), or if it is on another sheet (farther): on another object, or nearer to another crossing
of its ray than to the first one. All others are right, and have an error in t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray


class WrongHits(NamedTuple):
    """First hits of n rays, sorted by what is wrong with them; each (n,) bool."""

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
    """Say in which way first hits are wrong.

    Parameters
    ----------
    exact_object, found_object : (n,) int32
        Objects that are met; -1 for none.
    is_elsewhere : (n,) bool
        Whether the found t is nearer to another crossing than to the first; read where both meet
        something.
    judged : (n,) bool
        False for rays whose exact answer is decided within rounding: they are left out.
    """
    exists, found = exact_object >= 0, found_object >= 0
    both = judged & exists & found
    farther = both & ((exact_object != found_object) | is_elsewhere)
    return WrongHits(judged & exists & ~found, judged & ~exists & found, farther, both & ~farther)


def is_nearer(found_t: FloatArray, next_t: FloatArray, exact_t: FloatArray) -> BoolArray:
    """Tell where found t are nearer to the next crossing than to the first, (n,) bool.

    ``next_t`` is inf where the ray meets nothing more.
    """
    with np.errstate(invalid="ignore"):  # inf - inf where both miss
        nearer: BoolArray = np.abs(found_t - next_t) < np.abs(found_t - exact_t)
    return nearer
