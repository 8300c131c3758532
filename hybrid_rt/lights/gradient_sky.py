"""A sky whose radiance depends on elevation only."""

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.lights.light import BLACK, Environment, upright
from hybrid_rt.shading.kernels.environment import GRADIENT


class GradientSky(Environment):
    """Environment light whose radiance is linear in the cosine between direction and ``up``.

    Parameters
    ----------
    bottom, top : number or three numbers
        Radiance along -``up`` and ``up``, at least 0.
    up : three numbers
        The zenith, a direction of any length.

    Raises
    ------
    ValueError, TypeError
        If a radiance is out of range, or ``up`` is zero or not finite.

    Notes
    -----
    Where only one light is sampled for each hit, the sky is chosen as often as a lamp of average power,
    however faint it is: beside a single lamp, half of the samples go to it. A black sky is left out.
    """

    def __init__(self, bottom: ArrayLike, top: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> None:
        low = checks.rgb(bottom, "GradientSky bottom")
        high = checks.rgb(top, "GradientSky top")
        heights = np.array([low.mean(), high.mean()])
        if heights.any():  # only their ratio counts, and squares of very small ones would vanish
            heights /= heights.max()
        self._table = BLACK._replace(
            kind=GRADIENT,
            frame=upright(checks.as_direction(up, "GradientSky up")),
            colors=np.stack([low, high]),
            # A black sky is chosen from evenly.
            heights=heights if heights.any() else np.ones(2),
        )

    def __repr__(self) -> str:
        """Return the call that makes it."""
        bottom, top = (one_or_three(color) for color in self._table.colors)
        return call(self, bottom, top, up=self._table.frame[2])
