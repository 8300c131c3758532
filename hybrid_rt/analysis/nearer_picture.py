"""Which of two pictures is nearer to a reference, and whether that can be told.

The mean squared errors of both are compared, over all pixels and without the worst 0.1 % of each
picture's. How much their difference would scatter is estimated from the means of square tiles:
noise of photons is alike in neighbours, and few white dots make few tiles decide, so that the
scatter is as large as the difference. Errors may also differ from place to place without any noise.
So a verdict is left open only if the stated noise of the pictures is as large as the difference.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.image_metrics import of_most, relative_squares

# The edge of a tile, pixels; small pictures have at least about so many tiles along each edge.
TILE, LEAST_TILES = 8, 4
# A difference of less than so many standard errors may be chance: 5 % of differences are, if tiles
# are many and no few of them decide.
STANDARD_ERRORS = 2.0


@dataclass(frozen=True)
class Verdict:
    """Which of two pictures is nearer by one measure."""

    first_is_nearer: bool | None  # None: both are equally near
    is_told: bool  # whether the difference is beyond the noise


def verdicts(
    one: NDArray[np.floating],
    other: NDArray[np.floating],
    reference: NDArray[np.floating],
    noise: float | None,
) -> tuple[Verdict, Verdict]:
    """Compare the errors of two pictures, over all pixels and without the worst 0.1 %.

    ``noise`` is the largest relative difference from the reference that noise explains; None: unknown.
    """
    first, second = (relative_squares(image, reference).mean(axis=2) for image in (one, other))
    most = [np.where(of_most(squares), squares, 0.0) for squares in (first, second)]
    return _verdict(first, second, noise), _verdict(most[0], most[1], noise)


def _verdict(one: FloatArray, other: FloatArray, noise: float | None) -> Verdict:
    # Scaled, so that no square overflows.
    scale = max(float(one.max()), float(other.max())) or 1.0
    if not math.isfinite(scale):
        return Verdict(None, is_told=False)
    gap = one / scale - other / scale
    mean = float(gap.mean())
    if mean == 0.0:
        return Verdict(None, is_told=True)
    errors = [math.sqrt(float((squares / scale).mean())) for squares in (one, other)]
    apart = math.sqrt(scale) * abs(errors[0] - errors[1])
    may_be_noise = noise is None or apart <= noise
    is_chance = abs(mean) <= STANDARD_ERRORS * _standard_error(gap)
    return Verdict(mean < 0.0, is_told=not (may_be_noise and is_chance))


def _standard_error(values: FloatArray) -> float:
    """Return the standard error of the mean of (height, width), from the means of tiles."""
    height, width = values.shape
    edges = [max(min(TILE, n // LEAST_TILES), 1) for n in (height, width)]
    cuts = [np.arange(0, n, edge) for n, edge in zip((height, width), edges, strict=True)]
    sums = np.add.reduceat(np.add.reduceat(values, cuts[0], axis=0), cuts[1], axis=1)
    n_pixels = np.outer(*(np.diff([*cut, n]) for cut, n in zip(cuts, (height, width), strict=True)))
    if sums.size < 2:
        return math.inf
    # Tiles at the borders are smaller: each tile's deviation is that of its sum.
    off = sums - n_pixels * values.mean()
    variance = float((off**2).sum()) * sums.size / (sums.size - 1)
    return math.sqrt(variance) / values.size
