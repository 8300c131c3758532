"""The report of a render: settings, seconds, counts, errors, and the light that is left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_rt.core.ledger import twelve_digits
from hybrid_rt.core.memory import peak_memory_mib
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.media.absorption import unclosed_bodies
from hybrid_rt.integrators.workers import Blur
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.limits import Clock
from hybrid_rt.rendering.unmet_light import (
    interval_of_noise,
    missing_light,
    unmet_light,
    unmet_place,
)
from hybrid_rt.rendering.versions import versions
from hybrid_rt.sensor.film import Film

if TYPE_CHECKING:
    from hybrid_rt.integrators.photons.cross_check import CrossCheck
    from hybrid_rt.integrators.photons.unfound_light import UnfoundLight

# What a picture holds if nothing is left out.
ALL_LIGHT = "all light"
# Light that an integrator does not find and that is not measured either.
NOT_MEASURED = "paths without a surface that spreads light widely"
# From this share on, what max_depth cuts off is said of the picture as a whole as well; below, it is
# less than the intervals of common renders.
COUNTS = 1e-4


def light_left_out(
    report: dict[str, Any], left_out: list[str], unfound: UnfoundLight | None
) -> dict[str, Any]:
    """Return the entries about light that is not in the picture.

    Parameters
    ----------
    report : dict
        The entries so far.
    left_out : list of str
        The kinds of paths that the integrator does not find; see `Declaration.left_out_light`.
    unfound : UnfoundLight, optional
        Their size, if it was measured.

    Returns
    -------
    dict
        ``light_not_found``: ``left_out``. ``light_not_found_measured``: the ``mean`` of what paths
        with a wide lobe carry in up to ``max_depth`` bounces, with ``half_interval_95`` and
        ``share_of_image_mean``, all three None where ``why_unknown`` says that there is no size; None
        if not measured. Its ``not_measured`` names what it leaves out. ``picture_holds``: the light
        that the image mean, its interval and the relative errors are about. ``picture_is_blurred``:
        by photons.
    """
    integrator, max_depth = (report["settings"][name] for name in ("integrator", "max_depth"))
    holds = f"the light that {integrator} finds" if left_out else ALL_LIGHT
    if max(share_cut_off(report)) >= COUNTS:
        holds += (
            f" in up to {max_depth} bounces"
            if depth_cuts_off(report)
            else " but for faint branches"
        )
    measured, noise = None, report["noise"]
    if unfound is not None:
        of_image = noise["image_mean"] if noise is not None else 0.0
        share = None
        if unfound.mean is not None and of_image > 0.0:
            share = unfound.mean / of_image
        measured = {
            "photons": unfound.n_photons,
            "max_depth": unfound.max_depth,
            "mean": unfound.mean,
            "half_interval_95": unfound.half_interval,
            "share_of_image_mean": share,
            "lost_share": twelve_digits(unfound.lost_share),
            "why_unknown": unfound.why_unknown,
            "not_measured": NOT_MEASURED,
        }
    return {
        "light_not_found": left_out,
        "light_not_found_measured": measured,
        "picture_holds": holds,
        "picture_is_blurred": "photons" in report
        and report["photons"]["blur_root_mean_square_at_most"] != 0.0,
    }


def share_cut_off(report: dict[str, Any]) -> tuple[float, float]:
    """Return what limits of depth and weight have ended.

    Returns
    -------
    of_paths : float
        What paths from the camera carried there, over what they carried behind the first surface that
        spreads light: a dark surface sends little on in any case.
    of_photons : float
        The power that photons carried there, over all that was emitted; 0 without photons.
    """
    of_photons = 0.0
    if "photons" in report:
        power = report["photons"]["power_of_all_passes"]
        if any(power["lost"]):
            of_photons = sum(power["lost"]) / sum(power["emitted"])
    return report["ended_branches"]["lost_share"], of_photons


def depth_cuts_off(report: dict[str, Any]) -> bool:
    """Tell whether ``max_depth`` has ended anything, not only the limit of faint branches.

    Integrators from elsewhere may state the weight that was lost, and not how many paths lost it.
    """
    ended, (of_paths, of_photons) = report["ended_branches"], share_cut_off(report)
    is_by_depth = of_paths > 0.0 and not ended.get("below least contribution", 0)
    return ended.get("at max_depth", 0) > 0 or is_by_depth or of_photons > 0.0


def relative_error(
    noise: dict[str, Any] | None, blur: Blur, blur_stays: bool, error_power: float
) -> dict[str, Any] | None:
    """Return the estimated relative errors of the picture, or None after a single pass.

    ``blur_stays`` and ``error_power`` are those of `hybrid_rt.integrators.Options`.
    """
    if noise is None:
        return None
    both = math.hypot(noise["relative_rmse"], blur.counted)
    trimmed = math.hypot(noise["relative_rmse_trimmed"], blur.counted)
    ahead = math.hypot(noise["relative_rmse_trimmed_ahead"], blur.counted)
    return {
        "noise": noise["relative_rmse"],
        "noise_trimmed": noise["relative_rmse_trimmed"],
        "blur": blur.relative,
        "blur_at_most": blur.relative_at_most,
        "both": both if blur.counted < math.inf else None,
        "both_trimmed": trimmed if blur.counted < math.inf else None,
        "both_trimmed_ahead": ahead if blur.counted < math.inf else None,
        "blur_stays": blur_stays,
        "error_power": error_power,
    }


def _with_others(rays: dict[str, int], traced: int) -> dict[str, int]:
    """Return counts of rays by kind, with those that nobody named as "other"."""
    others = traced - sum(rays.values())
    return {**rays, "other": others} if others > 0 else rays


def make_report(
    settings: dict[str, Any],
    context: RenderContext,
    film: Film,
    clock: Clock,
    stopped_by: str,
    blur: Blur,
    check: CrossCheck | None,
) -> dict[str, Any]:
    """Return the entries that every integrator has."""
    ledger, tracer, total = context.ledger, context.tracer, clock.earlier + clock.seconds
    n_camera = ledger.rays["camera"]
    work = tracer.counters
    not_closed, lost = unclosed_bodies(context)
    n_certified = work["rays"] + work["shadow_rays"] - work["given_up"]
    return {
        "settings": settings,
        "versions": versions(),
        "passes": film.n_passes,
        "stopped_by": stopped_by,
        "seconds": {
            **{stage: round(seconds, 4) for stage, seconds in ledger.seconds.items()},
            # Threads that start, end and wait for each other, and whatever has no stage.
            "other": round(max(total - sum(ledger.seconds.values()), 0.0), 4),
            "total": round(total, 4),
        },
        "coarse": _coarse(tracer, total),
        "kernel_compilation_seconds": round(clock.earlier_compilation + clock.compile_seconds, 4),
        "rays": _with_others(dict(ledger.rays), work["rays"] + work["shadow_rays"]),
        "hits": dict(ledger.hits),
        "intersection": dict(work),
        "ended_branches": {
            **ledger.ended,
            "lost_weight_per_camera_ray": twelve_digits(ledger.lost_weight / n_camera),
            "lost_share": twelve_digits(ledger.lost_share()),
        },
        **_noise_and_check(
            film, context, blur, check, INTEGRATORS[settings["integrator"]].sends_photons
        ),
        "clear_bodies_not_closed": not_closed,
        "clear_bodies_lost": lost,
        "pixels_not_finite": int(np.count_nonzero(~np.isfinite(film.image).all(axis=2))),
        "geometry": {
            "accuracy": tracer.accuracy,
            "camera_hits": ledger.camera_hits,
            "camera_hits_without_bound": ledger.camera_hits_without_bound,
            "largest_t_bound_of_camera_hits": ledger.largest_t_bound,
            "certified_rays": n_certified if tracer.accuracy == "certified" else 0,
            "given_up": work["given_up"],
            "tangent": ledger.hits["tangent"],
            "changed_by_certificate": work["changed_by_certificate"],
        },
        "peak_memory_mib": round(peak_memory_mib(), 1),
        "plan": {"light": context.plan.as_dict(), "intersection": tracer.plan},
    }


def _noise_and_check(
    film: Film, context: RenderContext, blur: Blur, check: CrossCheck | None, ends_at_matt: bool
) -> dict[str, Any]:
    """Return the noise with half the 95 % interval of the image mean, and the estimate beside it.

    Wider to both sides for the blur of the mean, as far as it is known. At least what light that was not
    met may add, and what the mean lacks by the independent estimate.
    """
    noise = film.noise()
    if noise is None:
        return {"noise": None, "cross_check": None}
    n, camera = film.n_passes, context.scene.camera
    lamps = unmet_light(context.scene, n, ends_at_matt, context.options.samples_lights)
    place = unmet_place(context.scene, check, film, n * camera.width * camera.height)
    lamps, place = twelve_digits(lamps), twelve_digits(place)
    half = max(interval_of_noise(noise) + blur.of_mean_at_most, lamps, place)
    lost = twelve_digits(context.ledger.lost_share())
    lacks, is_contradicted = missing_light(check, noise, half, lost)
    noise |= {"unmet_lamps_95": lamps, "half_interval_95_of_image_mean": max(half, lacks)}
    estimate = None if check is None else check.mean
    if estimate is None:
        return {"noise": noise, "cross_check": None}
    return {
        "noise": noise,
        "cross_check": {
            "photons": estimate.n_photons,
            "photons_seen": estimate.n_seen,
            "mean": estimate.mean,
            "interval_95": [estimate.low, estimate.high],
            "of_highlights": estimate.of_highlights,
            "brightest_place": estimate.brightest_place,
            "unmet_place_95": place,
            "image_mean_lacks_at_most": lacks,
            "contradicts": is_contradicted,
        },
    }


def _coarse(tracer: Intersector, total: float) -> dict[str, Any]:
    """Return what the coarse stage took; its seconds are within those of the stages that trace rays."""
    spent = tracer.coarse_build_seconds + tracer.coarse_seconds
    return {
        "stage": "embree" if "embree" in tracer.plan["used"] else "none",
        "triangles": tracer.n_triangles,
        "build_seconds": round(tracer.coarse_build_seconds, 4),
        "hit_seconds": round(tracer.coarse_seconds, 4),
        "share_of_seconds": min(spent / total, 1.0) if total > 0.0 else 0.0,
    }
