"""Textures from pictures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.film import srgb_to_linear
from hybrid_rt.kernels.texture import CLAMP, IMAGE, REPEAT
from hybrid_rt.records import FloatArray
from hybrid_rt.textures.texture import Texture, TextureRow


class ImageTexture(Texture):
    """A picture laid over the parameters: u to the right, v up, bilinear between pixel centres.

    Parameters
    ----------
    image : path, or array (height, width), (height, width, 3) or (height, width, 4)
        Integers (8 or 16 bit) are sRGB and are decoded; floats are linear already. Grey counts for
        all channels; an alpha channel is ignored.
    wrap : "repeat" or "clamp"
        What lies outside [0, 1].

    Raises
    ------
    FileNotFoundError, ValueError
        If the file is missing, or the array has another shape, is empty, negative or not finite.
    """

    def __init__(
        self,
        image: str | os.PathLike[str] | NDArray[Any],
        wrap: Literal["repeat", "clamp"] = "repeat",
    ) -> None:
        if wrap not in {"repeat", "clamp"}:
            raise ValueError(f"ImageTexture wrap: {wrap!r} is unknown; use 'repeat' or 'clamp'")
        self._wrap = REPEAT if wrap == "repeat" else CLAMP
        if isinstance(image, str | os.PathLike):
            self._texels = _linear(_read(Path(image)), f"ImageTexture {os.fspath(image)!r}")
        else:
            self._texels = _linear(np.asarray(image), "ImageTexture array")

    @property
    def texels(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: linear, row 0 at the top."""
        return self._texels

    @property
    def brightest(self) -> FloatArray:
        """Return the largest value of each channel; filtering never exceeds it."""
        brightest: FloatArray = self._texels.max(axis=(0, 1)).astype(np.float64)
        return brightest

    @property
    def row(self) -> TextureRow:
        """Return the picture for the table."""
        return TextureRow(IMAGE, (0.0,) * 9, self._texels, self._wrap)


def _read(path: Path) -> NDArray[Any]:
    if not path.is_file():
        raise FileNotFoundError(f"ImageTexture: there is no file {str(path)!r}")
    import imageio.v3 as imageio

    image: NDArray[Any] = imageio.imread(path)
    return image


def _linear(image: NDArray[Any], what: str) -> NDArray[np.float32]:
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    if image.ndim != 3 or image.shape[2] not in {3, 4} or image.size == 0:
        raise ValueError(
            f"{what}: shape {image.shape} is no picture; use (height, width), (height, width, 3) or "
            "(height, width, 4)"
        )
    image = image[:, :, :3]
    if image.dtype in {np.dtype(np.uint8), np.dtype(np.uint16)}:
        return srgb_to_linear(image / np.iinfo(image.dtype).max).astype(np.float32)
    if not np.issubdtype(image.dtype, np.floating):
        raise TypeError(f"{what}: type {image.dtype} is unknown; use uint8, uint16 or floats")
    if not np.isfinite(image).all() or image.min() < 0.0:
        raise ValueError(f"{what}: holds negative or non-finite values")
    return np.ascontiguousarray(image, dtype=np.float32)
