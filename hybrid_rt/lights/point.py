"""Point lights."""

import math

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.suggestions import explains
from hybrid_rt.lights.light import Light, LightRow
from hybrid_rt.shading.kernels.light_kinds import POINT


@explains(
    power="intensity = power / (4 pi)",
    radiance="intensity, which is power per steradian",
    color="intensity",
)
class PointLight(Light):
    """An isotropic point light. Its irradiance falls off as 1 / r^2, and it is itself invisible.

    Parameters
    ----------
    position : three numbers
        Scene units.
    intensity : number or three numbers
        Power per steradian, at least 0.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.
    """

    def __init__(self, position: ArrayLike, intensity: ArrayLike) -> None:
        nothing = np.zeros(3)
        strength = checks.rgb(intensity, "PointLight intensity")
        self._row = LightRow(
            POINT,
            checks.as_vector(position, "PointLight position", up_to=checks.FARTHEST),
            nothing,
            nothing,
            strength,
            power=4.0 * math.pi * float(strength.mean()),
        )

    def __repr__(self) -> str:
        """Return the call that makes it."""
        row = self._row
        return call(self, row.origin, intensity=one_or_three(row.strength))
