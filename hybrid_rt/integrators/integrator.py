"""What every integrator answers, and what the passes of all of them share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.pool import Pool
from hybrid_rt.plan import Plan
from hybrid_rt.records import FloatArray, HitRecord
from hybrid_rt.report import Ledger
from hybrid_rt.sampler import Sampler, UIntArray
from hybrid_rt.scene import CompiledScene

# Rays in flight at a time. A ray and its hit take about 500 bytes, so a block stays near 128 MiB
# while its kernels' calls cost nothing beside its rays.
BLOCK = 2**18

# What a low-discrepancy point is for. Numbers from FIRST_PATH_DIMENSION on belong to the integrator.
PIXEL_DIMENSION, LENS_DIMENSION, FIRST_PATH_DIMENSION = 0, 1, 2


@dataclass(frozen=True)
class RenderContext:
    """Everything an integrator works with."""

    scene: CompiledScene
    tracer: Intersector
    pool: Pool
    plan: Plan
    sampler: Sampler
    ledger: Ledger
    max_depth: int


@dataclass(frozen=True)
class CameraBlock:
    """Camera rays: consecutive pixels of consecutive passes.

    Attributes
    ----------
    pixel, sample : (n,) uint64
        Number in the image, and of the pass.
    origins, directions : (n, 3) float64
    """

    pixel: UIntArray
    sample: UIntArray
    origins: FloatArray
    directions: FloatArray


class Integrator(ABC):
    """Computes passes: pure functions of scene, settings, seed and pass number."""

    def __init__(self, context: RenderContext) -> None:
        self.context = context

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Iterator[FloatArray]:
        """Yield the radiance of one sample per pixel, (height, width, 3) float64, for each pass.

        Small pictures take several passes in one batch. ``on_rays`` hears after each block how
        many camera rays are done.
        """
        camera = self.context.scene.camera
        n_pixels = camera.height * camera.width
        images = np.empty((len(passes), camera.height, camera.width, 3))
        rows = images.reshape(-1, 3)
        for first in range(0, len(passes) * n_pixels, BLOCK):
            stop = min(first + BLOCK, len(passes) * n_pixels)
            rows[first:stop] = self._radiance(self._camera_rays(passes, first, stop))
            if on_rays is not None:
                on_rays(stop)
        yield from images

    @abstractmethod
    def _radiance(self, block: CameraBlock) -> FloatArray:
        """Return the radiance (n, 3) that each camera ray brings."""

    def _camera_rays(self, passes: range, first: int, stop: int) -> CameraBlock:
        camera, sampler = self.context.scene.camera, self.context.sampler
        with self.context.ledger.stage("camera rays"):
            number = np.arange(first, stop, dtype=np.uint64)
            sample, pixel = np.divmod(number, np.uint64(camera.height * camera.width))
            sample += np.uint64(passes.start)
            place = sampler.points(pixel, PIXEL_DIMENSION, sample)
            lens = None
            if self.context.plan["lens samples"]:
                lens = sampler.points(pixel, LENS_DIMENSION, sample)
            row, column = np.divmod(pixel.astype(np.int64), camera.width)
            origins, directions = camera.rays(column + place[:, 0], row + place[:, 1], lens)
        self.context.ledger.rays["camera"] += pixel.size
        return CameraBlock(pixel, sample, origins, directions)

    def _first_hits(
        self, origins: FloatArray, directions: FloatArray, source: HitRecord | None
    ) -> HitRecord:
        """Trace rays and count how they end."""
        ledger = self.context.ledger
        with ledger.stage("intersect"):
            hits: HitRecord = self.context.tracer.intersect(origins, directions, source=source)
        ledger.count_hits(hits)
        return hits
