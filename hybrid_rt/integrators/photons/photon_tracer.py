"""Photon tracing: photons of every light, followed until they are absorbed or leave the scene.

Jensen, "Global illumination using photon maps", EGWR 1996. Photons are emitted in groups: one for
each light and kind (see `hybrid_rt.integrators.kernels.photon_emission`); small groups are followed
together. Each group has its own low-discrepancy sequences, which run on through the passes: one
pass is well distributed, and so are all passes together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import SurfaceLight, largest_channel
from hybrid_rt.integrators.kernels.density_estimate import splat_photons
from hybrid_rt.integrators.kernels.photon_emission import (
    Launch,
    Targets,
    launch_from_lights,
    launch_from_sky,
)
from hybrid_rt.integrators.kernels.photon_steps import (
    EMITTED,
    IS_SHOWN,
    MET_SPECULAR,
    TAKEN,
    Flight,
    Photons,
    add_power,
    scatter_photons,
    store_photons,
)
from hybrid_rt.integrators.light_points import leaving_points
from hybrid_rt.integrators.media.absorption import absorb
from hybrid_rt.integrators.media.beginnings import MediaAroundLights
from hybrid_rt.integrators.media.contacts import Contacts, first_hits
from hybrid_rt.integrators.photons.density_estimation import DensePlaces
from hybrid_rt.integrators.photons.emission import (
    Group,
    Piece,
    ball_of_world,
    in_sequence,
    names_of,
    powers_of_lights,
    targets_of,
)
from hybrid_rt.integrators.rows import joined, new_rows, rows_of
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.lobes.register import NARROW, SPREADS, WIDE
from hybrid_rt.shading.kernels.scatter import ABSORBED, LEFT, SCATTERED, SPECULAR, STOPPED

# Dimensions of photons begin far beyond those of camera rays, those of the first photons of all,
# which only find radii, farther still.
PHOTON_DIMENSION, PILOT_DIMENSION = 2**40, 2**41
LAUNCH, PER_LAUNCH = 0, 1
# What the points of one step are for.
DIRECTION, LOBE, LENS, PER_STEP = 0, 1, 2, 3
# Of the photons of a light, how many are aimed where there is something to aim at.
AIMED_SHARE = 0.5


class Splats(NamedTuple):
    """Contributions of photons to pixels; n rows."""

    pixel: NDArray[np.int64]
    value: FloatArray  # (n, 3), radiance


@dataclass
class Balance:
    """The energy balance of all photons of all passes.

    The rows of ``power`` (4, 3) are the power emitted, escaped, absorbed by surfaces and media, and
    lost at ``max_depth``.
    """

    power: FloatArray = field(default_factory=lambda: np.zeros((4, 3)))
    n_emitted: int = 0
    n_stored: int = 0

    def add(self, other: Balance) -> None:
        """Add the balance of other photons."""
        self.power += other.power
        self.n_emitted += other.n_emitted
        self.n_stored += other.n_stored


class PhotonTracer:
    """Emits photons and traces them.

    ``contacts``: None if no dielectric touches another surface.
    ``dense``: where caustic photons are splatted; None: nowhere.
    Raises ValueError if an unbounded surface is emissive, or an environment lights an unbounded
    surface: photons cannot be distributed uniformly there. The object is named.
    """

    def __init__(self, context: RenderContext, contacts: Contacts | None) -> None:
        self.context, self._contacts = context, contacts
        self.balance = Balance()
        self.dense: DensePlaces | None = None
        scene = context.scene
        self.world = ball_of_world(scene)
        self._light = SurfaceLight(context)
        self.gathers = scene.materials_with(WIDE)
        self._spreads = scene.materials_with(SPREADS)
        self._powers = powers_of_lights(scene, self.world)
        sends = np.flatnonzero((self._powers[:-1] > 0.0) & context.plan["photons"])
        self._media_around = MediaAroundLights(context, contacts, sends.tolist())

    @property
    def _targets(self) -> Targets:
        """What photons are aimed at; eye passes that send none never ask."""
        if not self.context.plan["aimed photons"]:
            return Targets(np.zeros((0, 3)), np.zeros(0))
        scene = self.context.scene
        return scene.once("targets", lambda: targets_of(scene))

    def groups(self, photons_per_pass: int) -> list[Group]:
        """Allot the photons of a pass to lights by power; every light that emits gets some."""
        power, groups = self._powers, list[Group]()
        share = self._shares(power / power.sum()) if power.any() else power
        aimed_share = AIMED_SHARE if self._targets.radius.size else 0.0
        for light in np.flatnonzero(power > 0.0):
            n = max(round(photons_per_pass * share[light]), 2)
            n_aimed = round(aimed_share * n)
            kinds = (False, True) if n_aimed else (False,)
            for is_aimed in kinds:
                groups.append(Group(len(groups), int(light), is_aimed, n - n_aimed, n_aimed))
        return groups

    def _shares(self, by_power: FloatArray) -> FloatArray:
        """Return which part of the photons each light gets, from the parts by power."""
        return by_power

    def shoot(
        self, block: list[Piece], pass_number: int, dimension: int, least: int
    ) -> tuple[Photons, list[Splats]]:
        """Trace the photons of a block together; return the stored photons and the splats.

        ``dimension``: first dimension of their random numbers.
        ``least``: photons with a smaller ``history`` are not stored.
        """
        context = self.context
        stored = [new_photons(0)]
        shown: list[Splats] = []
        with context.ledger.stage("photons"):
            names = [names_of(piece, pass_number) for piece in block]
            flight = self._launched([piece.group for piece in block], names, dimension)
        for depth in range(context.max_depth + 1):
            if flight.number.size == 0:
                break
            step = dimension + PER_LAUNCH + PER_STEP * depth
            with context.ledger.stage("photons"):
                # --- where they arrive
                hits, second, material = self._arrived(flight)
                shading = self._light.shading(
                    hits, flight.direction, material, flight.media, second
                )
                # --- what they leave there, and what the camera sees of it
                to_show = self._to_show(flight, shading)
                stored.append(self._stored(flight, shading, to_show, least))
                if to_show.size:
                    shown.append(self._shown(flight, shading, to_show, step)[1])
                # --- where they go next, and which ones stop
                goes_on = depth < context.max_depth
                flight = self._onward(flight, shading, second, step, goes_on)
        photons = joined(stored)
        self.balance.n_stored += len(photons.history)
        return photons, shown

    def _arrived(self, flight: Flight) -> tuple[HitRecord, IntArray, IntArray]:
        """Return where photons arrive: hits, faces that coincide with them, and materials.

        What media on the way absorb is taken from their power.
        """
        context = self.context
        source = NamedPoints(flight.source_id, flight.origin)
        hits, second = first_hits(
            context.tracer, self._contacts, flight.origin, flight.direction, source
        )
        context.ledger.rays["photon"] += len(hits)
        context.ledger.count_hits(hits)
        material = self._light.material(hits)
        taken = self.balance.power[TAKEN]
        add_power(flight.power, 1.0, taken)
        absorb(context, flight.media, material, hits, second, flight.power)
        add_power(flight.power, -1.0, taken)
        return hits, second, material

    def _to_show(self, flight: Flight, shading: Shading) -> NDArray[np.intp]:
        """Return the photons of caustics that have arrived where these are dense."""
        if self.dense is None:
            return np.zeros(0, dtype=np.intp)
        rows = np.flatnonzero((flight.history == MET_SPECULAR) & self.gathers[shading.material])
        return rows[self.dense.near(shading.hits.position[rows])]

    def _shown(
        self,
        flight: Flight,
        shading: Shading,
        rows: NDArray[np.intp],
        step: int,
        softened: LobeTable | None = None,
    ) -> tuple[NDArray[np.intp], Splats]:
        """Splat photons; return the rows of those that the camera sees, and their contributions.

        Where a disc as wide as a pixel would hold many photons, density estimation adds only blur. There
        each caustic photon is splatted to the pixel that sees it (Arvo, "Backward ray tracing", SIGGRAPH
        1986 course notes). Density estimation leaves it out where the camera sees the surface directly,
        and counts it where it sees the surface through mirrors and glass. So each photon counts once.

        ``rows`` (k,) int64: the photons to splat.
        ``softened``: narrow lobes to see the photons by, on both sides of rough glass. Default: the
        scene's wide lobes.
        """
        context, hits, geometric = self.context, shading.hits, shading.geometric
        lens = None
        if context.plan["lens samples"]:
            lens = self._points(flight.number[rows], step + LENS)
        lobes, asked, ratio = context.scene.lobes, WIDE, NO_RATIO
        if softened is not None:
            lobes, asked, ratio = softened, NARROW, rows_of(shading.ratio, rows)
        position = hits.position[rows]
        way, pixel, pdf = context.scene.camera.sees(position, lens)
        value = np.empty((rows.size, 3))
        splat_photons(
            lobes, asked, shading.material[rows], shading.colors[rows], hits.normal[rows],
            rows_of(geometric, rows), ratio, flight.direction[rows], flight.power[rows], way, pdf, value,
        )  # fmt: skip
        seen = np.flatnonzero(value.any(axis=1))
        named = NamedPoints(hits.object_id[rows[seen]], position[seen])
        context.ledger.rays["photons to camera"] += seen.size
        blocked = context.tracer.occluded(named.position, -way[seen], 1.0, source=named)
        seen = seen[~blocked]
        return rows[seen], Splats(pixel[seen], value[seen])

    def _stored(
        self, flight: Flight, shading: Shading, to_show: NDArray[np.intp], least: int
    ) -> Photons:
        """Return the photons that have arrived where light is gathered; those shown are marked."""
        hits, out = shading.hits, new_photons(flight.number.size)
        normal = shading.geometric if shading.geometric.size else hits.normal
        flight.history[to_show] |= IS_SHOWN
        n = store_photons(flight, shading.material, self.gathers, least, hits.position, normal, out)
        flight.history[to_show] ^= IS_SHOWN
        return rows_of(out, np.arange(n))

    def _onward(
        self, flight: Flight, shading: Shading, second: IntArray, step: int, goes_on: bool
    ) -> Flight:
        """Choose where each photon goes; return those that go on."""
        hits, material, n = shading.hits, shading.material, flight.number.size
        fate = np.empty(n, dtype=np.uint8)
        scatter_photons(
            self.context.scene.lobes, material, shading.colors, hits.normal, shading.geometric,
            shading.ratio, hits.position, hits.object_id, self._ways(flight, material, step),
            self._points(flight.number, step + LOBE), second, goes_on, flight, fate,
            self.balance.power,
        )  # fmt: skip
        ended = self.context.ledger.ended
        counts = np.bincount(fate, minlength=SPECULAR + 1)
        ended["photons absorbed or by roulette"] += int(counts[ABSORBED])
        ended["photons left or met a lamp"] += int(counts[LEFT])
        ended["photons at max_depth"] += int(counts[STOPPED])
        return rows_of(flight, np.flatnonzero(fate >= SCATTERED))

    def _launched(
        self, groups: Sequence[Group], names: Sequence[UIntArray], dimension: int
    ) -> Flight:
        """Launch the photons of these names of each group; groups of the sky come last."""
        scene = self.context.scene
        number = np.concatenate(names)
        n = number.size
        # Where a photon arrives depends on all of these together.
        name, index = in_sequence(number)
        xi = self.context.sampler.joint(name, dimension + LAUNCH, index, 5)
        # Columns of their own: slices are another type to numba, and the kernels compiled twice.
        way, place, choice = xi[:, :2].copy(), xi[:, 2:4].copy(), xi[:, 4].copy()
        columns = np.array([(g.light, g.n_spread, g.n_aimed, g.is_aimed) for g in groups])
        counts = [part.size for part in names]
        light, n_spread, n_aimed, is_aimed = np.repeat(columns, counts, axis=0).T.copy()
        launch = new_rows(Launch, n, "3f8, 3f8, 3f8")
        end = int(np.searchsorted(light, scene.n_lights))
        if end:
            launch_from_lights(
                scene.lights, scene.textures, leaving_points(scene, light[:end], place[:end]),
                light[:end], self._targets, n_spread, n_aimed, is_aimed, place, way, choice,
                np.empty((self._targets.radius.size, 5)), launch,
            )  # fmt: skip
        if end < n:
            launch_from_sky(
                scene.sky, self.world, self._targets, n_spread[end:], n_aimed[end:],
                is_aimed[end:], place[end:], way[end:], choice[end:],
                rows_of(launch, slice(end, n)),
            )  # fmt: skip
        source_id = np.append(scene.surface_of_light, np.int32(NOTHING))[light]
        self.balance.n_emitted += n
        add_power(launch.power, 1.0, self.balance.power[EMITTED])
        sent = np.flatnonzero(largest_channel(launch.power) > 0.0)
        origin, direction = launch.origin[sent], launch.direction[sent]
        return Flight(
            number=number[sent],
            origin=origin,
            direction=direction,
            power=launch.power[sent],
            media=self._media_around.at(light[sent], origin, direction),
            source_id=source_id[sent],
            history=np.zeros(sent.size, dtype=np.uint8),
        )

    def _points(self, number: UIntArray, dimension: int) -> FloatArray:
        name, index = in_sequence(number)
        return self.context.sampler.points(name, dimension, index)

    def _ways(self, flight: Flight, material: IntArray, step: int) -> FloatArray:
        """Return the numbers that choose directions, for the photons that may need them."""
        xi = np.zeros((material.size, 2))
        rows = np.flatnonzero(self._spreads[material])
        if rows.size:
            xi[rows] = self._points(flight.number[rows], step + DIRECTION)
        return xi


def new_photons(n: int) -> Photons:
    """Allocate n stored photons."""
    return new_rows(Photons, n, "3f8, 3f4, 3f4, 3f4, u1")
