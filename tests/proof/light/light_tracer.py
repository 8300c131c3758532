"""Reference pictures of a floor lit through glass, by plain light tracing.

The light tracer (`proof.light.kernels.light_tracer`) shares no code with the renderer.
It has no density estimation (only cells), no projection map, and all photons have equal power, so
the noise of a cell with n photons is sqrt(n).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.threads import available_threads
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.light.kernels.light_tracer import count_on_floor, look_at_floor

# Photons and rays that a thread takes at a time.
AT_ONCE = 2**20
RAYS_AT_ONCE = 2**16


@dataclass(frozen=True)
class Bench:
    """A diffuse square floor under a small square light, with dielectrics between them.

    ``lamp_height``, ``lamp_side``, ``radiance``: the light is horizontal, centred above the floor, and
    emits downward.
    ``half``, ``albedo``: the floor is [-half, half]^2 at z = 0.
    """

    spheres: tuple[tuple[float, ...], ...] = ((0.0, 0.0, 0.9, 0.6),)
    slabs: tuple[tuple[float, ...], ...] = ()
    lamp_height: float = 2.4
    lamp_side: float = 0.1
    radiance: float = 100.0
    half: float = 2.0
    albedo: float = 0.8
    ior: float = 1.5

    @property
    def power(self) -> float:
        """Power of the light."""
        return math.pi * self.lamp_side**2 * self.radiance

    def scene(self, camera: Camera) -> Scene:
        """Return the bench as a `Scene`."""
        half, side = self.half, self.lamp_side
        floor = Rectangle((-half, -half, 0), (2 * half, 0, 0), (0, 2 * half, 0))
        glass = Dielectric(self.ior)
        objects = [Object(floor, Lambertian(self.albedo), "floor")]
        objects += [Object(Sphere(s[:3], s[3]), glass, "sphere") for s in self.spheres]
        objects += [Object(Box(s[:3], s[3:]), Dielectric(self.ior), "pane") for s in self.slabs]
        corner = (-side / 2, -side / 2, self.lamp_height)
        lamp = RectangleLight(corner, (0, side, 0), (side, 0, 0), self.radiance)
        return Scene(camera, objects, [lamp])

    def floor_light(
        self, n_photons: int, n_cells: int, seed: int = 0, threads: int | None = None
    ) -> NDArray[np.int64]:
        """Count photons by cells of the floor, (n_cells, n_cells), first along x."""
        lamp, spheres, slabs = self._numbers()
        starts = range(0, n_photons, AT_ONCE)
        workers = threads or available_threads()

        def work(k: int) -> NDArray[np.int64]:
            counts = np.zeros((n_cells, n_cells), dtype=np.int64)
            for start in starts[k::workers]:
                count_on_floor(
                    lamp, self.half, self.albedo, spheres, slabs, self.ior, np.uint64(seed),
                    start, min(start + AT_ONCE, n_photons), counts,
                )  # fmt: skip
            return counts

        with ThreadPoolExecutor(workers) as executor:
            total: NDArray[np.int64] = np.sum(list(executor.map(work, range(workers))), axis=0)
        return total

    def picture(
        self,
        counts: NDArray[np.int64],
        n_photons: int,
        camera: Camera,
        rays_per_side: int = 8,
        seed: int = 0,
    ) -> FloatArray:
        """Return the radiance (height, width) that a camera sees on the lit floor.

        Each pixel is the mean over ``rays_per_side`` squared rays, evenly placed.
        """
        lamp, spheres, slabs = self._numbers()
        n_cells = len(counts)
        area = (2.0 * self.half / n_cells) ** 2
        factor = self.albedo / math.pi * self.power / (n_photons * area)
        image = np.zeros(camera.height * camera.width)
        shift = (np.arange(rays_per_side) + 0.5) / rays_per_side
        down, across = (grid.ravel() for grid in np.meshgrid(shift, shift, indexing="ij"))
        per_block = max(RAYS_AT_ONCE // shift.size**2, 1)
        for start in range(0, image.size, per_block):
            pixel = np.arange(start, min(start + per_block, image.size))
            row, column = np.divmod(pixel, camera.width)
            origins, directions = camera.rays(
                (column[:, None] + across).ravel(), (row[:, None] + down).ravel()
            )
            place = np.empty((len(origins), 2))
            look_at_floor(
                lamp, self.half, spheres, slabs, self.ior, np.uint64(seed),
                start * shift.size**2, origins, directions, place,
            )  # fmt: skip
            is_lit = np.isfinite(place[:, 0])
            cell = np.where(is_lit[:, None], (place + self.half) / (2.0 * self.half) * n_cells, 0.0)
            cell = np.clip(cell.astype(int), 0, n_cells - 1)
            light = np.where(is_lit, counts[cell[:, 0], cell[:, 1]], 0)
            image[pixel] = factor * light.reshape(pixel.size, -1).mean(axis=1)
        return image.reshape(camera.height, camera.width)

    def _numbers(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return (
            np.array([0.0, 0.0, self.lamp_height, self.lamp_side]),
            np.array(self.spheres, dtype=np.float64).reshape(-1, 4),
            np.array(self.slabs, dtype=np.float64).reshape(-1, 6),
        )


# A glass sphere of radius 0.6 that floats 0.3 above the floor; and the same behind a pane.
BALL = Bench()
BEHIND_PANE = Bench(slabs=((-1.9, -1.45, 0.05, 1.9, -1.35, 2.0),))
CAMERA = Camera((0.0, -3.0, 2.2), (0.0, 0.0, 0.3), (0.0, 0.0, 1.0), 45.0, 256, 256)
