"""Image textures."""

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks, exr, hdr
from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.color import srgb_to_linear
from hybrid_rt.shading.kernels.texture import CLAMP, IMAGE, REPEAT
from hybrid_rt.textures.texture import Texture, TextureRow
from meshing.checks import refuse_mask


class ImageTexture(Texture):
    """An image over the surface parameters: u points right, v up; bilinear between pixel centres.

    Parameters
    ----------
    image : path, or array (height, width) or (height, width, 1 to 4)
        Row 0 is the upper one. Integers (8 or 16 bits) are decoded from sRGB, floats are taken as
        linear; of one bit (bool), True is 1. Grey, of one or two channels, is used for all three; an
        alpha channel, the second or fourth, is ignored. A file holds one picture; .exr needs the
        extra "exr", .hdr (Radiance) nothing.
    wrap : "repeat" or "clamp"
        What happens outside [0, 1].

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        If the file is missing, ``wrap`` is unknown, or the array has another shape or dtype, is
        empty, negative or not finite.
    """

    def __init__(
        self,
        image: str | os.PathLike[str] | NDArray[Any],
        wrap: Literal["repeat", "clamp"] = "repeat",
    ) -> None:
        checks.choice(wrap, "ImageTexture wrap", ("repeat", "clamp"))
        self._wrap = REPEAT if wrap == "repeat" else CLAMP
        self._texels = linear_texels(image, "ImageTexture")

    def __repr__(self) -> str:
        """Name the size of the image."""
        height, width, _ = self._texels.shape
        return f"ImageTexture({width} x {height}, wrap={self.wrap!r})"

    @property
    def wrap(self) -> Literal["repeat", "clamp"]:
        """What happens outside [0, 1]."""
        return "repeat" if self._wrap == REPEAT else "clamp"

    @property
    def texels(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: linear, row 0 at the top."""
        return self._texels

    @property
    def brightest(self) -> FloatArray:
        """Return the largest value of each channel; filtering never exceeds it."""
        return self._texels.max(axis=(0, 1)).astype(np.float64)

    @property
    def mean(self) -> FloatArray:
        """Return the mean of the texels, channel by channel."""
        return self._texels.mean(axis=(0, 1), dtype=np.float64)

    @property
    def row(self) -> TextureRow:
        """Return the image's row of the texture table."""
        return TextureRow(IMAGE, (0.0,) * 9, self._texels, self._wrap)


def linear_texels(image: str | os.PathLike[str] | NDArray[Any], owner: str) -> NDArray[np.float32]:
    """Return a picture as (height, width, 3) float32, linear; see `ImageTexture`. ``owner`` is for messages."""
    if isinstance(image, str | os.PathLike):
        return _linear(_read(Path(image), owner), f"{owner} {os.fspath(image)!r}")
    refuse_mask(image, f"{owner} image")
    try:
        array = np.asarray(image)
    except ValueError:
        raise ValueError(
            f"{owner} image is {checks.shown(image)}: pass rows of equal length"
        ) from None
    return _linear(array, f"{owner} image")


def _read(path: Path, owner: str) -> NDArray[Any]:
    what = f"{owner} image is {str(path)!r}"
    if not path.is_file():
        raise FileNotFoundError(f"{what}: there is no such file")
    readers = {".exr": _read_exr, ".hdr": hdr.read_hdr, ".pic": hdr.read_hdr}
    reader = readers.get(path.suffix.lower(), _read_picture)
    try:
        return reader(path)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"{what}: {exr.NEEDED}") from error
    except SeveralPicturesError as error:
        raise ValueError(
            f"{what}, of several pictures: pass one of them as an array, imageio.imread(file, index=0)"
        ) from error
    except Exception as error:  # whatever the reader of that format raises
        because = f" ({error})" if reader is hdr.read_hdr else ""
        raise ValueError(
            f"{what}: pass a picture file, it cannot be read as one{because}"
        ) from error


class SeveralPicturesError(Exception):
    """A file holds several pictures, as an animation does."""


def _read_picture(path: Path) -> NDArray[Any]:
    import imageio.v3 as imageio

    # Of some formats, as GIF, `imread` returns a stack of all pictures.
    pictures = imageio.imiter(path)
    image: NDArray[Any] = np.asarray(next(pictures))
    if next(pictures, None) is not None:
        raise SeveralPicturesError
    if image.ndim == 3 and image.shape[2] == 4 and imageio.immeta(path).get("mode") == "CMYK":
        image = imageio.imread(path, mode="RGB")  # four inks are no colour and alpha
    return image


def _read_exr(path: Path) -> NDArray[Any]:
    """Return linear radiance: the channels R, G and B, or Y for all three."""
    planes, _ = exr.read_exr(path)
    names = "RGB" if "R" in planes else "YYY"
    return np.stack([planes[name] for name in names], axis=2).astype(np.float32)


def _linear(image: NDArray[Any], what: str) -> NDArray[np.float32]:
    if image.ndim == 3 and image.shape[2] in {1, 2}:  # grey, and alpha
        image = image[:, :, 0]
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    if image.ndim != 3 or image.shape[2] not in {3, 4} or image.size == 0:
        raise ValueError(
            f"{what} has shape {image.shape}: pass (height, width), or (height, width, n) with 1 channel "
            "(grey), 2 (grey, alpha), 3 (red, green, blue) or 4 (and alpha)"
        )
    image = image[:, :, :3]
    if image.dtype == np.bool_:
        image = image.astype(np.float32)
    if image.dtype.kind == "u" and image.dtype.itemsize <= 2:
        return srgb_to_linear(image / np.iinfo(image.dtype).max).astype(np.float32)
    if not np.issubdtype(image.dtype, np.floating):
        raise TypeError(f"{what} has type {image.dtype}: pass uint8, uint16, bool or floats")
    if image.dtype.itemsize < 4:  # the limit itself is beyond its range
        image = image.astype(np.float32)
    if not (np.isfinite(image).all() and image.min() >= 0.0 and image.max() <= checks.BRIGHTEST):
        raise ValueError(
            f"{what} holds negative or non-finite values, or some above {checks.BRIGHTEST:g}: pass "
            "numbers from 0 on"
        )
    # A copy: what the caller does to his array later changes no scene.
    return np.array(image, dtype=np.float32, order="C")
