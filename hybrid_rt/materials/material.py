"""The interface of materials: each is a short list of lobes, the terms of its BSDF.

A material is a short tuple of lobes. Integrators see only the flat table of all of them, so a
mixture is nothing but more lobes, and a new material is one file.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from hybrid_rt.shading.kernels.lobes.register import TRAITS
from hybrid_rt.textures.texture import Texture


@dataclass(frozen=True)
class Lobe:
    """One way of sending light on."""

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
        """What is true of the lobe, in bits: see the register."""
        return TRAITS[self.kind] | self.breadth


class Material(ABC):
    """What a surface is made of; immutable."""

    @property
    @abstractmethod
    def lobes(self) -> tuple[Lobe, ...]:
        """The ways in which the material sends light on."""

    @property
    def radiance(self) -> Texture | None:
        """What the surface sends out by itself on the side of its normal; None: nothing."""
        return None
