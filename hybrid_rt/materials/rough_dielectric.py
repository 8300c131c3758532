"""Rough dielectrics: frosted glass."""

from __future__ import annotations

import math

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.materials.dielectric import EXTREME, changed
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.materials.roughness import alpha_of
from hybrid_rt.shading.kernels.lobes.register import ROUGH_DIELECTRIC
from hybrid_rt.textures.texture import Texture, as_texture


class RoughDielectric(Material):
    """A dielectric body with a rough surface; inside and closedness are as for `Dielectric`.

    GGX microfacets with Smith shadowing and masking that reflect and refract by Fresnel's equations
    (Walter et al. 2007). Interreflection between microfacets is lost. Next-event estimation
    evaluates transmission: a light behind the surface lights it directly. For shadow rays between
    other surfaces it is opaque, as smooth glass is. Where the surface lies inside a body of higher
    priority, or both sides have the same index, rays pass it as they pass smooth glass.

    Camera paths always follow it; photon density is never estimated on it.

    Parameters
    ----------
    ior : float
        Index of refraction of the body; 1e-6 to 1e6.
    roughness : float
        0.01 to 1; the alpha of GGX is its square.
    absorption : number or three numbers
        Absorption coefficient per scene unit, at least 0.
    tint : number, three numbers or texture
        Factor on transmitted light, 0 to 1.
    priority : float
        As for `Dielectric`.
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
        index = checks.number(ior, f"{what} ior", at_least=1.0 / EXTREME, up_to=EXTREME)
        alpha = alpha_of(roughness, f"{what} roughness", "Dielectric")
        density = checks.rgb(absorption, f"{what} absorption")
        rank = checks.number(priority, f"{what} priority")
        # Those of a dielectric without Schlick's approximation, then its own.
        number = (index, 0.0, *density.tolist(), rank, alpha)
        self._lobes = (Lobe(ROUGH_DIELECTRIC, as_texture(tint, f"{what} tint"), number),)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        (lobe,) = self._lobes
        return call(self, lobe.number[0], roughness=math.sqrt(lobe.number[-1]), **changed(lobe))

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Return the single dielectric lobe."""
        return self._lobes
