"""Which rays come near the ball around a surface: all others need no exact arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from hybrid_rt.core.records import FloatArray
from proof.judges.kernels import events

# Rays that pass the ball by this part of it miss what is inside, whatever rounds.
CLEAR = 1e-6


def near_rays(
    center: FloatArray, size: float, o: FloatArray, d: FloatArray
) -> Iterator[tuple[int, float, float]]:
    """Yield number, band and |direction| of the rays that come near a ball of diameter ``size``.

    Parameters
    ----------
    center : (3,) float64
    size : float
    o, d : (n, 3) float64
    """
    for i in range(len(o)):
        length = math.hypot(*d[i])
        band = events.BAND * max(math.dist(o[i], center), size)
        across = np.linalg.norm(np.cross(o[i] - center, d[i])) / length
        if across <= (1.0 + CLEAR) * 0.5 * size + 2.0 * band:
            yield i, band, length
