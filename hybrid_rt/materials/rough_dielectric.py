"""Rough dielectrics: frosted glass."""

import math

from numpy.typing import ArrayLike

from hybrid_rt.core.one_line import call
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.dielectric import body, changed
from hybrid_rt.materials.material import Material
from hybrid_rt.materials.roughness import alpha_of
from hybrid_rt.shading.kernels.lobes.register import ROUGH_DIELECTRIC
from hybrid_rt.textures.texture import Texture


@explains(
    color="absorption, per scene unit of way: -ln(color) / way; or tint",
    index="ior",
    refractive_index="ior",
    alpha="roughness = sqrt(alpha)",
)
class RoughDielectric(Material):
    """A dielectric body with a rough surface. It must be closed, as a `Dielectric` must.

    The model has GGX microfacets with Smith's height-correlated shadowing and masking that reflect
    and refract by Fresnel's equations. Interreflection between microfacets is lost. Next-event estimation includes
    transmission, so a light behind the surface lights it directly. The surface is opaque for shadow
    rays between other surfaces, as smooth glass is. Inside a body of higher priority, or with the
    same index on both sides, rays pass the surface as they pass smooth glass.

    Camera paths always follow a sampled direction; photon density is never estimated on it.

    Parameters
    ----------
    ior : float
        Index of refraction of the body, relative to vacuum, from 1e-6 to 1e6.
    roughness : float
        From 0.01 to 1; the alpha of GGX is its square.
    absorption : number or three numbers
        Absorption coefficient per scene unit, at least 0.
    tint : number, three numbers or texture
        Factor on transmitted light, from 0 to 1.
    priority : float
        As for `Dielectric`.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.

    References
    ----------
    Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007. Heitz,
    "Understanding the masking-shadowing function in microfacet-based BRDFs", JCGT 3(2), 2014.
    """

    def __init__(
        self,
        ior: float,
        roughness: float,
        absorption: ArrayLike = (0.0, 0.0, 0.0),
        tint: Texture | ArrayLike = 1.0,
        priority: float = 0.0,
    ) -> None:
        what = "RoughDielectric"
        alpha = alpha_of(roughness, f"{what} roughness", "Dielectric")
        self._lobes = (body(ROUGH_DIELECTRIC, what, ior, absorption, tint, priority, alpha),)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        (lobe,) = self._lobes
        return call(self, lobe.number[0], roughness=math.sqrt(lobe.number[-1]), **changed(lobe))
