"""The camera: pinhole or thin lens; rays from film positions, and back."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.keywords import explains
from hybrid_rt.core.one_line import call
from hybrid_rt.core.records import FloatArray

# Below this sine between view and up the picture's roll is decided by rounding.
SMALLEST_SINE = 1e-8
# A lens wider than this, in distances of the sharp plane, leaves no digits of where rays meet there.
WIDEST_LENS = 1e6
# Pixels along a side; far fewer fill any machine, which `hybrid_rt.rendering.memory` says in time.
MOST_PIXELS = 10**9


@explains(
    fov="vertical_fov, in degrees",
    fovy="vertical_fov, in degrees",
    focal_distance="focus_distance",
    focal_length="vertical_fov = 2 atan(h / (2 focal_length)), in degrees, h the height of the sensor",
    fstop="aperture, the diameter of the lens: focal length / f-number",
    resolution="width and height",
    position="look_from",
    origin="look_from",
    target="look_at",
)
class Camera:
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
        self.look_from = checks.as_vector(look_from, "Camera look_from", up_to=checks.FARTHEST)
        self.look_at = checks.as_vector(look_at, "Camera look_at", up_to=checks.FARTHEST)
        self.up = checks.as_vector(up, "Camera up")
        self.vertical_fov = checks.number(
            vertical_fov, "Camera vertical_fov", above=0.0, below=180.0, hint="degrees"
        )
        self.width = checks.whole(width, "Camera width", at_least=1, up_to=MOST_PIXELS)
        self.height = checks.whole(height, "Camera height", at_least=1, up_to=MOST_PIXELS)
        self.aperture = checks.number(
            aperture, "Camera aperture", at_least=0.0, up_to=checks.FARTHEST, hint="0: a pinhole"
        )
        view = self.look_at - self.look_from
        if not view.any():
            raise ValueError("Camera look_at equals look_from: pass another point to look at")
        if focus_distance is None:
            focus_distance = math.hypot(*view)
        self.focus_distance = checks.number(
            focus_distance, "Camera focus_distance", above=0.0, up_to=4.0 * checks.FARTHEST
        )
        if self.aperture > WIDEST_LENS * self.focus_distance:
            raise ValueError(
                f"Camera aperture is {self.aperture:g}, focus_distance {self.focus_distance:g}: pass "
                f"a lens at most {WIDEST_LENS:g} times as wide as that is far"
            )

        self._forward = checks.as_direction(view, "Camera view")
        up_direction = checks.as_direction(self.up, "Camera up")
        right = np.cross(self._forward, up_direction)
        if np.linalg.norm(right) < SMALLEST_SINE:
            raise ValueError(
                f"Camera up is {self.up.tolist()}, parallel to the view: pass another direction"
            )
        self._right = right / np.linalg.norm(right)
        self._upward = np.cross(self._right, self._forward)
        self._half_height = math.tan(math.radians(self.vertical_fov) / 2.0)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        lens = {}
        if self.has_lens:
            lens = {"aperture": self.aperture, "focus_distance": self.focus_distance}
        return call(
            self,
            self.look_from,
            self.look_at,
            self.up,
            vertical_fov=self.vertical_fov,
            width=self.width,
            height=self.height,
            **lens,
        )

    @property
    def has_lens(self) -> bool:
        """Whether the aperture is positive."""
        return self.aperture > 0.0

    @property
    def pixel_size(self) -> float:
        """Side of a pixel on a plane at distance one."""
        return 2.0 * self._half_height / self.height

    def resized(self, width: int, height: int | None = None) -> Camera:
        """Return the same camera with another resolution.

        Parameters
        ----------
        width : int
        height : int, optional
            Default: in proportion to the width, rounded, at least 1.
        """
        if height is None:
            width = checks.whole(width, "Camera width", at_least=1, up_to=MOST_PIXELS)
            height = max(round(width * self.height / self.width), 1)
        return Camera(
            self.look_from,
            self.look_at,
            self.up,
            self.vertical_fov,
            width,
            height,
            self.aperture,
            self.focus_distance,
        )

    def rays(
        self, column: ArrayLike, row: ArrayLike, lens: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return origins and unit directions of rays through film positions.

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
        column = checks.finite(column, "Camera.rays column", (-1,))
        row = checks.finite(row, "Camera.rays row", (column.size,))
        lens = None if lens is None else _lens_samples(lens, column.size, "Camera.rays")
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
            Vector from the lens to each point.
        pixel : (n,) int64
            Index in row-major order from the upper left; -1 outside the picture.
        pdf : (n,) float64
            pdf per solid angle of directions to positions that are uniform in the pixel; 0 outside.

        Raises
        ------
        ValueError, TypeError
            As for `rays`.
        """
        points = checks.finite(points, "Camera.sees points", (-1, 3))
        lens = None if lens is None else _lens_samples(lens, len(points), "Camera.sees")
        shift = self._on_lens(lens)
        way = points - (self.look_from + shift)
        depth = way @ self._forward
        distance = np.sqrt(np.einsum("ij,ij->i", way, way))
        in_front = depth > 0.0
        depth = np.where(in_front, depth, 1.0)
        on_film = way / depth[:, None] + shift / self.focus_distance
        scale = self.height / self._half_height
        column = np.floor(0.5 * (on_film @ self._right * scale + self.width))
        row = np.floor(0.5 * (self.height - on_film @ self._upward * scale))
        inside = in_front & (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        column, row = np.where(inside, column, 0.0), np.where(inside, row, 0.0)
        pixel = np.where(inside, (row * self.width + column).astype(np.int64), -1)
        pdf = np.where(inside, self._pdf_ahead * (distance / depth) ** 3, 0.0)
        return way, pixel, pdf

    def may_see(self, bounds: FloatArray, from_the_middle: bool = False) -> bool:
        """Tell whether anything within a box (2, 3), scene units, may be in the picture.

        False is certain, but for roundings: the box lies behind the camera or wholly beyond one of the
        four sides of its view. With a lens it is always True, unless its middle alone is asked for.
        """
        if self.has_lens and not from_the_middle:
            return True
        corners = np.array(list(product(*np.transpose(bounds)))) - self.look_from
        depth = corners @ self._forward
        high = depth * self._half_height
        wide = high * self.width / self.height
        across, upward = corners @ self._right, corners @ self._upward
        beyond = [-depth, across - wide, -across - wide, upward - high, -upward - high]
        return bool(np.max(np.min(beyond, axis=1)) <= 0.0)

    def direction_pdf(self, directions: FloatArray) -> FloatArray:
        """Return the pdf per solid angle (n,) of unit directions (n, 3) sampled by `rays`.

        Each is uniform within its pixel, through one point of the lens.
        """
        pdf: FloatArray = self._pdf_ahead / (directions @ self._forward) ** 3
        return pdf

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


def _lens_samples(lens: ArrayLike, n: int, what: str) -> FloatArray:
    samples = checks.finite(lens, f"{what} lens", (n, 2))
    if n and not 0.0 <= samples.min() <= samples.max() < 1.0:
        raise ValueError(
            f"{what} lens holds {samples.min():g} to {samples.max():g}: pass numbers in [0, 1)"
        )
    return samples
