"""What a report says of photons, of the light that they alone find, and of the blur of their discs.

Blur is estimated from what discs of half the area find in each pass.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.plain_records import absent
from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.image_metrics import DARK
from hybrid_rt.sensor.passes import RUN

# The noise of the estimated blur is read from how much it differs between tiles of the picture: so
# many tiles a side, wider than most discs and so nearly independent. Student's t for their degrees
# of freedom, one-sided 95 %.
TILES, STUDENT = 4, 1.753
# The true blur is up to so many times its estimate: 1.3 times at borders, as the estimate takes light
# for smooth; as a relative figure 1.8 times beside them, where blurred light brightens what it is
# divided by. docs/error_vs_time.md has the figures.
AT_BORDERS = 2.0
# The mean of a picture changes where discs reach over the border of what is lit, through a wall say: by
# an amount that is proportional to their radius. Discs of half the area lose root 1/2 of it, so the
# whole is so many times the difference.
OF_MEAN = 1.0 / (1.0 - math.sqrt(0.5))
# The blur of the mean is estimated to first order in the radius of the discs. In corners they lose light
# twice: there it was up to so many times the estimate.
CORNERS = 1.2
# Light that an integrator does not find and that is not measured either.
NOT_MEASURED = "paths without a surface that spreads light widely"


@dataclass(frozen=True)
class LightNotFound:
    """Light that an integrator does not find, of paths that meet a wide lobe."""

    photons: int  # photons traced
    max_depth: int  # bounces that they were followed for
    # What they carried there, over what they carried behind their first surface: about the share of
    # this light that has more bounces, and that ``mean`` lacks
    lost_share: float
    # What it would add to the mean of the picture over pixels and channels; None if not known
    mean: float | None = None
    # None where nothing of a group of photons reaches the camera: what is seen so rarely has no
    # interval that holds
    half_interval_95: float | None = None
    why_unknown: str = ""  # Why there is no ``mean``; "": there is
    share_of_image_mean: float | None = None
    not_measured: str = NOT_MEASURED


@dataclass(frozen=True)
class Power:
    """Power by channel, summed over all passes: emitted, and what became of it."""

    emitted: list[float]
    escaped: list[float]
    absorbed: list[float]
    lost: list[float]


@dataclass(frozen=True, kw_only=True)
class PhotonFigures:
    """Settings, counts, blur and power of the photons of a render.

    The page "The report" of the documentation explains them. Those that may be None belong to one
    integrator.
    """

    per_pass: int
    emitted: int
    stored: int
    stored_in_caustic_map: int | None = absent()
    shown_to_camera: int
    alpha: float | None = absent()
    first_radii: list[float] | None = absent()
    last_radii: list[float] | None = absent()
    camera_rays_per_pixel: int | None = absent()
    shadow_rays_per_point: int | None = absent()
    nearest: int | None = absent()
    gather_points: int
    gathered_per_point: float
    points_without_photons: int
    points_with_shown_photons_alone: int
    blur: str
    blur_root_mean_square: float | None
    blur_root_mean_square_at_most: float | None
    blur_relative_rmse: float | None
    blur_relative_rmse_at_most: float | None
    blur_of_image_mean: float | None
    blur_of_image_mean_standard_error: float | None
    power_of_all_passes: Power

    @property
    def lost_share(self) -> float:
        """The power that ``max_depth`` cut off, over all that was emitted."""
        power = self.power_of_all_passes
        return sum(power.lost) / sum(power.emitted) if any(power.lost) else 0.0


@dataclass(frozen=True)
class Blur:
    """The blur (bias) of a picture: root mean squares over pixels and channels.

    As for noise (`hybrid_rt.sensor.film.Film`), the relative figures divide each square by
    x^2 + 0.01.
    """

    # Estimates; None if not above their own noise
    absolute: float | None
    # Upper limits at about 95 % confidence; None if unknown
    absolute_at_most: float | None
    relative: float | None
    relative_at_most: float | None
    # By how much the image mean is too bright (too dark, if negative), and the standard error of
    # that estimate; None if unknown
    of_mean: float | None
    of_mean_error: float | None

    @property
    def counted(self) -> float:
        """The blur that counts toward a target: the relative estimate, else its limit, else inf."""
        if self.relative is not None:
            return self.relative
        return math.inf if self.relative_at_most is None else self.relative_at_most

    @property
    def of_mean_at_most(self) -> float:
        """How far the image mean may be off by it, at about 95 % confidence; 0 if unknown.

        An estimate below its own noise counts as it is: otherwise the interval of every mean would be
        that of the estimate's noise.
        """
        blur, error = abs(self.of_mean or 0.0), self.of_mean_error or 0.0
        return CORNERS * blur + 2.0 * error if blur > 2.0 * error else blur


NO_BLUR, UNKNOWN_BLUR = Blur(*(0.0,) * 6), Blur(*(None,) * 6)


class BlurSums:
    """Sums over passes of how much less discs of half the area give, and of the squares.

    They are added up by runs, as `hybrid_rt.sensor.film.Film` adds pictures.

    ``height``, ``width``: size of the picture.
    """

    def __init__(self, height: int, width: int) -> None:
        self.height, self.width = height, width
        self.n_passes = 0
        self._sums, self._run = np.zeros((2, 2, height * width, 3))
        # Sum over whole runs of the picture's mean change, and of its square.
        self._of_runs = np.zeros(2)

    @OVERFLOWS
    def add(self, change: FloatArray) -> None:
        """Add that of one pass, (pixels, 3)."""
        self._run[0] += change
        self._run[1] += change * change
        self._count(1)

    @OVERFLOWS
    def add_run(self, run: FloatArray) -> None:
        """Add the sums over the passes of a whole run, (2, pixels, 3)."""
        self._run += run
        self._count(RUN)

    def _count(self, n: int) -> None:
        self.n_passes += n
        if self.n_passes % RUN == 0:
            change = float(self._run[0].mean())
            self._of_runs += change, change * change
            self._sums += self._run
            self._run[:] = 0.0

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the sums, from which `restore` goes on: arrays by name, no copies."""
        n = np.array(self.n_passes)
        sums = {"blur": self._sums, "blur_of_run": self._run, "blur_of_runs": self._of_runs}
        return {**sums, "blur_passes": n}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take over the sums of another picture of the same size."""
        for name in ("blur", "blur_of_run"):
            if state[name].shape != self._sums.shape or state[name].dtype != self._sums.dtype:
                raise ValueError(f"{name} is {state[name].dtype} {state[name].shape}")
        self._sums, self._run = state["blur"].copy(), state["blur_of_run"].copy()
        self._of_runs = state["blur_of_runs"].copy()
        self.n_passes = int(state["blur_passes"])

    @OVERFLOWS
    def estimate(self, image: NDArray[np.float32]) -> Blur:
        """Estimate the blur (bias) of the mean of all passes so far.

        To first order blur is proportional to the area of the disc, so it is twice the change from
        halving the area. The mean product of that change in different passes is its square, without
        the noise that the square of one pass has; at least two passes are needed.
        """
        n = self.n_passes
        if n < 2:
            return UNKNOWN_BLUR
        change, of_squares = self._sums + self._run
        squares = 4.0 * (change * change - of_squares) / (n * (n - 1))
        # What the squares of the mean change have beyond these products.
        noise = 4.0 * (change / n) ** 2 - squares
        if not np.isfinite(squares).all():
            return UNKNOWN_BLUR
        weight = image.reshape(-1, 3).astype(np.float64) ** 2 + DARK
        return Blur(
            *self._root_mean(squares, noise),
            *self._root_mean(squares / weight, noise / weight),
            OF_MEAN * float(change.mean()) / n,
            self._error_of_mean(),
        )

    def _error_of_mean(self) -> float | None:
        """Return the standard error of the mean's blur, from the differences between runs."""
        n = self.n_passes // RUN
        if n < 2:
            return None
        total, of_squares = self._of_runs.tolist()
        variance = max(of_squares - total * total / n, 0.0) / (n - 1)
        return OF_MEAN * math.sqrt(variance / n) / RUN

    def _root_mean(
        self, squares: FloatArray, noise: FloatArray
    ) -> tuple[float | None, float | None]:
        """Return the root of the mean of estimated squares (pixels, 3), and a limit to the true one.

        Estimates of small squares are often negative; one below its own noise says nothing but the
        limit. ``noise`` is the variance that each square is free of.
        """
        mean = float(squares.mean())
        if min(self.height, self.width) < TILES:
            # As if all pixels had one noise in common, the most that they can.
            error = math.sqrt(2.0) * float(noise.mean())
            least = STUDENT * error
        else:
            rows, columns = (np.arange(TILES) * n // TILES for n in (self.height, self.width))
            of_pixels = squares.reshape(self.height, self.width, 3).sum(axis=2)
            tiles = np.add.reduceat(np.add.reduceat(of_pixels, rows, axis=0), columns, axis=1)
            error = TILES * float(tiles.std(ddof=1)) / squares.size
            # Tiles differ by blur as well, if few have it: then it is above the pixels' noise.
            least = min(STUDENT * error, float(noise.mean()))
        at_most = AT_BORDERS * math.sqrt(max(mean, 0.0) + STUDENT * error)
        is_known = mean > least or error == 0.0
        return math.sqrt(max(mean, 0.0)) if is_known else None, at_most
