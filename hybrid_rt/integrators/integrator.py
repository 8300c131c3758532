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
    """Camera rays of consecutive pixels, one per pixel."""

    pixel: UIntArray
    origins: FloatArray
    directions: FloatArray


class Integrator(ABC):
    """Computes passes: pure functions of scene, settings, seed and pass number."""

    def __init__(self, context: RenderContext) -> None:
        self.context = context

    def render_pass(
        self, pass_number: int, on_rays: Callable[[int], None] | None = None
    ) -> FloatArray:
        """Return the radiance of one sample per pixel, (height, width, 3) float64.

        ``on_rays`` hears after each block how many camera rays of the pass are done.
        """
        camera = self.context.scene.camera
        image = np.empty((camera.height * camera.width, 3))
        for block in self._camera_blocks(pass_number):
            first = int(block.pixel[0])
            image[first : first + block.pixel.size] = self._radiance(block, pass_number)
            if on_rays is not None:
                on_rays(first + block.pixel.size)
        return image.reshape(camera.height, camera.width, 3)

    @abstractmethod
    def _radiance(self, block: CameraBlock, pass_number: int) -> FloatArray:
        """Return the radiance (n, 3) that each camera ray brings."""

    def _camera_blocks(self, pass_number: int) -> Iterator[CameraBlock]:
        camera, sampler = self.context.scene.camera, self.context.sampler
        n_pixels = camera.height * camera.width
        for first in range(0, n_pixels, BLOCK):
            with self.context.ledger.stage("camera rays"):
                pixel = np.arange(first, min(first + BLOCK, n_pixels), dtype=np.uint64)
                place = sampler.points(pixel, PIXEL_DIMENSION, pass_number)
                lens = None
                if self.context.plan["lens samples"]:
                    lens = sampler.points(pixel, LENS_DIMENSION, pass_number)
                row, column = np.divmod(pixel.astype(np.int64), camera.width)
                origins, directions = camera.rays(column + place[:, 0], row + place[:, 1], lens)
            self.context.ledger.rays["camera"] += pixel.size
            yield CameraBlock(pixel, origins, directions)

    def _first_hits(
        self, origins: FloatArray, directions: FloatArray, source: HitRecord | None
    ) -> HitRecord:
        """Trace rays and count how they end."""
        ledger = self.context.ledger
        with ledger.stage("intersect"):
            hits: HitRecord = self.context.tracer.intersect(origins, directions, source=source)
        ledger.count_hits(hits)
        return hits
