"""How many shadow rays each hit point of the eye pass casts, chosen by variance against cost.

The photons of a pass often cost more than its camera rays, while direct light makes most of its
noise. Then several shadow rays per point pay. A pilot set of camera rays, with random numbers that
no pass uses, measures what the noise of a pixel comes from: shadow rays, photons, and the rest. So
the number is a function of scene, seed and options alone.

The optimum of variance times cost is that of splitting: Arvo and Kirk, "Particle transport and image
synthesis", SIGGRAPH 1990.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import PIXEL_BITS
from hybrid_rt.integrators.kernels.density_estimate import Sums
from hybrid_rt.integrators.photons.density_estimation import Discs
from hybrid_rt.integrators.photons.eye_pass import EyePass, Waiting
from hybrid_rt.sensor.image_metrics import DARK
from hybrid_rt.sensor.passes import GROUPS

# Powers of two keep the shadow rays of a pass a net of Sobol's sequence.
NUMBERS = (1, 2, 4, 8, 16)
# Over several passes shadow rays fall more evenly than at random, which the pilot set does not see:
# a gain of less than this factor was none in caustic_through_glass.
ABOUT_AS_GOOD = 1.1
# Pixels of the pilot set, camera rays through each, and shadow rays from each of their hit points.
PILOT_PIXELS, PER_PIXEL, PER_POINT = 1024, 2, 8
# Pixels in which a camera ray met a lamp by chance would decide all: so many of the worst are left
# out of every hundred.
LEFT_OUT = 0.01
# Epanechnikov's weights of the photons in a disc have this mean square; their mean is one.
MEAN_SQUARE_WEIGHT = 4.0 / 3.0
# Density estimation at a point costs about as much as so many rays: 2 in wine_glass, 5 in
# caustic_through_glass.
GATHER_COST = 3.0


@dataclass(frozen=True)
class Work:
    """Variance of a pixel in one pass, relative to its square, and cost in rays per pixel.

    Attributes
    ----------
    of_shadow_rays, of_rest : float
        Variances: that of one shadow ray per point, and that of everything else.
    shadow_rays, rest : float
        Costs.
    """

    of_shadow_rays: float
    of_rest: float
    shadow_rays: float
    rest: float

    def with_number(self, n: int) -> float:
        """Return variance times cost with n shadow rays per point."""
        return (self.of_rest + self.of_shadow_rays / n) * (self.rest + n * self.shadow_rays)

    @property
    def best_number(self) -> int:
        """The smallest number of shadow rays with about the least variance times cost."""
        least = min(map(self.with_number, NUMBERS))
        return next(n for n in NUMBERS if self.with_number(n) <= ABOUT_AS_GOOD * least)


def measure_work(
    context: RenderContext, field: Discs, share: float, photon_rays: float
) -> Work | None:
    """Measure what noise and cost of a pass come from.

    Parameters
    ----------
    context : RenderContext
        Its counts are left alone.
    field : Discs
        Photons of a pilot pass.
    share : float
        Their number over that of a pass.
    photon_rays : float
        Rays of the photons of a pass.

    Returns
    -------
    Work or None
        None if there are no shadow rays, or if their light is beyond the largest number.
    """
    own = replace(context, tracer=context.tracer.with_own_counters(), ledger=Ledger())
    pilot, rays = _PilotEyePass(own, field, share), own.ledger.rays
    if not pilot.casts_shadow_rays:
        return None
    radiance = pilot.pilot_radiance().reshape(-1, PER_PIXEL, 3)
    n = rays["camera"]
    of_shadow_rays, of_photons = (
        variance.reshape(-1, PER_PIXEL, 3).mean(axis=1)
        for variance in (pilot.of_shadow_rays, pilot.of_photons)
    )
    # What the rays through one pixel differ by, without the noise of the shadow rays that is left.
    if not np.isfinite([radiance.sum(), of_shadow_rays.sum(), of_photons.sum()]).all():
        return None
    of_camera_rays = radiance.var(axis=1, ddof=1) - of_shadow_rays / PER_POINT
    of_rest = np.maximum(of_camera_rays, 0.0) + of_photons
    weight = 1.0 / (radiance.mean(axis=1) ** 2 + DARK)
    squares = np.stack([of_shadow_rays * weight, of_rest * weight]).mean(axis=2)
    kept = np.argsort(squares.sum(axis=0))[: math.ceil((1.0 - LEFT_OUT) * squares.shape[1])]
    pixels = own.scene.camera.width * own.scene.camera.height
    gathered = GATHER_COST * pilot.n_points + rays["to photons"]
    seen = rays["camera"] + rays["mirrored or refracted"] + gathered
    mean_square = squares[:, kept].mean(axis=1)
    return Work(
        of_shadow_rays=float(mean_square[0]),
        of_rest=float(mean_square[1]),
        shadow_rays=rays["shadow"] / (PER_POINT * n),
        rest=photon_rays / pixels + seen / n,
    )


class _PilotEyePass(EyePass):
    """An eye pass that notes the variances of its direct light and of its photons.

    Attributes
    ----------
    of_shadow_rays, of_photons : (n, 3) float64
        Of each camera ray traced: the variance of one shadow ray from each of its points, and about
        that of the photons of one pass.
    """

    def __init__(self, context: RenderContext, field: Discs, share: float) -> None:
        super().__init__(context)
        self.fields = (field,)
        self._share = share
        self.of_shadow_rays = self.of_photons = np.zeros((0, 3))

    def pilot_radiance(self) -> FloatArray:
        """Return the radiance of the pilot set's camera rays, `PER_PIXEL` in a row for each pixel."""
        camera = self.context.scene.camera
        n = min(PILOT_PIXELS, camera.width * camera.height)
        # Spread over the picture by Roberts' sequence: multiples of powers of the plastic number.
        place = 0.5 + np.arange(n)[:, None] * np.array([0.7548776662466927, 0.5698402909980532])
        row, column = (place % 1.0 * (camera.height, camera.width)).astype(np.int64).T
        pixel = np.repeat(row * camera.width + column, PER_PIXEL).astype(np.uint64)
        # In a group that no pass belongs to.
        pixel += np.uint64(GROUPS) << PIXEL_BITS
        sample = np.tile(np.arange(PER_PIXEL, dtype=np.uint64), n)
        self.of_shadow_rays, self.of_photons = np.zeros((2, pixel.size, 3))
        return self.radiance_through(pixel, sample)

    def _add_direct(self, points: Waiting, radiance: FloatArray) -> None:
        paths = points.paths
        rows = np.arange(paths.camera_ray.size)
        found = np.zeros((PER_POINT, rows.size, 3))
        for j in range(PER_POINT):
            xi = self._shadow_ray_points(points, PER_POINT, j)
            self._wide.from_one(points.shading, rows, paths.throughput, paths.media, xi, found[j])
        np.add.at(self.of_shadow_rays, paths.camera_ray, found.var(axis=0, ddof=1))
        np.add.at(radiance, paths.camera_ray, found.mean(axis=0))

    def _note_gathered(
        self, camera_ray: NDArray[np.int64], throughput: FloatArray, sums: Sums
    ) -> None:
        # As if photons fell at random: so many of them that the pass has in the disc.
        n = np.maximum(sums.near, 1) / self._share
        square = (throughput * sums.value) ** 2
        np.add.at(self.of_photons, camera_ray, MEAN_SQUARE_WEIGHT * square / n[:, None])
