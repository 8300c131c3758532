"""The interface of materials: each is a short list of lobes, the terms of its BSDF.

Integrators see only the flat table of all lobes, so a mixture is just more lobes, and a new
material is one file.
"""

from dataclasses import dataclass

from hybrid_rt.shading.kernels.lobes.register import TRAITS
from hybrid_rt.textures.texture import Texture


@dataclass(frozen=True)
class Lobe:
    """One term of a BSDF."""

    kind: int
    """One of those in `hybrid_rt.shading.kernels.lobes.register`."""
    color: Texture
    number: tuple[float, ...] = ()
    """What they are, the lobe's kernel knows."""
    weight: float = 1.0
    """Share of the lobe in a mixture."""
    breadth: int = 0
    """WIDE, NARROW or DELTA, where the register leaves that to the material."""

    @property
    def traits(self) -> int:
        """The lobe's traits (bits), see `hybrid_rt.shading.kernels.lobes.register`."""
        return TRAITS[self.kind] | self.breadth


class Material:
    """Scattering and emission of a surface; immutable. Each class sets `_lobes`."""

    _lobes: tuple[Lobe, ...]

    @property
    def lobes(self) -> tuple[Lobe, ...]:
        """The terms of the material's BSDF."""
        return self._lobes

    @property
    def radiance(self) -> Texture | None:
        """Radiance emitted on the side of the normal; None: nothing."""
        return None
