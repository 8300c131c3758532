"""Light from one point into a cone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.lights.light import Light, LightRow
from hybrid_rt.shading.kernels.light_kinds import SPOT

# Narrower cones are a few roundings of a unit direction wide.
NARROWEST = 1e-3


class SpotLight(Light):
    """Shines into a cone with a smooth edge, falls off as 1 / r^2, is not seen itself.

    Along a direction at angle theta from the axis the intensity is ``intensity`` times x^2 (3 - 2 x)
    with x = (cos theta - cos cone_angle) / (cos(cone_angle - edge_angle) - cos cone_angle), cut off
    at 0 and 1: full up to ``cone_angle - edge_angle``, none from ``cone_angle`` on, and smooth
    between. So the power is pi (2 - cos cone_angle - cos(cone_angle - edge_angle)) ``intensity``.

    Parameters
    ----------
    position, direction : three numbers each
        The direction is that of the axis, of any length.
    intensity : number or three numbers
        Power per steradian near the axis, at least 0.
    cone_angle : float
        Degrees from the axis to where the light ends, 0.001 to 180: half of the cone's opening.
    edge_angle : float
        Degrees, from 0 (a hard edge) to ``cone_angle``: the part of it that the edge takes.

    Notes
    -----
    This is pbrt's spot with ``coneangle`` for ``cone_angle`` and ``conedeltaangle`` for
    ``edge_angle``; Mitsuba's ``cutoff_angle`` is ``cone_angle`` and its ``beam_width`` is
    ``cone_angle - edge_angle``, but its edge is linear in the angle.
    """

    def __init__(
        self,
        position: ArrayLike,
        direction: ArrayLike,
        intensity: ArrayLike,
        cone_angle: float = 30.0,
        edge_angle: float = 5.0,
    ) -> None:
        place = checks.as_vector(position, "SpotLight position", up_to=checks.FARTHEST)
        axis = checks.as_direction(direction, "SpotLight direction")
        strength = checks.rgb(intensity, "SpotLight intensity")
        outer = checks.number(
            cone_angle, "SpotLight cone_angle", at_least=NARROWEST, up_to=180.0, hint="degrees"
        )
        edge = checks.number(
            edge_angle,
            "SpotLight edge_angle",
            at_least=0.0,
            up_to=outer,
            hint="degrees, the edge is part of the cone",
        )
        # 1 - cos without its cancellation.
        bright, dark = (2.0 * math.sin(math.radians(0.5 * a)) ** 2 for a in (outer - edge, outer))
        self._row = LightRow(
            SPOT,
            place,
            axis,
            np.array([bright, dark, 0.0]),
            strength,
            power=math.pi * (bright + dark) * float(strength.mean()),
        )

    @property
    def row(self) -> LightRow:
        """Return the light as flat numbers."""
        return self._row

    @property
    def surface(self) -> None:
        """Return None: a point is not seen."""
        return
