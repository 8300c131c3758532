"""A pilot set of camera rays, with random numbers that no pass uses, and what it measures.

It finds thin things, and how many camera rays a pass sends through each pixel and shadow rays from each
point. The photons of a pass often cost more than its camera rays, while most of the noise is that of the
camera rays (lamps seen by way of glass, edges) or of direct light. Then several of them pay, with the
same photons. The numbers are functions of scene, seed and options alone.

The optimum of variance times cost is that of splitting: Arvo and Kirk, "Particle transport and image
synthesis", SIGGRAPH 1990.
"""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import PIXEL_BITS, CameraBlock
from hybrid_rt.integrators.kernels.density_estimate import Sums
from hybrid_rt.integrators.photons.covered_discs import ThinPlaces
from hybrid_rt.integrators.photons.density_estimation import Discs, Field, Points
from hybrid_rt.integrators.photons.eye_pass import EyePass, PendingPoints
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.image_metrics import DARK
from hybrid_rt.sensor.passes import GROUPS
from hybrid_rt.sensor.projection import Projection

# Pixels that its rays go through at most; of small pictures each has several.
PILOT_PIXELS = 1024
# Powers of two keep the rays of a pass a net of Sobol's sequence.
CAMERA_RAYS, SHADOW_RAYS = (1, 2, 4), (1, 2, 4, 8, 16)
# Over several passes shadow rays fall more evenly than at random, which the pilot set does not see:
# a gain of less than this factor was none in caustic_through_glass.
ABOUT_AS_GOOD = 1.1
# Camera rays of the pilot set through each pixel, and shadow rays from each of their hit points.
PER_PIXEL, PER_POINT = 2, 8
# Pixels in which a camera ray met a lamp by chance would decide all: so many of the worst are left
# out of every hundred.
LEFT_OUT = 0.01
# Density estimation at a point costs about as much as so many rays: 2 in wine_glass, 5 in
# caustic_through_glass.
GATHER_COST = 3.0


def pilot_rays(camera: Projection, per_pixel: int) -> tuple[UIntArray, UIntArray]:
    """Return ``pixel`` and ``sample`` (see `CameraBlock`) of ``per_pixel`` rays in a row for each pixel."""
    n = min(PILOT_PIXELS, camera.width * camera.height)
    # Spread over the picture by Roberts' sequence: multiples of powers of the plastic number.
    place = 0.5 + np.arange(n)[:, None] * np.array([0.7548776662466927, 0.5698402909980532])
    row, column = (place % 1.0 * (camera.height, camera.width)).astype(np.int64).T
    pixel = np.repeat(row * camera.width + column, per_pixel).astype(np.uint64)
    # In a group that no pass belongs to.
    pixel += np.uint64(GROUPS) << PIXEL_BITS
    return pixel, np.tile(np.arange(per_pixel, dtype=np.uint64), n)


def find_thin_places(
    context: RenderContext, radius_at: Callable[[Points], FloatArray]
) -> ThinPlaces | None:
    """Find where discs are wider than what they lie on, by the points of a pilot set.

    ``context``: its counts are left alone.
    ``radius_at``: returns the radii (n,) of the discs of the first pass.
    """
    own = context.with_own_counts()
    finder = _Finder(own, radius_at)
    n_pixels = own.scene.camera.width * own.scene.camera.height
    finder.radiance_through(*pilot_rays(own.scene.camera, max(PILOT_PIXELS // n_pixels, 1)))
    return finder.thin_places


class _Finder(EyePass):
    """An eye pass that measures how far discs are covered, and gathers no light."""

    def __init__(self, context: RenderContext, radius_at: Callable[[Points], FloatArray]) -> None:
        super().__init__(context)
        self._radius_at = radius_at

    def _add_at(self, waiting: PendingPoints, block: CameraBlock, radiance: FloatArray) -> None:
        del block, radiance
        points = self._points_of(waiting)
        rows = np.arange(len(points.xi))
        self.thin_places = ThinPlaces.of(
            self.context, self._contacts, points, self._radius_at(points), self._draw(waiting, rows)
        )


@dataclass(frozen=True)
class Work:
    """Variances of a pixel in one pass, relative to its square, and costs in rays per pixel."""

    # Variances: that of one camera ray, that of one shadow ray from each of its points, and that of
    # the photons of a pass
    of_camera_rays: float
    of_shadow_rays: float
    of_photons: float
    # Their costs
    camera_rays: float
    shadow_rays: float
    photons: float

    def cost(self, n_camera: int, n_shadow: int) -> float:
        """Return the rays of a pass for each pixel."""
        return self.photons + n_camera * (self.camera_rays + n_shadow * self.shadow_rays)

    def variance(self, n_camera: int, n_shadow: int) -> float:
        """Return the variance of a pixel in one pass."""
        of_camera_rays = self.of_camera_rays + self.of_shadow_rays / n_shadow
        return self.of_photons + of_camera_rays / n_camera

    @property
    def best_numbers(self) -> tuple[int, int]:
        """Camera rays and shadow rays of the cheapest pass of about the least variance times cost."""
        product = {
            numbers: self.variance(*numbers) * self.cost(*numbers)
            for numbers in itertools.product(CAMERA_RAYS, SHADOW_RAYS)
        }
        limit = ABOUT_AS_GOOD * min(product.values())
        good = [numbers for numbers, value in product.items() if value <= limit]
        return min(good, key=lambda numbers: self.cost(*numbers))


def measure_work(
    context: RenderContext, halves: tuple[Discs, Discs], of_pass: float, photon_rays: float
) -> Work | None:
    """Measure what noise and cost of a pass come from.

    ``context``: its counts are left alone.
    ``halves``, two Discs: every other photon of a pilot pass, and the rest.
    ``of_pass``: the variance of the photons of a pass over that of all these photons.
    ``photon_rays``: rays of the photons of a pass.
    Returns None if light is beyond the largest number.
    """
    own = context.with_own_counts()
    pilot, rays = _PilotEyePass(own, halves), own.ledger.rays
    radiance = pilot.pilot_radiance().reshape(-1, PER_PIXEL, 3)
    n = rays["camera"]
    of_shadow_rays, of_photons = (
        variance.reshape(-1, PER_PIXEL, 3).mean(axis=1)
        for variance in (pilot.of_shadow_rays, of_pass * pilot.difference**2)
    )
    # What the rays through one pixel differ by, without the noise of the shadow rays that is left.
    if not np.isfinite([radiance.sum(), of_shadow_rays.sum(), of_photons.sum()]).all():
        return None
    of_camera_rays = radiance.var(axis=1, ddof=1) - of_shadow_rays / PER_POINT
    weight = 1.0 / (radiance.mean(axis=1) ** 2 + DARK)
    of_each = (np.maximum(of_camera_rays, 0.0), of_shadow_rays, of_photons)
    squares = np.stack([variance * weight for variance in of_each]).mean(axis=2)
    kept = np.argsort(squares.sum(axis=0))[: math.ceil((1.0 - LEFT_OUT) * squares.shape[1])]
    of_each_kept = squares[:, kept].mean(axis=1).tolist()
    pixels = own.scene.camera.width * own.scene.camera.height
    # Each half of the photons was looked for at all points.
    gathered = (GATHER_COST * pilot.counted["n_points"] + rays["to photons"]) / len(halves)
    seen = rays["camera"] + rays["mirrored or refracted"] + gathered
    return Work(
        of_camera_rays=of_each_kept[0],
        of_shadow_rays=of_each_kept[1],
        of_photons=of_each_kept[2],
        camera_rays=seen / n,
        shadow_rays=rays["shadow"] / (PER_POINT * n),
        photons=photon_rays / pixels,
    )


class _PilotEyePass(EyePass):
    """An eye pass that notes the variances of its direct light and of its photons.

    ``of_shadow_rays`` (n, 3): variance of one shadow ray from each of a camera ray's points.
    ``difference`` (n, 3): what one half of the photons adds to each camera ray minus what the other
    half adds.
    """

    def __init__(self, context: RenderContext, halves: tuple[Discs, Discs]) -> None:
        super().__init__(context)
        self.fields = halves
        self.of_shadow_rays = self.difference = np.zeros((0, 3))

    def pilot_radiance(self) -> FloatArray:
        """Return the radiance of the pilot set's camera rays, `PER_PIXEL` in a row for each pixel."""
        pixel, sample = pilot_rays(self.context.scene.camera, PER_PIXEL)
        self.of_shadow_rays, self.difference = np.zeros((2, pixel.size, 3))
        return self.radiance_through(pixel, sample)

    def _add_direct(self, points: PendingPoints, radiance: FloatArray) -> None:
        paths = points.paths
        rows = np.arange(paths.camera_ray.size)
        found = np.zeros((PER_POINT, rows.size, 3))
        for j in range(PER_POINT):
            xi = self._shadow_ray_points(points, PER_POINT, j)
            self._wide.from_one(points.shading, rows, paths.throughput, paths.media, xi, found[j])
        np.add.at(self.of_shadow_rays, paths.camera_ray, found.var(axis=0, ddof=1))
        np.add.at(radiance, paths.camera_ray, found.mean(axis=0))

    @OVERFLOWS
    def _note_gathered(
        self, field: Field, camera_ray: NDArray[np.int64], throughput: FloatArray, sums: Sums
    ) -> None:
        # What half of the photons adds minus what the other half adds: its mean square is the
        # variance of the sum of both.
        sign = 1.0 if field is self.fields[0] else -1.0
        np.add.at(self.difference, camera_ray, sign * throughput * sums.value)
