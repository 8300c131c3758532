"""Diffuse surfaces."""

from numpy.typing import ArrayLike

from hybrid_rt.core.one_line import call
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import DIFFUSE
from hybrid_rt.textures.texture import Texture, as_texture, plain_color


@explains(reflectance="color", albedo="color")
class Lambertian(Material):
    """Lambertian (diffuse) reflection, f = color / pi, on both sides of the surface.

    Parameters
    ----------
    color : number, three numbers or texture
        Albedo per channel, from 0 to 1.

    Raises
    ------
    ValueError, TypeError
        If the colour is out of range or not a colour.
    """

    def __init__(self, color: Texture | ArrayLike) -> None:
        self._lobes = (Lobe(DIFFUSE, as_texture(color, "Lambertian color")),)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        return call(self, plain_color(self._lobes[0].color))
