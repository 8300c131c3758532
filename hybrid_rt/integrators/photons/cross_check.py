"""An independent estimate of the mean of a picture, by photons.

Camera paths that meet little of the light agree with each other all the same, and so no variance
between them tells of what they lack: a highlight that falls between the samples, light through rough
glass or a thin opening, a small bright spot. Photons come to it from the other end. A `Probe` follows
some of all lights, a few for the camera rays of hundreds, and what the camera sees of them is added to
what camera rays see of lamps and sky. The mean of the picture is held against that.

Where lobes are so narrow that photons, too, would miss what the camera sees of lights without area, the
last lobe before the camera is widened. All else is unbiased but for the blur of photons seen in mirrors.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import Photons
from hybrid_rt.integrators.light_found import letters_of_lights
from hybrid_rt.integrators.photons.photon_tracer import joined
from hybrid_rt.integrators.photons.probe import (
    Beginnings,
    Probe,
    View,
    context_for_photons,
    first_surfaces,
    group_of_photons,
    probe_of,
)
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.intervals import STUDENT, TWO_SIDED
from hybrid_rt.sensor.passes import GROUPS

# Photons of a first try, one for so many pixels, and within these limits. If the camera sees fewer than
# ENOUGH of them, in effect, MOST_PHOTONS are sent.
PIXELS_EACH, FEWEST_PHOTONS, MOST_PHOTONS, ENOUGH = 64, 2000, 20_000, 30.0
# Far from the dimensions of all other photons, and of the first ones where photons are sent again.
CHECK_DIMENSION, REPEATED = 2**43, 2**44
# The normal quantile of a limit that one estimate of a thousand is beyond.
ONE_IN_1000 = 3.09
# The brightest place is where so many photons lie closest together, in cells of a grid that halve so
# often; of more photons some are looked at.
IN_A_CELL, HALVINGS, MOST_PLACES = 8, 20, 20_000


@dataclass(frozen=True)
class MeanEstimate:
    """An estimate of the mean of a picture over pixels and channels.

    Attributes
    ----------
    n_photons : int
        Photons traced.
    n_seen : int
        Those that the camera sees.
    n_effective : float
        How many events of one size would have the same relative error.
    mean : float
    low, high : float
        The 95 % interval of ``mean``: a score interval, as few bright photons make it skewed.
    least : float
        A limit that a true mean is below in one estimate of a thousand.
    of_highlights : float
        The part of ``mean`` that narrow lobes show of lights without area.
    brightest_place : float
        The radiance of the brightest place that reflects light widely, about: the mean of the channels
        where `IN_A_CELL` photons lie closest together.
    """

    n_photons: int
    n_seen: int
    n_effective: float
    mean: float
    low: float
    high: float
    least: float
    of_highlights: float
    brightest_place: float


class CrossCheck:
    """An estimate of the mean of the light that an integrator finds, repeated with more photons if need be.

    Parameters
    ----------
    context : RenderContext
        Its counts are left alone; the seconds of coarse hits are added to its tracer's.
    found : str
        Regular expression of the paths that are found; see `hybrid_rt.integrators.light_found`.

    Attributes
    ----------
    mean : MeanEstimate or None
        None if there is nothing to compare: what is returned is not radiance, the camera is inside
        glass, a light has no end (see `PhotonTracer`), or the light is too bright for float64.
    """

    def __init__(self, context: RenderContext, found: str) -> None:
        self._context, self._found = context, found
        camera = context.scene.camera
        n = min(max(camera.width * camera.height // PIXELS_EACH, FEWEST_PHOTONS), MOST_PHOTONS)
        self._is_first = n < MOST_PHOTONS
        self.mean: MeanEstimate | None = None
        # An integrator that finds every word, not only those that begin with a light, shows something else.
        if re.fullmatch(found, "LE") and not re.fullmatch(found, "E"):
            self.mean = self._estimate(n, CHECK_DIMENSION)
        if self.mean is not None and self.mean.n_effective < ENOUGH:
            self.repeat()

    def repeat(self) -> None:
        """Estimate once more, with `MOST_PHOTONS` other photons, unless that was done."""
        if self._is_first:
            self._is_first = False
            self.mean = self._estimate(MOST_PHOTONS, CHECK_DIMENSION + REPEATED) or self.mean

    @OVERFLOWS
    def _estimate(self, n: int, dimension: int) -> MeanEstimate | None:
        with self._context.ledger.stage("cross-check"):
            try:
                return _estimated(self._context, self._found, n, dimension)
            except ValueError:  # photons cannot be distributed uniformly on what has no end
                return None


def _estimated(context: RenderContext, found: str, n: int, dimension: int) -> MeanEstimate | None:
    """Return the estimate of about n photons, whose random numbers begin at this dimension."""
    probes = list[Probe]()
    values, highlights, n_photons = [np.zeros(0)], 0.0, 0
    stored, number = list[Photons](), [np.zeros(0, dtype=np.uint64)]
    lit, light = [np.zeros((0, 3))], [np.zeros(0)]
    for beginnings in _beginnings(context, found):
        probe = probe_of(context, beginnings, context.max_depth, dimension)
        if probe is None:
            return None
        seen = probe.follow(n // GROUPS)
        n_photons += probe.balance.n_emitted
        _, photon = np.unique(seen.number, return_inverse=True)
        values.append(np.bincount(photon, seen.value) / GROUPS)
        highlights += float(seen.value[seen.is_highlight].sum()) / GROUPS
        stored.append(probe.stored)
        number.append(probe.number_of_stored)
        lit.append(probe.lit)
        light.append(probe.light / GROUPS)
        probes.append(probe)
    if not probes:
        return None
    value = np.concatenate(values)
    own = context_for_photons(context, context.scene, context.max_depth)
    seen_by_rays = _of_camera_rays(own, joined(stored), np.concatenate(number), n, dimension)
    for used in (own, *(probe.context for probe in probes)):
        context.tracer.coarse_seconds += used.tracer.coarse_seconds
    moments = _moments(value, max(n_photons, 1)) + seen_by_rays
    mean, variance, third = (float(moment) for moment in moments)
    if not (math.isfinite(mean) and math.isfinite(third)):
        return None
    low, high = _interval(mean, variance, third, TWO_SIDED)
    return MeanEstimate(
        n_photons=n_photons,
        n_seen=value.size,
        n_effective=_ratio(mean, variance),
        mean=mean,
        low=low,
        high=high,
        least=_interval(mean, variance, third, ONE_IN_1000)[0],
        of_highlights=highlights,
        brightest_place=_brightest(np.concatenate(lit), np.concatenate(light)),
    )


def _beginnings(context: RenderContext, found: str) -> list[Beginnings]:
    """Return what begins paths that are found whatever follows, the lights that are alike together."""
    letters = dict.fromkeys(letters_of_lights(context.scene).tolist())
    if context.scene.environment is not None:
        letters["K"] = None
    lights: dict[tuple[str, bool, bool], str] = {}
    for light in letters:
        direct = bool(re.fullmatch(found, f"{light}DE"))
        # Lamps with area and the sky are met by the camera rays that narrow lobes send on.
        highlights = light == "P" and bool(re.fullmatch(found, "PGE"))
        key = first_surfaces(found, light, all), direct, highlights
        if any(key):
            lights[key] = lights.get(key, "") + light
    return [Beginnings(names, *key) for key, names in lights.items()]


def _of_camera_rays(
    context: RenderContext, photons: Photons, number: NDArray[np.uint64], n: int, dimension: int
) -> FloatArray:
    """Return the moments of what camera rays see: lamps, sky, and photons in mirrors; see `_moments`.

    Rays that gather the same photons are not independent: those of each group of passes have photons of
    their own, and the variance is at least what the groups differ by.
    """
    view, group = View(context, dimension - 2), group_of_photons(number)
    if not number.size:
        return _moments(view.radiance(photons, 0, n) / n, n)
    n = n // GROUPS
    of_groups = []
    for k in range(GROUPS):
        mine = Photons(*(column[group == k] for column in photons))
        of_groups.append(view.radiance(mine, k, n))
    moments = _moments(np.concatenate(of_groups) / (n * GROUPS), n * GROUPS)
    means = [float(radiance.mean()) for radiance in of_groups]
    between = float(np.var(means, ddof=1)) / GROUPS * (STUDENT[GROUPS - 2] / TWO_SIDED) ** 2
    if between > moments[1] > 0.0:
        moments[1:] *= between / moments[1]
    return moments


def _moments(values: FloatArray, n: int) -> FloatArray:
    """Return sum, and the second and third central moment of a sum of n values, of which others are 0."""
    mean = values.sum() / n
    gaps = values - mean
    left = n - values.size
    return np.array(
        [
            n * mean,
            (gaps**2).sum() + left * mean**2,
            (gaps**3).sum() - left * mean**3,
        ]
    )


def _interval(mean: float, variance: float, third: float, quantile: float) -> tuple[float, float]:
    """Return the score interval of a sum of rare events; see `half_interval_of_mean`."""
    event = third / variance if third > 0.0 else 0.0
    skewed = 0.5 * quantile**2 * event
    half = math.hypot(quantile * math.sqrt(variance), skewed)
    return mean + skewed - half, mean + skewed + half


def _brightest(position: FloatArray, light: FloatArray) -> float:
    """Return the radiance where photons (n, 3) with these powers (n,) lie closest together."""
    every = -(-light.size // MOST_PLACES) or 1
    position, light = position[::every], every * light[::every]
    if light.size < IN_A_CELL:
        return 0.0
    low = position.min(axis=0)
    size = float((position - low).max())
    highest = 0.0
    for halving in range(HALVINGS if size > 0.0 else 0):
        side = size / 2**halving
        cell = np.floor((position - low) / side).astype(np.int64)
        _, number = np.unique(cell @ np.array([1, 2**21, 2**42]), return_inverse=True)
        count = np.bincount(number)
        if count.max() < IN_A_CELL:
            break
        power = np.bincount(number, light)[count >= IN_A_CELL]
        highest = max(highest, float(power.max()) / (math.pi * side * side))
    return highest


def _ratio(mean: float, variance: float) -> float:
    """Return the squared mean over the variance; 0 where nothing was seen."""
    if variance > 0.0:
        return mean * mean / variance
    return math.inf if mean > 0.0 else 0.0
