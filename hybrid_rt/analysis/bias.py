"""What signed mean errors tell of a method's bias, the part of its error that stays.

Noise averages out over a picture and over its parts, light that a method does not find does not. By
the inequality of Cauchy and Schwarz the mean of x - r over n values, squared and divided by the mean of
r^2 + 0.01, is at most the squared relative RMSE; so each mean gives a lower bound of it.
"""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.sensor.image_metrics import DARK, of_most

# A picture is cut into so many tiles a side: each is large enough for noise to average out.
TILES = 8
# Standard errors of a mean of tiles, of which there are some 64, to a limit of 97.5 %.
OF_TILES = 2.0


def least_by_mean(mean_error: float, half_interval: float, truth: NDArray[np.floating]) -> float:
    """Return the least relative RMSE of which a picture's mean gives proof; 0 if of none.

    The mean error and half its 95 % interval are radiance; nan: unknown.
    """
    sure = abs(mean_error) - half_interval
    if not sure > 0.0:
        return 0.0
    return sure / math.sqrt(float((truth.astype(np.float64) ** 2).mean()) + DARK)


def least_by_tiles(
    images: Sequence[NDArray[np.floating]], truth: NDArray[np.floating], own_error: float
) -> float:
    """Return the least relative RMSE of which the means of tiles give proof; 0 if of none.

    The product of a tile's errors in two independent runs is on average the square of what both share: bias,
    and the reference's own error, a relative RMSE, which is taken off (nan: unknown).
    """
    if len(images) < 2:
        return 0.0
    weights = _tile_means(truth.astype(np.float64) ** 2 + DARK)
    errors = [_tile_means(image.astype(np.float64) - truth) for image in images]
    shared = np.mean([one * other for one, other in combinations(errors, 2)], axis=0) / weights
    # Channels of a tile share their noise; tiles are independent.
    of_tiles = shared.mean(axis=1)
    doubt = OF_TILES * float(of_tiles.std(ddof=1)) / math.sqrt(len(of_tiles))
    own = 0.0 if math.isnan(own_error) else own_error
    return math.sqrt(max(float(of_tiles.mean()) - doubt - own * own, 0.0))


def shared_error(
    one: NDArray[np.float64],
    other: NDArray[np.float64],
    weight: NDArray[np.float64],
    trimmed: bool = False,
) -> tuple[float, float]:
    """Return the relative RMSE that two differences share, 0 if not seen above the noise, and its limit.

    The ``weight`` (height, width, 3) is what squared differences are divided by. Where they are ``trimmed``, the worst
    0.1 % of the pixels are left out.
    """
    # Channels of a pixel share their noise; pixels are independent.
    products = (one * other / weight).mean(axis=2)
    if trimmed:
        products = products[of_most(((one * one + other * other) / weight).mean(axis=2))]
    square, doubt = float(products.mean()), 1.96 * float(products.std(ddof=1)) / products.size**0.5
    return math.sqrt(square) if square > doubt else 0.0, math.sqrt(max(square, 0.0) + doubt)


def _tile_means(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means over tiles: (tiles, channels)."""
    return np.array(
        [
            tile.mean(axis=(0, 1))
            for rows in np.array_split(values, min(TILES, values.shape[0]), axis=0)
            for tile in np.array_split(rows, min(TILES, values.shape[1]), axis=1)
        ]
    )
