"""From passes to a picture, and from a picture to a file."""

from __future__ import annotations

import errno
import importlib.util
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
from hybrid_rt.report import as_json
from meshing.checks import as_path, number

UIntArray = NDArray[np.uint64]

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


def screen_pixels(image: NDArray[np.floating], exposure: float = 0.0) -> NDArray[np.uint8]:
    """Encode a linear picture for a screen, 8 bit; nan is black."""
    shown = np.nan_to_num(image.astype(np.float64), posinf=np.inf) * 2.0**exposure
    return np.rint(linear_to_srgb(shown) * 255.0).astype(np.uint8)


# Passes are dealt out to groups, a run of RUN passes to each in turn, and every group has random
# numbers of its own. So errors taken from the differences between groups are honest, however evenly
# the passes within a group fill their domain; a run is a complete net, so few passes are as good as
# they can be. More groups would know their error better and make it larger: docs/error_vs_time.md
# says what four cost.
GROUPS, RUN = 4, 4

# Exposures up to here keep their factor a number.
MOST_STOPS = 100.0

# Radiances beyond the range of numbers end as inf and nan, which the report counts.
OVERFLOWS = np.errstate(over="ignore", invalid="ignore")

# Pixels of which errors are computed at a time: what it takes stays in the processor's cache.
STRIP = 2**12

# Half the width of a 95 % interval in standard errors: Student's t by degrees of freedom.
_STUDENT = (
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145,
)  # fmt: skip

# Four means say little about their own spread, and where rare paths bring much light the lucky
# pixels believe their error to be none. So the interval of a pixel borrows from the pixels around
# it: they are alike but not the same, and discs of photons give them common noise, so together they
# count for twice the degrees of freedom that it has by itself. docs/error_vs_time.md has figures.
BORROWED = 2
# Student's t as above for 3, 6, 9, ... degrees of freedom: with what neighbours lend.
_STUDENT_OF_PIXELS = (
    3.182, 2.447, 2.262, 2.179, 2.131, 2.101, 2.080, 2.064, 2.052, 2.042, 2.035, 2.028, 2.023,
    2.018,
)  # fmt: skip


def group_of(pass_number: UIntArray) -> tuple[UIntArray, UIntArray]:
    """Return the group of each pass, and the pass's number in it."""
    run, place = np.divmod(pass_number, np.uint64(RUN))
    turn, group = np.divmod(run, np.uint64(GROUPS))
    return group, turn * np.uint64(RUN) + place


def pass_of(group: UIntArray, number: UIntArray) -> UIntArray:
    """Return the passes that `group_of` takes apart."""
    turn, place = np.divmod(number, np.uint64(RUN))
    return (turn * np.uint64(GROUPS) + group) * np.uint64(RUN) + place


class Film:
    """The sums of all passes so far, group by group.

    Parameters
    ----------
    height, width : int
    """

    def __init__(self, height: int, width: int) -> None:
        self.n_passes = 0
        self._sums = np.zeros((GROUPS, height, width, 3))
        self._counts = np.zeros(GROUPS, dtype=np.int64)
        self._means = np.zeros(GROUPS)  # of whole pictures, summed like the pictures
        # Until every group holds a run, passes count as independent of each other.
        self._first_means: list[float] = []
        self._squares: FloatArray | None = np.zeros((height, width, 3))

    @OVERFLOWS
    def add(self, radiance: FloatArray) -> None:
        """Add one pass (height, width, 3); passes come in the order of their numbers."""
        group = self.n_passes // RUN % GROUPS
        mean = float(radiance.mean())
        self._sums[group] += radiance
        self._means[group] += mean
        self._counts[group] += 1
        self.n_passes += 1
        if self.n_passes >= GROUPS * RUN:
            self._squares = None
        elif self._squares is not None:
            self._squares += radiance * radiance
            self._first_means.append(mean)

    @property
    @OVERFLOWS
    def image(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: the mean of the passes, linear, row 0 at the top."""
        return self._mean().astype(np.float32)

    @property
    @OVERFLOWS
    def standard_error(self) -> FloatArray:
        """(height, width, 3) float64: of each pixel; a single pass tells nothing: nan.

        From 16 passes on it comes from the differences between groups. Before, passes count as
        independent; they are better than that, so the figures err on the safe side. The squares
        are right in the mean over many pixels; of a single one see `half_interval`.
        """
        return np.sqrt(self._variances())

    @property
    def half_interval(self) -> FloatArray:
        """(height, width, 3) float64: half the width of each pixel's 95 % interval; nan as above.

        A pixel's own variance and the mean of its neighbours' make one estimate; in pictures of one
        pixel its own has to do. Of many intervals 95 % hold the truth; beside edges of the noise,
        where neighbours differ most, more do on the calm side and fewer on the other.
        """
        own = self._variances()
        n = (self.n_passes if self._squares is not None else GROUPS) - 2
        if own.shape[0] * own.shape[1] == 1:
            return _STUDENT[max(n, 0)] * np.sqrt(own)
        both = (own + BORROWED * _mean_of_neighbours(own)) / (1.0 + BORROWED)
        half: FloatArray = _STUDENT_OF_PIXELS[max(n, 0)] * np.sqrt(both)
        return half

    def _variances(self) -> FloatArray:
        """Return the variances (height, width, 3) of the mean, nan after one pass."""
        variances = np.full(self._sums.shape[1:], np.nan)
        if self.n_passes >= 2:
            for rows, _, variance in self._strips():
                variances[rows] = variance
        return variances

    @OVERFLOWS
    def relative_error(self) -> float:
        """Return the estimated relative root mean square error of the picture, nan after one pass.

        Its square is what `hybrid_rt.measures.relative_mse` is expected to be against the limit r of
        infinitely many passes: the mean over pixels and channels of s^2 / (r^2 + 0.01), s the
        standard error. As r is not known, the picture stands in for it. One bright path makes both
        s and the value of its pixel large; divided by each other they would hide the error. So
        what one group of passes varies by is divided by the mean of the other groups. Before 16
        passes the mean of the pixel's neighbours is taken for r where it is darker.
        """
        return self._root_mean_squares()[1]

    @OVERFLOWS
    def noise(self) -> dict[str, Any] | None:
        """Return estimates of the standard error, or None where a single pass tells nothing.

        See `standard_error` and `relative_error`; ``errs_on_the_safe_side`` before 16 passes. A 95 %
        interval of the image mean reaches ``interval_factor`` standard errors to either side.
        """
        n = self.n_passes
        if n < 2:
            return None
        is_early = self._squares is not None
        mean = float(self._means.sum()) / n
        if is_early:
            of_mean = float(np.std(self._first_means, ddof=1)) / math.sqrt(n)
        else:
            of_mean = math.sqrt(float(self._variance(self._means, mean)))
        absolute, relative = self._root_mean_squares()
        return {
            "errs_on_the_safe_side": is_early,
            "interval_factor": _STUDENT[(n if is_early else GROUPS) - 2],
            "image_mean": mean,
            "standard_error_of_image_mean": of_mean,
            "root_mean_square_standard_error_of_pixels": absolute,
            "relative_rmse": relative,
        }

    def _mean(self) -> FloatArray:
        mean: FloatArray = self._sums.sum(axis=0) / self.n_passes
        return mean

    def _root_mean_squares(self) -> tuple[float, float]:
        """Return those of the pixels' standard errors, absolute and relative; nan after one pass."""
        if self.n_passes < 2:
            return math.nan, math.nan
        is_early = self._squares is not None
        level = _without_peaks(self._mean()) if is_early else None
        absolute, plain, crossed = 0.0, 0.0, 0.0
        for rows, mean, variance in self._strips():
            absolute += float(variance.sum())
            seen = mean if level is None else level[rows]
            plain += float((variance / (seen * seen + DARK)).sum())
            if not is_early:
                crossed += self._relative_to_others(self._sums[:, rows])
        n = self._sums[0].size
        # Both have the same mean where no path is rare; the larger errs on the safe side.
        return math.sqrt(absolute / n), math.sqrt(max(plain, crossed) / n)

    def _relative_to_others(self, sums: FloatArray) -> float:
        """Return the sum of variances of the mean, each over what other groups found, (4, ...).

        For independent groups g, h, k of one mean, (g - h) (g - k) has the variance of g alone as
        its mean, whatever h and k are.
        """
        n, total = self.n_passes, sums.sum(axis=0)
        counts = self._counts.reshape(-1, *(1,) * total.ndim)
        means = sums / counts
        result = 0.0
        for group, count in enumerate(self._counts):
            others = (total - sums[group]) / (n - count)
            gaps = means[group] - np.delete(means, group, axis=0)
            # Sum over pairs, twice: the square of the sum without the squares.
            pairs = gaps.sum(axis=0) ** 2 - (gaps * gaps).sum(axis=0)
            n_pairs = len(gaps) * (len(gaps) - 1)
            share = (count / n) ** 2 / n_pairs
            result += share * float((pairs / (others * others + DARK)).sum())
        return result

    def _strips(self) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield rows, their mean and the variance of that, a strip of the picture at a time."""
        n = self.n_passes
        height, width, _ = self._sums.shape[1:]
        at_once = max(STRIP // width, 1)
        for first in range(0, height, at_once):
            rows = slice(first, first + at_once)
            sums = self._sums[:, rows]
            mean = sums.sum(axis=0) / n
            if self._squares is None:
                yield rows, mean, self._variance(sums, mean)
            else:
                # Rounding can leave a variance of -1e-17 where all passes agree.
                squares = np.maximum(self._squares[rows] / n - mean * mean, 0.0)
                yield rows, mean, squares / (n - 1)

    def _variance(self, sums: FloatArray, mean: FloatArray | float) -> FloatArray:
        """Return the variance of the mean, from sums over groups (GROUPS, ...).

        Of independent passes the squares below have n - sum(n_g^2) / n times the variance of one
        as their mean: unbiased also where groups differ in size.
        """
        squares = np.zeros(sums.shape[1:])
        for sum_of_group, count in zip(sums, self._counts, strict=True):
            squares += (sum_of_group - count * mean) ** 2
        variance: FloatArray = squares / float(self.n_passes**2 - np.square(self._counts).sum())
        return variance


def _without_peaks(image: FloatArray) -> FloatArray:
    """Return an image (height, width, 3) no brighter than the mean of each pixel's neighbours."""
    if image.shape[0] * image.shape[1] == 1:
        return image
    return np.minimum(image, _mean_of_neighbours(image))


def _mean_of_neighbours(image: FloatArray) -> FloatArray:
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
        The sidecar: a.json of a.png, a.npz.json of a.npz, so that none takes another's place.

    Raises
    ------
    ValueError, OSError, ModuleNotFoundError
        If the ending is another one, no file can be made there, or OpenEXR is not installed.
    """
    target = check_output(path)
    number(exposure, "exposure", at_least=-MOST_STOPS, up_to=MOST_STOPS, hint="stops")
    if np.ndim(image) != 3 or np.shape(image)[2] != 3:
        raise ValueError(f"image has shape {np.shape(image)}: pass (height, width, 3)")
    text = as_json(report)
    with replacing(target) as file:
        WRITERS[target.suffix.lower()](file, image, text, channels or {}, exposure)
    sidecar = sidecar_of(target)
    with replacing(sidecar) as file:
        file.write(text.encode())
    return sidecar


def sidecar_of(picture: Path) -> Path:
    """Return where the report of a picture is kept."""
    return picture.with_suffix(
        ".json" if picture.suffix.lower() == ".png" else f"{picture.suffix}.json"
    )


def keeps_channels(picture: Path) -> bool:
    """Tell whether files of this kind hold more than radiance."""
    return picture.suffix.lower() != ".png"


def check_output(path: str | os.PathLike[str]) -> Path:
    """Return the path if a picture can be written there; see `save_image` for what is raised."""
    target = as_path(path, "output")
    if target.suffix.lower() not in WRITERS:
        raise ValueError(f"output {str(target)!r} has an unknown ending: pass {', '.join(WRITERS)}")
    for file in (target, sidecar_of(target)):
        check_writable(file)
    if target.suffix.lower() == ".exr" and importlib.util.find_spec("OpenEXR") is None:
        raise ModuleNotFoundError(
            f"output {str(target)!r}: EXR needs the package OpenEXR: pip install 'hybrid-rt[exr]'"
        )
    return target


def check_writable(file: Path) -> None:
    """Refuse a file that cannot be written, or replaced."""
    if not file.parent.is_dir():
        raise FileNotFoundError(
            f"output {str(file)!r} has no folder {str(file.parent)!r}: make it, or name another file"
        )
    try:
        # A trial tells more than permissions do: full disks, names too long.
        trial = _temporary(file)
        trial.touch()
        trial.unlink()
        if file.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a folder")
    except OSError as error:
        raise type(error)(
            f"output {str(file)!r} cannot be written ({error.strerror}): name another file"
        ) from error


def _write_png(
    file: BinaryIO,
    image: NDArray[np.float32],
    _report: str,
    _channels: Channels,
    exposure: float,
) -> None:
    import imageio.v3 as imageio

    imageio.imwrite(file, screen_pixels(image, exposure), extension=".png")


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
def replacing(target: Path) -> Iterator[BinaryIO]:
    """Open a file under a temporary name that takes the target's place once it is complete."""
    temporary = _temporary(target)
    try:
        with temporary.open("wb") as file:
            yield file
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _temporary(target: Path) -> Path:
    return target.with_name(f".{target.name}.{os.getpid()}.part")
