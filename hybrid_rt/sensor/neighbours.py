"""Means over the surroundings of each pixel."""

from __future__ import annotations

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
    mean: FloatArray = total / count
    return mean


def mean_around(image: FloatArray, reach: int) -> tuple[FloatArray, FloatArray]:
    """Return the means (height, width, 3) over squares about each pixel, and how many these are."""
    total = np.concatenate([image, np.ones((*image.shape[:2], 1))], axis=2)
    for axis in (0, 1):
        n = total.shape[axis]
        padded = np.pad(total, [(reach, reach) if a == axis else (0, 0) for a in range(3)])
        total = np.zeros_like(total)
        for shift in range(2 * reach + 1):
            total += padded.take(range(shift, shift + n), axis=axis)
    return total[:, :, :3] / total[:, :, 3:], total[:, :, 3:]
