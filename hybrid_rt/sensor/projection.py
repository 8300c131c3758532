"""What all cameras are: a map from places in the picture to rays, and back."""

import copy
from abc import ABC, abstractmethod
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray

# Below this sine between view and up the picture's roll is decided by rounding.
SMALLEST_SINE = 1e-8
# What other programs call some arguments of all cameras.
MEANT = {
    "resolution": "width and height", "position": "look_from", "origin": "look_from",
    "target": "look_at",
}  # fmt: skip
# Pixels along a side; far fewer fill any machine, which `hybrid_rt.rendering.memory` says in time.
MOST_PIXELS = 10**9


class Projection(ABC):
    """A camera: where it stands and looks, its resolution, and its rays."""

    def __init__(
        self, look_from: ArrayLike, look_at: ArrayLike, up: ArrayLike, width: int, height: int
    ) -> None:
        name = type(self).__name__
        self.look_from = checks.as_vector(look_from, f"{name} look_from", up_to=checks.FARTHEST)
        self.look_at = checks.as_vector(look_at, f"{name} look_at", up_to=checks.FARTHEST)
        self.up = checks.as_vector(up, f"{name} up")
        self.width = checks.whole(width, f"{name} width", at_least=1, up_to=MOST_PIXELS)
        self.height = checks.whole(height, f"{name} height", at_least=1, up_to=MOST_PIXELS)
        view = self.look_at - self.look_from
        if not view.any():
            raise ValueError(f"{name} look_at equals look_from: pass another point to look at")
        self._forward = checks.as_direction(view, f"{name} view")
        right = np.cross(self._forward, checks.as_direction(self.up, f"{name} up"))
        if np.linalg.norm(right) < SMALLEST_SINE:
            raise ValueError(
                f"{name} up is {self.up.tolist()}, parallel to the view: pass another direction"
            )
        self._right = right / np.linalg.norm(right)
        self._upward = np.cross(self._right, self._forward)

    @property
    def has_lens(self) -> bool:
        """Whether rays through one place of the picture begin at several points."""
        return False

    @property
    def reach(self) -> float:
        """Radius of a ball around ``look_from`` in which all rays begin, scene units."""
        return 0.0

    def resized(self, width: int, height: int | None = None) -> Self:
        """Return the same camera with another resolution.

        Parameters
        ----------
        width : int
        height : int, optional
            Default: in proportion to the width, rounded, at least 1.
        """
        name, other = type(self).__name__, copy.copy(self)
        other.width = checks.whole(width, f"{name} width", at_least=1, up_to=MOST_PIXELS)
        if height is None:
            height = max(round(other.width * self.height / self.width), 1)
        other.height = checks.whole(height, f"{name} height", at_least=1, up_to=MOST_PIXELS)
        return other

    def rays(
        self, column: ArrayLike, row: ArrayLike, lens: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return origins and unit directions of rays through places in the picture.

        Parameters
        ----------
        column, row : (n,) float64
            Positions in pixels from the upper left corner. Pixel (0, 0) covers [0, 1) x [0, 1).
        lens : (n, 2) float64 in [0, 1), optional
            Lens samples. By default every ray passes through the centre of the lens.

        Returns
        -------
        origins, directions : (n, 3) float64
            Scene units; unit vectors.

        Raises
        ------
        ValueError, TypeError
            For arrays of other shapes, numbers that are not finite, and lens samples out of range.
        """
        what = f"{type(self).__name__}.rays"
        column = checks.finite(column, f"{what} column", (-1,))
        row = checks.finite(row, f"{what} row", (column.size,))
        return self._rays(column, row, _lens_samples(lens, column.size, what))

    def sees(
        self, points: ArrayLike, lens: ArrayLike | None = None
    ) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Project points to pixels: the inverse of `rays`.

        Parameters
        ----------
        points : (n, 3) float64
            Scene units.
        lens : (n, 2) float64 in [0, 1), optional
            Lens samples from which the points are seen.

        Returns
        -------
        way : (n, 3) float64
            Vector to each point from where the ray to it begins.
        pixel : (n,) int64
            Index in row-major order from the upper left; -1 outside the picture.
        pdf : (n,) float64
            pdf per solid angle of directions to positions that are uniform in the pixel; 0 outside. It
            is the pdf per area across the ray times the square of the distance, also of parallel rays.

        Raises
        ------
        ValueError, TypeError
            As for `rays`.
        """
        what = f"{type(self).__name__}.sees"
        points = checks.finite(points, f"{what} points", (-1, 3))
        return self._sees(points, _lens_samples(lens, len(points), what))

    @abstractmethod
    def _rays(
        self, column: FloatArray, row: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `rays` does, of checked arrays."""

    @abstractmethod
    def _sees(
        self, points: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Return what `sees` does, of checked arrays."""

    @abstractmethod
    def direction_pdf(self, directions: FloatArray) -> FloatArray:
        """Return the pdf per solid angle (n,) of unit directions (n, 3) sampled by `rays`.

        Each is uniform within its pixel, through one point of the lens. Of parallel rays it is minus
        the pdf per area across them.
        """

    @abstractmethod
    def may_see(self, bounds: FloatArray, from_the_middle: bool = False) -> bool:
        """Tell whether anything within a box (2, 3), scene units, may be in the picture.

        False is certain, but for roundings. With a lens it is always True, unless its middle alone is
        asked for.
        """

    @abstractmethod
    def pixel_widths(self, points: FloatArray) -> FloatArray:
        """Return about how wide a pixel is at points (n, 3), scene units, (n,)."""

    def _in_frame(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the components of vectors (n, 3) to the right, upward and forward."""
        return vectors @ self._right, vectors @ self._upward, vectors @ self._forward

    def _corners_in_frame(self, bounds: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the corners of a box (2, 3) as seen from ``look_from``; see `_in_frame`."""
        return self._in_frame(np.array(list(product(*np.transpose(bounds)))) - self.look_from)

    def _pixels(
        self, column: FloatArray, row: FloatArray, may_be: NDArray[np.bool_] | bool = True
    ) -> NDArray[np.int64]:
        """Return the pixels at places in the picture, -1 outside or where there is none."""
        column, row = np.floor(column), np.floor(row)
        inside = may_be & (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        column, row = np.where(inside, column, 0.0), np.where(inside, row, 0.0)
        return np.where(inside, (row * self.width + column).astype(np.int64), -1)


def _lens_samples(lens: ArrayLike | None, n: int, what: str) -> FloatArray | None:
    if lens is None:
        return None
    samples = checks.finite(lens, f"{what} lens", (n, 2))
    if n and not 0.0 <= samples.min() <= samples.max() < 1.0:
        raise ValueError(
            f"{what} lens holds {samples.min():g} to {samples.max():g}: pass numbers in [0, 1)"
        )
    return samples
