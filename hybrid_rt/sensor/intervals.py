"""95 % intervals of pixels and of the image mean, from the differences between groups of passes.

Four means say little about their own spread, and light that rare paths bring is missing from most
pixels without any variance that shows it. So the interval of a pixel borrows from its surroundings,
and that of the mean allows for the skewness that bright paths give it. docs/error_vs_time.md has
the coverage.
"""

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.neighbours import mean_around, mean_of_neighbours, sums_around

# Half the width of a 95 % interval in standard errors: Student's t by degrees of freedom.
STUDENT = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145,
)  # fmt: skip
# Pixels around are alike but not the same, and discs of photons give them common noise, so together
# they count for twice the degrees of freedom that a pixel has by itself.
BORROWED = 2
# Student's t as above for 3, 6, 9, ... degrees of freedom: with what neighbours lend.
_STUDENT_OF_PIXELS = (
    3.182, 2.447, 2.262, 2.179, 2.131, 2.101, 2.080, 2.064, 2.052, 2.042, 2.035, 2.028, 2.023,
    2.018,
)  # fmt: skip
# The medians of a pixel's groups lack what rare paths bring: what they lack in the mean over so many
# pixels to either side, at most (one-sided 95 %), is a limit to that light.
REACH, ONE_SIDED = 3, 1.645
# Light that a pixel and its neighbours meet once in hundreds of passes shows farther away only; there
# the pixels are asked whose noise is alike. Quiet pixels (a sky, a lamp in sight) keep their narrow
# intervals beside noisy ones, and the other way round.
FAR_REACH = 15
# Alike: of noise of the same decade or the next, in parts of the brightness. Less than the least
# is all alike.
LEAST_DECADE = -5
# What an interval follows from lies within so many pixels; noise is compared in squares of 3 x 3.
SURROUNDINGS = FAR_REACH + 1
# Rows at a time: their planes stay in the processor's cache.
ROWS = 64
TWO_SIDED = 1.96
# Sums of cubes over a square of pixels stay finite below this.
HUGE = 1e100


def half_intervals(variances: FloatArray, freedom: int) -> FloatArray:
    """Return half the intervals (height, width, 3) of pixels by the variances of their means.

    ``variances`` (height, width, 3).
    ``freedom``: degrees of freedom of each, 1 to 14.
    """
    if variances.shape[0] * variances.shape[1] == 1:
        return STUDENT[freedom - 1] * np.sqrt(variances)
    both = (variances + BORROWED * mean_of_neighbours(variances)) / (1.0 + BORROWED)
    return _STUDENT_OF_PIXELS[freedom - 1] * np.sqrt(both)


def light_of_rare_paths(above: FloatArray, lowest: FloatArray) -> FloatArray:
    """Return a limit to the light (height, width, 3) that rare paths bring to pixels.

    The larger of two: from all pixels of 7 x 7, and from those of 31 x 31 whose noise is alike.

    ``above`` (height, width, 3): by how much the mean of a pixel exceeds the median of its groups.
    ``lowest`` (height, width, 2): brightness and noise of a pixel without its brightest paths: mean
    and range of all its groups but the highest.
    """
    around, n = mean_around(above, REACH)
    squares = mean_around(above * above, REACH)[0]
    variance = np.maximum(squares - around * around, 0.0) / n
    near = np.maximum(around + ONE_SIDED * np.sqrt(variance), 0.0)
    return np.maximum(near, _far_light(above, _decades(lowest)))


def bright_path(of_groups: FloatArray) -> tuple[float, float]:
    """Return the sums of squares and cubes by which the groups of pixels differ from their mean.

    ``of_groups`` (groups, ...).
    """
    gaps = of_groups - of_groups.mean(axis=0)
    squares = gaps * gaps
    return float(squares.sum()), float((squares * gaps).sum())


def half_interval_of_mean(standard_error: float, factor: float, bright: float) -> float:
    """Return half the 95 % interval of an image mean.

    Where few bright paths make up the noise the mean is skewed: with bad luck it lacks the very
    paths that would show in its standard error. Then it is a sum of so many events, each of the
    size of a bright path, and the upper side of the score interval for counts is the half. Without
    bright paths it is that of Student's t.

    ``standard_error``, ``factor``: Student's t times the standard error is half the interval of an
    even mean.
    ``bright``: what one bright path contributes to the mean.
    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 1927.
    """
    return float(score_limits(factor * standard_error, bright, TWO_SIDED)[1])


def score_limits(
    reach: FloatArray | float, event: FloatArray | float, quantile: float
) -> tuple[FloatArray, FloatArray]:
    """Return how far the score interval of a sum of rare events reaches to both sides of it.

    ``reach``: the quantile times the standard error.
    ``event``: what one event adds: the third moment over the second.
    """
    skewed = 0.5 * quantile**2 * np.asarray(event)
    half = np.hypot(reach, skewed)
    return skewed - half, skewed + half


def _score_limit(
    mean: FloatArray, square: FloatArray, cube: FloatArray, n: FloatArray
) -> FloatArray:
    """Return upper limits to the mean of n values that a few events make, from mean powers; 0 at least.

    As in `half_interval_of_mean`: an event is what the third moment is over the second.
    """
    event = np.divide(cube, square, out=np.zeros_like(cube), where=cube > 0.0) / n
    variance = np.maximum(square - mean * mean, 0.0) / n
    _, upper = score_limits(ONE_SIDED * np.sqrt(variance), event, ONE_SIDED)
    return np.maximum(mean + upper, 0.0)


def _decades(lowest: FloatArray) -> NDArray[np.int64]:
    """Return classes of noise (height, width): powers of ten of noise over brightness."""
    level, noise = np.moveaxis(mean_around(lowest, 1)[0], 2, 0)
    share = np.divide(noise, level, out=np.zeros_like(noise), where=noise != 0.0)
    decades = np.floor(np.log10(np.maximum(share, 10.0**LEAST_DECADE)))
    # What is not finite is like nothing else.
    return np.where(np.isfinite(decades), decades, 100.0).astype(np.int64)


def _far_light(above: FloatArray, decades: NDArray[np.int64]) -> FloatArray:
    """Return the limit from pixels of like noise, within `FAR_REACH`; rows at a time."""
    limit = np.zeros_like(above)
    height = len(above)
    is_summed: NDArray[np.bool_] = np.all(np.abs(above) < HUGE, axis=2)
    for first in range(0, height, ROWS):
        own = slice(first, min(first + ROWS, height))
        low = max(first - FAR_REACH, 0)
        around = slice(low, own.stop + FAR_REACH)
        for decade in np.unique(decades[own]).tolist():
            # What is not finite, or has no square and cube, would spoil the sums of all around.
            is_alike = (np.abs(decades[around] - decade) <= 1) & is_summed[around]
            counted = np.where(is_alike[:, :, None], above[around], 0.0)
            powers = [counted, counted**2, counted**3]
            planes = np.concatenate([*powers, is_alike[:, :, None]], axis=2)
            rows = decades[own] == decade
            sums = sums_around(planes, FAR_REACH)[first - low : own.stop - low][rows]
            n = sums[:, 9:]
            # None like it is within reach: `light_of_rare_paths` has the limit of the pixels around.
            mean, square, cube = np.split(sums[:, :9] / np.maximum(n, 1.0), 3, axis=1)
            limit[own][rows] = _score_limit(mean, square, cube, np.maximum(n, 1.0))
    return limit
