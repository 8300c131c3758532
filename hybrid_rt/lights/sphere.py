"""Spherical area lights."""

import math

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.suggestions import explains
from hybrid_rt.lights.light import Light, LightRow, lamp_radiance
from hybrid_rt.primitives import Sphere
from hybrid_rt.shading.kernels.light_kinds import SPHERE


@explains(
    power="radiance = power / (4 pi^2 radius^2)",
    intensity="radiance, which is intensity / (pi radius^2)",
    emission="radiance",
    color="radiance",
)
class SphereLight(Light):
    """A spherical area light with constant radiance on its outside.

    The outside is visible to all rays; the inside is black. The sphere occludes light and reflects
    none.

    Parameters
    ----------
    center : three numbers
        Scene units.
    radius : float
        Above 0, scene units.
    radiance : number or three numbers
        At least 0.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.
    """

    def __init__(self, center: ArrayLike, radius: float, radiance: ArrayLike) -> None:
        middle = checks.as_vector(center, "SphereLight center", up_to=checks.FARTHEST)
        size = checks.number(radius, "SphereLight radius", above=0.0, up_to=checks.FARTHEST)
        strength = lamp_radiance(radiance, "SphereLight", "Sphere")
        self._row = LightRow(
            SPHERE,
            middle,
            np.array([size, 0.0, 0.0]),
            np.zeros(3),
            strength,
            power=4.0 * math.pi**2 * size * size * float(strength.mean()),
        )
        self._surface = Sphere(middle, size)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        row = self._row
        radiance = one_or_three(row.strength)
        return call(self, row.origin, radius=row.edge_u[0], radiance=radiance)
