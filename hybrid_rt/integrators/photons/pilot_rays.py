"""A pilot set of camera rays, with random numbers that no pass uses, and what it finds of thin things."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import PIXEL_BITS, CameraBlock
from hybrid_rt.integrators.photons.covered_discs import ThinPlaces
from hybrid_rt.integrators.photons.density_estimation import Points
from hybrid_rt.integrators.photons.eye_pass import EyePass, PendingPoints
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.sensor.passes import GROUPS
from hybrid_rt.sensor.projection import Projection

# Pixels that its rays go through at most; of small pictures each has several.
PILOT_PIXELS = 1024


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
    own = replace(context, tracer=context.tracer.with_own_counters(), ledger=Ledger())
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
