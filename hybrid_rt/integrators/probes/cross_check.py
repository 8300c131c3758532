"""An independent estimate of the mean of a picture, by photons.

Camera paths that meet little of the light agree with each other all the same, and so no variance
between them tells of what they lack: a highlight that falls between the samples, light through rough
glass or a thin opening, a small bright spot. Photons come to it from the other end. A `Probe` follows
some of all lights, a few for the camera rays of hundreds, and what the camera sees of them is added to
what camera rays see of lamps and sky. Far from what is in view they are connected to it, as
one photon on a small bright spot is to tell of its light. The mean of the picture is held against that.

Where lobes are so narrow that photons, too, would miss what the camera sees of lights without area, the
last lobe before the camera is widened. All else is unbiased but for the blur of photons seen in mirrors.
"""

import math
import re
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.photons.photon_tracer import new_photons
from hybrid_rt.integrators.probes.probe import (
    Ends,
    Probe,
    Seen,
    View,
    beginnings_of,
    context_for_photons,
    first_surfaces,
    group_of_photons,
    probe_of,
)
from hybrid_rt.integrators.rows import joined
from hybrid_rt.sensor.film import OVERFLOWS, REGIONS, regions_of
from hybrid_rt.sensor.intervals import STUDENT, TWO_SIDED, score_limits
from hybrid_rt.sensor.passes import GROUPS
from hybrid_rt.sensor.projection import Projection

# Photons of a first try, one for so many pixels, and within these limits. If the camera sees fewer than
# ENOUGH of them, in effect, MOST_PHOTONS are sent.
PIXELS_EACH, FEWEST_PHOTONS, MOST_PHOTONS, ENOUGH = 64, 2000, 20_000, 16.0
# Far from the dimensions of all other photons, and of the first ones where photons are sent again.
CHECK_DIMENSION, REPEATED = 2**43, 2**44
# The normal quantile of a limit that one estimate of a thousand is beyond.
ONE_IN_1000 = 3.09
# Photons are connected to ends of camera rays farther away than this times the extent of these ends, their
# root mean square distance from their middle: nearer ones find what is in view as often by themselves.
REACH = 1.5
# The brightest place is where so many photons lie closest together, in cells of a grid that halve so
# often; of more photons some are looked at.
IN_A_CELL, HALVINGS, MOST_PLACES = 8, 20, 20_000


@dataclass(frozen=True)
class MeanEstimate:
    """An estimate of the mean of a picture over pixels and channels."""

    n_photons: int  # photons traced
    n_seen: int  # those that the camera sees, or that are connected to what it sees
    # How many events of one size would have the same relative error; 0 if none of the photons of a
    # light is seen
    n_effective: float
    mean: float
    # The 95 % interval of ``mean``: a score interval, as few bright photons make it skewed
    low: float
    high: float
    least: float  # A limit that a true mean is below in one estimate of a thousand
    of_highlights: float  # the part of ``mean`` that narrow lobes show of lights without area
    # The radiance of the brightest place that reflects light widely, about: the mean of the
    # channels where `IN_A_CELL` photons lie closest together
    brightest_place: float
    # (3, `REGIONS`): mean, variance and third central moment of what surely lights regions of the
    # picture: all but highlights, and photons seen in mirrors
    regions: FloatArray

    def least_of_regions(self, quantile: float) -> FloatArray:
        """Return lower limits of what surely lights regions of the picture."""
        return _least(self.regions, quantile)

    def most_of_regions(self, quantile: float) -> FloatArray:
        """Return upper limits of it."""
        return _interval(self.regions, quantile)[1]


class CrossCheck:
    """An estimate of the mean of the light that an integrator finds, repeated with more photons if need be.

    ``context``: its counts are left alone; the seconds of coarse hits are added to its tracer's.
    ``found``: regular expression of the paths that are found; see
    `hybrid_rt.integrators.light_found`.
    ``mean``: None if there is nothing to compare: what is returned is not radiance, the camera is
    inside glass, a light has no end (see `PhotonTracer`), or the light is too bright for float64.
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

    def repeat(self) -> bool:
        """Estimate once more, with `MOST_PHOTONS` other photons, unless that was done; tell whether."""
        if not self._is_first:
            return False
        self._is_first = False
        self.mean = self._estimate(MOST_PHOTONS, CHECK_DIMENSION + REPEATED) or self.mean
        return True

    @OVERFLOWS
    def _estimate(self, n: int, dimension: int) -> MeanEstimate | None:
        with self._context.ledger.stage("cross-check"):
            try:
                return _estimated(self._context, self._found, n, dimension)
            except ValueError:  # photons cannot be distributed uniformly on what has no end
                return None


def _estimated(context: RenderContext, found: str, n: int, dimension: int) -> MeanEstimate | None:
    """Return the estimate of about n photons, whose random numbers begin at this dimension."""
    own = context_for_photons(context, context.scene, context.max_depth)
    view = View(own, dimension - 2)
    # --- camera rays: lamps and sky that they see, and where they end
    radiance = view.radiance(new_photons(0), GROUPS, n)
    place, ends = view.place, _ends(view, n)
    # --- photons
    probes, all_seen = list[Probe](), list[Seen]()
    for beginnings in beginnings_of(context.scene, partial(_begin, found)):
        probe = probe_of(context, beginnings, context.max_depth, dimension)
        if probe is None:
            return None
        all_seen.append(probe.follow(n // GROUPS, ends))
        probes.append(probe)
    if not probes:
        return None
    stored = joined([probe.stored for probe in probes])
    number = np.concatenate([probe.number_of_stored for probe in probes])
    n_photons = sum(probe.balance.n_emitted for probe in probes)
    if number.size:
        view.gather_photons(stored, group_of_photons(number))
    whole, n_seen = _moments_of_rays(radiance, view.gathered), 0
    for seen in all_seen:
        value = _by_photon(seen)
        whole += _moments(value, np.zeros(value.size, np.intp), max(n_photons, 1), 1)
        n_seen += value.size
    for used in (own, *(probe.context for probe in probes)):
        context.tracer.coarse_seconds += used.tracer.coarse_seconds
    mean, variance, third = (float(moment) for moment in whole[:, 0])
    if not (math.isfinite(mean) and math.isfinite(third)):
        return None
    low, high = _interval(whole, TWO_SIDED)
    return MeanEstimate(
        n_photons=n_photons,
        n_seen=n_seen,
        n_effective=_ratio(mean, variance) if all(p.sees_every_light for p in probes) else 0.0,
        mean=mean,
        low=float(low[0]),
        high=float(high[0]),
        least=float(_least(whole, ONE_IN_1000)[0]),
        of_highlights=sum(float(s.value[s.is_highlight].sum()) / GROUPS for s in all_seen),
        brightest_place=_brightest(
            np.concatenate([probe.lit for probe in probes]),
            np.concatenate([probe.light for probe in probes]) / GROUPS,
        ),
        regions=_moments_of_regions(
            context.scene.camera, all_seen, place, radiance, max(n_photons, 1)
        ),
    )


def _begin(found: str, light: str) -> tuple[str, bool, bool]:
    """Return the surfaces behind which all paths of a light are found, and whether its direct light is."""
    # Lamps with area and the sky are met by the camera rays that narrow lobes send on.
    highlights = light == "P" and bool(re.fullmatch(found, "PGE"))
    direct = bool(re.fullmatch(found, f"{light}DE"))
    return first_surfaces(found, light, all), direct, highlights


def _ends(view: View, n: int) -> Ends | None:
    """Return where n camera rays end; None where nothing spreads light widely."""
    if view.points is None:
        return None
    position = view.points.shading.hits.position
    size = math.sqrt(float(position.var(axis=0).sum()))
    return Ends(view.points, n, REACH * size)


def _moments_of_rays(radiance: FloatArray, gathered: FloatArray) -> FloatArray:
    """Return the moments (3, 1) of the mean of camera rays; see `_moments`.

    Those that gather the same photons are not independent: the variance is at least what groups differ by.
    """
    n, total = radiance.size, radiance + gathered
    moments = _moments(total / n, np.zeros(n, np.intp), n, 1)
    if gathered.any():
        means = np.array([total[k::GROUPS].mean() for k in range(GROUPS)])
        between = float(means.var(ddof=1)) / GROUPS * (STUDENT[GROUPS - 2] / TWO_SIDED) ** 2
        if between > moments[1, 0] > 0.0:
            moments[1:] *= between / moments[1, 0]
    return moments


def _by_photon(seen: Seen) -> FloatArray:
    """Return what each photon adds to the mean."""
    _, photon = np.unique(seen.number, return_inverse=True)
    return np.bincount(photon, seen.value) / GROUPS


def _moments_of_regions(
    camera: Projection,
    all_seen: list[Seen],
    place: NDArray[np.int64],
    radiance: FloatArray,
    n_photons: int,
) -> FloatArray:
    """Return the moments (3, `REGIONS`) of what surely lights regions of the picture; see `_moments`.

    Photons in mirrors and highlights of widened lobes are left out: their blur may cross borders.
    """
    region = regions_of(camera.height, camera.width).ravel()
    parts_of_picture = np.bincount(region, minlength=REGIONS) / region.size
    of_ray = region[place]
    n = np.maximum(np.bincount(of_ray, minlength=REGIONS), 1)
    moments = _moments(radiance / n[of_ray], of_ray, n, REGIONS)
    for seen in all_seen:
        own = np.flatnonzero(~seen.is_highlight)
        key = seen.number[own] * np.uint64(REGIONS) + region[seen.pixel[own]].astype(np.uint64)
        each, photon = np.unique(key, return_inverse=True)
        value = np.bincount(photon, seen.value[own]) / GROUPS
        of_value = (each % np.uint64(REGIONS)).astype(np.intp)
        value /= parts_of_picture[of_value]
        moments += _moments(value, of_value, n_photons, REGIONS)
    return moments


def _moments(
    values: FloatArray, region: NDArray[np.intp], n: NDArray[np.intp] | int, n_regions: int
) -> FloatArray:
    """Return sum, and the second and third central moment of a sum, of n values in each region.

    Values that are not given are 0.

    Returns (3, n_regions).
    """
    total = np.bincount(region, values, n_regions)
    mean = total / n
    gaps = values - mean[region]
    left = n - np.bincount(region, minlength=n_regions)
    second = np.bincount(region, gaps**2, n_regions) + left * mean**2
    third = np.bincount(region, gaps**3, n_regions) - left * mean**3
    return np.stack([total, second, third])


def _interval(moments: FloatArray, quantile: float) -> tuple[FloatArray, FloatArray]:
    """Return the score intervals of sums of rare events by their moments (3, n)."""
    mean, variance, _ = moments
    lower, upper = score_limits(quantile * np.sqrt(variance), _event(moments), quantile)
    return mean + lower, mean + upper


def _least(moments: FloatArray, quantile: float) -> FloatArray:
    """Return lower limits of such sums that hold far out, where score intervals do not.

    Of n events the limit is chi square's over 2, with 2 n degrees of freedom, by Wilson and Hilferty, "The
    distribution of chi-square", PNAS 1931. One event alone tells next to nothing.
    """
    mean, variance, _ = moments
    event, error = _event(moments), np.sqrt(variance)
    # 1 / sqrt(n), as n events of this size have this variance.
    rare = np.divide(event, error, out=np.zeros_like(mean), where=error > 0.0)
    root = np.maximum(1.0 - rare * rare / 9.0 - quantile * rare / 3.0, 0.0)
    is_rare = rare > 1e-6
    below = np.divide(error * (1.0 - root**3), rare, out=quantile * error, where=is_rare)
    return mean - below


def _event(moments: FloatArray) -> FloatArray:
    """Return the size of one event."""
    _, variance, third = moments
    return np.divide(third, variance, out=np.zeros_like(third), where=third > 0.0)


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
