"""Path tracing with light found in two ways: by asking lights, and by running into them.

Kajiya, "The rendering equation", SIGGRAPH 1986; the two ways are weighted after Veach and Guibas,
"Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995. Each camera ray
becomes one path; a batch of them takes its steps together.
"""

from __future__ import annotations

import numpy as np

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
from hybrid_rt.kernels.pack import Paths, add_products, pack_paths
from hybrid_rt.kernels.scatter import ABSORBED, LEFT, SCATTERED, SPECULAR, STOPPED, scatter
from hybrid_rt.records import FloatArray, HitRecord, IntArray

STRATEGIES = {"both": BOTH, "lights": LIGHT_ONLY, "directions": DIRECTION_ONLY}

# What the low-discrepancy points of one step are for.
TO_LIGHT, DIRECTION, CHOICE, PER_STEP = 0, 1, 2, 3


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
                add_products(paths.camera_ray, paths.throughput, arriving, radiance)
                if depth > self.context.max_depth:
                    self._lose(paths.throughput[material >= 0])
                    break
                shading = self._light.shading(hits, paths.directions, material)
                # --- light we reach for
                if self._asks_lights:
                    xi = self._points(paths, depth, TO_LIGHT)
                    self._light.from_one(shading, paths.camera_ray, paths.throughput, xi, radiance)
                # --- where they go next, and which ones stop
                paths = self._onward(paths, shading, depth)
            if paths.camera_ray.size == 0:
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

        cross_media(
            paths.media,
            scene.lobes,
            scene.glass_of,
            material,
            hits.front_face,
            hits.t,
            paths.throughput,
        )

    def _onward(self, paths: Paths, shading: Shading, depth: int) -> Paths:
        """Choose where each path goes; return those that go on."""
        n = paths.camera_ray.size
        is_last = depth == self.context.max_depth
        # The last step may still run into light, so that both ways of finding it agree; but a
        # mirrored or refracted ray would be one direction more.
        may_spread = not is_last or self._options.strategy != "lights"
        roulette = self._options.survival if depth >= self._options.roulette_depth else 0.0
        xi, choice = self._points(paths, depth, DIRECTION), self._points(paths, depth, CHOICE)
        onward, pdf = np.empty((n, 3)), np.empty(n)
        fate = np.empty(n, dtype=np.uint8)
        hits, lobes = shading.hits, self.context.scene.lobes

        scatter(
            lobes,
            shading.material,
            shading.colors,
            hits.normal,
            shading.directions,
            shading.geometric,
            xi,
            choice,
            paths.media,
            may_spread,
            not is_last,
            roulette,
            onward,
            paths.throughput,
            pdf,
            fate,
        )
        ledger = self.context.ledger
        counts = np.bincount(fate, minlength=SPECULAR + 1)
        ledger.rays["scattered"] += int(counts[SCATTERED])
        ledger.rays["mirrored or refracted"] += int(counts[SPECULAR])
        ledger.ended["absorbed or by roulette"] += int(counts[ABSORBED])
        ledger.ended["left the scene or met a lamp"] += int(counts[LEFT])
        if counts[STOPPED]:
            self._lose(paths.throughput[fate == STOPPED])
        out = Paths(*(np.empty_like(column) for column in paths))
        n_out = pack_paths(paths, fate, SCATTERED, hits.position, hits.object_id, onward, pdf, out)
        return Paths(*(column[:n_out] for column in out))

    def _lose(self, throughput: FloatArray) -> None:
        """Count paths that the limit ends, and what they might have carried."""
        if len(throughput):
            self.context.ledger.ended["at max_depth"] += len(throughput)
            self.context.ledger.lost_weight += float(largest_channel(throughput).sum())
