"""Rectangular area lights."""

import math

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.suggestions import explains
from hybrid_rt.lights.light import Light, LightRow, lamp_radiance
from hybrid_rt.primitives import Rectangle
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE


@explains(
    power="radiance = power / (pi area)",
    intensity="radiance, which is intensity / area as seen from the front",
    emission="radiance",
    color="radiance",
)
class RectangleLight(Light):
    """A rectangular area light with constant radiance on the side of edge_u x edge_v.

    That side is visible to all rays; the back is black. Both sides occlude light and reflect none.

    Parameters
    ----------
    corner, edge_u, edge_v : three numbers each
        The rectangle is corner + u edge_u + v edge_v for u and v in [0, 1], scene units.
    radiance : number or three numbers
        At least 0.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number, or the edges span no area.
    """

    def __init__(
        self, corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, radiance: ArrayLike
    ) -> None:
        origin = checks.as_vector(corner, "RectangleLight corner", up_to=checks.FARTHEST)
        u = checks.edge(edge_u, "RectangleLight edge_u")
        v = checks.edge(edge_v, "RectangleLight edge_v")
        strength = lamp_radiance(radiance, "RectangleLight", "Rectangle")
        no_area = (
            f"RectangleLight edges are {u.tolist()} and {v.tolist()}, of no area: pass two in "
            "different directions (for a point: PointLight)"
        )
        try:
            self._surface = Rectangle(origin, u, v)
        except ValueError as error:
            raise ValueError(no_area) from error
        if self._surface.area == 0.0:  # it is below all numbers
            raise ValueError(no_area)
        power = math.pi * self._surface.area * float(strength.mean())
        self._row = LightRow(RECTANGLE, origin, u, v, strength, power=power)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        row = self._row
        radiance = one_or_three(row.strength)
        return call(self, row.origin, row.edge_u, row.edge_v, radiance=radiance)
