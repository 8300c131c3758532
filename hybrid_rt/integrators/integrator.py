"""The interface of integrators, and the generation of camera rays."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.media.beginnings import MediaAroundCamera
from hybrid_rt.integrators.media.contacts import Contacts, first_hits
from hybrid_rt.integrators.rows import rows_of
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.sensor.passes import group_of

# Camera rays that one thread follows at a time. The last steps of a block have few paths left, so
# calls cost more than rays there: 2^16 take a tenth less time than 2^15, and 2^17 no less.
BLOCK = 2**16

# What a low-discrepancy point is for. Numbers from FIRST_PATH_DIMENSION on belong to the integrator.
PIXEL_DIMENSION, LENS_DIMENSION, FIRST_PATH_DIMENSION = 0, 1, 2

# The group of a pass stands above the pixel's number.
PIXEL_BITS = np.uint64(40)


def place_of_pixel(name: UIntArray) -> NDArray[np.int64]:
    """Return the pixel index within one picture, from ``pixel`` of a `CameraBlock`."""
    return (name & ((np.uint64(1) << PIXEL_BITS) - np.uint64(1))).astype(np.int64)


@dataclass(frozen=True)
class CameraBlock:
    """Camera rays: consecutive pixels of consecutive passes."""

    # (n,) uint64: keys of their random numbers: the pixel index, with the pass's group in the high
    # bits, and the index of the pass in its group (see `hybrid_rt.sensor.passes.group_of`)
    pixel: UIntArray
    sample: UIntArray
    # (n, 3)
    origins: FloatArray
    directions: FloatArray


class Integrator(ABC):
    """Computes passes; each is a pure function of scene, settings, seed and pass number."""

    def __init__(self, context: RenderContext) -> None:
        self.context = context
        self._contacts: Contacts | None = None
        if context.plan["contacts"]:
            self._contacts = Contacts(context.scene, context.tracer)
        self._media_around_camera = MediaAroundCamera(context, self._contacts)
        # The medium stack in which the rays of a block begin, (STACK,); (0,) without dielectrics.
        self._camera_media = self._media_around_camera.middle

    def begin(self) -> None:  # noqa: B027 (a hook that most leave empty)
        """Compute, once, what all passes need; by default nothing."""

    def follow(self, first: Integrator) -> None:
        """Copy what the integrator of another thread computed in `begin`."""
        del first

    @property
    def parts(self) -> int:
        """In how many parts each pass is prepared: more than 1 where that takes long."""
        return 1

    @property
    def most_at_once(self) -> int:
        """How many passes may be prepared together: fewer where that takes much memory."""
        return sys.maxsize

    def prepare(self, passes: range, part: int) -> Any:
        """Compute a part of what all blocks of some passes need; by default nothing.

        Passes of several parts come one by one.
        """
        del passes, part

    def gather(self, passes: range, prepared: Sequence[Any]) -> Any:
        """Put the results of `prepare`, pass by pass and part by part, together for the passes traced next."""
        del passes, prepared

    def take(self, gathered: Any) -> None:
        """Store what the `gather` of one thread returned, which all threads share."""
        del gathered

    def add_prepared(self, prepared: Any, images: FloatArray) -> None:
        """Add the contributions of a result of `prepare` to the pictures (passes, pixels, 3)."""
        del prepared, images

    def trace(self, passes: range, first: int, stop: int) -> FloatArray:
        """Return the radiance (stop - first, 3) of a run of camera rays.

        ``first`` and ``stop`` count the pixels of the first pass, then those of the second, and so
        on.
        """
        radiance = self.radiance_through(*self._keys(passes, first, stop))
        if radiance.shape != (stop - first, 3):
            raise ValueError(
                f"{type(self).__name__}._radiance returned an array of shape {radiance.shape} for "
                f"{stop - first} camera rays: return one of shape ({stop - first}, 3)"
            )
        return radiance

    @abstractmethod
    def _radiance(self, block: CameraBlock) -> FloatArray:
        """Return the radiance (n, 3) that each camera ray brings."""

    def _keys(self, passes: range, first: int, stop: int) -> tuple[UIntArray, UIntArray]:
        """Return ``pixel`` and ``sample`` of a run of camera rays, see `CameraBlock`."""
        camera = self.context.scene.camera
        number = np.arange(first, stop, dtype=np.uint64)
        sample, pixel = np.divmod(number, np.uint64(camera.height * camera.width))
        # Groups of passes are pictures on their own, with independent random numbers.
        group, sample = group_of(sample + np.uint64(passes.start))
        return pixel + (group << PIXEL_BITS), sample

    def radiance_through(self, pixel: UIntArray, sample: UIntArray) -> FloatArray:
        """Return the radiance (n, 3) of camera rays with these keys, see `CameraBlock`."""
        with self.context.ledger.stage("camera rays"):
            block = self._through(pixel, sample)
        if not self._media_around_camera.differs:
            return self._radiance(block)
        radiance = np.zeros_like(block.directions)
        for media, rows in self._media_around_camera.groups(block.origins):
            self._camera_media = media
            radiance[rows] = self._radiance(rows_of(block, rows))
        return radiance

    def _through(self, pixel: UIntArray, sample: UIntArray) -> CameraBlock:
        """Return the camera rays with these keys, see `CameraBlock`."""
        camera, sampler = self.context.scene.camera, self.context.sampler
        row, column = np.divmod(place_of_pixel(pixel), camera.width)
        place = sampler.points(pixel, PIXEL_DIMENSION, sample)
        lens = None
        if self.context.plan["lens samples"]:
            lens = sampler.points(pixel, LENS_DIMENSION, sample)
        origins, directions = camera.rays(column + place[:, 0], row + place[:, 1], lens)
        self.context.ledger.rays["camera"] += pixel.size
        return CameraBlock(pixel, sample, origins, directions)

    def _first_hits(
        self, origins: FloatArray, directions: FloatArray, source: HitRecord | NamedPoints | None
    ) -> tuple[HitRecord, IntArray]:
        """Trace rays and count how they end; see `Contacts.at` for what else is returned."""
        ledger = self.context.ledger
        with ledger.stage("intersect"):
            tracer = self.context.tracer
            hits, second = first_hits(tracer, self._contacts, origins, directions, source)
        ledger.count_hits(hits)
        if source is None:
            ledger.note_camera_hits(hits)
        return hits, second
