"""Progressive photon mapping by independent passes.

Hachisuka, Ogaki and Jensen, "Progressive photon mapping", ToG 27(5), 2008; in the form of Knaus and
Zwicker, "Progressive photon mapping: a probabilistic approach", ToG 30(3), 2011, in which passes
share nothing: each shoots photons of its own and looks at them with one ray per pixel, the discs
of later passes are smaller, and the mean of the passes loses both noise and blur.

Camera rays are followed through mirrors, metals and glass. Wherever one meets a surface that
spreads light widely, lights are asked directly there and photons for all the light that comes by
way of other surfaces. A photon is stored wherever it arrives at such a surface, but for its first
flight: straight light is found by shadow rays, with less noise and no blur.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from queue import SimpleQueue
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.crew import Crew
from hybrid_rt.integrators.gathering import PhotonField, Radii, shrunk
from hybrid_rt.integrators.integrator import (
    FIRST_PATH_DIMENSION,
    CameraBlock,
    Integrator,
    RenderContext,
)
from hybrid_rt.integrators.options import PPMOptions
from hybrid_rt.integrators.shooting import (
    PHOTON_DIMENSION,
    PILOT_DIMENSION,
    Balance,
    Group,
    Shooter,
    blocks_of,
    joined,
)
from hybrid_rt.integrators.start_media import media_at
from hybrid_rt.integrators.surface_light import (
    Shading,
    SurfaceLight,
    largest_channel,
    named_points,
)
from hybrid_rt.kernels.gather import segments_to_photons
from hybrid_rt.kernels.light import BOTH, LIGHT_ONLY
from hybrid_rt.kernels.lobes import DIELECTRIC, METAL, PHONG
from hybrid_rt.kernels.media import STACK, cross_media
from hybrid_rt.kernels.pack import Paths, add_products, pack_paths
from hybrid_rt.kernels.photons import MET_SPECULAR, Photons
from hybrid_rt.kernels.scatter import ABSORBED, LEFT, SCATTERED, SPECULAR, STOPPED, scatter
from hybrid_rt.records import FloatArray, HitRecord, IntArray

# Camera rays that one thread follows and gathers for at a time. The order of the sums over photons
# hangs on it, so it is the same for any number of threads.
CAMERA_RAYS_AT_ONCE = 2**13
# The photons that radii are found by, at most.
PILOT_PHOTONS = 100_000

# What the low-discrepancy points of one step are for.
TO_LIGHT, TO_LIGHT_METAL, DIRECTION, CHOICE, TO_PHOTON, PER_STEP = 0, 1, 2, 3, 4, 5


class ProgressivePhotons(Integrator):
    """See the module; `Integrator` for what it offers.

    ``field`` holds the photons of the pass that is being looked at.
    """

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self.options: PPMOptions = context.options or PPMOptions()
        self.shooter = Shooter(context)
        self.field: PhotonField | None = None
        self.n_gathered = 0
        self.n_points = 0
        self.n_without = 0
        lights, plan, lobes = context.scene.lights, context.plan, context.scene.lobes
        # Straight light is not asked for by a further direction here: asking lights counts whole.
        self._wide = SurfaceLight(context, LIGHT_ONLY, PHONG)
        self._light = SurfaceLight(context, BOTH, DIELECTRIC)
        asks = bool(lights.chance.any())
        self._asks_lights = asks and (plan["light samples"] or plan["sky samples"])
        self._asks_for_metal = self._asks_lights and bool((lobes.kind == METAL).any())
        self._camera_media = media_at(context) if plan["medium stack"] else []
        self._is_wide = _slots(context, lambda kind: kind <= PHONG)
        self._follows = _slots(context, lambda kind: kind > PHONG).any(axis=1)

    def _radiance(self, block: CameraBlock) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        paths = self._leaving_camera(block)
        for depth in range(self.context.max_depth + 1):
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
                shading = self._light.shading(hits, paths.directions, material)
                # --- surfaces that spread light widely: lights asked, photons counted
                wide = np.flatnonzero(self.shooter.gathers[material])
                if wide.size:
                    self._gather(paths, shading, wide, depth, radiance)
                # --- where they go next by mirrors, metals and glass, and which ones stop
                paths = self._onward(paths, shading, depth, radiance)
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
        if self.context.plan["medium stack"]:
            cross_media(
                paths.media, scene.lobes, scene.glass_of, material, hits.front_face, hits.t,
                paths.throughput,
            )  # fmt: skip

    def _gather(
        self, paths: Paths, shading: Shading, rows: Any, depth: int, radiance: FloatArray
    ) -> None:
        """Add straight light and that of photons at some of the hits."""
        there = Paths(*(column[rows] for column in paths))
        wide = _rows_of(shading, rows, self._is_wide)
        if self._asks_lights:
            xi = self._points(there, depth, TO_LIGHT)
            self._wide.from_one(wide, there.camera_ray, there.throughput, xi, radiance)
        if self.field is None:
            return
        with self.context.ledger.stage("gather"):
            xi = np.ascontiguousarray(self._points(there, depth, TO_PHOTON)[:, 0])
            value, near, chosen = self.field.radiance(wide, xi)
        self._leave_out_hidden(wide, value, chosen)
        add_products(there.camera_ray, there.throughput, value, radiance)
        self.n_points += near.size
        self.n_gathered += int(near.sum())
        self.n_without += int(np.count_nonzero(near == 0))

    def _leave_out_hidden(
        self, shading: Shading, value: FloatArray, chosen: NDArray[np.int64]
    ) -> None:
        """Take away light of photons behind walls.

        Whether one photon lies behind a wall, chosen by its part in the sum, decides for the whole
        sum: right in the mean, and without noise where all or none of them do.
        """
        assert self.field is not None
        rows = np.flatnonzero(chosen >= 0)
        if rows.size == 0:
            return
        hits, photons = shading.hits, self.field.photons
        normal = shading.geometric if shading.geometric.size else hits.normal
        origin, way = np.empty((rows.size, 3)), np.empty((rows.size, 3))
        segments_to_photons(
            rows, hits.position, normal, shading.directions, chosen, photons.position,
            photons.normal, origin, way,
        )  # fmt: skip
        apart = np.flatnonzero(way.any(axis=1))
        self.context.ledger.rays["to photons"] += apart.size
        with self.context.ledger.stage("photons hidden"):
            blocked = self.context.tracer.occluded(origin[apart], way[apart], 1.0)
        value[rows[apart[blocked]]] = 0.0

    def _onward(self, paths: Paths, shading: Shading, depth: int, radiance: FloatArray) -> Paths:
        """Choose where each path goes that need not stop; return those that go on."""
        ledger = self.context.ledger
        ledger.ended["left the scene or met a lamp"] += int(np.count_nonzero(shading.material < 0))
        rows = np.flatnonzero(self._follows[shading.material])
        ledger.ended["met surfaces that gather"] += int(
            np.count_nonzero(shading.material >= 0) - rows.size
        )
        paths = Paths(*(column[rows] for column in paths))
        shading = _rows_of(shading, rows, ~self._is_wide)
        n = rows.size
        if n == 0:
            return paths
        if self._asks_for_metal:
            xi = self._points(paths, depth, TO_LIGHT_METAL)
            self._light.from_one(shading, paths.camera_ray, paths.throughput, xi, radiance)
        onward, pdf = np.empty((n, 3)), np.empty(n)
        fate = np.empty(n, dtype=np.uint8)
        goes_on = depth < self.context.max_depth
        scatter(
            self.context.scene.lobes, shading.material, shading.colors, shading.hits.normal,
            shading.directions, shading.geometric, self._points(paths, depth, DIRECTION),
            self._points(paths, depth, CHOICE), paths.media, goes_on, goes_on,
            1.0 if depth else 0.0, onward, paths.throughput, pdf, fate,
        )  # fmt: skip
        counts = np.bincount(fate, minlength=SPECULAR + 1)
        ledger.rays["mirrored or refracted"] += int(counts[SCATTERED] + counts[SPECULAR])
        ledger.ended["absorbed or by roulette"] += int(counts[ABSORBED] + counts[LEFT])
        if counts[STOPPED]:
            ledger.ended["at max_depth"] += int(counts[STOPPED])
            ledger.lost_weight += float(largest_channel(paths.throughput[fate == STOPPED]).sum())
        out = Paths(*(np.empty_like(column) for column in paths))
        hits = shading.hits
        n_out = pack_paths(paths, fate, SCATTERED, hits.position, hits.object_id, onward, pdf, out)
        return Paths(*(column[:n_out] for column in out))


class PhotonCrew(Crew):
    """Integrators that shoot the photons of a pass together, then look at them together."""

    def __init__(
        self, context: RenderContext, threads: int, make: Callable[[RenderContext], Any]
    ) -> None:
        super().__init__(context, threads, make)
        self._threads = threads
        self._radii: Radii | None = None
        self._last_radii: list[float] = []

    @property
    def _tracers(self) -> list[ProgressivePhotons]:
        return cast(list[ProgressivePhotons], self._integrators)

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Iterator[FloatArray]:
        """Yield the radiance of one sample per pixel and one set of photons, for each pass."""
        camera = self.context.scene.camera
        for k, number in enumerate(passes):
            if self.context.plan["photons"]:
                self._look_at(number)
            done = k * camera.height * camera.width

            def heard(n: int, done: int = done) -> None:
                if on_rays is not None:
                    on_rays(done + n)

            yield from super().render_passes(range(number, number + 1), heard)

    def _block_size(self, n: int) -> int:
        del n
        return CAMERA_RAYS_AT_ONCE

    def _look_at(self, pass_number: int) -> None:
        """Shoot the photons of a pass and show them to all integrators."""
        ledger, options = self.context.ledger, self._tracers[0].options
        if self._radii is None:
            self._radii = self._first_radii()
        photons = self._shot(options.photons_per_pass, pass_number, PHOTON_DIMENSION)
        with ledger.stage("photon tree"):
            shrink = float(shrunk(np.ones(1), pass_number, options.alpha)[0])
            field = PhotonField(photons, self._radii, shrink, self.context.scene.lobes)
        self._last_radii = [float(r) for r in shrink * self._radii.classes]
        for integrator in self._tracers:
            integrator.field = field

    def _first_radii(self) -> Radii:
        options = self._tracers[0].options
        if options.initial_radius is not None:
            return Radii.fixed(options.initial_radius)
        n = min(PILOT_PHOTONS, options.photons_per_pass)
        photons = self._shot(n, 0, PILOT_DIMENSION)
        for integrator in self._tracers:
            # Their light is in no picture.
            integrator.shooter.balance = Balance.zero()
        with self.context.ledger.stage("photon tree"):
            extent = 2.0 * float(self._tracers[0].shooter.world[3])
            return Radii.of(photons, n / options.photons_per_pass, extent, self._threads)

    def _shot(self, n: int, pass_number: int, dimension: int) -> Photons:
        """Shoot the photons of a pass, in one order whatever the number of threads."""
        idle: SimpleQueue[Shooter] = SimpleQueue()
        for integrator in self._tracers:
            idle.put(integrator.shooter)

        def work(block: tuple[Group, int, int]) -> Photons:
            free, (group, first, stop) = idle.get(), block
            try:
                return free.shoot(group, pass_number, first, stop, dimension, MET_SPECULAR)
            finally:
                idle.put(free)

        blocks = blocks_of(self._tracers[0].shooter.groups(n))
        if self._threads == 1:
            return joined([work(block) for block in blocks])
        with ThreadPoolExecutor(self._threads, thread_name_prefix="hybrid_rt") as executor:
            return joined(list(executor.map(work, blocks)))

    def gather(self) -> None:
        """Add up the counters of all threads."""
        first, *others = self._tracers
        for other in others:
            first.shooter.balance.add(other.shooter.balance)
            first.n_points += other.n_points
            first.n_gathered += other.n_gathered
            first.n_without += other.n_without
        super().gather()

    def report(self) -> dict[str, Any]:
        """Return what the photons did, in plain types."""
        first = self._tracers[0]
        balance, options = first.shooter.balance, first.options
        watt = {
            name: [float(x) for x in getattr(balance, name)]
            for name in ("emitted", "escaped", "absorbed", "lost")
        }
        photons = {
            "per_pass": options.photons_per_pass,
            "alpha": options.alpha,
            "emitted": balance.n_emitted,
            "stored": balance.n_stored,
            "gather_points": first.n_points,
            "gathered_per_point": first.n_gathered / max(first.n_points, 1),
            "points_without_photons": first.n_without,
            "first_radii": [] if self._radii is None else self._radii.classes.tolist(),
            "last_radii": self._last_radii,
            "power_of_all_passes": watt,
        }
        return {"photons": photons}


def _slots(context: RenderContext, of_kind: Callable[[Any], Any]) -> Any:
    """Return (materials + 1, slots) bool: lobes of these kinds; the last row is for no material."""
    lobes = context.scene.lobes
    n_slots = int(np.diff(lobes.first).max(initial=0))
    marks = np.zeros((lobes.first.size, n_slots), dtype=np.bool_)
    for m in range(lobes.first.size - 1):
        kinds = lobes.kind[lobes.first[m] : lobes.first[m + 1]]
        marks[m, : kinds.size] = of_kind(kinds)
    return marks


def _rows_of(shading: Shading, rows: Any, keeps: Any) -> Shading:
    """Select rows of a shading, with the colours of the kept lobes only."""
    material = shading.material[rows]
    geometric = shading.geometric
    return replace(
        shading,
        hits=shading.hits[rows],
        directions=shading.directions[rows],
        material=material,
        colors=shading.colors[rows] * keeps[material][:, :, None],
        geometric=geometric[rows] if geometric.size else geometric,
    )
