"""The panoramic camera: all directions in one picture, by latitude and longitude."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.one_line import call
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.suggestions import explains
from hybrid_rt.sensor.projection import MEANT, Projection

# The sine of the polar angle counts as this at least: at the poles the pdf has no bound.
SMALLEST_POLAR_SINE = 1e-12


@explains(
    vertical_fov="no field of view: the picture shows 360 x 180 degrees",
    fov="no field of view: the picture shows 360 x 180 degrees",
    **MEANT,
    forward="look_at, which is look_from + forward",
)
class PanoramicCamera(Projection):
    """A camera that sees all directions: an equirectangular picture of 360 x 180 degrees.

    Columns are longitudes, rows latitudes, evenly. The upper edge is the direction ``up``, as far as it is
    perpendicular to the view; the middle of the picture is ``look_at``, a quarter of the width to the right
    is to the right of it, and the left and right edges are behind. An `ImageEnvironment` with the same
    ``up`` shows such a picture of a level view unmirrored, with another azimuth of its middle.

    Parameters
    ----------
    look_from, look_at : three numbers
        The eye, and a point at the centre of the picture, scene units.
    up : three numbers
        Up vector, of any length. It need not be perpendicular to the view direction.
    width, height : int
        Resolution. Pixels on the horizon are square if the width is twice the height.

    Raises
    ------
    ValueError, TypeError
        If a parameter is invalid; the message names it.
    """

    def __init__(
        self,
        look_from: ArrayLike,
        look_at: ArrayLike,
        up: ArrayLike,
        width: int = 960,
        height: int = 480,
    ) -> None:
        super().__init__(look_from, look_at, up, width, height)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        return call(
            self, self.look_from, self.look_at, self.up, width=self.width, height=self.height
        )

    def _rays(
        self, column: FloatArray, row: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return rays from the eye; see `Projection.rays`."""
        del lens
        azimuth = (2.0 * column / self.width - 1.0) * math.pi
        polar = row / self.height * math.pi
        level = np.sin(polar)
        directions = np.multiply.outer(level * np.cos(azimuth), self._forward)
        directions += np.multiply.outer(level * np.sin(azimuth), self._right)
        directions += np.multiply.outer(np.cos(polar), self._upward)
        directions /= np.sqrt(np.einsum("ij,ij->i", directions, directions))[:, None]
        return np.tile(self.look_from, (column.size, 1)), directions

    def _sees(
        self, points: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Project points to pixels; see `Projection.sees`."""
        del lens
        way = points - self.look_from
        across, upward, ahead = self._in_frame(way)
        level = np.hypot(across, ahead)
        distance = np.hypot(level, upward)
        column = (np.arctan2(across, ahead) / math.pi + 1.0) * (0.5 * self.width)
        row = np.arctan2(level, upward) / math.pi * self.height
        # The right edge is the left one, and the lower edge belongs to the last row.
        column = np.where(column < self.width, column, 0.0)
        pixel = self._pixels(column, np.minimum(row, self.height - 0.5), distance > 0.0)
        sine = level / np.where(distance > 0.0, distance, 1.0)
        return way, pixel, np.where(pixel >= 0, self._pdf(sine), 0.0)

    def direction_pdf(self, directions: FloatArray) -> FloatArray:
        """Return the pdf per solid angle (n,) of unit directions (n, 3) sampled by `rays`."""
        across, _, ahead = self._in_frame(directions)
        return self._pdf(np.hypot(across, ahead))

    def may_see(self, bounds: FloatArray, from_the_middle: bool = False) -> bool:
        """Return True: all directions are in the picture."""
        del bounds, from_the_middle
        return True

    def pixel_widths(self, points: FloatArray) -> FloatArray:
        """Return the height of a pixel at points (n, 3), scene units, (n,)."""
        away = np.linalg.norm(points - self.look_from, axis=1)
        return math.pi / self.height * away

    def _pdf(self, sine: FloatArray) -> FloatArray:
        """Return the pdf per solid angle: a pixel has 2 pi^2 sine / (width height) steradians."""
        return (0.5 * self.width * self.height / math.pi**2) / np.maximum(sine, SMALLEST_POLAR_SINE)
