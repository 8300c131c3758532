"""Path tracing with light found in two ways: by asking lights, and by running into them.

Kajiya, "The rendering equation", SIGGRAPH 1986; the two ways are weighted after Veach and Guibas,
"Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995. Each camera ray
becomes one path; a batch of them takes its steps together.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.integrator import (
    FIRST_PATH_DIMENSION,
    CameraBlock,
    Integrator,
    RenderContext,
)
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.start_media import media_at
from hybrid_rt.integrators.surface_light import (
    Shading,
    SurfaceLight,
    largest_channel,
    named_points,
)
from hybrid_rt.kernels.light import BOTH, DIRECTION_ONLY, LIGHT_ONLY
from hybrid_rt.kernels.lobes import DIELECTRIC
from hybrid_rt.kernels.media import STACK, cross_media
from hybrid_rt.kernels.scatter import ABSORBED, SCATTERED, SPECULAR, STOPPED, scatter
from hybrid_rt.records import FloatArray, HitRecord, IntArray
from hybrid_rt.sampler import UIntArray

STRATEGIES = {"both": BOTH, "lights": LIGHT_ONLY, "directions": DIRECTION_ONLY}

# What the low-discrepancy points of one step are for.
TO_LIGHT, DIRECTION, CHOICE, PER_STEP = 0, 1, 2, 3


@dataclass(frozen=True)
class Paths:
    """Paths on their way, in the order of the camera rays they come from.

    Attributes
    ----------
    camera_ray : (n,) int64
        Row in the block of camera rays.
    pixel, sample : (n,) uint64
        They name the path's random numbers.
    origins, directions : (n, 3) float64
        Directions are unit vectors.
    throughput : (n, 3) float64
        What one unit of radiance on this ray adds to its pixel.
    pdf : (n,) float64
        Density with which the direction was chosen; 0 where it had no choice.
    media : (n, STACK) int32
        Dielectrics that the ray is in; (n, 0) where the scene has none.
    source_id : (n,) int32
        Object that the ray leaves from; -1 at the camera.
    """

    camera_ray: NDArray[np.int64]
    pixel: UIntArray
    sample: UIntArray
    origins: FloatArray
    directions: FloatArray
    throughput: FloatArray
    pdf: FloatArray
    media: IntArray
    source_id: IntArray

    def __len__(self) -> int:
        """Return the number of paths."""
        return int(self.camera_ray.size)

    def __getitem__(self, rows: NDArray[np.intp]) -> Paths:
        """Select rows by an index array."""
        return Paths(*(getattr(self, field.name).take(rows, axis=0) for field in fields(self)))


class PathTracer(Integrator):
    """See the module; `Integrator` for what it offers."""

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self._options: PathOptions = context.options or PathOptions()
        strategy = STRATEGIES[self._options.strategy]
        self._light = SurfaceLight(context, strategy, DIELECTRIC)
        lights, plan = context.scene.lights, context.plan
        asks = strategy != DIRECTION_ONLY and bool(lights.chance.any())
        self._asks_lights = asks and (plan["light samples"] or plan["sky samples"])
        self._camera_media = media_at(context) if plan["medium stack"] else []

    def _radiance(self, block: CameraBlock) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        paths = self._leaving_camera(block)
        for depth in range(self.context.max_depth + 2):
            # --- where the rays arrive
            source = named_points(paths.source_id, paths.origins) if depth else None
            hits = self._first_hits(paths.origins, paths.directions, source)
            with self.context.ledger.stage("shade"):
                material = self._light.material(hits)
                # --- what the way there absorbed
                self._absorb(paths, hits, material)
                # --- light they ran into
                arriving = self._light.arriving(hits, paths.origins, paths.directions, paths.pdf)
                radiance[paths.camera_ray] += paths.throughput * arriving
                met = np.flatnonzero(material >= 0)
                if depth > self.context.max_depth:
                    self._lose(paths.throughput[met])
                    break
                paths, hits, material = paths[met], hits[met], material[met]
                shading = Shading(
                    hits, paths.directions, material, self._light.colors(material, hits)
                )
                # --- light we reach for
                if self._asks_lights:
                    direct = self._light.from_one(shading, self._points(paths, depth, TO_LIGHT))
                    radiance[paths.camera_ray] += paths.throughput * direct
                # --- where they go next, and which ones stop
                paths = self._onward(paths, shading, depth)
            if len(paths) == 0:
                break
        return radiance

    def _leaving_camera(self, block: CameraBlock) -> Paths:
        n = block.pixel.size
        media = np.full((n, STACK if self.context.plan["medium stack"] else 0), -1, dtype=np.int32)
        media[:, : len(self._camera_media)] = self._camera_media
        return Paths(
            camera_ray=np.arange(n),
            pixel=block.pixel,
            sample=block.sample,
            origins=block.origins,
            directions=block.directions,
            throughput=np.ones((n, 3)),
            pdf=np.zeros(n),
            media=media,
            source_id=np.full(n, -1, dtype=np.int32),
        )

    def _points(self, paths: Paths, depth: int, use: int) -> FloatArray:
        dimension = FIRST_PATH_DIMENSION + depth * PER_STEP + use
        return self.context.sampler.points(paths.pixel, dimension, paths.sample)

    def _absorb(self, paths: Paths, hits: HitRecord, material: IntArray) -> None:
        """Weaken throughput by Beer and Lambert's law over the way just gone."""
        scene = self.context.scene
        if not self.context.plan["medium stack"]:
            return

        def cross(i: int, j: int) -> None:
            cross_media(
                paths.media[i:j],
                scene.lobes,
                scene.glass_of,
                material[i:j],
                hits.front_face[i:j],
                hits.t[i:j],
                paths.throughput[i:j],
            )

        self.context.pool.run(cross, len(paths))

    def _onward(self, paths: Paths, shading: Shading, depth: int) -> Paths:
        """Choose where each path goes; return those that go on."""
        n = len(paths)
        is_last = depth == self.context.max_depth
        # The last step may still run into light, so that both ways of finding it agree; but a
        # mirrored or refracted ray would be one direction more.
        may_spread = not is_last or self._options.strategy != "lights"
        roulette = self._options.survival if depth >= self._options.roulette_depth else 0.0
        xi, choice = self._points(paths, depth, DIRECTION), self._points(paths, depth, CHOICE)
        onward, pdf = np.empty((n, 3)), np.empty(n)
        fate = np.empty(n, dtype=np.uint8)
        hits, lobes = shading.hits, self.context.scene.lobes

        def send(i: int, j: int) -> None:
            scatter(
                lobes,
                shading.material[i:j],
                shading.colors[i:j],
                hits.normal[i:j],
                shading.directions[i:j],
                xi[i:j],
                choice[i:j],
                paths.media[i:j],
                may_spread,
                not is_last,
                roulette,
                onward[i:j],
                paths.throughput[i:j],
                pdf[i:j],
                fate[i:j],
            )

        self.context.pool.run(send, n)
        ledger = self.context.ledger
        counts = np.bincount(fate, minlength=SPECULAR + 1)
        ledger.rays["scattered"] += int(counts[SCATTERED])
        ledger.rays["mirrored or refracted"] += int(counts[SPECULAR])
        ledger.ended["absorbed or by roulette"] += int(counts[ABSORBED])
        if counts[STOPPED]:
            self._lose(paths.throughput[fate == STOPPED])
        going = np.flatnonzero(fate >= SCATTERED)
        return Paths(
            camera_ray=paths.camera_ray[going],
            pixel=paths.pixel[going],
            sample=paths.sample[going],
            origins=hits.position.take(going, axis=0),
            directions=onward.take(going, axis=0),
            throughput=paths.throughput.take(going, axis=0),
            pdf=pdf[going],
            media=paths.media.take(going, axis=0),
            source_id=hits.object_id[going],
        )

    def _lose(self, throughput: FloatArray) -> None:
        """Count paths that the limit ends, and what they might have carried."""
        if len(throughput):
            self.context.ledger.ended["at max_depth"] += len(throughput)
            self.context.ledger.lost_weight += float(largest_channel(throughput).sum())
