"""From passes to a picture, and from a picture to a file."""

from __future__ import annotations

import importlib.util
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.records import FloatArray

# IEC 61966-2-1: a straight piece near black, then a power. The limits are the standard's.
_LINEAR_LIMIT, _SRGB_LIMIT, _SLOPE, _OFFSET, _POWER = 0.0031308, 0.04045, 12.92, 0.055, 2.4


def linear_to_srgb(linear: ArrayLike) -> FloatArray:
    """Encode linear values for a screen; values outside [0, 1] are clipped."""
    x = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    curve = (1.0 + _OFFSET) * np.maximum(x, _LINEAR_LIMIT) ** (1.0 / _POWER) - _OFFSET
    return np.where(x <= _LINEAR_LIMIT, _SLOPE * x, curve)


def srgb_to_linear(encoded: ArrayLike) -> FloatArray:
    """Decode values from 0 to 1 of a picture made for a screen."""
    x = np.asarray(encoded, dtype=np.float64)
    return np.where(x <= _SRGB_LIMIT, x / _SLOPE, ((x + _OFFSET) / (1.0 + _OFFSET)) ** _POWER)


class Film:
    """The sum of all passes so far, and of their squares.

    Parameters
    ----------
    height, width : int
    """

    def __init__(self, height: int, width: int) -> None:
        self.n_passes = 0
        self._sum = np.zeros((height, width, 3))
        self._sum_of_squares = np.zeros((height, width, 3))
        self._pass_means: list[float] = []

    def add(self, radiance: FloatArray) -> None:
        """Add one pass (height, width, 3); passes come in the order of their numbers."""
        self.n_passes += 1
        self._sum += radiance
        self._sum_of_squares += radiance * radiance
        self._pass_means.append(float(radiance.mean()))

    @property
    def image(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: the mean of the passes, linear, row 0 at the top."""
        return (self._sum / self.n_passes).astype(np.float32)

    @property
    def standard_error(self) -> FloatArray:
        """(height, width, 3) float64: of each pixel, from the differences between passes.

        Passes share one low-discrepancy sequence, so their mean is better than independent ones
        would be: the figures err on the safe side. A single pass tells nothing: nan.
        """
        n = self.n_passes
        if n < 2:
            return np.full_like(self._sum, np.nan)
        mean = self._sum / n
        # Rounding can leave a variance of -1e-17 where all passes agree.
        variance = np.maximum(self._sum_of_squares / n - mean * mean, 0.0)
        error: FloatArray = np.sqrt(variance / (n - 1))
        return error

    def noise(self) -> dict[str, float] | None:
        """Return estimates of the standard error, or None where a single pass tells nothing.

        See `standard_error`.
        """
        n = self.n_passes
        if n < 2:
            return None
        return {
            "image_mean": float(np.mean(self._pass_means)),
            "standard_error_of_image_mean": float(np.std(self._pass_means, ddof=1) / math.sqrt(n)),
            "root_mean_square_standard_error_of_pixels": math.sqrt(
                float(np.square(self.standard_error).mean())
            ),
        }


Channels = Mapping[str, NDArray[np.float32]]


def save_image(
    path: str | os.PathLike[str],
    image: NDArray[np.float32],
    report: dict[str, Any],
    channels: Channels | None = None,
    exposure: float = 0.0,
) -> Path:
    """Write a picture, and its report beside it as JSON.

    Parameters
    ----------
    path : path ending in .png, .npz or .exr
        PNG: 8 bit, sRGB, values above 1 clipped. NPZ: ``image`` as it is, ``report`` as JSON text
        and the channels by name. EXR: 32-bit channels R, G, B and name.part, the report as the
        attribute "hybrid_rt"; needs the package OpenEXR (the extra "exr"). An existing file is
        replaced, at once and only by a complete one.
    image : (height, width, 3) float32
    report : dict
    channels : dict, optional
        By name, (height, width) or (height, width, parts) float32; not kept by PNG.
    exposure : float
        Stops: a PNG shows 2**exposure times the radiance. The other formats keep radiance.

    Returns
    -------
    Path
        The sidecar: the same name ending in .json.

    Raises
    ------
    ValueError, FileNotFoundError, ModuleNotFoundError
        If the ending is another one, the folder does not exist, or OpenEXR is not installed.
    """
    target = check_output(path)
    text = json.dumps(report, indent=2, allow_nan=False) + "\n"
    with _replacing(target) as file:
        WRITERS[target.suffix.lower()](file, image, text, channels or {}, exposure)
    sidecar = target.with_suffix(".json")
    with _replacing(sidecar) as file:
        file.write(text.encode())
    return sidecar


def check_output(path: str | os.PathLike[str]) -> Path:
    """Return the path if a picture can be written there; see `save_image` for what is raised."""
    target = Path(path)
    if target.suffix.lower() not in WRITERS:
        raise ValueError(f"output {str(target)!r}: unknown ending; use {', '.join(WRITERS)}")
    if not target.parent.is_dir():
        raise FileNotFoundError(
            f"output {str(target)!r}: there is no folder {str(target.parent)!r}"
        )
    if not os.access(target.parent, os.W_OK):
        raise PermissionError(f"output {str(target)!r}: the folder is not writable")
    if target.suffix.lower() == ".exr" and importlib.util.find_spec("OpenEXR") is None:
        raise ModuleNotFoundError(
            f"output {str(target)!r}: EXR needs the package OpenEXR: pip install 'hybrid-rt[exr]'"
        )
    return target


def _write_png(
    file: BinaryIO,
    image: NDArray[np.float32],
    _report: str,
    _channels: Channels,
    exposure: float,
) -> None:
    import imageio.v3 as imageio

    shown = image.astype(np.float64) * 2.0**exposure
    pixels = np.rint(linear_to_srgb(shown) * 255.0).astype(np.uint8)
    imageio.imwrite(file, pixels, extension=".png")


def _write_npz(
    file: BinaryIO,
    image: NDArray[np.float32],
    report: str,
    channels: Channels,
    _exposure: float,
) -> None:
    arrays: dict[str, NDArray[Any]] = {"image": image, "report": np.array(report), **channels}
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _write_exr(
    file: BinaryIO,
    image: NDArray[np.float32],
    report: str,
    channels: Channels,
    _exposure: float,
) -> None:
    import OpenEXR

    from hybrid_rt.channels import PARTS

    planes = {name: image[:, :, k] for k, name in enumerate("RGB")}
    for name, values in channels.items():
        if values.ndim == 2:
            planes[name] = values
        else:
            planes |= {f"{name}.{part}": values[:, :, k] for k, part in enumerate(PARTS[name])}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "hybrid_rt": report,
    }
    contiguous = {name: np.ascontiguousarray(plane) for name, plane in planes.items()}
    OpenEXR.File(header, contiguous).write(file.name)


Writer = Callable[[BinaryIO, NDArray[np.float32], str, Channels, float], None]

WRITERS: dict[str, Writer] = {".png": _write_png, ".npz": _write_npz, ".exr": _write_exr}


@contextmanager
def _replacing(target: Path) -> Iterator[BinaryIO]:
    """Open a file under a temporary name that takes the target's place once it is complete."""
    temporary = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as file:
            yield file
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
