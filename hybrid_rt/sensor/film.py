"""The film: passes are summed by groups; the noise is estimated from the groups' differences."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.image_metrics import DARK, DIM, WORST
from hybrid_rt.sensor.intervals import (
    REACH,
    STUDENT,
    bright_path,
    half_intervals,
    light_of_rare_paths,
)
from hybrid_rt.sensor.neighbours import mean_around, mean_of_neighbours
from hybrid_rt.sensor.passes import GROUPS, RUN

# Radiances beyond the range of numbers end as inf and nan, which the report counts.
OVERFLOWS = np.errstate(over="ignore", invalid="ignore")


# Pixels of which errors are computed at a time: what it takes stays in the processor's cache.
STRIP = 2**12
# Rows at a time of an estimate that takes the pixels around as well.
HALO_ROWS = 32

# From this share of the squared error in the worst pixels on, rare paths decide it, and estimates from
# less than 16 passes may be too small: half of the error in tests with one bright sample in 10**5.
RARE = 0.1


# Regions of the picture each way, and in all.
ACROSS = 4
REGIONS = ACROSS**2


def regions_of(height: int, width: int) -> NDArray[np.int64]:
    """Return the region (height, width) of each pixel, 0 to `REGIONS` - 1: parts of a grid."""
    row, column = np.arange(height) * ACROSS // height, np.arange(width) * ACROSS // width
    return ACROSS * row[:, None] + column


@dataclass(frozen=True)
class RelativeErrors:
    """Estimated relative root mean square errors of a picture; nan after one pass."""

    whole: float  # over all pixels
    # Without the worst pixels; ``whole`` if there are none. nan if a pixel is not finite.
    trimmed: float
    n_worst: int  # number of the worst pixels: 0.1 %, rounded down, so none of less than 1000
    share_of_worst: float  # of the sum of squared errors, the part in the worst pixels, 0 to 1
    # What ``trimmed`` will be after twice as many passes, and after 16 at least, if each worst
    # pixel is a dot: a path that other pixels will meet as often. It is above ``trimmed`` where the
    # worst pixels will soon be too few to hold the dots.
    ahead: float


@dataclass(frozen=True)
class MeanNoise:
    """The mean of a picture and its noise: what `half_interval_of_mean` takes."""

    interval_factor: float
    image_mean: float
    standard_error_of_image_mean: float
    bright_path_in_image_mean: float


@dataclass(frozen=True)
class Noise(MeanNoise):
    """The estimated noise of a picture."""

    # True before 16 passes, unless the worst pixels hold more than a tenth of the squared error:
    # then too few passes have met what those pixels show
    errs_on_the_safe_side: bool
    root_mean_square_standard_error_of_pixels: float
    # ``whole``, ``trimmed`` and ``ahead`` of `RelativeErrors`
    relative_rmse: float
    relative_rmse_trimmed: float
    relative_rmse_trimmed_ahead: float
    worst_pixels: int
    worst_pixels_share_of_squared_error: float
    pixels_without_light: int  # those that are black in every pass, whose error counts as none
    pixels_dark: int  # all others darker than `DIM`


class Film:
    """Accumulates passes, group by group; estimates the noise of their mean.

    The error of a picture is stated twice: over all pixels, and without the worst 0.1 %. A few
    pixels that rare, bright paths have met (fireflies) can hold most of the squared error of a
    picture that looks fine elsewhere; the two figures tell them from noise. The squared relative
    error of a pixel is the sum over channels of s^2 / (r^2 + 0.01), see `relative_errors`; the
    worst pixels are those where its estimate is the largest, and the trimmed error is the root of
    the mean over the others. It is the estimate of `PictureErrors.relative_rmse_of_most` in
    `hybrid_rt.sensor.image_metrics`.

    Within a group the passes of a run are added up by themselves, and then added to the runs before
    them: whoever traces a whole run may add it up, to the same bits.

    Parameters
    ----------
    height, width : int

    Attributes
    ----------
    n_passes : int
    is_whole : bool
        False while passes are added: whoever adds them says so.
    """

    def __init__(self, height: int, width: int) -> None:
        self.n_passes, self.is_whole = 0, True
        self._sums = np.zeros((GROUPS, height, width, 3))
        self._run = np.zeros((height, width, 3))  # the present run, as far as it is done
        self._counts = np.zeros(GROUPS, dtype=np.int64)
        self._means = np.zeros(GROUPS)  # of whole pictures, summed like the pictures
        # Until every group holds a run, passes count as independent of each other.
        self._first_means: list[float] = []
        self._squares: FloatArray | None = np.zeros((height, width, 3))

    @property
    def takes_runs(self) -> bool:
        """Whether the next passes may come as a whole run; see `add_run`."""
        return self.n_passes >= GROUPS * RUN and self.n_passes % RUN == 0

    @OVERFLOWS
    def add(self, radiance: FloatArray) -> None:
        """Add one pass (height, width, 3); passes must come in order."""
        mean = float(radiance.mean())
        self._run += radiance
        if self._squares is not None:
            self._squares += radiance * radiance
            self._first_means.append(mean)
        self._count(1, [mean])

    @OVERFLOWS
    def add_run(self, total: FloatArray, means: Sequence[float]) -> None:
        """Add the sum of the passes of a run, and their means over the picture, in their order."""
        if not self.takes_runs or len(means) != RUN:
            raise ValueError(
                f"film has {self.n_passes} passes, {len(means)} more come as one: add them singly"
            )
        self._run += total
        self._count(RUN, means)

    def _count(self, n: int, means: Sequence[float]) -> None:
        group = self.n_passes // RUN % GROUPS
        for mean in means:
            self._means[group] += mean
        self._counts[group] += n
        self.n_passes += n
        if self.n_passes % RUN == 0:
            self._sums[group] += self._run
            self._run[:] = 0.0
        if self.n_passes >= GROUPS * RUN:
            self._squares = None

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the sums, from which `restore` goes on: arrays by name, no copies."""
        arrays = {"sums": self._sums, "run": self._run, "counts": self._counts}
        arrays |= {"means": self._means, "first_means": np.array(self._first_means)}
        return arrays if self._squares is None else {**arrays, "squares": self._squares}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take over the sums of another film of the same size.

        Raises
        ------
        ValueError, KeyError
            If they are those of a film of another size, or of none.
        """
        for name, own in (("sums", self._sums), ("run", self._run), ("counts", self._counts)):
            if state[name].shape != own.shape or state[name].dtype != own.dtype:
                raise ValueError(f"{name} are {state[name].dtype} {state[name].shape}")
        self._sums, self._run = state["sums"].copy(), state["run"].copy()
        self._counts, self._means = state["counts"].copy(), state["means"].copy()
        self._first_means = state["first_means"].tolist()
        self._squares = state["squares"].copy() if "squares" in state else None
        self.n_passes = int(self._counts.sum())

    @property
    @OVERFLOWS
    def image(self) -> NDArray[np.float32]:
        """(height, width, 3) float32: the mean of the passes, linear, row 0 at the top."""
        result = np.empty(self._sums.shape[1:], np.float32)
        for rows in self._rows():
            result[rows] = self._of_groups(rows).sum(axis=0) / self.n_passes
        return result

    @property
    @OVERFLOWS
    def standard_error(self) -> FloatArray:
        """(height, width, 3) float64: standard error of each pixel; nan after a single pass.

        From 16 passes on it is estimated from the differences between groups. Before that, passes
        are taken as independent, which overestimates the error. The squares are unbiased, so they
        are accurate as a mean over many pixels; for single pixels see `half_interval`.
        """
        return np.sqrt(self._variances())

    @property
    @OVERFLOWS
    def half_interval(self) -> FloatArray:
        """(height, width, 3) float64: half the width of each pixel's 95 % interval; nan as above.

        The variance is pooled from the pixel and its neighbours. From 16 passes on it is at least a
        limit to the light that rare paths bring: by how much means exceed the medians of their
        groups, at most, in the pixels around and in those farther away with like noise. The coverage
        is about 95 % over many pixels; next to an edge of the noise level it is higher on the
        quieter side and lower on the other, and light that no path has met nearby is not covered.
        """
        own = self._variances()
        freedom = max((self.n_passes if self._squares is not None else GROUPS) - 1, 1)
        half = half_intervals(own, freedom)
        if self._squares is not None or own[:, :, 0].size == 1:
            return half
        above, lowest = np.empty_like(own), np.empty((*own.shape[:2], 2))
        counts = self._counts.reshape(-1, 1, 1, 1)
        for rows, mean, _ in self._strips():
            of_groups = self._of_groups(rows) / counts
            grey = np.sort(of_groups.mean(axis=3), axis=0)[:-1]
            lowest[rows] = np.stack([grey.mean(axis=0), grey[-1] - grey[0]], axis=2)
            of_groups.sort(axis=0)
            above[rows] = mean - 0.5 * (of_groups[1] + of_groups[2])
        return np.maximum(half, light_of_rare_paths(above, lowest))

    def _variances(self) -> FloatArray:
        """Return the variances (height, width, 3) of the mean, nan after one pass."""
        variances = np.full(self._sums.shape[1:], np.nan)
        if self.n_passes >= 2:
            for rows, _, variance in self._strips():
                variances[rows] = variance
        return variances

    def relative_error(self) -> float:
        """Return `relative_errors` over all pixels."""
        return self.relative_errors().whole

    @OVERFLOWS
    def relative_errors(self) -> RelativeErrors:
        """Return the estimated relative root mean square errors of the picture.

        The square of the first estimates `hybrid_rt.sensor.image_metrics.relative_mse` against the
        limit r of infinitely many passes: the mean over pixels and channels of s^2 / (r^2 + 0.01),
        s the standard error. The picture stands in for the unknown r. One bright path increases
        both s and its pixel's value, so that their ratio would hide the error; therefore the
        deviation of one group of passes is divided by the mean of the other groups. Before 16
        passes the mean of the pixel's neighbours is taken for r where it is darker.

        The worst pixels are chosen by the same estimate of each, in which a pixel with a rare,
        bright path ranks by the value of that path.
        """
        return self._root_mean_squares()[1]

    @OVERFLOWS
    def noise_of_mean(self) -> MeanNoise:
        """Return the image mean, and what its interval follows from; after a single pass nan."""
        n = self.n_passes
        is_early = self._squares is not None
        mean = float(self._means.sum()) / n
        of_mean = math.nan
        if not is_early:
            of_mean = math.sqrt(float(self._variance(self._means, mean)))
        elif n > 1:
            of_mean = float(np.std(self._first_means, ddof=1)) / math.sqrt(n)
        return MeanNoise(
            interval_factor=STUDENT[(max(n, 2) if is_early else GROUPS) - 2],
            image_mean=mean,
            standard_error_of_image_mean=of_mean,
            bright_path_in_image_mean=0.0 if is_early else self._bright_path(mean),
        )

    @OVERFLOWS
    def noise(self) -> Noise | None:
        """Return the estimates of the noise; None after a single pass."""
        if self.n_passes < 2:
            return None
        absolute, relative = self._root_mean_squares()
        n_pixels = self._sums[0].size // 3
        is_lit = self._sums.any(axis=(0, 3)) | self._run.any(axis=2)
        return Noise(
            **vars(self.noise_of_mean()),
            errs_on_the_safe_side=self._squares is not None and relative.share_of_worst <= RARE,
            root_mean_square_standard_error_of_pixels=absolute,
            relative_rmse=relative.whole,
            relative_rmse_trimmed=relative.trimmed,
            relative_rmse_trimmed_ahead=relative.ahead,
            worst_pixels=relative.n_worst,
            worst_pixels_share_of_squared_error=relative.share_of_worst,
            pixels_without_light=n_pixels - int(np.count_nonzero(is_lit)),
            pixels_dark=int(np.count_nonzero(is_lit & (self.image.mean(axis=2) < DIM))),
        )

    @OVERFLOWS
    def regions(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the means of `regions_of` the picture, their variances, and what bright paths add to them.

        All are of the mean of the channels, (`REGIONS`,) float64; from 16 passes on.
        """
        _, height, width, _ = self._sums.shape
        region = regions_of(height, width)
        sums = np.zeros((3 + GROUPS, REGIONS))
        counts = self._counts.reshape(-1, 1, 1)
        for rows in self._rows():
            grey = self._grey(rows)
            mean = grey.sum(axis=0) / self.n_passes
            grey /= counts
            gaps = grey - grey.mean(axis=0)
            squares = gaps * gaps
            planes = [mean, squares.sum(axis=0), (squares * gaps).sum(axis=0), *gaps]
            for k, plane in enumerate(planes):
                sums[k] += np.bincount(region[rows].ravel(), plane.ravel(), REGIONS)
        n = np.maximum(np.bincount(region.ravel(), minlength=REGIONS), 1)
        mean, squares, cubes = sums[:3]
        # Paths of neighbouring pixels may share light: they vary together.
        together = np.divide(
            (sums[3:] ** 2).sum(axis=0), squares, out=np.ones(REGIONS), where=squares > 0.0
        )
        variance = squares * max(together.mean(), 1.0) / (GROUPS * (GROUPS - 1))
        event = np.divide(cubes, squares, out=np.zeros(REGIONS), where=cubes > 0.0) / (GROUPS - 2)
        return mean / n, variance / n**2, event / n

    @property
    @OVERFLOWS
    def highest_sum(self) -> float:
        """The largest sum over the passes of a group that a pixel holds, mean of the channels.

        No single path has brought more.
        """
        return max(float(self._grey(rows).max()) for rows in self._rows())

    def _bright_path(self, mean: float) -> float:
        """Return what one of the bright paths that make the noise contributes to the image mean.

        Where pixels meet events of one size at random, the third moment of their sums over the second
        is that size, in any number of passes. Both are estimated without bias from the groups of each
        pixel. The third is negative or 0 where bright paths are as frequent as dark ones: then 0.
        """
        if not 0.0 < mean < math.inf:
            return 0.0
        squares = cubes = 0.0
        counts = self._counts.reshape(-1, 1, 1) * mean
        for rows in self._rows():
            of_rows = bright_path(self._grey(rows) / counts)
            squares, cubes = squares + of_rows[0], cubes + of_rows[1]
        size = cubes / squares if squares > 0.0 and cubes > 0.0 else 0.0
        # k3 / k2 of four groups is the sums' ratio times n / (n - 2); a group is a quarter of the mean.
        return mean * size / (GROUPS - 2) / self._sums[0, :, :, 0].size

    def _mean(self) -> FloatArray:
        return self._of_groups(slice(None)).sum(axis=0) / self.n_passes

    def _of_groups(self, rows: slice) -> FloatArray:
        """Return the sums over groups (GROUPS, rows, width, 3), with the present run in its own."""
        if self.n_passes % RUN == 0:
            return self._sums[:, rows]
        sums = self._sums[:, rows].copy()
        sums[self.n_passes // RUN % GROUPS] += self._run[rows]
        return sums

    def _grey(self, rows: slice) -> FloatArray:
        """Return the means of the channels of the sums over groups, (GROUPS, rows, width)."""
        # Einsum is many times as fast as mean over three channels.
        return np.einsum("ghwc->ghw", self._of_groups(rows)) / 3.0

    def _root_mean_squares(self) -> tuple[float, RelativeErrors]:
        """Return those of the pixels' standard errors, absolute and relative; nan after one pass."""
        height, width, _ = self._sums.shape[1:]
        n_worst = int(WORST * height * width)
        if self.n_passes < 2:
            return math.nan, RelativeErrors(math.nan, math.nan, n_worst, math.nan, math.nan)
        is_early = self._squares is not None
        level = _without_peaks(self._mean()) if is_early else None
        absolute, plain = 0.0, np.empty((height, width))
        crossed = plain if is_early else np.empty_like(plain)
        for rows, mean, variance in self._strips():
            absolute += float(variance.sum())
            seen = mean if level is None else level[rows]
            plain[rows] = (variance / (seen * seen + DARK)).sum(axis=2)
        if not is_early:
            for first in range(0, height, HALO_ROWS):
                rows = slice(first, min(first + HALO_ROWS, height))
                crossed[rows] = self._relative_to_others(rows)
        times = max(2.0, GROUPS * RUN / self.n_passes)
        errors = _relative_errors(plain, crossed, n_worst, times)
        return math.sqrt(absolute / plain.size / 3.0), errors

    def _relative_to_others(self, rows: slice) -> FloatArray:
        """Return variances of the mean, each over what other groups found, summed over channels.

        For independent groups g, h, k of one mean, (g - h) (g - k) has the variance of g alone as
        its mean, whatever h and k are. The estimate of a single pixel may be negative.

        Where light comes by rare paths, and most of it, a pixel's other groups may have met none of
        it yet. Their mean is then far below the pixel's, and to divide by its square would overstate
        the error many times. So where the other groups of the pixels around differ by more than all
        that the pixel's own have found, what they exceed their lowest by is taken from around.

        Returns (rows, width).
        """
        around = slice(max(rows.start - REACH, 0), rows.stop + REACH)
        own = slice(rows.start - around.start, rows.stop - around.start)
        sums = self._of_groups(around)
        n, total = self.n_passes, sums.sum(axis=0)
        counts = self._counts.reshape(-1, *(1,) * total.ndim)
        means = sums / counts
        result: FloatArray = np.zeros(total[own].shape[:-1])
        for group, count in enumerate(self._counts):
            others = (total - sums[group]) / (n - count)
            of_others = np.delete(means, group, axis=0)
            lowest = of_others.min(axis=0)
            excess = mean_around(others - lowest, REACH)[0]
            seen = np.where(excess > others, np.maximum(lowest + excess, others), others)[own]
            gaps = means[group, own] - of_others[:, own]
            # Sum over pairs, twice: the square of the sum without the squares.
            pairs = gaps.sum(axis=0) ** 2 - (gaps * gaps).sum(axis=0)
            n_pairs = len(gaps) * (len(gaps) - 1)
            share = (count / n) ** 2 / n_pairs
            result += share * (pairs / (seen * seen + DARK)).sum(axis=-1)
        return result

    def _rows(self) -> Iterator[slice]:
        """Yield the rows of the picture, a strip at a time."""
        _, height, width, _ = self._sums.shape
        at_once = max(STRIP // width, 1)
        for first in range(0, height, at_once):
            yield slice(first, first + at_once)

    def _strips(self) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield rows, their mean and the variance of that, a strip at a time."""
        n = self.n_passes
        for rows in self._rows():
            sums = self._of_groups(rows)
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
        return squares / float(self.n_passes**2 - np.square(self._counts).sum())


def _relative_errors(
    plain: FloatArray, crossed: FloatArray, n_worst: int, times: float
) -> RelativeErrors:
    """Return the errors of a picture from two estimates of its pixels' squares (height, width).

    Both have the same mean where no path is rare; the larger errs on the safe side. The second
    says which pixels are the worst: in the first a bright path hides its own error.

    So many ``times`` the passes have so many times the dots, each with 1 / times^2 of the squared
    error. The worst pixels then hold the brightest 1 / times of them, and the others spill over.
    """
    n_kept = plain.size - n_worst
    whole = max(float(plain.sum()), float(crossed.sum()))
    error = math.sqrt(whole / plain.size / 3.0)
    if not math.isfinite(whole):
        return RelativeErrors(error, math.nan, n_worst, math.nan, math.nan)
    kept, spilled = whole, 0.0
    if n_worst:
        order = np.argpartition(crossed.ravel(), n_kept - 1)
        rows, worst = order[:n_kept], np.sort(crossed.ravel()[order[n_kept:]])
        kept = max(float(plain.ravel()[rows].sum()), float(crossed.ravel()[rows].sum()))
        spilled = max(float(worst[: n_worst - math.ceil(n_worst / times)].sum()), 0.0)
    share = 1.0 - kept / whole if whole > 0.0 else 0.0
    ahead = math.sqrt((kept + spilled) / times / n_kept / 3.0)
    return RelativeErrors(error, math.sqrt(kept / n_kept / 3.0), n_worst, share, ahead)


def _without_peaks(image: FloatArray) -> FloatArray:
    """Return an image (height, width, 3) no brighter than the mean of each pixel's neighbours."""
    if image.shape[0] * image.shape[1] == 1:
        return image
    return np.minimum(image, mean_of_neighbours(image))
