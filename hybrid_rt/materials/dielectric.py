"""Glass, water and other clear bodies."""

from __future__ import annotations

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import DIELECTRIC
from hybrid_rt.textures.texture import Texture, as_texture

# Squares of the index multiply radiance at every surface: beyond this pictures overflow.
EXTREME = 1e6


class Dielectric(Material):
    """A smooth clear body; its inside is the side opposite the surface's normal.

    A body may have several surfaces, of one material; together they must be closed. The report of
    a render names those that rays enter and never leave, or leave without having entered. A ray
    keeps count of eight bodies within each other, a ninth is reported like one that is not closed.

    Reflection and refraction follow Fresnel's equations for unpolarised light. Radiance is
    multiplied by the square of the index ratio where it enters or leaves. Inside, each channel
    falls as exp(-absorption x length).

    Parameters
    ----------
    ior : float
        Index of refraction of the material itself, 1 for empty space; 1e-6 to 1e6. What counts at a
        surface is its ratio to the index of the body around, if there is one: a bubble of air in
        glass is ``Dielectric(1.0)`` within ``Dielectric(1.5)``.
    absorption : number or three numbers
        Per unit of length, at least 0.
    tint : number, three numbers or texture
        Factor on light that passes the surface, 0 to 1.
    schlick : bool
        Use Schlick's approximation in place of Fresnel's equations.
    priority : float
        Where bodies overlap, the one of the highest priority fills the space, among equals the one
        entered last. So a drink that reaches a little into its glass, with a lower priority,
        touches it without a gap.
    """

    def __init__(
        self,
        ior: float = 1.5,
        absorption: ArrayLike = (0.0, 0.0, 0.0),
        tint: Texture | ArrayLike = 1.0,
        schlick: bool = False,
        priority: float = 0.0,
    ) -> None:
        index = checks.number(ior, "Dielectric ior", at_least=1.0 / EXTREME, up_to=EXTREME)
        density = checks.rgb(absorption, "Dielectric absorption")
        rank = checks.number(priority, "Dielectric priority")
        number = (index, float(checks.flag(schlick, "Dielectric schlick")), *density.tolist(), rank)
        self._lobes = (Lobe(DIELECTRIC, as_texture(tint, "Dielectric tint"), number),)

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """Return the single dielectric lobe."""
        return self._lobes
