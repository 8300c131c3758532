"""Polished and brushed metal."""

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import METAL, MIRROR
from hybrid_rt.textures.texture import Texture, as_texture, plain_color

# The cosine of the angle to the mirror direction rounds by 1e-16: here that is 2e-4 of the widest, 1 - cos =
# fuzz^2 / 2. At 1e-8 a ball lost a tenth of its light.
LEAST_FUZZ = 1e-6


@explains(reflectance="color", roughness="fuzz, which is no roughness, or take RoughConductor")
class Metal(Material):
    """A mirror whose direction is perturbed by a random point in a ball of radius ``fuzz``.

    This is the lobe of "Ray Tracing in One Weekend" (Shirley): the mirror direction plus ``fuzz``
    times a point of the unit ball. Here its pdf p has a closed form, and the lobe is reciprocal: f
    = color p / max(cos_in, cos_out). Light that is sampled into the surface is absorbed.

    Parameters
    ----------
    color : number, three numbers or texture
        Reflectance per channel, from 0 to 1.
    fuzz : float
        0 (a perfect mirror), or from 1e-6 to 1.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.
    """

    def __init__(self, color: Texture | ArrayLike, fuzz: float = 0.0) -> None:
        spread = checks.number(fuzz, "Metal fuzz", at_least=0.0, up_to=1.0, hint="0: a mirror")
        if 0.0 < spread < LEAST_FUZZ:
            raise ValueError(
                f"Metal fuzz is {spread:g}: pass 0 (a mirror), or a number from {LEAST_FUZZ:g} to 1"
            )
        texture = as_texture(color, "Metal color")
        self._lobes = (Lobe(METAL, texture, (spread,)) if spread > 0.0 else Lobe(MIRROR, texture),)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        (lobe,) = self._lobes
        fuzz = lobe.number[0] if lobe.number else 0.0
        return call(self, plain_color(lobe.color), fuzz=fuzz)
