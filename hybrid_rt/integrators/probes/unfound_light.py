"""The size of the light that an integrator does not find, estimated by photons.

Photons of the lights concerned are followed by a `hybrid_rt.integrators.probes.probe.Probe`; what the
camera sees of them by paths that the integrator does not find is added up. The sum is unbiased for the
paths that end in ``DE``: on a surface with a wide lobe that the camera sees directly. Paths without any
``D`` are not measured.

Which kinds of paths an integrator finds does not depend on how long they may be. So photons are
followed for `LEAST_DEPTH` bounces at least, even if the picture has a smaller ``max_depth``.
"""

import math
import re
from dataclasses import replace
from functools import partial

import numpy as np

from hybrid_rt.core.ledger import twelve_digits
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import LOST
from hybrid_rt.integrators.photons.figures import LightNotFound
from hybrid_rt.integrators.probes.probe import (
    TRAITS,
    Probe,
    View,
    beginnings_of,
    first_surfaces,
    group_of_photons,
    probe_of,
)
from hybrid_rt.integrators.rows import rows_of
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.intervals import STUDENT
from hybrid_rt.sensor.passes import GROUPS

# Photons traced: one a pixel. A caustic that holds a tenth of the light is then known to about a
# tenth of itself, in about 0.1 s.
FEWEST_PHOTONS, MOST_PHOTONS = 2000, 20_000
# Bounces that photons are followed for at least: the default ``max_depth`` of a render. The light that
# whitted leaves out has one bounce and more, whatever ``max_depth`` is.
LEAST_DEPTH = 16
# Why there is no size.
MIXED = "photons cannot follow a mirror alone that is mixed with rough glass"
# Far from the dimensions of the photons in pictures.
UNFOUND_DIMENSION = 2**42
# Camera rays for each photon: fewer add noise.
RAYS = 2


@OVERFLOWS
def unfound_light(context: RenderContext, found: str) -> LightNotFound | None:
    """Estimate the light that is not found.

    ``context``: its counts are left alone; the seconds of coarse hits are added to its tracer's.
    ``found``: regular expression of the paths that are found; see
    `hybrid_rt.integrators.light_found`.
    Returns None if it cannot be measured so: no such path meets a wide lobe, the camera is inside
    glass, a light has no end (see `PhotonTracer`), or the light is too bright for float64.
    """
    camera = context.scene.camera
    n = min(max(camera.width * camera.height, FEWEST_PHOTONS), MOST_PHOTONS)
    means, is_measured, n_photons = np.zeros(GROUPS), False, 0
    is_mixed, begun, lost = False, 0.0, 0.0
    for beginnings in beginnings_of(context.scene, partial(_begin, found)):
        try:
            tracer = probe_of(context, beginnings, _depth(context), UNFOUND_DIMENSION)
        except ValueError:  # photons cannot be distributed uniformly on what has no end
            return None
        if tracer is None or not tracer.has_beginnings or not tracer.context.plan["photons"]:
            continue
        is_measured = True
        is_mixed |= tracer.is_mixed
        means += _mean_by_group(tracer, n // GROUPS)
        context.tracer.coarse_seconds += tracer.context.tracer.coarse_seconds
        n_photons += tracer.balance.n_emitted
        begun += tracer.begun
        lost += float(tracer.balance.power[LOST].sum())
    if not is_measured or not np.isfinite(means).all():
        return None
    lost_share = twelve_digits(lost / begun) if begun > 0.0 else 0.0
    light = LightNotFound(n_photons, _depth(context), lost_share)
    why = ""
    if is_mixed:
        why = MIXED
    elif not (means > 0.0).all():
        few = "too few" if means.any() else "none"
        why = f"of {n_photons:,} photons {few} reach the camera"
    if why:
        return replace(light, why_unknown=why)
    half = STUDENT[GROUPS - 2] * float(means.std(ddof=1)) / math.sqrt(GROUPS)
    return replace(light, mean=float(means.mean()), half_interval_95=half)


def _depth(context: RenderContext) -> int:
    """Return the number of bounces to follow photons for."""
    return max(context.max_depth, LEAST_DEPTH)


def _mean_by_group(tracer: Probe, photons_per_pass: int) -> FloatArray:
    """Return what the photons of a pass of each group of passes add to the mean, (GROUPS,)."""
    seen = tracer.follow(photons_per_pass)
    total: FloatArray = np.bincount(
        group_of_photons(seen.number), seen.value, minlength=GROUPS
    ).astype(np.float64)
    if tracer.number_of_stored.size:
        view = View(tracer.context, UNFOUND_DIMENSION - 2)
        group = group_of_photons(tracer.number_of_stored)
        for k in range(GROUPS):
            view.radiance(rows_of(tracer.stored, group == k), k, RAYS * photons_per_pass)
            total[k] += view.gathered.mean()
    return total


def _begin(found: str, light: str) -> tuple[str, bool, bool]:
    """Return the surfaces behind which no path of a light is found, and whether its direct light is not."""
    some = first_surfaces(found, light, any)
    firsts = "".join(first for first in TRAITS if first not in some)
    return firsts, not re.fullmatch(found, f"{light}DE"), False
