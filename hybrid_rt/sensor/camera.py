"""The perspective camera: pinhole or thin lens."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.suggestions import explains
from hybrid_rt.sensor.projection import MEANT, Projection

# A lens wider than this, in distances of the sharp plane, leaves no digits of where rays meet there.
WIDEST_LENS = 1e6


@explains(
    fov="vertical_fov, in degrees",
    fovy="vertical_fov, in degrees",
    focal_distance="focus_distance",
    focal_length="vertical_fov = 2 atan(h / (2 focal_length)), in degrees, h the height of the sensor",
    fstop="aperture, the diameter of the lens: focal length / f-number",
    **MEANT,
)
class Camera(Projection):
    """A pinhole camera, or one with a thin lens if ``aperture`` is positive.

    Parameters
    ----------
    look_from, look_at : three numbers
        The eye, and the point at the centre of the picture, scene units.
    up : three numbers
        Up vector, of any length. It need not be perpendicular to the view direction.
    vertical_fov : float
        Full vertical field of view, degrees, between 0 and 180.
    width, height : int
        Resolution; pixels are square.
    aperture : float
        Diameter of the lens, scene units; 0 is a pinhole.
    focus_distance : float, optional
        Distance to the plane of focus along the view direction, scene units. Default: the distance
        of ``look_at``.

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
        vertical_fov: float = 40.0,
        width: int = 640,
        height: int = 480,
        aperture: float = 0.0,
        focus_distance: float | None = None,
    ) -> None:
        super().__init__(look_from, look_at, up, width, height)
        self.vertical_fov = checks.number(
            vertical_fov, "Camera vertical_fov", above=0.0, below=180.0, hint="degrees"
        )
        self.aperture = checks.number(
            aperture, "Camera aperture", at_least=0.0, up_to=checks.FARTHEST, hint="0: a pinhole"
        )
        if focus_distance is None:
            focus_distance = math.hypot(*(self.look_at - self.look_from))
        self.focus_distance = checks.number(
            focus_distance, "Camera focus_distance", above=0.0, up_to=4.0 * checks.FARTHEST
        )
        if self.aperture > WIDEST_LENS * self.focus_distance:
            raise ValueError(
                f"Camera aperture is {self.aperture:g}, focus_distance {self.focus_distance:g}: pass "
                f"a lens at most {WIDEST_LENS:g} times as wide as that is far"
            )
        self._half_height = math.tan(math.radians(self.vertical_fov) / 2.0)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        lens = {}
        if self.has_lens:
            lens = {"aperture": self.aperture, "focus_distance": self.focus_distance}
        named = {"vertical_fov": self.vertical_fov, "width": self.width, "height": self.height}
        return call(self, self.look_from, self.look_at, self.up, **named, **lens)

    @property
    def has_lens(self) -> bool:
        """Whether the aperture is positive."""
        return self.aperture > 0.0

    @property
    def reach(self) -> float:
        """Radius of the lens, scene units."""
        return 0.5 * self.aperture

    @property
    def pixel_size(self) -> float:
        """Side of a pixel on a plane at distance one."""
        return 2.0 * self._half_height / self.height

    def _rays(
        self, column: FloatArray, row: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """Return rays through the lens; see `Projection.rays`."""
        across = (2.0 * column - self.width) / self.height * self._half_height
        upward = (1.0 - 2.0 * row / self.height) * self._half_height
        directions = self._forward + np.multiply.outer(across, self._right)
        directions += np.multiply.outer(upward, self._upward)
        if lens is None:
            origins = np.tile(self.look_from, (column.size, 1))
        else:
            shift = self._on_lens(lens)
            origins = self.look_from + shift
            directions -= shift / self.focus_distance
        directions /= np.sqrt(np.einsum("ij,ij->i", directions, directions))[:, None]
        return origins, directions

    def _sees(
        self, points: FloatArray, lens: FloatArray | None
    ) -> tuple[FloatArray, NDArray[np.int64], FloatArray]:
        """Project points to pixels; see `Projection.sees`."""
        shift = self._on_lens(lens)
        way = points - (self.look_from + shift)
        depth = way @ self._forward
        distance = np.sqrt(np.einsum("ij,ij->i", way, way))
        in_front = depth > 0.0
        depth = np.where(in_front, depth, 1.0)
        on_film = way / depth[:, None] + shift / self.focus_distance
        scale = self.height / self._half_height
        column = 0.5 * (on_film @ self._right * scale + self.width)
        row = 0.5 * (self.height - on_film @ self._upward * scale)
        pixel = self._pixels(column, row, in_front)
        pdf = np.where(pixel >= 0, self._pdf_ahead * (distance / depth) ** 3, 0.0)
        return way, pixel, pdf

    def may_see(self, bounds: FloatArray, from_the_middle: bool = False) -> bool:
        """Tell whether anything within a box (2, 3) may be in the picture; see `Projection.may_see`.

        False: the box lies behind the camera or wholly beyond one of the four sides of its view.
        """
        if self.has_lens and not from_the_middle:
            return True
        across, upward, depth = self._corners_in_frame(bounds)
        high = depth * self._half_height
        wide = high * self.width / self.height
        beyond = [-depth, across - wide, -across - wide, upward - high, -upward - high]
        return bool(np.max(np.min(beyond, axis=1)) <= 0.0)

    def direction_pdf(self, directions: FloatArray) -> FloatArray:
        """Return the pdf per solid angle (n,) of unit directions (n, 3) sampled by `rays`."""
        return self._pdf_ahead / (directions @ self._forward) ** 3

    def pixel_widths(self, points: FloatArray) -> FloatArray:
        """Return the side of a pixel at points (n, 3), scene units, (n,)."""
        away: FloatArray = np.linalg.norm(points - self.look_from, axis=1)
        return self.pixel_size * away

    @property
    def _pdf_ahead(self) -> float:
        """Density per solid angle of directions straight ahead.

        A pixel covers the square of `pixel_size` at depth one, where a steradian covers one over
        the cosine cubed.
        """
        return (0.5 * self.height / self._half_height) ** 2

    def _on_lens(self, lens: FloatArray | None) -> FloatArray:
        """Return places on the lens as seen from its centre, (n, 3), or (3,) for the centre."""
        if lens is None:
            return np.zeros(3)
        radius = 0.5 * self.aperture * np.sqrt(lens[:, 0])
        angle = 2.0 * math.pi * lens[:, 1]
        shift = np.multiply.outer(radius * np.cos(angle), self._right)
        shift += np.multiply.outer(radius * np.sin(angle), self._upward)
        return shift
