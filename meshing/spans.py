"""Parameters of patches that lie side by side on a sheet: (k, 4) spans, u0, u1, v0, v1 of each."""

import numpy as np
from numpy.typing import NDArray

from meshing.checks import FloatArray


def within_patch(
    spans: FloatArray, u: FloatArray, v: FloatArray, patch_id: NDArray[np.integer]
) -> tuple[FloatArray, FloatArray]:
    """Convert parameters of the sheet to those of its patches."""
    u0, u1, v0, v1 = np.moveaxis(spans[patch_id], -1, 0)
    return (u - u0) / (u1 - u0), (v - v0) / (v1 - v0)


def across(
    spans: FloatArray, u: FloatArray, v: FloatArray, patch_id: NDArray[np.integer]
) -> tuple[FloatArray, FloatArray]:
    """Convert parameters of patches to those of the sheet; borders stay where they are."""
    u0, u1, v0, v1 = np.moveaxis(spans[patch_id], -1, 0)
    return (np.where(u == 1.0, u1, u0 + u * (u1 - u0)), np.where(v == 1.0, v1, v0 + v * (v1 - v0)))
