"""The eye pass of photon mapping: camera paths up to surfaces with wide lobes.

A camera path is followed through mirrors, metals and glass. At every wide lobe, direct light is
found by next-event estimation and indirect light by density estimation; the delta and narrow lobes
of a mixture are followed further. Shadow rays find direct light with less noise than photons and
without blur, so photons are stored from their second hit on.

At glass both branches are followed, each with its share (Arvo and Kirk, "Particle transport and image
synthesis", SIGGRAPH 1990): a path that chooses reflection by its reflectance, 0.04, and then meets a lamp
adds the lamp's whole radiance to one pixel in 25. Roulette leaves paths of `FAINT` or more alone, and
fainter ones survive with `FAINT`. So no path carries more than it should but by `FAINT`, and of a camera
ray no more than 1 / `FAINT` branches are expected at a time.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import (
    NO_CONNECTION,
    NONE_SMOOTH,
    SurfaceLight,
    largest_channel,
)
from hybrid_rt.integrators.integrator import (
    FIRST_PATH_DIMENSION,
    CameraBlock,
    Integrator,
    place_of_pixel,
)
from hybrid_rt.integrators.kernels.branches import LAST
from hybrid_rt.integrators.kernels.compaction import Paths, add_products
from hybrid_rt.integrators.kernels.density_estimate import LARGEST_HEIGHT, Sums, segments_to_photons
from hybrid_rt.integrators.media.absorption import absorb, square_of_index
from hybrid_rt.integrators.path.camera_paths import leaving_camera
from hybrid_rt.integrators.photons.covered_discs import (
    MOST_SEGMENTS,
    Draw,
    ThinPlaces,
    one_over_coverage,
)
from hybrid_rt.integrators.photons.density_estimation import Discs, Field, Points, widest_discs
from hybrid_rt.integrators.photons.photon_tracer import PhotonTracer
from hybrid_rt.integrators.rows import joined, rows_of
from hybrid_rt.integrators.shading import Shading, glass_branches
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.shading.kernels.emitter import BOTH, LIGHT_ONLY
from hybrid_rt.shading.kernels.lobes.register import EVERY, FOLLOWED, NARROW, TRANSMITS, WIDE
from hybrid_rt.shading.kernels.medium_stack import IOR
from hybrid_rt.shading.kernels.scatter import (
    ABSORBED,
    LEFT,
    SCATTERED,
    SPECULAR,
    STOPPED,
    ConnectionPdf,
    scatter,
)

# Variance over that of choosing always and roulette by what is carried, 10 renders of 8 passes of
# 10 000 photons, 48 pixels wide: wine_glass 0.14, teapot_ppm 0.44, glass_and_mirror 0.87, still_life 0.52,
# for 1.05 to 1.25 times the time. With 0.1 (2000 photons): 0.27, 0.54, 0.98, 0.83.
FAINT = 0.02
# Small pictures send several camera rays of each pixel together, up to so many: the steps of few rays cost no
# less than those of many.
FEWEST_AT_ONCE = 2**14
# Of the points of a block without photons, so many are searched for photons shown to the camera.
MOST_ASKED = 1024
# The low-discrepancy point of the first segment across a disc, and what those of one step are for.
COVERAGE_DIMENSION = np.uint64(2**45)
TO_LIGHT, TO_LIGHT_NARROW, DIRECTION, CHOICE, TO_PHOTON, PER_STEP = 0, 1, 2, 3, 4, 5


@dataclass(frozen=True)
class PendingPoints:
    """Points on wide lobes, n rows, whose light is still to be estimated."""

    paths: Paths
    shading: Shading
    depth: UIntArray  # (n,) uint64, of the path that arrives there


class EyePass(Integrator):
    """See the module; `Integrator` for what it offers.

    ``photon_tracer``: traces the photons of this thread.
    ``fields``: the photon maps of the current pass.
    ``thin_places``: where discs are wider than what they lie on.
    ``n_camera_rays``: camera rays through each pixel in a pass.
    ``n_shadow_rays``: shadow rays from each point on a wide lobe.
    ``casts_shadow_rays``: whether there are any.
    ``is_in_the_open``: whether the camera is outside all dielectrics.
    ``blur`` (pixels, 3): radiance of this pass minus that by discs of half the area, from which the
    blur is estimated. Written.
    ``counted``: "n_points", "n_gathered" and "n_without", points that gathered photons, photons that they
    gathered, and points that met none; "n_shown", those of the latter whose discs hold photons that were
    shown to the camera, judged by some of them; "shown_power", power of these photons, of each block and
    pass once, at least. Written.
    """

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self.photon_tracer = PhotonTracer(context, self._contacts)
        self.fields: tuple[Field, ...] = ()
        self.thin_places: ThinPlaces | None = None
        self.n_camera_rays = 1
        self.n_shadow_rays = 1
        camera = context.scene.camera
        self.blur = np.zeros((camera.height * camera.width if context.plan["photons"] else 0, 3))
        self.counted: dict[str, Any] = Counter()
        self._share_of_rays = 1.0
        lights, plan, lobes = context.scene.lights, context.plan, context.scene.lobes
        # Next-event estimation alone finds direct light at wide lobes, so its weight is one.
        self._wide = SurfaceLight(context, LIGHT_ONLY, WIDE)
        self._light = SurfaceLight(context, BOTH, EVERY)
        asks = bool(lights.chance.any())
        self.casts_shadow_rays = asks and (plan["light samples"] or plan["sky samples"])
        self._casts_them_for_narrow = self.casts_shadow_rays and bool((lobes.traits & NARROW).any())
        self.is_in_the_open = self._media_around_camera.is_in_the_open
        self._is_wide = context.scene.lobes_with(WIDE)
        # Where glass is all that is followed, a choice is between its two branches.
        is_alone = context.scene.lobes_with(FOLLOWED).sum(axis=1) == 1
        self._splits = is_alone & context.scene.materials_with(TRANSMITS)
        self._splits &= ~context.scene.materials_with(NARROW)
        self._follows = context.scene.materials_with(FOLLOWED)

    def trace(self, passes: range, first: int, stop: int) -> FloatArray:
        """Return the radiance (stop - first, 3) of pixels: the mean of `n_camera_rays` each."""
        pixel, sample = self._keys(passes, first, stop)
        n = self.n_camera_rays
        radiance = np.zeros((pixel.size, 3))
        if self.fields:
            self.blur[place_of_pixel(pixel)] = 0.0
        at_once = min(max(FEWEST_AT_ONCE // pixel.size, 1), n)
        for first_ray in range(0, n, at_once):
            # All camera rays of all passes are points of one sequence.
            rays = np.arange(first_ray, min(first_ray + at_once, n), dtype=np.uint64)[:, None]
            self._share_of_rays = len(rays) / n
            found = self.radiance_through(
                np.tile(pixel, len(rays)), (sample * np.uint64(n) + rays).ravel()
            )
            for part in found.reshape(len(rays), -1, 3):
                radiance += part
        return radiance / n

    def _radiance(self, block: CameraBlock) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        paths = leaving_camera(block, self._camera_media)
        waiting: list[PendingPoints] = []
        for depth in range(self.context.max_depth + 1):
            # --- where the rays arrive
            source = NamedPoints(paths.source_id, paths.origins) if depth else None
            hits, second = self._first_hits(paths.origins, paths.directions, source)
            with self.context.ledger.stage("shade"):
                material = self._light.material(hits)
                # --- what the way there absorbed
                absorb(self.context, paths.media, material, hits, second, paths.throughput)
                # --- light they ran into
                arriving = self._light.arriving(
                    hits, paths.origins, paths.directions, paths.pdf, NO_CONNECTION, paths.media
                )
                add_products(paths.camera_ray, paths.throughput, arriving, radiance)
                shading = self._light.shading(hits, paths.directions, material, paths.media, second)
                # --- surfaces that spread light widely: lights and photons come later
                wide = np.flatnonzero(self.photon_tracer.gathers[material])
                if wide.size:
                    here = _by_lobes(rows_of(shading, wide), self._is_wide)
                    depths = np.full(wide.size, depth, dtype=np.uint64)
                    waiting.append(PendingPoints(rows_of(paths, wide), here, depths))
                # --- where they go next by mirrors, metals and glass, and which ones stop
                paths = self._onward(paths, shading, second, depth, radiance)
            if paths.camera_ray.size == 0:
                break
        # --- light at all these places: few large batches are faster
        if waiting:
            self._add_at(joined(waiting), block, radiance)
        return radiance

    def _add_at(self, points: PendingPoints, block: CameraBlock, radiance: FloatArray) -> None:
        """Add the light at all points of a block."""
        if self.casts_shadow_rays:
            with self.context.ledger.stage("shade"):
                self._add_direct(points, radiance)
        if self.fields:
            blur = np.zeros_like(radiance)
            self._gather(points, radiance, blur)
            # A pixel may have several rays in the block.
            np.add.at(self.blur, place_of_pixel(block.pixel), blur / self.n_camera_rays)

    def _points(self, paths: Paths, depth: UIntArray | int, use: int) -> FloatArray:
        dimension = FIRST_PATH_DIMENSION + depth * PER_STEP + use
        return self.context.sampler.points(paths.pixel, dimension, paths.sample)

    def _add_direct(self, points: PendingPoints, radiance: FloatArray) -> None:
        """Add the direct light at points: the mean of several shadow rays each.

        A branch that carries so little that its one ray has less variance than the mean of several
        at full weight gets one ray.
        """
        n = self.n_shadow_rays
        if n == 1:
            self._add_shadow_rays(points, 1, radiance)
            return
        is_strong = largest_channel(points.paths.throughput) ** 2 * n > 1.0
        for rows, n_each in ((np.flatnonzero(is_strong), n), (np.flatnonzero(~is_strong), 1)):
            if rows.size:
                self._add_shadow_rays(rows_of(points, rows), n_each, radiance)

    def _add_shadow_rays(self, points: PendingPoints, n: int, radiance: FloatArray) -> None:
        paths = points.paths
        throughput = paths.throughput / n
        for j in range(n):
            xi = self._shadow_ray_points(points, n, j)
            self._wide.from_one(
                points.shading, paths.camera_ray, throughput, paths.media, xi, radiance
            )

    def _shadow_ray_points(self, points: PendingPoints, n: int, j: int) -> FloatArray:
        """Return the random numbers of the j-th of n shadow rays of each point."""
        # All shadow rays of all passes are points of one sequence.
        sample = points.paths.sample * np.uint64(n) + np.uint64(j)
        return self._points(points.paths._replace(sample=sample), points.depth, TO_LIGHT)

    def _gather(self, waiting: PendingPoints, radiance: FloatArray, blur: FloatArray) -> None:
        """Add the light of photons at all points of a block."""
        camera_ray, throughput = waiting.paths.camera_ray, waiting.paths.throughput
        points = self._points_of(waiting)
        for field in self.fields:
            with self.context.ledger.stage("gather"):
                sums, radius = field.radiance(points)
            hidden = self._hidden(points, field, sums.chosen)
            sums.value[hidden] = sums.blur[hidden] = 0.0
            with self.context.ledger.stage("cover of discs"):
                self._divide_by_coverage(waiting, points, radius, sums)
            add_products(camera_ray, throughput, sums.value, radiance)
            add_products(camera_ray, throughput, sums.blur, blur)
            self._note_gathered(field, camera_ray, throughput, sums)
            self.counted["n_points"] += camera_ray.size
            self.counted["n_gathered"] += int(sums.near.sum())
            without = np.flatnonzero(sums.near == 0)
            self.counted["n_without"] += without.size
            self._note_shown(points, field, without)

    def _points_of(self, waiting: PendingPoints) -> Points:
        shading = waiting.shading
        xi = self._points(waiting.paths, waiting.depth, TO_PHOTON)
        return Points(
            shading.hits.position,
            shading.hits.normal,
            shading.directions,
            shading.geometric,
            shading.material,
            shading.colors,
            waiting.depth == 0,
            np.ascontiguousarray(xi[:, 0]),
            widest_discs(self.context.scene)[shading.hits.object_id],
        )

    @OVERFLOWS
    def _divide_by_coverage(
        self, waiting: PendingPoints, points: Points, radius: FloatArray, sums: Sums
    ) -> None:
        """Divide estimates where discs are wider than what they lie on by the part that is covered."""
        rows = np.flatnonzero(sums.value.any(axis=1))
        if self.thin_places is None or not rows.size:
            return
        rows = rows[self.thin_places.near(points.position[rows])]
        if not rows.size:
            return
        # Discs, and those of half the area; the same random numbers make the noise of the difference small.
        twice, wide = np.tile(rows, 2), np.tile(radius[rows], 2)
        area = np.repeat([1.0, 0.5], rows.size)
        factor, mixed = one_over_coverage(
            self.context, self._contacts, rows_of(points, twice), np.sqrt(area) * wide, LARGEST_HEIGHT * wide,
            self._draw(waiting, twice),
        )  # fmt: skip
        factor, of_half = factor.reshape(2, -1, 1)
        half = of_half * (sums.value[rows] - sums.blur[rows])
        sums.value[rows] *= factor
        sums.blur[rows] = (1.0 - mixed[: rows.size, None]) * sums.value[rows] - half

    def _draw(self, waiting: PendingPoints, rows: NDArray[np.intp]) -> Draw:
        """Return what draws random points for some of the points."""
        pixel, sample, depth = (
            column[rows] for column in (waiting.paths.pixel, waiting.paths.sample, waiting.depth)
        )
        dimension = COVERAGE_DIMENSION + depth * np.uint64(MOST_SEGMENTS)

        def draw(some: NDArray[np.intp], first: int, n: int) -> FloatArray:
            return self.context.sampler.several(
                pixel[some], dimension[some] + np.uint64(first), sample[some], n
            )

        return draw

    def _note_shown(self, points: Points, field: Field, without: NDArray[np.intp]) -> None:
        """Count points that met no photon but those that were shown to the camera."""
        if self.photon_tracer.dense is None or not without.size or not isinstance(field, Discs):
            return
        asked = without[:: -(-without.size // MOST_ASKED)]
        found = field.shown_photons(points, asked)
        found = found[found >= 0]
        self.counted["n_shown"] += round(without.size * found.size / asked.size)
        power = float(field.photons.power[np.unique(found)].sum(dtype=np.float64))
        self.counted["shown_power"] += power * self._share_of_rays

    def _note_gathered(
        self, field: Field, camera_ray: NDArray[np.int64], throughput: FloatArray, sums: Sums
    ) -> None:
        """Note density estimates and how much each counts; by default nothing."""

    def _hidden(self, points: Points, field: Field, chosen: NDArray[np.int64]) -> NDArray[np.intp]:
        """Return the points whose photons lie behind walls.

        Whether one photon does, chosen by its part in the sum, decides for the whole sum: right in
        the mean, and without noise where all or none of them do.
        """
        rows = np.flatnonzero(chosen >= 0)
        if rows.size == 0:
            return rows
        photons = field.photons
        normal = points.geometric if points.geometric.size else points.normal
        origin, way = np.empty((rows.size, 3)), np.empty((rows.size, 3))
        segments_to_photons(
            rows, points.position, normal, points.direction, chosen, photons.position,
            photons.normal, origin, way,
        )  # fmt: skip
        apart = np.flatnonzero(way.any(axis=1))
        self.context.ledger.rays["to photons"] += apart.size
        with self.context.ledger.stage("photons hidden"):
            blocked = self.context.tracer.occluded(origin[apart], way[apart], 1.0)
        return rows[apart[blocked]]

    def _onward(
        self, paths: Paths, shading: Shading, second: IntArray, depth: int, radiance: FloatArray
    ) -> Paths:
        """Choose where each path goes that need not stop; return those that go on."""
        ledger = self.context.ledger
        ledger.ended["left the scene or met a lamp"] += int(np.count_nonzero(shading.material < 0))
        rows = np.flatnonzero(self._follows[shading.material])
        ledger.ended["met surfaces that gather"] += int(
            np.count_nonzero(shading.material >= 0) - rows.size
        )
        paths, second = rows_of(paths, rows), rows_of(second, rows)
        shading = _by_lobes(rows_of(shading, rows), ~self._is_wide)
        if rows.size == 0:
            return paths
        if self._casts_them_for_narrow and depth < self.context.max_depth:
            xi = self._points(paths, depth, TO_LIGHT_NARROW)
            self._light.from_one(
                shading, paths.camera_ray, paths.throughput, paths.media, xi, radiance
            )
        choice = self._points(paths, depth, CHOICE)
        # The branches of a path share its random numbers: each by itself is right.
        paths, shading, second, choice = self._split(paths, shading, second, choice)
        n = len(choice)
        onward, pdf = np.empty((n, 3)), np.empty(n)
        fate = np.empty(n, dtype=np.uint8)
        goes_on = depth < self.context.max_depth
        hits = shading.hits
        scatter(
            self.context.scene.lobes, shading.vertices, self._points(paths, depth, DIRECTION),
            choice, paths.media, second, goes_on, goes_on, 0.0,
            ConnectionPdf(hits.t, paths.pdf, NONE_SMOOTH, hits.object_id, paths.connection_pdf),
            onward, paths.throughput, pdf, fate,
        )  # fmt: skip
        self._thin_out(paths, fate, choice[:, 1])
        counts = np.bincount(fate, minlength=SPECULAR + 1)
        ledger.rays["mirrored or refracted"] += int(counts[SCATTERED] + counts[SPECULAR])
        ledger.ended["absorbed or by roulette"] += int(counts[ABSORBED] + counts[LEFT])
        if counts[STOPPED]:
            ledger.ended["at max_depth"] += int(counts[STOPPED])
            stopped = np.flatnonzero(fate == STOPPED)
            square = square_of_index(paths.media[stopped], self.context.scene.lobes)
            ledger.lost_weight += float((largest_channel(paths.throughput[stopped]) * square).sum())
        paths = paths._replace(
            origins=hits.position, directions=onward, pdf=pdf, source_id=hits.object_id
        )
        return rows_of(paths, np.flatnonzero(fate >= SCATTERED))

    def _split(
        self, paths: Paths, shading: Shading, second: IntArray, choice: FloatArray
    ) -> tuple[Paths, Shading, IntArray, FloatArray]:
        """Double the paths of which both branches are followed; return all with their choices.

        ``second`` (n,) int32, or (0,): faces that coincide with the hits, see `Contacts.at`.
        ``choice`` (n, 2): the first column chooses the branch.
        """
        scene, rows = self.context.scene, np.flatnonzero(self._splits[shading.material])
        if rows.size == 0:
            return paths, shading, second, choice
        lobe = scene.glass_of[shading.material[rows]]
        share, _, _, _ = glass_branches(scene.lobes, lobe, shading, rows, paths.media, second)
        # 0: hidden in another body, and passed as if it was not there.
        is_split = (share > 0.0) & (share < 1.0)
        rows, share = rows[is_split], share[is_split, None]
        count = np.ones(len(choice), dtype=np.int64)
        count[rows] = 2
        parent = np.repeat(np.arange(len(choice)), count)
        reflected = (np.cumsum(count) - count)[rows]
        paths, shading, second, choice = rows_of((paths, shading, second, choice), parent)
        choice[reflected, 0], choice[reflected + 1, 0] = 0.0, LAST
        paths.throughput[reflected] *= share
        paths.throughput[reflected + 1] *= 1.0 - share
        return paths, shading, second, choice

    def _thin_out(self, paths: Paths, fate: NDArray[np.uint8], xi: FloatArray) -> None:
        """Russian roulette among the paths that go on, by random numbers (n,) in [0, 1).

        Changes ``paths.throughput`` and ``fate``.
        """
        rows = np.flatnonzero(fate >= SCATTERED)
        carried = largest_channel(paths.throughput[rows])
        if paths.media.shape[1]:
            # Within glass radiance counts by its index squared, given back on the way out: the largest
            # index of all bodies around stands for it.
            media, number = paths.media[rows], self.context.scene.lobes.number
            index = np.where(media != NOTHING, number[:, IOR][media], 1.0)
            carried = carried * np.maximum(index.max(axis=1), 1.0) ** 2
        faint = carried < FAINT
        rows, survival = rows[faint], carried[faint] / FAINT
        lives = xi[rows] < survival
        fate[rows[~lives]] = ABSORBED
        paths.throughput[rows[lives]] /= survival[lives, None]


def _by_lobes(shading: Shading, keeps: BoolArray) -> Shading:
    """Return a shading with the colours of the kept lobes (materials + 1, lobes) only."""
    return replace(shading, colors=shading.colors * keeps[shading.material][:, :, None])
