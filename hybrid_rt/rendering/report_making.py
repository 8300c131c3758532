"""The making of a render's report."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hybrid_rt.core.ledger import twelve_digits
from hybrid_rt.core.memory import peak_memory_mib
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.media.absorption import unclosed_bodies
from hybrid_rt.integrators.photons.figures import Blur, LightNotFound
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.limits import Clock
from hybrid_rt.rendering.report import (
    ALL_LIGHT,
    ClusterFigures,
    CoarseStage,
    EndedBranches,
    Geometry,
    MeanCheck,
    PictureNoise,
    PictureSettings,
    RelativeError,
    Report,
    StoreFigures,
    WrongFirstHits,
)
from hybrid_rt.rendering.report_warnings import all_warnings
from hybrid_rt.rendering.set_up import Ready
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.rendering.unmet_light import (
    interval_of_noise,
    missing_light,
    unmet_light,
    unmet_place,
)
from hybrid_rt.rendering.versions import versions
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.film import Film

if TYPE_CHECKING:
    from hybrid_rt.integrators.probes.cross_check import CrossCheck

# From this share on, what max_depth cuts off is said of the picture as a whole as well; below, it is
# less than the intervals of common renders.
COUNTS = 1e-4


def picture_settings(scene: Scene, settings: Settings) -> PictureSettings:
    """Return settings with the size of the picture."""
    camera = scene.camera
    return PictureSettings(**vars(settings), width=camera.width, height=camera.height)


def make_report(
    settings: PictureSettings,
    ready: Ready,
    film: Film,
    clock: Clock,
    stopped_by: str,
    check: CrossCheck | None,
    wrong: WrongFirstHits | None,
    unfound: LightNotFound | None,
    cluster: ClusterFigures | None,
    store: StoreFigures | None,
) -> Report:
    """Return the report of a picture, whose workers are done."""
    context, workers, own = ready.context, ready.workers, settings.own
    ledger, tracer = context.ledger, context.tracer
    n_camera, work = ledger.rays["camera"], tracer.counters
    n_traced = work["rays"] + work["shadow_rays"]
    n_unnamed = n_traced - sum(ledger.rays.values())
    not_closed, lost = unclosed_bodies(context)
    blur = workers.blur(film.image)
    photons = workers.photons(blur)
    noise, checked = _noise_and_check(film, context, blur, check, settings)
    total = clock.earlier + clock.seconds
    report = Report(
        settings=settings,
        versions=versions(),
        passes=film.n_passes,
        stopped_by=stopped_by,
        seconds={
            **{stage: round(seconds, 4) for stage, seconds in ledger.seconds.items()},
            # Threads that start, end and wait for each other, and whatever has no stage.
            "other": round(max(total - sum(ledger.seconds.values()), 0.0), 4),
            "total": round(total, 4),
        },
        coarse=_coarse(tracer, total),
        kernel_compilation_seconds=round(clock.earlier_compilation + clock.compile_seconds, 4),
        # What nobody named is "other".
        rays=dict(ledger.rays) | ({"other": n_unnamed} if n_unnamed > 0 else {}),
        hits=dict(ledger.hits),
        intersection=dict(work),
        ended_branches=EndedBranches(
            by_reason=dict(ledger.ended),
            lost_weight_per_camera_ray=twelve_digits(ledger.lost_weight / n_camera),
            lost_share=twelve_digits(ledger.lost_share()),
        ),
        noise=noise,
        cross_check=checked,
        relative_error=relative_error(noise, blur, own.blur_stays, own.error_power),
        light_not_found=ready.left_out,
        light_not_found_measured=_beside(unfound, noise),
        picture_holds=ALL_LIGHT,
        picture_is_blurred=photons is not None and photons.blur_root_mean_square_at_most != 0.0,
        clear_bodies_not_closed=not_closed,
        clear_bodies_lost=lost,
        lamps_in_surfaces=ready.sunken,
        faults=ready.faults,
        pixels_not_finite=int(np.count_nonzero(~np.isfinite(film.image).all(axis=2))),
        geometry=Geometry(
            accuracy=tracer.accuracy,
            camera_hits=ledger.camera_hits,
            camera_hits_without_bound=ledger.camera_hits_without_bound,
            largest_t_bound_of_camera_hits=ledger.largest_t_bound,
            certified_rays=n_traced - work["given_up"] if tracer.accuracy == "certified" else 0,
            given_up=work["given_up"],
            tangent=ledger.hits["tangent"],
            changed_by_certificate=work["changed_by_certificate"],
            wrong_first_hits=wrong,
        ),
        peak_memory_mib=round(peak_memory_mib(), 1),
        plan={"light": context.plan.as_dict(), "intersection": tracer.plan},
        photons=photons,
        points_missed_by_photons=workers.n_missed,
        cluster=cluster,
        store=store,
    )
    report = replace(report, picture_holds=_held(report))
    return replace(report, warnings=all_warnings(report))


def _held(report: Report) -> str:
    """Return which light the image mean, its interval and the relative errors are about."""
    settings = report.settings
    holds = f"the light that {settings.integrator} finds" if report.light_not_found else ALL_LIGHT
    if max(report.share_cut_off) < COUNTS:
        return holds
    by_depth = f" in up to {settings.max_depth} bounces"
    return holds + (by_depth if report.depth_cuts_off else " but for faint branches")


def _beside(unfound: LightNotFound | None, noise: PictureNoise | None) -> LightNotFound | None:
    """Return light that is not found with its share of the image mean, where both are known."""
    if unfound is None or unfound.mean is None or noise is None or not noise.image_mean > 0.0:
        return unfound
    return replace(unfound, share_of_image_mean=unfound.mean / noise.image_mean)


def relative_error(
    noise: PictureNoise | None, blur: Blur, blur_stays: bool, error_power: float
) -> RelativeError | None:
    """Return the estimated relative errors of the picture, or None after a single pass."""
    if noise is None:
        return None

    def both(part: float) -> float | None:
        return math.hypot(part, blur.counted) if blur.counted < math.inf else None

    whole, trimmed = noise.relative_rmse, noise.relative_rmse_trimmed
    return RelativeError(
        noise=whole,
        noise_trimmed=trimmed,
        blur=blur.relative,
        blur_at_most=blur.relative_at_most,
        both=both(whole),
        both_trimmed=both(trimmed),
        both_trimmed_ahead=both(noise.relative_rmse_trimmed_ahead),
        blur_stays=blur_stays,
        error_power=error_power,
    )


def _noise_and_check(
    film: Film,
    context: RenderContext,
    blur: Blur,
    check: CrossCheck | None,
    settings: PictureSettings,
) -> tuple[PictureNoise | None, MeanCheck | None]:
    """Return the noise with half the 95 % interval of the image mean, and the estimate beside it.

    Wider to both sides for the blur of the mean, as far as it is known. At least what light that was not
    met may add, and what the mean lacks by the independent estimate.
    """
    noise = film.noise()
    if noise is None:
        return None, None
    n, camera = film.n_passes, context.scene.camera
    ends_at_matt = settings.declared.sends_photons
    lamps = unmet_light(context.scene, n, ends_at_matt, context.options.samples_lights)
    place = unmet_place(context.scene, check, film, n * camera.width * camera.height)
    lamps, place = twelve_digits(lamps), twelve_digits(place)
    half = max(interval_of_noise(noise) + blur.of_mean_at_most, lamps, place)
    lost = twelve_digits(context.ledger.lost_share())
    missing = missing_light(check, film, noise, half, lost)
    half = max(half, missing.of_mean)
    of_picture = PictureNoise(
        **vars(noise), unmet_lamps_95=lamps, half_interval_95_of_image_mean=half
    )
    estimate = None if check is None else check.mean
    if estimate is None:
        return of_picture, None
    return of_picture, MeanCheck(
        photons=estimate.n_photons,
        photons_seen=estimate.n_seen,
        mean=estimate.mean,
        interval_95=(estimate.low, estimate.high),
        of_highlights=estimate.of_highlights,
        brightest_place=estimate.brightest_place,
        unmet_place_95=place,
        image_mean_lacks_at_most=missing.of_mean,
        regions_lack_at_most=missing.of_regions.tolist(),
        contradicts=missing.is_contradicted,
        region=missing.region,
    )


def _coarse(tracer: Intersector, total: float) -> CoarseStage:
    spent = tracer.coarse_build_seconds + tracer.coarse_seconds
    return CoarseStage(
        stage="embree" if "embree" in tracer.plan["used"] else "none",
        triangles=tracer.n_triangles,
        build_seconds=round(tracer.coarse_build_seconds, 4),
        hit_seconds=round(tracer.coarse_seconds, 4),
        share_of_seconds=min(spent / total, 1.0) if total > 0.0 else 0.0,
    )
