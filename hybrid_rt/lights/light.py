"""The interface of lights and environments."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from hybrid_rt.shading.kernels.environment import NO_SKY, EnvironmentTable, sky_on_rays
from hybrid_rt.textures.texture import Texture
from meshing.surface import Surface


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


class Light:
    """A light inside the scene; immutable. Each class sets `_row`, and `_surface` if rays can hit it."""

    _row: LightRow
    _surface: Surface | None = None

    @property
    def row(self) -> LightRow:
        """The light's row of the light table."""
        return self._row

    @property
    def surface(self) -> Any:
        """The surface that emits from its front side; None for a light that rays cannot hit."""
        return self._surface


# What is no picture has this one texel, which kernels do not read.
BLACK = EnvironmentTable(
    kind=NO_SKY,
    frame=np.eye(3),
    colors=np.zeros((2, 3)),
    heights=np.ones(2),
    texel=np.zeros((1, 1, 3), dtype=np.float32),
    rows=np.array([[0.0, 1.0]]),
    columns=np.array([[0.0, 1.0]]),
)


class Environment:
    """Light from infinitely far; immutable. Each class sets `_table`."""

    _table: EnvironmentTable

    @property
    def table(self) -> EnvironmentTable:
        """The table that the kernels take."""
        return self._table

    def radiance(self, directions: FloatArray) -> FloatArray:
        """Return the radiance (n, 3) arriving from unit directions (n, 3)."""
        radiance, pdf = np.empty((len(directions), 3)), np.empty(len(directions))
        sky_on_rays(self.table, np.ascontiguousarray(directions, np.float64), radiance, pdf)
        return radiance


def lamp_radiance(radiance: Texture | ArrayLike, lamp: str, surface: str) -> FloatArray:
    """Return the radiance (3,) of a lamp that shines evenly; a texture takes an object with that surface."""
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
