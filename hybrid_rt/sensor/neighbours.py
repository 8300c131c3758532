"""Means over the surroundings of each pixel."""

import numpy as np

from hybrid_rt.core.records import FloatArray


def mean_of_neighbours(image: FloatArray) -> FloatArray:
    """Return the means (height, width, 3) over the up to eight pixels around each of several."""
    height, width, _ = image.shape
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)))
    inside = np.pad(np.ones((height, width, 1)), ((1, 1), (1, 1), (0, 0)))
    total, count = np.zeros_like(image), np.zeros((height, width, 1))
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                total += padded[down : down + height, right : right + width]
                count += inside[down : down + height, right : right + width]
    return total / count


def mean_around(image: FloatArray, reach: int) -> tuple[FloatArray, FloatArray]:
    """Return means (height, width, n) over squares about each pixel, and how many pixels these are."""
    sums = sums_around(np.concatenate([image, np.ones((*image.shape[:2], 1))], axis=2), reach)
    return sums[:, :, :-1] / sums[:, :, -1:], sums[:, :, -1:]


def sums_around(planes: FloatArray, reach: int) -> FloatArray:
    """Return sums (height, width, n) over squares about each pixel, cut off by the border.

    Sums of 1, 2, 4, ... neighbours are put together. Unlike differences of sums from the border on,
    they neither round more than the square does nor carry inf and nan out of it.
    """
    total = planes
    for axis in (0, 1):
        n, n_in_square = total.shape[axis], 2 * reach + 1
        widths = [(reach, reach) if a == axis else (0, 0) for a in range(3)]
        block, n_in_block, done = np.moveaxis(np.pad(total, widths), axis, 0), 1, 0
        parts = np.zeros((n, *block.shape[1:]))
        while True:
            if n_in_square & n_in_block:
                parts += block[done : done + n]
                done += n_in_block
            if done == n_in_square:
                break
            block = block[:-n_in_block] + block[n_in_block:]
            n_in_block *= 2
        total = np.moveaxis(parts, 0, axis)
    return total
