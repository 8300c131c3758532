"""Glossy surfaces: the energy-conserving Phong model."""

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import DIFFUSE, NARROW, PHONG, WIDE
from hybrid_rt.textures.texture import Texture, as_texture, plain_color

# A sum of two colours that should be one may exceed it by rounding.
_ROUNDING = 1e-12
# At this exponent the rounding of a cosine, 1e-16, changes its power by 1e-6.
SHARPEST = 1e10
# Of the photons around a point few fall within a sharper lobe, and none within a very sharp one: then it
# is missing, and no error estimate tells. On a ball in a room, squared error x time of ppm by gathering
# over that by following is 0.8 at an exponent of 100, 2.4 at 300 and 18 at 1000; of photon_map it is 1.0
# at 30, 3.2 at 100 and 10 at 300.
SHARPEST_WIDE = 100.0


@explains(color="diffuse and specular", shininess="exponent")
class Phong(Material):
    """Modified Phong model: f = diffuse / pi + specular (n + 2) / (2 pi) cos^n alpha.

    Here n is the exponent and alpha the angle to the mirror direction. The specular term is
    normalised: its albedo is at most ``specular``.

    Parameters
    ----------
    diffuse, specular : number, three numbers or texture
        Albedos per channel; their sum is at most 1.
    exponent : float
        Above 0, at most 1e10. Larger exponents give sharper highlights. Up to 100 the lobe counts as
        wide: photon density is estimated on it, and Whitted's method lights it directly. Beyond that,
        one sampled direction is followed.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range, or the two albedos sum to more than 1.

    References
    ----------
    Lafortune and Willems, "Using the modified Phong reflectance model for physically based
    rendering", 1994.
    """

    def __init__(
        self, diffuse: Texture | ArrayLike, specular: Texture | ArrayLike, exponent: float
    ) -> None:
        matt = as_texture(diffuse, "Phong diffuse")
        glossy = as_texture(specular, "Phong specular")
        total = matt.brightest + glossy.brightest
        if (total > 1.0 + _ROUNDING).any():
            raise ValueError(
                f"Phong diffuse + specular reaches {np.max(total):g}: pass at most 1 together (a "
                "surface cannot send on more light than it receives)"
            )
        power = checks.number(
            exponent, "Phong exponent", above=0.0, up_to=SHARPEST, hint="beyond it use Mirror"
        )
        breadth = WIDE if power <= SHARPEST_WIDE else NARROW
        self._lobes = (Lobe(DIFFUSE, matt), Lobe(PHONG, glossy, (power,), breadth=breadth))

    def __repr__(self) -> str:
        """Return the call that makes it."""
        matt, glossy = self._lobes
        colors = plain_color(matt.color), plain_color(glossy.color)
        return call(self, *colors, exponent=glossy.number[0])
