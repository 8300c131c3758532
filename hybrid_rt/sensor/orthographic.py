"""The orthographic camera: parallel rays from the points of a film."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.suggestions import explains
from hybrid_rt.sensor.projection import MEANT, Projection


@explains(
    ortho_scale="view_height, the height of what is seen (Blender: along the longer side)",
    scale="view_height, the height of what is seen",
    zoom="view_height, the height of what is seen",
    vertical_fov="view_height, scene units: the rays are parallel",
    fov="view_height, scene units: the rays are parallel",
    **MEANT,
)
class OrthographicCamera(Projection):
    """A camera of parallel rays: things look as large as they are, however far away.

    Rays begin in the plane through ``look_from`` across the view. What lies behind it is not seen.

    Parameters
    ----------
    look_from, look_at : three numbers
        The middle of the film, and a point at the centre of the picture, scene units.
    up : three numbers
        Up vector, of any length. It need not be perpendicular to the view direction.
    view_height : float
        Height of what is seen, scene units.
    width, height : int
        Resolution; pixels are square.

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
        view_height: float,
        width: int = 640,
        height: int = 480,
    ) -> None:
        super().__init__(look_from, look_at, up, width, height)
        self.view_height = checks.number(
            view_height, "OrthographicCamera view_height", above=0.0, up_to=checks.FARTHEST
        )
        # Else pixels would be rounded away in the coordinates of the film.
        farthest = float(np.abs(self.look_from).max())
        if self.view_height < farthest * 2.0**-40:
            raise ValueError(
                f"OrthographicCamera view_height is {self.view_height:g}, look_from {farthest:g} from the "
                "origin: pass a look_from nearer to it, the picture is the same along the view"
            )

    def __repr__(self) -> str:
        """Return the call that makes it."""
        named = {"view_height": self.view_height, "width": self.width, "height": self.height}
        return call(self, self.look_from, self.look_at, self.up, **named)

    @property
    def reach(self) -> float:
        """Half the diagonal of the film, scene units."""
        return 0.5 * self._pixel * math.hypot(self.width, self.height)

    def _rays(
        self, column: FloatArray, row: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return parallel rays from the places of the film; see `Projection.rays`."""
        del lens
        across = (column - 0.5 * self.width) * self._pixel
        upward = (0.5 * self.height - row) * self._pixel
        origins = self.look_from + np.multiply.outer(across, self._right)
        origins += np.multiply.outer(upward, self._upward)
        return origins, np.tile(self._forward, (column.size, 1))

    def _sees(
        self, points: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Project points to pixels; see `Projection.sees`."""
        del lens
        across, upward, depth = self._in_frame(points - self.look_from)
        column = 0.5 * self.width + across / self._pixel
        row = 0.5 * self.height - upward / self._pixel
        pixel = self._pixels(column, row, depth > 0.0)
        pdf = np.where(pixel >= 0, (depth / self._pixel) ** 2, 0.0)
        return np.multiply.outer(depth, self._forward), pixel, pdf

    def direction_pdf(self, directions: FloatArray) -> FloatArray:
        """Return minus the pdf per area across the rays (n,): a pixel is seen evenly."""
        return np.full(len(directions), -1.0 / self._pixel**2)

    def may_see(self, bounds: FloatArray, from_the_middle: bool = False) -> bool:
        """Tell whether anything within a box (2, 3) may be in the picture; see `Projection.may_see`."""
        del from_the_middle
        across, upward, depth = self._corners_in_frame(bounds)
        wide, high = 0.5 * self.width * self._pixel, 0.5 * self.height * self._pixel
        beyond = [-depth, across - wide, -across - wide, upward - high, -upward - high]
        return bool(np.max(np.min(beyond, axis=1)) <= 0.0)

    def pixel_widths(self, points: FloatArray) -> FloatArray:
        """Return the side of a pixel, the same at all points, (n,)."""
        return np.full(len(points), self._pixel)

    @property
    def _pixel(self) -> float:
        """Side of a pixel, scene units."""
        return self.view_height / self.height
