"""The size of the light that an integrator does not find, estimated by photons.

Photons of the lights concerned are followed from surface to surface. Each that arrives by a path
that the integrator does not find is splatted to the pixel that sees it (Arvo, "Backward ray
tracing", SIGGRAPH 1986 course notes). The sum is unbiased for the paths that end in ``DE``: on a
surface with a wide lobe that the camera sees directly. What it sees of such surfaces in mirrors,
through glass and on metal is estimated by photon mapping: camera rays gather the same photons where
they end. That is blurred, so a little is lost at edges. Paths without any ``D`` are not measured.

Which kinds of paths an integrator finds does not depend on how long they may be. So photons are
followed for `LEAST_DEPTH` bounces at least, even if the picture has a smaller ``max_depth``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import PIXEL_BITS
from hybrid_rt.integrators.kernels.density_estimate import Sums
from hybrid_rt.integrators.kernels.photon_steps import LOST, Flight, Photons
from hybrid_rt.integrators.light_found import letters_of_lights
from hybrid_rt.integrators.media.beginnings import media_around_camera
from hybrid_rt.integrators.media.contacts import Contacts
from hybrid_rt.integrators.photons import PPM
from hybrid_rt.integrators.photons.density_estimation import Discs, Field, Radii
from hybrid_rt.integrators.photons.eye_pass import EyePass
from hybrid_rt.integrators.photons.light_tracing import shown_rows
from hybrid_rt.integrators.photons.photon_groups import Group, sequence_of, size_for_discs
from hybrid_rt.integrators.photons.photon_tracer import (
    LENS,
    PER_LAUNCH,
    PER_STEP,
    PhotonTracer,
    joined,
)
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.plan import make_plan
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.passes import GROUPS, RUN
from hybrid_rt.shading.kernels.lobes.register import DELTA, FOLLOWED, NARROW, TRANSMITS, WIDE

# Photons traced: one a pixel. A caustic that holds a tenth of the light is then known to about a
# tenth of itself, in about 0.1 s.
FEWEST_PHOTONS, MOST_PHOTONS = 2000, 20_000
# Of more lights so many are chosen by each group of passes: each takes launches of its own.
MOST_LIGHTS = 32
# Bounces that photons are followed for at least: the default ``max_depth`` of a render. The light that
# whitted leaves out has one bounce and more, whatever ``max_depth`` is.
LEAST_DEPTH = 16
# Why there is no size.
MIXED = "photons cannot follow a mirror alone that is mixed with rough glass"
# Far from the dimensions of the photons in pictures.
UNFOUND_DIMENSION = 2**42
# The sequence of a photon stands above its number there, so all are followed together: that takes a
# tenth of the time of following them group by group. As the sequence of all, the first one is named.
BITS, ALL = np.uint64(32), 0
# Camera rays for each photon, which gather photons within this share of the size of the scene: fewer
# or narrower ones add noise, wider ones lose more at edges.
RAYS, RADIUS = 2, 0.007
# Student's t for the means of four groups of photons, two-sided 95 %.
STUDENT = 3.182
# Lobes of the letters of `hybrid_rt.integrators.light_found`.
TRAITS = {"D": WIDE, "G": NARROW, "S": DELTA}
# Surfaces between the first and the last that are tried: paths that differ beyond do not differ in
# whether an integrator finds them.
MOST_BETWEEN = 2


@dataclass(frozen=True)
class UnfoundLight:
    """Light that an integrator does not find, of paths that meet a wide lobe.

    Attributes
    ----------
    n_photons : int
        Photons traced.
    mean : float or None
        What it would add to the mean of the picture over pixels and channels; None if not known.
    half_interval : float or None
        Half of the 95 % interval of ``mean``; None where nothing of a group of photons reaches the
        camera: what is seen so rarely has no interval that holds.
    max_depth : int
        Bounces that photons were followed for.
    lost_share : float
        What they carried there, over what they carried behind their first surface: about the share
        of this light that has more bounces, and that ``mean`` lacks.
    why_unknown : str
        Why there is no ``mean``; "": there is.
    """

    n_photons: int
    mean: float | None
    half_interval: float | None
    max_depth: int
    lost_share: float
    why_unknown: str = ""


@dataclass(frozen=True)
class _Beginnings:
    """Paths that are not found whatever follows: their lights, and their first surfaces.

    ``direct``: also those that arrive straight from the light.
    """

    lights: str
    firsts: str
    direct: bool


@OVERFLOWS
def unfound_light(context: RenderContext, found: str) -> UnfoundLight | None:
    """Estimate the light that is not found.

    Parameters
    ----------
    context : RenderContext
        Its counts are left alone; the seconds of coarse hits are added to its tracer's.
    found : str
        Regular expression of the paths that are found; see `hybrid_rt.integrators.light_found`.

    Returns
    -------
    UnfoundLight or None
        None if it cannot be measured so: no such path meets a wide lobe, the camera is inside
        glass, a light has no end (see `PhotonTracer`), or the light is too bright for float64.
    """
    camera = context.scene.camera
    n = min(max(camera.width * camera.height, FEWEST_PHOTONS), MOST_PHOTONS)
    means, is_measured, n_photons = np.zeros(GROUPS), False, 0
    is_mixed, begun, lost = False, 0.0, 0.0
    for beginnings in _beginnings(found, context.scene):
        try:
            tracer = _tracer(context, beginnings)
        except ValueError:  # photons cannot be distributed uniformly on what has no end
            return None
        if tracer is None or not tracer.has_beginnings:
            continue
        is_measured = True
        is_mixed |= tracer.is_mixed
        means += tracer.seen(n // GROUPS)  # by each group of passes
        context.tracer.coarse_seconds += tracer.context.tracer.coarse_seconds
        n_photons += tracer.balance.n_emitted
        begun += tracer.begun
        lost += float(tracer.balance.power[LOST].sum())
    if not is_measured or not np.isfinite(means).all():
        return None
    depth, lost_share = _depth(context), lost / begun if begun > 0.0 else 0.0
    why = ""
    if is_mixed:
        why = MIXED
    elif not (means > 0.0).all():
        few = "too few" if means.any() else "none"
        why = f"of {n_photons:,} photons {few} reach the camera"
    if why:
        return UnfoundLight(n_photons, None, None, depth, lost_share, why)
    half = STUDENT * float(means.std(ddof=1)) / math.sqrt(GROUPS)
    return UnfoundLight(n_photons, float(means.mean()), half, depth, lost_share)


def _depth(context: RenderContext) -> int:
    """Return the number of bounces to follow photons for."""
    return max(context.max_depth, LEAST_DEPTH)


class _Tracer(PhotonTracer):
    """Traces photons that begin in certain ways, and finds what the camera sees of them.

    Attributes
    ----------
    has_beginnings : bool
        Whether the scene has surfaces, or light straight from lights, that paths begin with.
    is_mixed : bool
        Whether some of these surfaces are mixtures of which photons cannot follow the part alone.
    begun : float
        Power of the photons that began so, summed over channels. Written.
    """

    def __init__(
        self,
        context: RenderContext,
        contacts: Contacts | None,
        beginnings: _Beginnings,
        chosen: FloatArray,
    ) -> None:
        super().__init__(context, contacts)
        self._direct = beginnings.direct
        self._chosen = chosen
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

    def seen(self, photons_per_pass: int) -> FloatArray:
        """Return what the photons of a pass of each group of passes add to the mean, (GROUPS,)."""
        context, total = self.context, np.zeros(GROUPS)
        groups = self.groups(photons_per_pass)
        if not groups:  # what shines is black
            return total
        mirrors = bool(context.scene.materials_with(FOLLOWED).any())
        stored: list[Photons] = []
        group_of_stored = [np.zeros(0, dtype=np.intp)]
        flight = self._all_launched(groups)
        for depth in range(context.max_depth + 1):
            if flight.number.size == 0:
                break
            step = UNFOUND_DIMENSION + PER_LAUNCH + PER_STEP * depth
            hits, second, material = self._arrived(flight)
            shading = self._light.shading(hits, flight.direction, material, flight.media, second)
            # --- what the camera sees of it
            rows = np.flatnonzero(self.gathers[shading.material])
            if rows.size and (depth or self._direct):
                lens = None
                if context.plan["lens samples"]:
                    lens = self._points(ALL, flight.number[rows], step + LENS)
                seen, splats = shown_rows(context, flight, shading, rows, lens)
                total += np.bincount(
                    _group_of(flight, seen), splats.value.sum(axis=1), minlength=GROUPS
                )
                if mirrors:
                    # Marked as shown: points that the camera sees directly do not gather them.
                    stored.append(self._stored(flight, shading, rows, 0))
                    group_of_stored.append(_group_of(flight, rows))
            # --- where they go next: at first only by lobes after which nothing is found
            if depth == 0:
                shading = replace(
                    shading,
                    colors=shading.colors * self._keeps[shading.material][:, :, None],
                    material=np.where(
                        self._begins[shading.material], shading.material, np.int32(NOTHING)
                    ),
                )
            goes_on = depth < context.max_depth
            if depth == 0 and self._direct:
                self.begun += float(flight.power[shading.material >= 0].sum())
            flight = self._onward(flight, shading, second, ALL, step, goes_on)
            if depth == 0 and not self._direct:
                self.begun += float(flight.power.sum())
        camera = context.scene.camera
        total /= 3 * camera.width * camera.height
        photons, group = joined(stored), np.concatenate(group_of_stored)
        if group.size:
            view = _MirrorView(context)
            for k in range(GROUPS):
                mine = Photons(*(column[group == k] for column in photons))
                total[k] += view.mean(mine, k, RAYS * photons_per_pass)
        return total

    def _all_launched(self, groups: list[Group]) -> Flight:
        """Launch photons of all lights and groups of passes; numbers tell their sequences."""
        flights = []
        for group in groups:
            for k in np.flatnonzero(self._chosen[:, group.light]).tolist():
                sequence, first = sequence_of(group, k * RUN)
                number = np.arange(first, first + group.n, dtype=np.uint64)
                flight = self._launched(group, sequence, number, UNFOUND_DIMENSION)
                flight.number[:] |= np.uint64(sequence) << BITS
                flight.power[:] *= self._chosen[k, group.light]
                flights.append(flight)
        return Flight(*(np.concatenate(columns) for columns in zip(*flights, strict=True)))


def _group_of(flight: Flight, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the group of passes of some photons."""
    group: NDArray[np.intp] = ((flight.number[rows] >> BITS) % np.uint64(GROUPS)).astype(np.intp)
    return group


class _MirrorView(EyePass):
    """Camera rays that gather photons where they arrive by way of mirrors, glass and metal."""

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        # Light that lamps send to what the rays meet is not asked for.
        self.casts_shadow_rays = self._casts_them_for_narrow = False
        self._radii = Radii.fixed(RADIUS * size_for_discs(context))
        self._sum = 0.0

    def mean(self, photons: Photons, group: int, n: int) -> float:
        """Return what photons add to the mean of the picture, by n camera rays spread over it."""
        scene, sampler = self.context.scene, self.context.sampler
        self.fields = (Discs(photons, scene.lobes, self._radii, 1.0),)
        self._sum = 0.0
        sample = np.arange(n, dtype=np.uint64)
        name = np.full(n, group, dtype=np.uint64)
        place = np.arange(n) + sampler.points(name, UNFOUND_DIMENSION - 2, sample)[:, 0]
        n_pixels = scene.camera.width * scene.camera.height
        pixel = np.minimum(place * (n_pixels / n), n_pixels - 1).astype(np.uint64)
        self.radiance_through(pixel + (name << PIXEL_BITS), sample)
        return self._sum / (3 * n)

    def _note_gathered(
        self, field: Field, camera_ray: NDArray[np.int64], throughput: FloatArray, sums: Sums
    ) -> None:
        del field, camera_ray
        self._sum += float((throughput * sums.value).sum())


def _tracer(context: RenderContext, beginnings: _Beginnings) -> _Tracer | None:
    """Return what traces photons of these beginnings; None if nothing is seen of them."""
    scene = context.scene
    letters = letters_of_lights(scene)
    sends = np.isin(letters, list(beginnings.lights))
    power = np.where(sends, scene.power, 0.0)
    chosen = _chosen(power, context.sampler)
    scene = replace(
        scene,
        power=np.where(chosen[:, :-1].any(axis=0), power, 0.0),
        environment=scene.environment if "K" in beginnings.lights else None,
    )
    tracer = context.tracer.with_own_counters()
    own = replace(
        context, scene=scene, plan=make_plan(scene, PPM), tracer=tracer, ledger=Ledger(),
        max_depth=_depth(context),
    )  # fmt: skip
    contacts = Contacts(scene, tracer) if own.plan["contacts"] else None
    if not own.plan["photons"] or (media_around_camera(own, contacts) != NOTHING).any():
        return None
    return _Tracer(own, contacts, beginnings, chosen)


def _chosen(power: FloatArray, sampler: Sampler) -> FloatArray:
    """Choose lights for each group of passes, evenly by power; of few lights all.

    Parameters
    ----------
    power : (lights,) float64

    Returns
    -------
    (GROUPS, lights + 1) float64
        Factors on the light of each, the sky last: 0 if not chosen, 1 in the mean.
    """
    factors = np.ones((GROUPS, power.size + 1))
    if np.count_nonzero(power) <= MOST_LIGHTS:
        return factors
    share = power / power.sum()
    before = np.cumsum(share)
    place = sampler.points(np.arange(GROUPS, dtype=np.uint64), UNFOUND_DIMENSION - 1, 0)[:, :1]
    rows = np.searchsorted(before / before[-1], (np.arange(MOST_LIGHTS) + place) / MOST_LIGHTS)
    for k in range(GROUPS):
        factors[k, :-1] = np.bincount(rows[k], minlength=power.size)
        factors[k, :-1] /= np.where(share > 0.0, MOST_LIGHTS * share, 1.0)
    return factors


def _beginnings(found: str, scene: CompiledScene) -> list[_Beginnings]:
    """Return what begins paths that are not found, the lights that are alike together."""
    letters = dict.fromkeys(letters_of_lights(scene).tolist())
    if scene.environment is not None:
        letters["K"] = None
    between = ["".join(word) for n in range(MOST_BETWEEN + 1) for word in product(TRAITS, repeat=n)]
    ends = [f"{word}{end}" for word in between for end in ("DE", "DSE", "DGE")]
    lights: dict[tuple[str, bool], str] = {}
    for light in letters:
        firsts = "".join(
            first
            for first in TRAITS
            if not any(re.fullmatch(found, f"{light}{first}{end}") for end in ends)
        )
        direct = not re.fullmatch(found, f"{light}DE")
        if firsts or direct:
            lights[firsts, direct] = lights.get((firsts, direct), "") + light
    return [_Beginnings(names, *key) for key, names in lights.items()]
