"""How far a picture is from a reference."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.records import FloatArray

# Keeps dark pixels from deciding a relative error.
DARK = 0.01


def relative_mse(
    image: NDArray[np.floating], reference: NDArray[np.floating], leave_out: float = 0.0
) -> float:
    """Return the mean over pixels and channels of (x - r)^2 / (r^2 + 0.01).

    ``leave_out`` is the share of the worst values that do not count.
    """
    errors = relative_squares(image, reference).ravel()
    n_kept = errors.size - int(leave_out * errors.size)
    return float(np.partition(errors, n_kept - 1)[:n_kept].mean())


def relative_squares(image: NDArray[np.floating], reference: NDArray[np.floating]) -> FloatArray:
    """Return (x - r)^2 / (r^2 + 0.01) for each pixel and channel."""
    if image.shape != reference.shape:
        raise ValueError(f"image has shape {image.shape}, its reference {reference.shape}")
    x, r = image.astype(np.float64), reference.astype(np.float64)
    squares: FloatArray = (x - r) ** 2 / (r * r + DARK)
    return squares


def noise_of_reference(
    reference: NDArray[np.floating], standard_error: NDArray[np.floating]
) -> float:
    """Return the relative MSE that a reference with these standard errors has by itself."""
    return relative_mse(reference + standard_error, reference)


def seconds_to(target: float, seconds: Sequence[float], errors: Sequence[float]) -> float:
    """Return the seconds at which errors, falling with time, reach a target.

    Between two measurements the line in logarithms; before the first its seconds, after the last
    nan.
    """
    for k, (t, error) in enumerate(zip(seconds, errors, strict=True)):
        if error > target:
            continue
        if k == 0:
            return t
        t0, error0 = seconds[k - 1], errors[k - 1]
        share = math.log(error0 / target) / math.log(error0 / error)
        return float(t0 * (t / t0) ** share)
    return math.nan
