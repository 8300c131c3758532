"""Photons that begin in chosen ways, and what the camera sees of them.

They are followed from surface to surface. Each that arrives where the camera sees it is splatted to the
pixel (Arvo, "Backward ray tracing", SIGGRAPH 1986 course notes): on wide lobes and, if asked for, on the
narrow lobes that it comes to before any wide one. What the camera sees of wide lobes in
mirrors, through glass and on metal is estimated by photon mapping: camera rays gather the same photons
where they end. That is blurred, so a little is lost at edges.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import SurfaceLight
from hybrid_rt.integrators.integrator import PIXEL_BITS, CameraBlock, place_of_pixel
from hybrid_rt.integrators.kernels.density_estimate import Sums, splat_photons
from hybrid_rt.integrators.kernels.photon_steps import MET_SPREADING, Flight, Photons
from hybrid_rt.integrators.light_found import letters_of_lights
from hybrid_rt.integrators.media.beginnings import MediaAroundCamera
from hybrid_rt.integrators.media.contacts import Contacts
from hybrid_rt.integrators.photons import PPM
from hybrid_rt.integrators.photons.density_estimation import Discs, Field, Radii
from hybrid_rt.integrators.photons.emission import (
    NUMBER_BITS,
    Group,
    Piece,
    in_sequence,
    names_of,
    size_for_discs,
)
from hybrid_rt.integrators.photons.eye_pass import EyePass, PendingPoints
from hybrid_rt.integrators.photons.photon_tracer import (
    LENS,
    PER_LAUNCH,
    PER_STEP,
    PhotonTracer,
    new_photons,
)
from hybrid_rt.integrators.rows import joined, rows_of
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.materials.table import softened
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.plan import make_plan
from hybrid_rt.sensor.passes import GROUPS, RUN
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.emitter import UNWEIGHTED
from hybrid_rt.shading.kernels.lobes.register import DELTA, EVERY, FOLLOWED, NARROW, TRANSMITS, WIDE

# Of more lights so many are chosen by each group of passes: each takes launches of its own.
MOST_LIGHTS = 32
# So large a part of the photons is spread evenly over lights.
EVENLY = 0.25
# Camera rays gather photons within this share of the size of the scene: narrower discs add noise,
# wider ones lose more at edges.
RADIUS = 0.007
# Lobes of the letters of `hybrid_rt.integrators.light_found`.
TRAITS = {"D": WIDE, "G": NARROW, "S": DELTA}
# Surfaces between the first and the last that are tried: paths that differ beyond do not differ in
# whether an integrator finds them.
MOST_BETWEEN = 2


@dataclass(frozen=True)
class Beginnings:
    """How paths begin: their lights, and their first surfaces.

    ``direct``: also those that arrive straight from the light. ``highlights``: also what narrow lobes
    show of them before any wide lobe.
    """

    lights: str
    firsts: str
    direct: bool
    highlights: bool = False


class Seen(NamedTuple):
    """What the camera sees directly of the photons of a pass of each group; n contributions."""

    number: NDArray[np.uint64]  # (n,), of the photon
    pixel: NDArray[np.int64]  # (n,)
    value: FloatArray  # (n,), what it adds to the mean over pixels and channels
    is_highlight: NDArray[np.bool_]  # (n,), whether a narrow lobe shows it


@dataclass(frozen=True)
class Ends:
    """Where n camera rays end on wide lobes, and from which distance on photons are connected to them.

    Segments that long bound what one connection adds; see Keller, "Instant radiosity", SIGGRAPH 1997.
    """

    points: PendingPoints
    n: int
    reach: float


class Probe(PhotonTracer):
    """Traces photons that begin in certain ways, and finds what the camera sees of them.

    ``chosen`` (GROUPS, lights + 1): factors on the light of each, see `_chosen`.
    ``dimension``: the first of their random numbers.
    ``has_beginnings``: whether the scene has surfaces, or light straight from lights, that paths
    begin with.
    ``is_mixed``: whether some of these surfaces are mixtures of which photons cannot follow the
    part alone.
    ``begun``: power of the photons that began so, summed over channels. Written.
    ``stored``, ``number_of_stored``, Photons and (n,) uint64: what camera rays may gather, if there
    is something to see it by. Written.
    ``sees_every_light``: whether the camera sees photons of each light. Written.
    ``lit``, ``light`` (n, 3) and (n,): where photons met wide lobes, and what these reflect of
    them: the mean of the channels of the power of all groups. Written.
    """

    def __init__(
        self,
        context: RenderContext,
        contacts: Contacts | None,
        beginnings: Beginnings,
        chosen: FloatArray,
        dimension: int,
    ) -> None:
        super().__init__(context, contacts)
        self._direct = beginnings.direct
        self._chosen, self._dimension = chosen, dimension
        scene = context.scene
        self._keeps = np.zeros_like(scene.lobes_with(WIDE))
        for letter in beginnings.firsts:
            self._keeps |= scene.lobes_with(TRAITS[letter])
        # Glass in a mixture is chosen by its weight, whatever its colour.
        others = scene.lobes_with(TRANSMITS) & ~self._keeps
        kept = np.asarray(self._keeps.any(axis=1))
        self._begins = kept & ~others.any(axis=1)
        self.has_beginnings = self._direct or bool(kept.any())
        self.is_mixed = bool((kept & ~self._begins).any())
        self.begun = 0.0
        self.stored, self.number_of_stored = new_photons(0), np.zeros(0, dtype=np.uint64)
        self.sees_every_light = True
        self.lit, self.light = np.zeros((0, 3)), np.zeros(0)
        self._is_wide = scene.lobes_with(WIDE)
        # Where all lobes are wide, photons go on by these.
        self._connects = self.gathers & ~scene.materials_with(NARROW | DELTA | TRANSMITS)
        self._shows = scene.materials_with(NARROW) & beginnings.highlights
        self._softened = softened(scene.lobes) if self._shows.any() else None

    def follow(self, photons_per_pass: int, ends: Ends | None = None) -> Seen:
        """Trace the photons of a pass of each group of passes; return what the camera sees.

        With ``ends`` light between two wide lobes that are farther apart than its reach is found by
        connections alone, and all other light by photons alone.
        """
        context = self.context
        groups = self.groups(photons_per_pass)
        none = np.zeros(0)
        seen = [Seen(none.astype(np.uint64), none.astype(np.int64), none, none.astype(np.bool_))]
        if not groups:  # what shines is black
            return seen[0]
        mirrors = bool(context.scene.materials_with(FOLLOWED).any())
        stored, numbers = [self.stored], [self.number_of_stored]
        lit, light = [self.lit], [self.light]
        flight = self._all_launched(groups, ends is not None)
        light_of = np.array([group.light for group in groups])
        lights = np.unique(light_of[_number_of_group(flight.number)])
        connected = flight.number[:0]
        for depth in range(context.max_depth + 1):
            if flight.number.size == 0:
                break
            step = self._dimension + PER_LAUNCH + PER_STEP * depth
            hits, second, material = self._arrived(flight)
            shading = self._light.shading(hits, flight.direction, material, flight.media, second)
            # --- what the camera sees of it
            rows = np.flatnonzero(self.gathers[shading.material])
            if rows.size and (depth or self._direct):
                lit.append(hits.position[rows])
                wide = shading.colors[rows] * self._is_wide[shading.material[rows]][:, :, None]
                light.append((flight.power[rows] * wide.sum(axis=1)).mean(axis=1))
                # --- but for what connections have found
                own = np.ones(rows.size, dtype=np.bool_)
                if ends is not None:
                    was_connected = np.isin(flight.number[rows], connected)
                    own = ~(was_connected & (hits.t[rows] >= ends.reach))
                seen.append(self._seen(flight, shading, rows[own], step, None))
                if mirrors:
                    # Marked as shown: points that the camera sees directly do not gather them.
                    stored.append(rows_of(self._stored(flight, shading, rows, 0), own))
                    numbers.append(flight.number[rows[own]])
            if self._softened is not None:
                is_first = flight.history & MET_SPREADING == 0
                rows = np.flatnonzero(self._shows[shading.material] & is_first)
                seen.append(self._seen(flight, shading, rows, step, self._softened))
            # --- where they go next: at first only by the lobes asked for
            if depth == 0:
                shading = replace(
                    shading,
                    colors=shading.colors * self._keeps[shading.material][:, :, None],
                    material=np.where(
                        self._begins[shading.material], shading.material, np.int32(NOTHING)
                    ),
                )
            goes_on = depth < context.max_depth
            if ends is not None and goes_on:
                in_the_open = (flight.media == NOTHING).all(axis=1)
                rows = np.flatnonzero(self._connects[shading.material] & in_the_open)
                connected = flight.number[rows]
                seen.append(self._connected(flight, shading, rows, ends, step))
            if depth == 0 and self._direct:
                self.begun += float(flight.power[shading.material >= 0].sum())
            flight = self._onward(flight, shading, second, step, goes_on)
            if depth == 0 and not self._direct:
                self.begun += float(flight.power.sum())
        self.stored, self.number_of_stored = joined(stored), np.concatenate(numbers)
        self.lit, self.light = np.concatenate(lit), np.concatenate(light)
        found = Seen(*(np.concatenate(columns) for columns in zip(*seen, strict=True)))
        seen_lights = light_of[_number_of_group(found.number)]
        self.sees_every_light = bool(np.isin(lights, seen_lights).all())
        return found

    def _shares(self, by_power: FloatArray) -> FloatArray:
        """Mostly by power, but `EVENLY`: a faint light may be all that lights a part of the picture."""
        is_lit: FloatArray = (by_power > 0.0) / np.count_nonzero(by_power)
        return (1.0 - EVENLY) * by_power + EVENLY * is_lit

    def _seen(
        self,
        flight: Flight,
        shading: Shading,
        rows: NDArray[np.intp],
        step: int,
        by_narrow: LobeTable | None,
    ) -> Seen:
        """Return what the camera sees of some photons, by wide lobes or by these narrow ones."""
        camera = self.context.scene.camera
        rows, splats = self._shown(flight, shading, rows, step, by_narrow)
        value = splats.value.sum(axis=1) / (3 * camera.width * camera.height)
        is_highlight = np.full(rows.size, by_narrow is not None)
        return Seen(flight.number[rows], splats.pixel, value, is_highlight)

    def _connected(
        self, flight: Flight, shading: Shading, rows: NDArray[np.intp], ends: Ends, step: int
    ) -> Seen:
        """Connect photons with an end of a camera ray each, chosen at random."""
        scene, hits, geometric = self.context.scene, shading.hits, shading.geometric
        n = ends.points.depth.size
        xi = self._points(flight.number[rows], step + LENS)[:, 0]
        point = rows_of(ends.points, np.minimum((xi * n).astype(np.intp), n - 1))
        there = point.shading
        way = hits.position[rows] - there.hits.position
        distance = np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)
        # --- irradiance there, across the segment
        irradiance, value = np.empty((rows.size, 3)), np.empty((rows.size, 3))
        splat_photons(
            scene.lobes, WIDE, shading.material[rows], shading.colors[rows], hits.normal[rows],
            rows_of(geometric, rows), NO_RATIO, flight.direction[rows], flight.power[rows], way,
            (distance >= ends.reach).astype(np.float64), irradiance,
        )  # fmt: skip
        # --- radiance back along the camera ray: no foreshortening as of photons on a surface
        normal = there.geometric if there.geometric.size else there.hits.normal
        direction = -way / distance[:, None]
        arriving = np.abs(np.einsum("ij,ij->i", normal, direction))
        facing = np.abs(np.einsum("ij,ij->i", normal, there.directions))
        ratio = np.divide(arriving, facing, out=np.zeros(rows.size), where=facing > 0.0)
        splat_photons(
            scene.lobes, WIDE, there.material, there.colors, there.hits.normal, there.geometric,
            NO_RATIO, direction, irradiance, there.directions, ratio, value,
        )  # fmt: skip
        value *= point.paths.throughput
        sent = np.flatnonzero(value.any(axis=1))
        source = NamedPoints(hits.object_id[rows[sent]], hits.position[rows[sent]])
        target = NamedPoints(there.hits.object_id[sent], there.hits.position[sent])
        blocked = self.context.tracer.occluded(
            source.position, -way[sent], 1.0, source=source, target=target
        )
        sent = sent[~blocked]
        return Seen(
            flight.number[rows[sent]],
            place_of_pixel(point.paths.pixel[sent]).astype(np.int64),
            value[sent].sum(axis=1) * (n / (3.0 * ends.n)),
            np.zeros(sent.size, dtype=np.bool_),
        )

    def _all_launched(self, groups: list[Group], together: bool) -> Flight:
        """Launch photons of all lights and groups of passes.

        Those of a light that leave ``together`` are points of one sequence: so fewer small openings are missed
        than by a sequence for each group of passes, but then groups tell too much noise.
        """
        pairs = [(g, k) for g in groups for k in range(GROUPS) if self._chosen[k, g.light] > 0.0]
        names = [
            names_of(Piece(group, k * group.n, (k + 1) * group.n), 0)
            if together
            else names_of(Piece(group, 0, group.n), k * RUN)
            for group, k in pairs
        ]
        flight = self._launched([group for group, _ in pairs], names, self._dimension)
        number, k = np.divmod(flight.number >> NUMBER_BITS, np.uint64(GROUPS))
        if together:
            n = np.array([group.n for group in groups], dtype=np.uint64)[number]
            k = in_sequence(flight.number)[1] // n
            flight.number[:] += k << NUMBER_BITS
        light = np.array([group.light for group in groups])[number]
        flight.power[:] *= self._chosen[k, light][:, None]
        return flight


def _number_of_group(number: NDArray[np.uint64]) -> NDArray[np.intp]:
    """Return the numbers of the `Group` of photons of `Probe.follow`."""
    return ((number >> NUMBER_BITS) // np.uint64(GROUPS)).astype(np.intp)


def group_of_photons(number: NDArray[np.uint64]) -> NDArray[np.intp]:
    """Return the group of passes of photons of `Probe.follow`."""
    return ((number >> NUMBER_BITS) % np.uint64(GROUPS)).astype(np.intp)


class View(EyePass):
    """Camera rays that gather photons where they arrive by way of mirrors, glass and metal.

    ``dimension``: that of the random numbers of their places in the picture.
    ``place`` (n,) int64: the pixels of the last camera rays, row by row. Written.
    ``points``: where they ended on wide lobes. Written.
    ``gathered`` (n,): what photons gave them, the mean of the channels. Written.
    """

    def __init__(self, context: RenderContext, dimension: int) -> None:
        super().__init__(context)
        # Light that lamps send to what the rays meet is not asked for, so lamps met count in full.
        self.casts_shadow_rays = self._casts_them_for_narrow = False
        self._light = SurfaceLight(context, UNWEIGHTED, EVERY)
        self._radii = Radii.fixed(RADIUS * size_for_discs(context))
        self._dimension = dimension
        self.place, self.gathered = np.zeros(0, dtype=np.int64), np.zeros(0)
        self.points: PendingPoints | None = None

    def _add_at(self, points: PendingPoints, block: CameraBlock, radiance: FloatArray) -> None:
        self.points = points
        super()._add_at(points, block, radiance)

    def radiance(self, photons: Photons, group: int, n: int) -> FloatArray:
        """Return the radiance (n,) of camera rays spread over the picture, the mean of the channels."""
        scene, sampler = self.context.scene, self.context.sampler
        self.fields = (Discs(photons, scene.lobes, self._radii, 1.0),) if photons.power.size else ()
        self.gathered, self.points = np.zeros(n), None
        sample = np.arange(n, dtype=np.uint64)
        name = np.full(n, group, dtype=np.uint64)
        place = np.arange(n) + sampler.points(name, self._dimension, sample)[:, 0]
        n_pixels = scene.camera.width * scene.camera.height
        self.place = np.minimum(place * (n_pixels / n), n_pixels - 1).astype(np.int64)
        pixel = self.place.astype(np.uint64) + (name << PIXEL_BITS)
        return self.radiance_through(pixel, sample).mean(axis=1)

    def gather_photons(self, photons: Photons, group: NDArray[np.intp]) -> None:
        """Let the last camera rays gather photons, in turn those of each group of passes."""
        if self.points is None:
            return
        ray = self.points.paths.camera_ray
        for k in range(GROUPS):
            mine = rows_of(photons, group == k)
            rows = np.flatnonzero(ray % GROUPS == k)
            if mine.power.size and rows.size:
                self.fields = (Discs(mine, self.context.scene.lobes, self._radii, 1.0),)
                unused = np.zeros((2, self.gathered.size, 3))
                self._gather(rows_of(self.points, rows), unused[0], unused[1])

    def _note_gathered(
        self, field: Field, camera_ray: NDArray[np.int64], throughput: FloatArray, sums: Sums
    ) -> None:
        del field
        given = (throughput * sums.value).mean(axis=1)
        self.gathered += np.bincount(camera_ray, given, minlength=self.gathered.size)


def context_for_photons(
    context: RenderContext, scene: CompiledScene, max_depth: int
) -> RenderContext:
    """Return a context whose plan is for photons, with counts of its own."""
    return context.with_own_counts(scene=scene, plan=make_plan(scene, PPM), max_depth=max_depth)


def first_surfaces(found: str, light: str, which: Callable[[Iterable[bool]], bool]) -> str:
    """Return the letters of first surfaces after which all paths are found, or any.

    ``found``: regular expression of the paths that are found.
    ``light``: the letter of the light.
    """
    between = ["".join(word) for n in range(MOST_BETWEEN + 1) for word in product(TRAITS, repeat=n)]
    ends = [f"{word}{end}" for word in between for end in ("DE", "DSE", "DGE")]
    return "".join(
        first
        for first in TRAITS
        if which(re.fullmatch(found, f"{light}{first}{end}") is not None for end in ends)
    )


def beginnings_of(
    scene: CompiledScene, begin: Callable[[str], tuple[str, bool, bool]]
) -> list[Beginnings]:
    """Return how paths begin, the lights that are alike together.

    ``begin``: what `Beginnings` holds for the letter of a light.
    """
    letters = dict.fromkeys(letters_of_lights(scene).tolist())
    if scene.environment is not None:
        letters["K"] = None
    lights: dict[tuple[str, bool, bool], str] = {}
    for light in letters:
        if any(key := begin(light)):
            lights[key] = lights.get(key, "") + light
    return [Beginnings(names, *key) for key, names in lights.items()]


def probe_of(
    context: RenderContext, beginnings: Beginnings, max_depth: int, dimension: int
) -> Probe | None:
    """Return what traces photons of these beginnings; None if nothing is seen of them.

    Raises ValueError if photons cannot be distributed uniformly, as on what has no end; see
    `PhotonTracer`.
    """
    scene = context.scene
    letters = letters_of_lights(scene)
    sends = np.isin(letters, list(beginnings.lights))
    power = np.where(sends, scene.power, 0.0)
    chosen = _chosen(power, context.sampler, dimension)
    scene = replace(
        scene,
        power=np.where(chosen[:, :-1].any(axis=0), power, 0.0),
        environment=scene.environment if "K" in beginnings.lights else None,
    )
    own = context_for_photons(context, scene, max_depth)
    contacts = Contacts(scene, own.tracer) if own.plan["contacts"] else None
    if not MediaAroundCamera(own, contacts).is_in_the_open:
        return None
    return Probe(own, contacts, beginnings, chosen, dimension)


def _chosen(power: FloatArray, sampler: Sampler, dimension: int) -> FloatArray:
    """Choose lights for each group of passes, evenly by power; of few lights all.

    ``power`` (lights,).
    Returns (GROUPS, lights + 1): factors on the light of each, the sky last: 0 if not chosen, 1 in
    the mean.
    """
    factors = np.ones((GROUPS, power.size + 1))
    if np.count_nonzero(power) <= MOST_LIGHTS:
        return factors
    share = power / power.sum()
    before = np.cumsum(share)
    place = sampler.points(np.arange(GROUPS, dtype=np.uint64), dimension - 1, 0)[:, :1]
    rows = np.searchsorted(before / before[-1], (np.arange(MOST_LIGHTS) + place) / MOST_LIGHTS)
    for k in range(GROUPS):
        factors[k, :-1] = np.bincount(rows[k], minlength=power.size)
        factors[k, :-1] /= np.where(share > 0.0, MOST_LIGHTS * share, 1.0)
    return factors
