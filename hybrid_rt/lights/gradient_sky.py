"""A sky whose colour changes with height only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt import checks
from hybrid_rt.lights.light import Environment
from hybrid_rt.records import FloatArray


class GradientSky(Environment):
    """Radiance linear in the height of the direction.

    Parameters
    ----------
    bottom, top : number or three numbers
        Radiance straight down and straight up, at least 0.
    up : three numbers
        Which way is up.
    """

    def __init__(self, bottom: ArrayLike, top: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> None:
        self._bottom = checks.rgb(bottom, "GradientSky bottom")
        self._top = checks.rgb(top, "GradientSky top")
        self._up = checks.direction(up, "GradientSky up")

    def radiance(self, directions: FloatArray) -> FloatArray:
        """Return what arrives from unit directions (n, 3), as (n, 3) radiances."""
        height = 0.5 + 0.5 * (directions @ self._up)
        return np.outer(1.0 - height, self._bottom) + np.outer(height, self._top)
