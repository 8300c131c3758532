"""Spot lights."""

import math

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.suggestions import explains
from hybrid_rt.lights.light import Light, LightRow
from hybrid_rt.shading.kernels.light_kinds import SPOT

# Narrower cones are a few roundings of a unit direction wide.
NARROWEST = 1e-3
# Width of the smooth edge, degrees, where none is given and the cone has room for it.
EDGE = 5.0


@explains(
    power="intensity = power / (2 pi (1 - cos(cone_angle))), with edge_angle=0",
    radiance="intensity, which is power per steradian",
    color="intensity",
    target="direction = target - position",
    angle="cone_angle, half of the opening, in degrees",
)
class SpotLight(Light):
    """A point light that emits into a cone with a smooth edge. It is itself invisible.

    At angle theta from the axis the intensity is ``intensity`` times x^2 (3 - 2 x), where
    x = (cos theta - cos cone_angle) / (cos(cone_angle - edge_angle) - cos cone_angle), clamped to
    [0, 1]: full up to ``cone_angle - edge_angle``, zero from ``cone_angle`` on, smooth in between.
    So the power is pi (2 - cos cone_angle - cos(cone_angle - edge_angle)) ``intensity``.

    Parameters
    ----------
    position, direction : three numbers each
        The position in scene units, and the axis of the cone, of any length.
    intensity : number or three numbers
        Power per steradian near the axis, at least 0.
    cone_angle : float
        Half the opening angle of the cone, degrees, 0.001 to 180.
    edge_angle : float, optional
        Width of the smooth edge inside the cone, degrees, from 0 (a hard edge) to ``cone_angle``.
        Default: 5, or the whole cone if it is narrower.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number, or the direction is zero; the message names
        it.

    Notes
    -----
    This is the spot light of pbrt, where ``cone_angle`` is called ``coneangle`` and ``edge_angle``
    is called ``conedeltaangle``. In Mitsuba ``cutoff_angle`` is ``cone_angle`` and ``beam_width``
    is ``cone_angle - edge_angle``, but there the edge is linear in the angle.
    """

    def __init__(
        self,
        position: ArrayLike,
        direction: ArrayLike,
        intensity: ArrayLike,
        cone_angle: float = 30.0,
        edge_angle: float | None = None,
    ) -> None:
        place = checks.as_vector(position, "SpotLight position", up_to=checks.FARTHEST)
        axis = checks.as_direction(direction, "SpotLight direction")
        strength = checks.rgb(intensity, "SpotLight intensity")
        outer = checks.number(
            cone_angle, "SpotLight cone_angle", at_least=NARROWEST, up_to=180.0, hint="degrees"
        )
        edge = checks.number(
            min(EDGE, outer) if edge_angle is None else edge_angle,
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

    def __repr__(self) -> str:
        """Return the call that makes it."""
        row = self._row
        # Of 1 - cos, without its cancellation.
        inner, outer = np.degrees(2.0 * np.arcsin(np.sqrt(0.5 * row.edge_v[:2])))
        strength = one_or_three(row.strength)
        angles = {"cone_angle": outer, "edge_angle": outer - inner}
        return call(self, row.origin, row.edge_u, intensity=strength, **angles)
