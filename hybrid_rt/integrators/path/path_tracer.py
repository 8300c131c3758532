"""Path tracing with next-event estimation, BSDF sampling and light subpaths, combined by MIS.

Kajiya, "The rendering equation", SIGGRAPH 1986; light that both next-event estimation and BSDF
sampling find is weighted by the power heuristic (Veach and Guibas, "Optimally combining sampling
techniques for Monte Carlo rendering", SIGGRAPH 1995). Each camera ray becomes one path, which
may divide at glass. The first hits of a batch are found together, then each path is followed to its end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import (
    NO_CONNECTION,
    NONE_SMOOTH,
    SurfaceLight,
    shadow_rays,
)
from hybrid_rt.integrators.integrator import (
    FIRST_PATH_DIMENSION,
    PIXEL_BITS,
    CameraBlock,
    Integrator,
)
from hybrid_rt.integrators.kernels.branches import MOST_SPLITS
from hybrid_rt.integrators.kernels.compaction import Paths, add_to_pixels
from hybrid_rt.integrators.kernels.followed_paths import Arrival, Scratch, follow_paths
from hybrid_rt.integrators.kernels.light_paths import LightVertices
from hybrid_rt.integrators.kernels.path_vertex import (
    FEW_SHADOW_RAYS,
    MOST_SHADOW_RAYS,
    Block,
    Rules,
    Tally,
    World,
)
from hybrid_rt.integrators.kernels.vertex_points import (
    PER_STEP,
    RUN_ACROSS,
    RUN_ALONG,
    TO_LIGHT,
    new_run_points,
)
from hybrid_rt.integrators.kernels.ways import ALL_LIGHTS, NO_LIGHTS, SKY_ALONE
from hybrid_rt.integrators.light_points import new_light_points
from hybrid_rt.integrators.media.contacts import NO_SECOND
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.path.balls import balls_of
from hybrid_rt.integrators.path.boxes import boxes_of
from hybrid_rt.integrators.path.camera_paths import glass_alone, leaving_camera, new_paths
from hybrid_rt.integrators.path.light_paths import (
    PILOT_PATHS,
    LightOfPasses,
    LightPathTracer,
    LightVertexPasses,
    candidates_of,
    diffuse_materials,
    finds_all_light,
    new_light_vertices,
    packed,
)
from hybrid_rt.integrators.path.mirrors import mirrors_of
from hybrid_rt.integrators.path.path_state import (
    columns_of,
    count_single_rays,
    count_vertices,
    new_doubtful,
    new_tally,
    new_vertex,
)
from hybrid_rt.integrators.path.pilot import (
    CLEARLY_LESS,
    FAR_LESS,
    FEWEST_PIXELS,
    PILOT_LIGHT_PATHS,
    work_times_noise,
)
from hybrid_rt.integrators.rows import joined, rows_of
from hybrid_rt.intersection.kind import new_record
from hybrid_rt.intersection.single_rays import no_single_rays
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.sensor.passes import pass_of
from hybrid_rt.shading.kernels.emitter import BOTH, DIRECTION_ONLY, LIGHT_ONLY
from hybrid_rt.shading.kernels.lobes.register import DELTA, EVERY

Kernel = Callable[..., tuple[int, int, int]]

STRATEGIES = {"both": BOTH, "lights": LIGHT_ONLY, "directions": DIRECTION_ONLY}
# Skies less uneven than this are found well enough by chance.
LEAST_UNEVENNESS = 2.0
# Fewer useful light subpaths are too noisy, if the ways that they find can be computed. Behind a pane
# with a lamp of half a degree, of which 1.7 % are, the error of the mean is 140 times that of the ways.
FEW_VERTICES = 0.02
# Ways to the sky that contribute less than this part of its mean radiance are left to roulette.
RR_SHARE = 0.1
NO_NUMBER = np.zeros(0, dtype=np.int64)


class PathTracer(Integrator):
    """See the module; `Integrator` for what it offers."""

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self._options: PathOptions = context.options or PathOptions()
        strategy = STRATEGIES[self._options.strategy]
        self._light = SurfaceLight(context, strategy, EVERY)
        lights, plan = context.scene.lights, context.plan
        asks = self._options.samples_lights and bool(lights.chance.any())
        self._samples_lights = asks and (plan["light samples"] or plan["sky samples"])
        self._split_glass = glass_alone(context.scene)
        self._diffuse_only = diffuse_materials(context.scene.lobes)
        self._lamps: LightPathTracer | None = None
        keeps_all = self._may_connect_all()
        # One mirror, lens or narrow surface, and a surface on either end of the join, at least; or light of
        # surfaces near lamps.
        if plan["light paths"] or keeps_all:
            self._lamps = LightPathTracer(
                context,
                self._light,
                self._contacts,
                self._media_around_camera,
                self._options,
                keeps_all,
            )
        scene = context.scene
        # Where rays cannot be traced one by one, paths advance together.
        single = context.tracer.single_rays() if plan["single rays"] else None
        self._follows = single is not None
        if plan["single rays"] and not self._follows:
            why = f'accuracy="{context.tracer.accuracy}" takes hits from triangles, by batches'
            plan.decide("single rays", False, "", why)
        self._single = single or no_single_rays()
        self._nowhere = Arrival(
            columns_of(new_record(0)), NO_SECOND, new_light_points(0), NO_CONNECTION
        )
        self._vertex = new_vertex(
            self._single.ray.record,
            self._light.n_slots,
            smooth=bool(scene.vertex_normals),
            contacts=self._contacts is not None,
            shining=bool(scene.shining),
            rough=self._light.rough_glass_of.size > 0,
        )
        self._samples_sky, self._rr_radiance = self._sky_to_sample()
        self._samples_lamps = False  # from all surfaces, for want of useful light paths
        sends = self._lamps is not None
        self._balls = balls_of(scene, wanted=self._samples_sky or sends)
        self._boxes = boxes_of(scene, wanted=self._samples_sky or sends)
        # Where the sky is sampled as well, a surface that is a mirror in part would be sampled twice.
        self._mirrors = mirrors_of(scene, alone=self._samples_sky, wanted=sends)
        self._plan_ways()
        self._scratch = self._new_scratch()
        self._doubtful = new_doubtful(context.max_depth if self._follows else 0)
        self.take(self._light_of(0, *self._no_light_vertices()))
        self._vertices_per_path = 0.0

    @property
    def most_at_once(self) -> int:
        """See `Integrator.most_at_once`."""
        return super().most_at_once if self._lamps is None else self._lamps.most_at_once

    def begin(self) -> None:
        """Estimate how useful light subpaths are."""
        if self._lamps is not None:
            self._vertices_per_path = self._lamps.estimate_vertices_per_path()
            if self._lamps.keeps_all:
                self._choose_connections(self._lamps)
            if self._vertices_per_path == 0.0 or (
                self._vertices_per_path < FEW_VERTICES and self._throws_by_one_pane()
            ):
                number = round(self._vertices_per_path * PILOT_PATHS) or "none"
                why = f"{number} of {PILOT_PATHS} light paths came to a surface that spreads light"
                self._leave_out_light_paths()
                if self.context.plan["light paths"]:
                    self.context.plan.decide("light paths", False, "", why)

    def _throws_by_one_pane(self) -> bool:
        """Tell whether all ways by mirrors and glass are by one box, and are computed."""
        scene = self.context.scene
        throws = np.flatnonzero(scene.materials_with(DELTA)[scene.material_of])
        return throws.size == 1 and bool(self._boxes.of_surface[throws[0]] >= 0)

    def _choose_connections(self, lamps: LightPathTracer) -> None:
        """Leave the light between diffuse surfaces to connections where that takes less work."""
        n_paths = lamps.n_paths
        connected = (True, lamps.min_distance, self._vertices_per_path)
        lamps.keeps_all = False
        followed = (False, np.inf, lamps.estimate_vertices_per_path())
        lamps.n_paths = PILOT_LIGHT_PATHS
        work = []
        for lamps.keeps_all, lamps.min_distance, self._vertices_per_path in (connected, followed):
            work.append(work_times_noise(self, n_paths))
        leads = self.context.plan["light paths"]
        if work[0] < (CLEARLY_LESS if leads else FAR_LESS) * work[1]:
            lamps.keeps_all, lamps.min_distance, self._vertices_per_path = connected
            why = "paths from lamps light every surface"
            why += ", and find what mirrors and glass throw" if leads else ""
            self.context.plan.decide("light paths", True, why, "")
        lamps.n_paths = n_paths

    def follow(self, first: Integrator) -> None:
        """Copy what `begin` estimated."""
        assert isinstance(first, PathTracer)
        self._vertices_per_path = first._vertices_per_path
        if self._lamps is None:
            return
        if first._lamps is None:
            self._leave_out_light_paths()
        else:
            self._lamps.min_distance = first._lamps.min_distance
            self._lamps.keeps_all = first._lamps.keeps_all

    def _may_connect_all(self) -> bool:
        """Tell whether connections might find all light between diffuse surfaces."""
        scene, allows = self.context.scene, not self._options.without_light_paths
        is_worth_a_pilot = scene.camera.width * scene.camera.height >= FEWEST_PIXELS
        has_both = bool(scene.lights.emit.any() and self._diffuse_only.any())
        return allows and is_worth_a_pilot and has_both and finds_all_light(scene)

    def _leave_out_light_paths(self) -> None:
        """Compute the ways to lamps from all surfaces instead."""
        self._lamps, self._samples_lamps = None, self._samples_lights
        # A surface that is a mirror in part would be sampled twice.
        self._mirrors = mirrors_of(self.context.scene, alone=True)
        self._plan_ways()
        self._scratch = self._new_scratch()

    def _sky_to_sample(self) -> tuple[bool, float]:
        """Tell whether ways by mirrors and glass to the sky may be worth their time; and see `Rules.rr_radiance`."""
        is_sampled = self._samples_lights and self.context.plan["sky samples"]
        if not is_sampled or self._options.strategy != "both":
            return False, 0.0
        sky = self.context.scene.brightness
        return sky.unevenness >= LEAST_UNEVENNESS, RR_SHARE * sky.mean

    @property
    def _samples_specular(self) -> bool:
        n_bodies = self._balls.radius.size + self._boxes.lobe.size + self._mirrors.surface.size
        return n_bodies > 0 and (
            self._samples_sky or self._samples_lamps or self._lamps is not None
        )

    def _sampled_everywhere(self) -> int:
        """See `Rules.specular_lights`."""
        if self._samples_specular and self._samples_lamps:
            return ALL_LIGHTS
        return SKY_ALONE if self._samples_specular and self._samples_sky else NO_LIGHTS

    def _new_paths(self, n: int) -> Paths:
        return new_paths(
            n, self._camera_media.size, self._lamps is not None, self._samples_specular
        )

    def _new_scratch(self) -> Scratch:
        return Scratch(
            self._single.ray,
            self._new_paths(1),
            self._new_paths(1),
            self._new_paths(MOST_SPLITS),
            np.empty(MOST_SPLITS, dtype=np.int64),
            self._vertex,
            new_run_points(RUN_ALONG if self._follows else RUN_ACROSS),
        )

    def _plan_ways(self) -> None:
        balls, boxes = self._balls.radius.size, self._boxes.lobe.size
        mirrors = self._mirrors.surface.size
        ends = []
        if self._lamps is not None:
            ends.append("to lamps, where camera paths come by way of mirrors and glass")
        if self._samples_lamps:
            ends.append("to lamps")
        if self._samples_sky:
            ends.append("to the sky")
        self.context.plan.decide(
            "ways by mirrors and glass",
            self._samples_specular,
            f"balls of glass or mirrors ({balls}), boxes of glass ({boxes}) and flat mirrors "
            f"({mirrors}): ways by these are computed {' and '.join(ends)}",
            "no sphere is of one mirror or of clear glass, no box of clear glass, and no rectangle a mirror "
            "by way of which a lamp may be reached"
            if ends
            else "no light paths, whose gaps they fill, and no sky that is bright in few directions",
        )

    @property
    def parts(self) -> int:
        """In how many parts the light subpaths of a pass are traced."""
        return 1 if self._lamps is None else self._lamps.parts

    def prepare(self, passes: range, part: int) -> LightVertexPasses | None:
        """Trace a part of the light subpaths of some passes."""
        if self._lamps is None:
            return None
        with self.context.ledger.stage("light paths"):
            return self._lamps.trace(passes, part)

    def gather(
        self, passes: range, prepared: Sequence[LightVertexPasses | None]
    ) -> LightOfPasses | None:
        """Put the light vertices of the passes that are traced next together."""
        found = [part for part in prepared if part is not None]
        if not found:
            return None
        sizes = np.zeros(len(passes), dtype=np.int64)
        for part in found:
            first = part.passes.start - passes.start
            sizes[first : first + len(part.passes)] += np.diff(part.offsets)
        first_of_pass = np.concatenate([[0], np.cumsum(sizes)])
        return self._light_of(passes.start, joined([part.points for part in found]), first_of_pass)

    def take(self, gathered: LightOfPasses | None) -> None:
        """Store the light vertices of the passes that are traced next."""
        if gathered is not None:
            self._light_vertices = gathered

    def _light_of(
        self, first_pass: int, points: LightVertices, first_of_pass: IntArray
    ) -> LightOfPasses:
        connected = points, first_of_pass
        if self._lamps is None or self._lamps.min_distance == np.inf:
            connected = self._no_light_vertices()
        return LightOfPasses(
            first_pass,
            packed(points),
            first_of_pass,
            *candidates_of(*connected, self._diffuse_only),
        )

    def _no_light_vertices(self) -> tuple[LightVertices, IntArray]:
        return new_light_vertices(0, self._light.n_slots), np.zeros(1, dtype=np.int64)

    def add_prepared(self, prepared: LightVertexPasses | None, images: FloatArray) -> None:
        """Add the splats of the light vertices."""
        if prepared is None:
            return
        for image, (first, stop) in zip(images, pairwise(prepared.first_splat), strict=True):
            add_to_pixels(prepared.pixel[first:stop], prepared.value[first:stop], image)

    def _radiance(self, block: CameraBlock) -> FloatArray:
        """Follow the paths of a block."""
        radiance = np.zeros_like(block.directions)
        tally = new_tally(self.context.scene.lobes.kind.size)
        kernel = partial(follow_paths, self._world(), self._rules())
        if self._follows:
            self._follow(kernel, self._block(block), radiance, tally)
        else:
            self._advance(kernel, block, radiance, tally)
        count_vertices(tally, self.context.ledger)
        return radiance

    def _follow(self, kernel: Kernel, rays: Block, radiance: FloatArray, tally: Tally) -> None:
        """Follow each path to its end."""
        arrival, end = self._nowhere, 0
        # Where nothing is called, the kernel finds first hits as fast.
        if not self._single.calls_nothing:
            hits, _ = self._first_hits(rays.origins, rays.directions, None)
            arrival = arrival._replace(hits=columns_of(hits))
        paths, shadows = self._new_paths(0), shadow_rays(MOST_SHADOW_RAYS)
        with self.context.ledger.stage("paths"):
            while end < rays.pixel.size:
                _, _, end = kernel(
                    0, rays, paths, end, arrival, self._single.tables, self._scratch, radiance,
                    shadows, paths, self._doubtful, tally,
                )  # fmt: skip
                count_single_rays(tally, self._doubtful, self._single, self.context)

    def _advance(
        self, kernel: Kernel, block: CameraBlock, radiance: FloatArray, tally: Tally
    ) -> None:
        """Advance all paths together, from vertex to vertex."""
        rays = self._block(block)
        paths = leaving_camera(
            block, self._camera_media, self._lamps is not None, self._samples_specular
        )
        n = paths.camera_ray.size
        if (self._split_glass != NOTHING).any():
            n *= 1 + MOST_SPLITS
        # Filled in turn: pages that are new each time would cost more than what is written.
        out, spare = (self._new_paths(n) for _ in range(2))
        most = MOST_SHADOW_RAYS if self._samples_specular else FEW_SHADOW_RAYS
        shadows = shadow_rays(most * n)
        for depth in range(self.context.max_depth + 2):
            # --- where the rays arrive
            source = NamedPoints(paths.source_id, paths.origins) if depth else None
            hits, second = self._first_hits(paths.origins, paths.directions, source)
            with self.context.ledger.stage("shade"):
                # --- light they ran into; light we reach for; where they go next, and which stop
                n_rays, n_out, _ = kernel(
                    depth, rays, paths, 0, self._shaded(paths, hits, second, depth),
                    self._single.tables, self._scratch, radiance, shadows, out, self._doubtful, tally,
                )  # fmt: skip
                self._light.add_unblocked(shadows, n_rays, radiance)
            if n_out == 0:
                break
            paths = rows_of(out, slice(n_out))
            out, spare = spare, out

    def _shaded(self, paths: Paths, hits: HitRecord, second: IntArray, depth: int) -> Arrival:
        points = new_light_points(0)
        if self._samples_lights and self.context.scene.shining:
            dimension = FIRST_PATH_DIMENSION + depth * PER_STEP + TO_LIGHT
            xi = self.context.sampler.points(paths.pixel, dimension, paths.sample)
            points = self._light.points_of_one(hits, xi)
        return Arrival(
            columns_of(hits),
            second,
            points,
            self._light.pdf_area_met(hits, paths.origins, paths.pdf, paths.connection_pdf),
        )

    def _block(self, block: CameraBlock) -> Block:
        camera_pdf, number = NO_CONNECTION, NO_NUMBER
        if self._lamps is not None:
            camera_pdf = self.context.scene.camera.direction_pdf(block.directions)
            passes = pass_of(block.pixel >> PIXEL_BITS, block.sample)
            number = passes.astype(np.int64) - self._light_vertices.first_pass
        return Block(
            block.pixel, block.sample, block.origins, block.directions, self._camera_media,
            camera_pdf, number,
        )  # fmt: skip

    def _world(self) -> World:
        scene = self.context.scene
        return World(
            material_of=scene.material_of,
            light_of=scene.light_of,
            surface_of_light=scene.surface_of_light,
            lobes=scene.lobes,
            color_factor=scene.color_factor,
            glass_of=scene.glass_of,
            split_glass_of=self._split_glass,
            rough_glass_of=self._light.rough_glass_of,
            textures=scene.textures,
            meshes=self._light.meshes,
            lights=scene.lights,
            light_cdf=np.cumsum(scene.lights.chance),
            sky=scene.sky,
            diffuse_only=self._diffuse_only,
            narrow=scene.narrow_materials,
            is_smooth=NONE_SMOOTH if self._lamps is None else self._lamps.is_smooth,
            light_vertices=self._light_vertices.points,
            candidates=self._light_vertices.candidates,
            first_of_pass=self._light_vertices.first_of_pass,
            first_group=self._light_vertices.first_group,
            balls=self._balls,
            boxes=self._boxes,
            mirrors=self._mirrors,
        )

    def _rules(self) -> Rules:
        context = self.context
        return Rules(
            seed=context.sampler.seed,
            first_dimension=np.uint64(FIRST_PATH_DIMENSION),
            follows=self._follows,
            strategy=STRATEGIES[self._options.strategy],
            samples_lights=self._samples_lights,
            has_sky=context.scene.environment is not None,
            has_light_paths=self._lamps is not None,
            specular_lights=self._sampled_everywhere(),
            rr_radiance=self._rr_radiance,
            n_light_paths=1.0 if self._lamps is None else float(self._lamps.n_paths),
            min_distance=np.inf if self._lamps is None else self._lamps.min_distance,
            vertices_per_path=self._vertices_per_path,
            max_depth=context.max_depth,
            roulette_depth=self._options.roulette_depth,
            survival=self._options.survival,
            # The last step may still run into light, so that both ways of finding it agree; but a
            # mirrored or refracted ray would be one direction more.
            samples_last_vertex=self._options.strategy != "lights",
        )
