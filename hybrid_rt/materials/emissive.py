"""Emissive surfaces."""

from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.materials.material import Material
from hybrid_rt.textures.texture import Texture, as_texture, plain_color


class Emissive(Material):
    """A surface that emits the same radiance in all directions on the side of its normal.

    Parameters
    ----------
    radiance : number, three numbers or texture
        Emitted radiance, at least 0.
    base : Material, optional
        How both sides scatter light. Default: they are black.

    Raises
    ------
    ValueError, TypeError
        If the radiance is out of range, or ``base`` is not a material or is itself emissive.
    """

    def __init__(self, radiance: Texture | ArrayLike, base: Material | None = None) -> None:
        if base is not None and not isinstance(base, Material):
            raise TypeError(f"Emissive base is {checks.shown(base)}: pass a material, or None")
        if base is not None and base.radiance is not None:
            raise ValueError("Emissive base shines itself: add up the two radiances")
        self._radiance = as_texture(radiance, "Emissive radiance", checks.BRIGHTEST)
        self._base = base
        self._lobes = () if base is None else base.lobes

    def __repr__(self) -> str:
        """Return the call that makes it."""
        further = {} if self._base is None else {"base": self._base}
        return call(self, plain_color(self._radiance), **further)

    @property
    def radiance(self) -> Texture:
        """Return the emitted radiance."""
        return self._radiance
