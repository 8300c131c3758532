"""The upper limit of t: a root that rounding alone puts on one side of it makes its row TANGENT.

The lower limit is part of the rule for roots (`hybrid_rt.intersection.kernels.search.nearest.offer`): it
is never lowered in a search, and so is the same for every root.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, WITHIN_BAND, Nearest, Rays
from hybrid_rt.intersection.kernels.search.rays import LARGEST

# How far beyond the limit is searched for roots whose bounds may reach below it: this part of the
# limit, and this part of the coordinates. Bounds of roots are larger only where a ray runs within
# 1e-9 or so of a flat face.
PART_OF_LIMIT, PART_OF_SCENE = 2.0**-6, 2.0**-20


class Limit:
    """The upper limits of n rays, where a search ends for them, and what that decides.

    ``rays``, Rays of n rows.
    ``t_max`` (n,): in lengths of the scaled directions, as all t here.
    ``reach``: the largest coordinate of the surfaces.
    ``is_limited``: whether the caller has set any limit.
    ``searched`` (n,): where the search ends; the search may change it.
    """

    def __init__(self, t_max: FloatArray, rays: Rays, reach: float, is_limited: bool) -> None:
        self._t_max, self.searched = t_max, t_max
        self._is_limited = is_limited
        if is_limited:
            more = PART_OF_SCENE * np.abs(rays.origin).max(axis=1, initial=reach)
            more += PART_OF_LIMIT * np.abs(np.maximum(t_max, -LARGEST))
            with np.errstate(over="ignore"):
                self.searched = t_max + more

    def apply(self, best: Nearest, flags: NDArray[np.uint8]) -> None:
        """Make hits beyond the limit misses; `WITHIN_BAND` is what their bounds allow on both sides.

        ``best``, Nearest of n rows, changed: described and settled.
        ``flags`` (n,) uint8, changed: of the rows.
        """
        if not self._is_limited:
            return
        # A bound of inf says that nothing is proven.
        is_open = (best.object_id >= 0) & np.isfinite(best.t_bound)
        is_open &= best.t - best.t_bound <= self._t_max
        is_open &= best.t + best.t_bound >= self._t_max
        beyond = best.t >= self._t_max
        best.tangent[beyond] = CLEAR
        best.tangent[is_open] = WITHIN_BAND
        best.object_id[beyond] = -1
        flags[beyond] = 0
        np.minimum(best.t, self._t_max, out=best.t)
