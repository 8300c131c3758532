"""What every light and every environment answers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from hybrid_rt.records import FloatArray


@dataclass(frozen=True)
class LightRow:
    """One light as the kernels take it: a row of the `LightTable`."""

    kind: int
    origin: FloatArray
    edge_u: FloatArray
    edge_v: FloatArray
    strength: FloatArray


class Light(ABC):
    """Something within the scene that shines; immutable."""

    @property
    @abstractmethod
    def row(self) -> LightRow:
        """The light as flat numbers."""

    @property
    @abstractmethod
    def surface(self) -> Any:
        """The surface that shines on its front side, or None for a light that is not seen."""


class Environment(ABC):
    """Light from infinitely far; immutable."""

    @abstractmethod
    def radiance(self, directions: FloatArray) -> FloatArray:
        """Return what arrives from unit directions (n, 3), as (n, 3) radiances."""
