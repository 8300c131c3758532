"""How brightly and how unevenly the sky and lamps with textures shine."""

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.cells import cells_of
from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.shading.kernels.environment import PICTURE, EnvironmentTable
from hybrid_rt.shading.kernels.texture import lobe_colors
from hybrid_rt.textures.image import ImageTexture
from hybrid_rt.textures.table import compile_textures
from hybrid_rt.textures.texture import Texture
from meshing.area import Weighted
from meshing.surface import Surface

# From this unevenness on a lamp is sampled by its brightness: below, few samples are wasted.
VERY_UNEVEN = 4.0
# Cells a side of such a lamp; its picture is averaged to twice as many texels a side at most, so that what
# points of each cell look up misses no bright texel.
CELLS_A_SIDE = 256
# Of the mean brightness, what a cell counts beside its own: what is looked up is not all that it holds.
LEAST_GLOW = 0.05


class Brightness(NamedTuple):
    """Of the sky, over all directions."""

    mean: float  # radiance, mean of its channels
    # Mean of squared radiance over its mean squared: 1 for a sky of one colour, at most 4/3 for a
    # gradient, and 1 / f if all light comes evenly from a part f of all directions.
    unevenness: float
    highest: float  # radiance anywhere, mean of its channels


def brightness(sky: EnvironmentTable) -> Brightness:
    """Return how brightly and how unevenly the sky shines.

    Texels count as even, though the sky is bilinear: for noise from texel to texel the unevenness is up to half
    as large again as what is seen, and the mean is off where poles differ from their neighbours.
    """
    if sky.kind == PICTURE:
        radiance = sky.texel.mean(axis=2, dtype=np.float64)
        edges = np.cos(np.pi * np.linspace(0.0, 1.0, len(radiance) + 1))
        weight = np.repeat(edges[:-1, None] - edges[1:, None], radiance.shape[1], axis=1)
    else:
        # Linear in the cosine to the zenith: three points of Simpson's rule are exact.
        low, high = sky.colors.mean(axis=1)
        radiance = np.array([low, 0.5 * (low + high), high])
        weight = np.array([1.0, 4.0, 1.0])
    mean = float(np.average(radiance, weights=weight))
    if mean == 0.0:
        return Brightness(0.0, 1.0, 0.0)
    # Squares of what is over the mean neither overflow nor vanish.
    unevenness = float(np.average((radiance / mean) ** 2, weights=weight))
    return Brightness(mean, unevenness, float(radiance.max()))


def is_very_uneven(texture: Texture) -> bool:
    """Tell whether a lamp with this texture is to be sampled by its brightness."""
    if not isinstance(texture, ImageTexture):
        return False
    radiance = texture.texels.mean(axis=2, dtype=np.float64)
    mean = float(radiance.mean())
    return mean > 0.0 and float(np.square(radiance / mean).mean()) > VERY_UNEVEN


def by_brightness(surface: Surface, texture: Texture) -> Weighted:
    """Return the cells of a bounded lamp, each chosen by its area times its brightness."""
    assert isinstance(texture, ImageTexture)
    sampler = cells_of(surface, CELLS_A_SIDE if len(surface) == 1 else 1)
    small = compile_textures([_averaged(texture)])
    cell = np.arange(sampler.share.size)
    glow = np.zeros(cell.size)
    for xi in (0.125, 0.375, 0.625, 0.875):
        for eta in (0.125, 0.375, 0.625, 0.875):
            place = np.full(cell.size, xi), np.full(cell.size, eta)
            patch, u, v = sampler.within(cell, *place)
            if isinstance(surface, TriangleMesh) and surface.texture_coordinates is not None:
                u, v = surface.texture_point(u, v, patch).T.copy()
            colors = np.zeros((cell.size, 1, 3))
            lobe_colors(
                small, np.zeros(1, dtype=np.int32), np.ones(1), np.array([0, 1], dtype=np.int32),
                np.zeros(cell.size, dtype=np.int32), u, v, np.zeros((cell.size, 3)), colors,
            )  # fmt: skip
            glow += colors.mean(axis=(1, 2)) / 16.0
    mean = float(sampler.share @ glow) or 1.0
    weight: FloatArray = glow / mean + LEAST_GLOW
    weighted = Weighted(sampler, weight)
    even = surface.area_sampler()
    assert even is not None  # it is bounded
    weighted.area = even.area
    return weighted


def _averaged(texture: ImageTexture) -> ImageTexture:
    """Return a picture of at most `2 CELLS_A_SIDE` texels a side, each the mean of those that it covers."""
    texels = texture.texels.astype(np.float64)
    for axis in (0, 1):
        n = texels.shape[axis]
        m = min(n, 2 * CELLS_A_SIDE)
        first = (np.arange(m) * n) // m
        counts = np.diff(np.append(first, n))
        sums = np.add.reduceat(texels, first, axis=axis)
        texels = sums / (counts[:, None, None] if axis == 0 else counts[None, :, None])
    return ImageTexture(texels, wrap=texture.wrap)
