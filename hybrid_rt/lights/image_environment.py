"""Environment light from a latitude-longitude image."""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.light import BLACK, Environment, upright
from hybrid_rt.shading.kernels.environment import PICTURE
from hybrid_rt.textures.image import linear_texels


class ImageEnvironment(Environment):
    """Environment light from a latitude-longitude image, seen from inside and not mirrored.

    The upper edge is the direction ``up``. The left edge is towards the coordinate axis least
    aligned with ``up``, made perpendicular to it. The azimuth grows to the right, clockwise as seen
    from above. With ``up`` = +y the left edge is towards +x, a quarter of the width towards +z, the
    middle towards -x, and three quarters towards -z; with +z, too, it is towards +x. Between
    texels the image is bilinear.

    Parameters
    ----------
    image : path, or array as `ImageTexture` takes it
        Integers, as most files hold, are decoded from sRGB; floats, as in .exr files, are linear
        radiance.
    up : three numbers
        The zenith, a direction of any length.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As for `ImageTexture`, and if ``up`` is zero or not finite.
    """

    def __init__(
        self, image: str | os.PathLike[str] | NDArray[Any], up: ArrayLike = (0.0, 1.0, 0.0)
    ) -> None:
        texels = linear_texels(image, "ImageEnvironment")
        rows, columns = _shares(texels)
        start, left, upward = upright(checks.as_direction(up, "ImageEnvironment up"))
        frame = np.stack([start, -left, upward])
        self._table = BLACK._replace(
            kind=PICTURE, frame=frame, texel=texels, rows=rows, columns=columns
        )

    def __repr__(self) -> str:
        """Name the size of the image."""
        height, width, _ = self._table.texel.shape
        up = ", ".join(f"{x:.4g}" for x in self._table.frame[2])
        return f"ImageEnvironment({width} x {height}, up=({up}))"


def _shares(texels: NDArray[np.float32]) -> tuple[FloatArray, FloatArray]:
    """Return the shares of rows and of texels within rows, each summed up from 0 to 1.

    A texel counts with the mean over its neighbours too, as radiance is bilinear.
    """
    bright = texels.mean(axis=2, dtype=np.float64)
    around = np.pad(bright, ((0, 0), (1, 1)), mode="wrap")
    bright = 0.25 * around[:, :-2] + 0.5 * around[:, 1:-1] + 0.25 * around[:, 2:]
    around = np.pad(bright, ((1, 1), (0, 0)), mode="edge")
    bright = 0.25 * around[:-2] + 0.5 * around[1:-1] + 0.25 * around[2:]
    height = len(bright)
    if not bright.any():
        bright = np.ones_like(bright)
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    of_row = bright.sum(axis=1) * (edges[:-1] - edges[1:])
    # A black row is never chosen, but its columns must still be a distribution.
    within = np.where(bright.sum(axis=1, keepdims=True) > 0.0, bright, 1.0)
    rows = np.concatenate([[0.0], np.cumsum(of_row)])[None]
    columns = np.concatenate([np.zeros((height, 1)), np.cumsum(within, axis=1)], axis=1)
    return rows / rows[:, -1:], columns / columns[:, -1:]
