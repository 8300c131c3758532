"""Frosted glass, and other clear bodies that are not smooth."""

from __future__ import annotations

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.materials.dielectric import EXTREME
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.materials.roughness import alpha_of
from hybrid_rt.shading.kernels.lobes.register import ROUGH_DIELECTRIC
from hybrid_rt.textures.texture import Texture, as_texture


class RoughDielectric(Material):
    """A clear body with a rough surface; `Dielectric` says what is its inside, and what is closed.

    Facets whose slopes follow GGX each reflect and refract by Fresnel's equations. Light that one
    facet sends to another is absorbed. Lights are found through the surface: it casts no shadow on
    what is seen through it, but on other surfaces it does, as glass does. Where it lies hidden in a
    body of higher priority, or borders on the same index, it is passed as smooth glass is.

    It is always followed, never gathered on: behind one face lies another, through which lights are
    found without blur.

    Parameters
    ----------
    ior : float
        Index of refraction of the body; 1e-6 to 1e6.
    roughness : float
        0.01 to 1; the alpha of GGX is its square.
    absorption : number or three numbers
        Per unit of length, at least 0.
    tint : number, three numbers or texture
        Factor on light that passes the surface, 0 to 1.
    priority : float
        As of `Dielectric`.
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

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Return the single dielectric lobe."""
        return self._lobes
