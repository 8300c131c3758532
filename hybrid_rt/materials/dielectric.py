"""Smooth dielectrics: glass, water, air bubbles."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import DIELECTRIC
from hybrid_rt.textures.texture import Texture, as_texture, plain_color

# Squares of the index multiply radiance at every surface: beyond this pictures overflow.
EXTREME = 1e6


@explains(
    color="absorption, per scene unit of way: -ln(color) / way; or tint",
    index="ior",
    refractive_index="ior",
    roughness="it to RoughDielectric",
)
class Dielectric(Material):
    """A smooth dielectric body. Its inside is the side opposite to the normal.

    A body may have several surfaces that share one material object; together they must be closed.
    The report of a render names bodies that rays enter and never leave, or leave without having
    entered. Up to eight nested bodies are tracked; a ninth is reported like one that is not closed.

    Reflection and refraction follow Fresnel's equations for unpolarised light; polarisation is not
    carried from surface to surface (a pane of index 1.5 passes 0.836 of the light at 60 degrees, where
    it should be 0.848; 0.904 for 0.907 at 45; the same at 0). Radiance is scaled
    by the square of the index ratio on refraction. Inside, each channel falls as
    exp(-absorption x length).

    Parameters
    ----------
    ior : float
        Index of refraction relative to vacuum, from 1e-6 to 1e6. At a surface it is taken relative
        to the surrounding body, if there is one: an air bubble in glass is ``Dielectric(1.0)``
        inside ``Dielectric(1.5)``.
    absorption : number or three numbers
        Absorption coefficient per scene unit, at least 0.
    tint : number, three numbers or texture
        Factor on transmitted light, from 0 to 1, applied at each surface.
    schlick : bool
        Use Schlick's approximation instead of Fresnel's equations.
    priority : float
        Where bodies overlap, the one with the highest priority fills the space; among equals it is
        the one that was entered last. So a liquid of lower priority that overlaps its glass a
        little touches it without a gap.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.

    References
    ----------
    Schmidt and Budge, "Simple nested dielectrics in ray traced images", Journal of Graphics Tools
    7, 2002.
    """

    def __init__(
        self,
        ior: float = 1.5,
        absorption: ArrayLike = (0.0, 0.0, 0.0),
        tint: Texture | ArrayLike = 1.0,
        schlick: bool = False,
        priority: float = 0.0,
    ) -> None:
        is_schlick = checks.flag(schlick, "Dielectric schlick")
        lobe = body(DIELECTRIC, "Dielectric", ior, absorption, tint, priority, schlick=is_schlick)
        self._lobes = (lobe,)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        (lobe,) = self._lobes
        ior, schlick, *_ = lobe.number
        further = {"schlick": True} if schlick else {}
        return call(self, ior, **changed(lobe), **further)


def body(
    kind: int,
    what: str,
    ior: float,
    absorption: ArrayLike,
    tint: Texture | ArrayLike,
    priority: float,
    *own: float,
    schlick: bool = False,
) -> Lobe:
    """Return the lobe of a clear body; ``own`` are numbers of its kind."""
    hint = "of one wavelength, as 1.5168: there is no catalogue of glasses"
    index = checks.number(ior, f"{what} ior", at_least=1.0 / EXTREME, up_to=EXTREME, hint=hint)
    density = checks.rgb(absorption, f"{what} absorption")
    rank = checks.number(priority, f"{what} priority")
    number = (index, float(schlick), *density.tolist(), rank, *own)
    return Lobe(kind, as_texture(tint, f"{what} tint"), number)


def changed(lobe: Lobe) -> dict[str, Any]:
    """Return those of absorption, tint and priority of a body's lobe that are not as by default."""
    absorption, tint = np.array(lobe.number[2:5]), plain_color(lobe.color)
    found: dict[str, Any] = {}
    if absorption.any():
        found["absorption"] = one_or_three(absorption)
    if not (isinstance(tint, float) and tint == 1.0):
        found["tint"] = tint
    if lobe.number[5] != 0.0:
        found["priority"] = lobe.number[5]
    return found
