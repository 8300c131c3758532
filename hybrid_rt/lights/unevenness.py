"""How brightly and how unevenly the sky shines."""

from typing import NamedTuple

import numpy as np

from hybrid_rt.shading.kernels.environment import PICTURE, EnvironmentTable


class Brightness(NamedTuple):
    """Of the sky, over all directions."""

    mean: float  # radiance, mean of its channels
    # Mean of squared radiance over its mean squared: 1 for a sky of one colour, at most 4/3 for a
    # gradient, and 1 / f if all light comes evenly from a part f of all directions.
    unevenness: float
    highest: float  # radiance anywhere, mean of its channels


def brightness(sky: EnvironmentTable) -> Brightness:
    """Return how brightly and how unevenly the sky shines.

    Texels count as even, though the sky is bilinear between their centres: for noise from texel to texel the
    unevenness is up to half as large again as what is seen, and the mean is off where poles differ from
    their neighbours.
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
