"""How unevenly the sky shines."""

import numpy as np

from hybrid_rt.shading.kernels.environment import PICTURE, EnvironmentTable


def unevenness(sky: EnvironmentTable) -> float:
    """Return the mean over all directions of squared radiance, over its mean squared.

    It is 1 for a sky of one colour, at most 4/3 for a gradient, and 1 / f if all light comes evenly
    from a part f of all directions.
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
    mean = np.average(radiance, weights=weight)
    return float(np.average(radiance**2, weights=weight) / mean**2) if mean > 0.0 else 1.0
