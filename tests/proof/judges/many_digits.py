"""The t of hits to 60 digits (needs mpmath), to test the proven bounds on t.

Newton iteration starts at the hit and ends at the root of the surface's own definition, with floats
taken as exact. No code of the tracer or the oracle is used.
"""

from __future__ import annotations

from collections.abc import Sequence

import mpmath
import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from meshing.surface import Surface
from proof.judges.digits import DIGITS, numbers
from proof.judges.surface_judge import Number, judge_of


def exact_t(
    surfaces: Sequence[Surface], hits: HitRecord, origins: FloatArray, directions: FloatArray
) -> list[Number]:
    """Return the t of the roots at which some hits are, to 60 digits; nan if Newton finds none.

    Parameters
    ----------
    surfaces : sequence of surfaces
    hits : HitRecord of n rows, none of them a miss
    origins, directions : (n, 3) float64
    """
    with mpmath.workdps(DIGITS):
        solvers = [judge_of(surface).solver() for surface in surfaces]
        rows = zip(
            hits.object_id, hits.patch_id, hits.u, hits.v, hits.t, origins, directions, strict=True
        )
        return [
            solvers[number](int(patch), float(u), float(v), float(t), numbers(o), numbers(d))
            for number, patch, u, v, t, o, d in rows
        ]


def excess(t: FloatArray, exact: Sequence[Number]) -> FloatArray:
    """Return |t - exact t|, (n,) float64, rounded once only."""
    with mpmath.workdps(DIGITS):
        gaps = [abs(mpmath.mpf(float(a)) - b) for a, b in zip(t, exact, strict=True)]
        return np.array([float(gap) for gap in gaps])
