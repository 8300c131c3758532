"""The sRGB transfer function and its inverse."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.film import OVERFLOWS

# IEC 61966-2-1: a straight piece near black, then a power. The limits are the standard's.
_LINEAR_LIMIT, _SRGB_LIMIT, _SLOPE, _OFFSET, _POWER = 0.0031308, 0.04045, 12.92, 0.055, 2.4


def linear_to_srgb(linear: ArrayLike) -> FloatArray:
    """Encode linear values as sRGB; values outside [0, 1] are clipped."""
    x = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    curve = (1.0 + _OFFSET) * np.maximum(x, _LINEAR_LIMIT) ** (1.0 / _POWER) - _OFFSET
    return np.where(x <= _LINEAR_LIMIT, _SLOPE * x, curve)


def srgb_to_linear(encoded: ArrayLike) -> FloatArray:
    """Decode sRGB values from 0 to 1 to linear ones."""
    x = np.asarray(encoded, dtype=np.float64)
    return np.where(x <= _SRGB_LIMIT, x / _SLOPE, ((x + _OFFSET) / (1.0 + _OFFSET)) ** _POWER)


@OVERFLOWS
def screen_pixels(image: NDArray[np.floating], exposure: float = 0.0) -> NDArray[np.uint8]:
    """Encode a linear picture as 8-bit sRGB; nan becomes black."""
    shown = np.nan_to_num(image.astype(np.float64), posinf=np.inf) * 2.0**exposure
    return np.rint(linear_to_srgb(shown) * 255.0).astype(np.uint8)
