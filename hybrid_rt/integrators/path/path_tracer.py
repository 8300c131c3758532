"""Path tracing with next-event estimation, BSDF sampling and light subpaths, combined by MIS.

Kajiya, "The rendering equation", SIGGRAPH 1986; light that both next-event estimation and BSDF
sampling find is weighted by the power heuristic (Veach and Guibas, "Optimally combining sampling
techniques for Monte Carlo rendering", SIGGRAPH 1995). Each camera ray becomes one path; a batch of
paths advances together, one bounce at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import (
    NONE_SMOOTH,
    Shading,
    SurfaceLight,
    largest_channel,
    shadow_rays,
)
from hybrid_rt.integrators.integrator import (
    FIRST_PATH_DIMENSION,
    PIXEL_BITS,
    CameraBlock,
    Integrator,
)
from hybrid_rt.integrators.kernels.compaction import Paths, add_products, add_to_pixels, pack_paths
from hybrid_rt.integrators.kernels.connections import CONNECT_CHANCE, connect_to_light_vertices
from hybrid_rt.integrators.media.absorption import absorb, media_around_camera
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.path.camera_paths import leaving_camera
from hybrid_rt.integrators.path.light_paths import (
    PILOT_PATHS,
    LightPathTracer,
    LightVertexPasses,
    joined,
)
from hybrid_rt.sensor.passes import pass_of
from hybrid_rt.shading.kernels.emitter import BOTH, DIRECTION_ONLY, LIGHT_ONLY
from hybrid_rt.shading.kernels.lobes.register import EVERY
from hybrid_rt.shading.kernels.scatter import (
    ABSORBED,
    LEFT,
    SCATTERED,
    SPECULAR,
    STOPPED,
    Rivals,
    scatter,
)

STRATEGIES = {"both": BOTH, "lights": LIGHT_ONLY, "directions": DIRECTION_ONLY}

# What the low-discrepancy points of one step are for.
TO_LIGHT, DIRECTION, CHOICE, CONNECT, PER_STEP = 0, 1, 2, 3, 4


class PathTracer(Integrator):
    """See the module; `Integrator` for what it offers.

    Parameters
    ----------
    context : RenderContext
    """

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self._options: PathOptions = context.options or PathOptions()
        strategy = STRATEGIES[self._options.strategy]
        self._light = SurfaceLight(context, strategy, EVERY)
        lights, plan = context.scene.lights, context.plan
        asks = strategy != DIRECTION_ONLY and bool(lights.chance.any())
        self._samples_lights = asks and (plan["light samples"] or plan["sky samples"])
        self._camera_media = media_around_camera(context, self._contacts)
        self._lamps: LightPathTracer | None = None
        # One mirror or lens, and a surface on either end of the join, at least.
        if plan["light paths"]:
            self._lamps = LightPathTracer(
                context, self._light, self._contacts, self._camera_media, self._options.light_paths
            )
        # Read only where paths from lights are weighed against those of the camera.
        self._is_smooth = NONE_SMOOTH if self._lamps is None else self._lamps.is_smooth
        self._of_use = 0.0

    def begin(self) -> None:
        """Estimate the number of light vertices per light subpath."""
        if self._lamps is not None:
            self._of_use = self._lamps.share_of_use()
            if self._of_use == 0.0:
                self._lamps = None
                why = f"none of {PILOT_PATHS} light paths came to a surface that spreads light"
                self.context.plan.decide("light paths", False, "", why)

    def follow(self, first: Integrator) -> None:
        """Copy what `begin` estimated."""
        assert isinstance(first, PathTracer)
        self._of_use = first._of_use
        if first._lamps is None:
            self._lamps = None

    def prepare(self, passes: range) -> LightVertexPasses | None:
        """Trace the light subpaths of some passes."""
        if self._lamps is None:
            return None
        with self.context.ledger.stage("light paths"):
            return self._lamps.trace(passes)

    def take(self, passes: range, prepared: Sequence[LightVertexPasses | None]) -> None:
        """Store the light vertices of the passes that are traced next."""
        runs = [run for run in prepared if run is not None]
        if runs:
            sizes = np.concatenate([np.diff(run.offsets) for run in runs])
            self._first_pass = passes.start
            self._first_of_pass = np.concatenate([[0], np.cumsum(sizes)])
            self._lit = joined([run.points for run in runs])

    def add_prepared(self, prepared: LightVertexPasses | None, images: FloatArray) -> None:
        """Add the splats of the light vertices."""
        if prepared is None:
            return
        for image, (first, stop) in zip(images, pairwise(prepared.offsets), strict=True):
            add_to_pixels(prepared.pixel[first:stop], prepared.value[first:stop], image)

    def _radiance(self, block: CameraBlock) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        paths = leaving_camera(block, self._camera_media, self._lamps is not None)
        for depth in range(self.context.max_depth + 2):
            # --- where the rays arrive
            source = NamedPoints(paths.source_id, paths.origins) if depth else None
            hits, second = self._first_hits(paths.origins, paths.directions, source)
            with self.context.ledger.stage("shade"):
                material = self._light.material(hits)
                # --- what the way there absorbed
                absorb(self.context, paths.media, material, hits, second, paths.throughput)
                # --- light they ran into
                arriving = self._light.arriving(
                    hits, paths.origins, paths.directions, paths.pdf, paths.rival, paths.media
                )
                add_products(paths.camera_ray, paths.throughput, arriving, radiance)
                if depth > self.context.max_depth:
                    self._lose(paths.throughput[material >= 0])
                    break
                shading = self._light.shading(hits, paths.directions, material, paths.media, second)
                # --- light we reach for
                xi = self._points(paths, depth)
                if self._samples_lights:
                    self._light.from_one(
                        shading,
                        paths.camera_ray,
                        paths.throughput,
                        paths.media,
                        xi[TO_LIGHT],
                        radiance,
                    )
                # --- light that mirrors and glass throw
                if self._connects(depth):
                    self._connect(paths, shading, depth, xi[CONNECT], radiance)
                # --- where they go next, and which ones stop
                paths = self._onward(paths, shading, second, depth, xi)
            if paths.camera_ray.size == 0:
                break
        return radiance

    def _points(self, paths: Paths, depth: int) -> FloatArray:
        """Return the points of one step, (uses, n, 2); see `TO_LIGHT` and its like."""
        dimension = FIRST_PATH_DIMENSION + depth * PER_STEP
        n_uses = PER_STEP if self._connects(depth) else CONNECT
        return self.context.sampler.several(paths.pixel, dimension, paths.sample, n_uses)

    def _connects(self, depth: int) -> bool:
        # Directions here, at the light vertex, and at one mirror or lens at least.
        return self._lamps is not None and depth + 3 <= self.context.max_depth

    def _connect(
        self, paths: Paths, shading: Shading, depth: int, xi: FloatArray, radiance: FloatArray
    ) -> None:
        """Add what comes from light vertices: one is asked by one hit in a few."""
        hits, n = shading.hits, paths.camera_ray.size
        rays = shadow_rays(n)
        number = pass_of(paths.pixel >> PIXEL_BITS, paths.sample).astype(np.int64)
        n_rays = connect_to_light_vertices(
            paths, self.context.scene.lobes, shading.vertices, shading.beyond, hits.object_id, self._lit, self._first_of_pass, number - self._first_pass, self._of_use, xi,
            self.context.max_depth - depth - 2, rays,
        )  # fmt: skip
        self._light.add_unblocked(rays, n_rays, radiance)

    def _before(self, paths: Paths, depth: int) -> FloatArray:
        """Return the densities of directions over how often light paths lead to where they end."""
        density: FloatArray = paths.pdf
        if self._lamps is None:
            return density
        if depth == 0:
            of_pixel: FloatArray = self.context.scene.camera.direction_pdf(paths.directions)
            of_pixel /= self._lamps.n_paths
            return of_pixel
        # Of the light vertices of a pass, `_of_use` a path, one is connected to, with a probability of
        # CONNECT_CHANCE.
        return density * (self._of_use / CONNECT_CHANCE)

    def _onward(
        self, paths: Paths, shading: Shading, second: IntArray, depth: int, xi: FloatArray
    ) -> Paths:
        """Choose where each path goes; return those that go on."""
        n = paths.camera_ray.size
        is_last = depth == self.context.max_depth
        # The last step may still run into light, so that both ways of finding it agree; but a
        # mirrored or refracted ray would be one direction more.
        may_spread = not is_last or self._options.strategy != "lights"
        roulette = self._options.survival if depth >= self._options.roulette_depth else 0.0
        onward, pdf = np.empty((n, 3)), np.empty(n)
        fate = np.empty(n, dtype=np.uint8)
        hits = shading.hits
        scatter(
            self.context.scene.lobes,
            shading.vertices,
            xi[DIRECTION],
            xi[CHOICE],
            paths.media,
            second,
            may_spread,
            not is_last,
            roulette,
            Rivals(
                hits.t, self._before(paths, depth), self._is_smooth, hits.object_id, paths.rival
            ),
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
