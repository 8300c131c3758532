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

from hybrid_rt.measures import DARK
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


# Passes are dealt out to so many groups in turn, pass n to group n mod GROUPS, and each group has
# random numbers of its own. Errors come from the differences between groups, so they are honest
# however evenly the passes within one group fill their domain. More groups would know their error
# better and make it larger; see docs/error_vs_time.md for what four cost.
GROUPS = 4

# Half the width of a 95 % interval in standard errors, for means of k = 2 .. GROUPS groups:
# Student's t with k - 1 degrees of freedom.
_STUDENT = {2: 12.706, 3: 4.303, 4: 3.182}


class Film:
    """The sums of all passes so far, group by group.

    Parameters
    ----------
    height, width : int
    """

    def __init__(self, height: int, width: int) -> None:
        self.n_passes = 0
        self._sums = np.zeros((GROUPS, height, width, 3))

    def add(self, radiance: FloatArray) -> None:
        """Add one pass (height, width, 3); passes come in the order of their numbers."""
        self._sums[self.n_passes % GROUPS] += radiance
        self.n_passes += 1

    @property
    def n_groups(self) -> int:
        """Number of groups that hold at least one pass."""
        return min(self.n_passes, GROUPS)

    @property
    def image(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: the mean of the passes, linear, row 0 at the top."""
        return self._mean().astype(np.float32)

    @property
    def standard_error(self) -> FloatArray:
        """(height, width, 3) float64: of each pixel, from the differences between groups.

        A 95 % interval reaches ``noise()["interval_factor"]`` standard errors to either side. A
        single pass tells nothing: nan.
        """
        if self.n_passes < 2:
            return np.full(self._sums.shape[1:], np.nan)
        mean = self._mean()
        squares = np.zeros_like(mean)
        for sum_of_group, n_in_group in self._groups():
            squares += (sum_of_group - n_in_group * mean) ** 2
        k = self.n_groups
        error: FloatArray = np.sqrt(k / (k - 1.0) * squares) / self.n_passes
        return error

    def relative_error(self) -> float:
        """Return the estimated relative root mean square error of the picture, nan after one pass.

        Its square is the mean over pixels and channels of s^2 / (x^2 + 0.01), s the standard error
        and x the value: what `hybrid_rt.measures.relative_mse` is expected to be against the limit
        of infinitely many passes.
        """
        return math.sqrt(float((self.standard_error**2 / (self._mean() ** 2 + DARK)).mean()))

    def noise(self) -> dict[str, float] | None:
        """Return estimates of the standard error, or None where a single pass tells nothing.

        See `standard_error` and `relative_error`.
        """
        n, k = self.n_passes, self.n_groups
        if n < 2:
            return None
        mean = float(self._mean().mean())
        squares = sum(
            (float(sum_of_group.mean()) - n_in_group * mean) ** 2
            for sum_of_group, n_in_group in self._groups()
        )
        return {
            "groups": k,
            "interval_factor": _STUDENT[k],
            "image_mean": mean,
            "standard_error_of_image_mean": math.sqrt(k / (k - 1.0) * squares) / n,
            "root_mean_square_standard_error_of_pixels": math.sqrt(
                float(np.square(self.standard_error).mean())
            ),
            "relative_rmse": self.relative_error(),
        }

    def _mean(self) -> FloatArray:
        mean: FloatArray = self._sums[: self.n_groups].sum(axis=0) / self.n_passes
        return mean

    def _groups(self) -> Iterator[tuple[FloatArray, int]]:
        """Yield the sum of each group and how many passes it holds."""
        each, more = divmod(self.n_passes, GROUPS)
        for group in range(self.n_groups):
            yield self._sums[group], each + (group < more)


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
