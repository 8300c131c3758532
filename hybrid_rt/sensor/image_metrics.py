"""Error metrics: a picture against a reference (RMSE, relative MSE, bias)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray

# Keeps dark pixels from deciding a relative error.
DARK = 0.01
# The radiance of which it is the square.
DIM = 0.1
# The share of pixels that a few bright paths can spoil in an otherwise good picture.
WORST = 1e-3


@dataclass(frozen=True)
class PictureErrors:
    """Errors of a picture x against a reference r.

    Attributes
    ----------
    rmse, relative_rmse : float
        Root mean squares, over pixels and channels, of x - r and of (x - r) / sqrt(r^2 + 0.01). The
        second is the root of `relative_mse`.
    rmse_of_most, relative_rmse_of_most : float
        The same without the worst 0.1 % of the pixels.
    mean_error, relative_mean_error : float
        Signed mean of x - r, and its ratio to the mean of r (nan if that is 0). Noise averages out,
        so what remains is bias.
    worst : float
        Largest |x - r|.
    """

    rmse: float
    relative_rmse: float
    rmse_of_most: float
    relative_rmse_of_most: float
    mean_error: float
    relative_mean_error: float
    worst: float


def picture_errors(image: NDArray[np.floating], reference: NDArray[np.floating]) -> PictureErrors:
    """Measure a picture (height, width, 3) against a reference.

    Raises
    ------
    ValueError
        If the two differ in shape or a value is not finite.
    """
    for name, values in (("image", image), ("reference", reference)):
        n_bad = int(np.count_nonzero(~np.isfinite(values).all(axis=-1)))
        if n_bad:
            raise ValueError(
                f"{name} has {n_bad} pixels that are not finite: leave such pictures out"
            )
    relative = relative_squares(image, reference)
    r = reference.astype(np.float64)
    gap = image.astype(np.float64) - r
    # Scaled, so that the squares of very bright pictures do not overflow.
    scale = float(np.abs(gap).max(initial=0.0)) or 1.0
    squares = (gap / scale) ** 2
    mean = scale * float((gap / scale).mean())
    of_reference = float(np.abs(r).max(initial=0.0)) or 1.0
    mean_of_reference = of_reference * float((r / of_reference).mean())
    return PictureErrors(
        rmse=scale * math.sqrt(float(squares.mean())),
        relative_rmse=math.sqrt(float(relative.mean())),
        rmse_of_most=scale * math.sqrt(_mean_of_most(squares)),
        relative_rmse_of_most=math.sqrt(_mean_of_most(relative)),
        mean_error=mean,
        relative_mean_error=mean / mean_of_reference if mean_of_reference else math.nan,
        worst=float(np.abs(gap).max(initial=0.0)),
    )


def _mean_of_most(squares: FloatArray) -> float:
    """Return the mean of squares (..., 3) without the pixels whose sums are the largest 0.1 %."""
    of_pixels = squares.reshape(-1, squares.shape[-1]).mean(axis=1)
    return float(of_pixels[of_most(of_pixels)].mean())


def of_most(of_pixels: FloatArray) -> NDArray[np.bool_]:
    """Tell which pixels are not among the worst 0.1 %, those of the largest values."""
    n_kept = of_pixels.size - int(WORST * of_pixels.size)
    kept = np.zeros(of_pixels.size, dtype=bool)
    kept[np.argpartition(of_pixels, n_kept - 1, axis=None)[:n_kept]] = True
    return kept.reshape(of_pixels.shape)


def relative_mse(
    image: NDArray[np.floating], reference: NDArray[np.floating], leave_out: float = 0.0
) -> float:
    """Return the mean over pixels and channels of (x - r)^2 / (r^2 + 0.01).

    ``leave_out`` is the share of the worst values that are not counted.
    """
    errors = relative_squares(image, reference).ravel()
    n_kept = errors.size - int(leave_out * errors.size)
    return float(np.partition(errors, n_kept - 1)[:n_kept].mean())


def relative_squares(image: NDArray[np.floating], reference: NDArray[np.floating]) -> FloatArray:
    """Return (x - r)^2 / (r^2 + 0.01) for each pixel and channel."""
    if image.shape != reference.shape:
        raise ValueError(
            f"image has shape {image.shape}, its reference {reference.shape}: pass equal ones"
        )
    x, r = image.astype(np.float64), reference.astype(np.float64)
    # Divided before it is squared: very bright pictures would overflow.
    with np.errstate(over="ignore"):  # very bright ones against dark ones do
        squares: FloatArray = ((x - r) / np.hypot(r, math.sqrt(DARK))) ** 2
    return squares


def noise_of_reference(
    reference: NDArray[np.floating], standard_error: NDArray[np.floating]
) -> float:
    """Return the relative MSE of a reference with these standard errors."""
    return relative_mse(reference + standard_error, reference)


def seconds_to(target: float, seconds: Sequence[float], errors: Sequence[float]) -> float:
    """Return the seconds at which errors, falling with time, reach a target.

    Between measurements the interpolation is log-log. The result is the first time if the first
    error is below the target, and nan if the last one is above it.
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
