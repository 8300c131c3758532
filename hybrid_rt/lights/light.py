"""The interface of lights and environments."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from hybrid_rt.shading.kernels.environment import EnvironmentTable, sky_on_rays
from hybrid_rt.textures.texture import Texture


@dataclass(frozen=True)
class LightRow:
    """One row of the `LightTable`."""

    kind: int
    origin: FloatArray
    edge_u: FloatArray
    edge_v: FloatArray
    strength: FloatArray
    texture: Texture | None = None
    """Takes the place of ``strength`` where the radiance varies."""
    power: float = 1.0
    """Emitted power, in the mean of the channels. It decides how often a light is sampled, and how many of
    the photons it sends; a texture counts by its mean, wherever on the surface it is bright."""


class Light(ABC):
    """A light inside the scene; immutable."""

    @property
    @abstractmethod
    def row(self) -> LightRow:
        """The light's row of the light table."""

    @property
    @abstractmethod
    def surface(self) -> Any:
        """The surface that emits from its front side; None for a light that rays cannot hit."""


class Environment(ABC):
    """Light from infinitely far; immutable."""

    @property
    @abstractmethod
    def table(self) -> EnvironmentTable:
        """The table that the kernels take."""

    def radiance(self, directions: FloatArray) -> FloatArray:
        """Return the radiance (n, 3) arriving from unit directions (n, 3)."""
        radiance, pdf = np.empty((len(directions), 3)), np.empty(len(directions))
        sky_on_rays(self.table, np.ascontiguousarray(directions, np.float64), radiance, pdf)
        return radiance


def lamp_radiance(radiance: Texture | ArrayLike, lamp: str, surface: str) -> FloatArray:
    """Return the radiance of a lamp that shines evenly, (3,) float64.

    Raises
    ------
    ValueError, TypeError
        If it is out of range, or a texture: that takes an object with the surface named.
    """
    if isinstance(radiance, Texture):
        raise TypeError(
            f"{lamp} radiance is a texture: pass a number or three; a picture shines as "
            f"Object({surface}(...), Emissive(texture))"
        )
    return checks.rgb(radiance, f"{lamp} radiance")


def upright(up: FloatArray) -> FloatArray:
    """Return a frame (3, 3) about a unit vector; rows are azimuth 0, azimuth 90 degrees, up.

    Azimuth 0 lies along the coordinate axis least aligned with ``up``, made perpendicular to it; of two
    alike the first, so +x where up is +y or +z.
    """
    start = np.zeros(3)
    start[np.argmin(np.abs(up))] = 1.0
    start -= (start @ up) * up
    start /= np.linalg.norm(start)
    return np.stack([start, np.cross(up, start), up])
