"""The report as text: noise, blur, geometric error, cost, and what stopped the render."""

import math

from hybrid_rt.integrators.photons.figures import LightNotFound
from hybrid_rt.rendering.forecast import further
from hybrid_rt.rendering.report import (
    ALL_LIGHT,
    PictureNoise,
    PictureSettings,
    RelativeError,
    Report,
)
from hybrid_rt.rendering.report_warnings import in_up_to, refused_workers, warnings_in_words
from hybrid_rt.rendering.units import duration, passes_in_words, per_cent
from hybrid_rt.scene.lint.lamps_in_surfaces import lamp_in_words
from hybrid_rt.sensor.image_metrics import DIM

# So many pixels are most of the picture.
MOST_OF_IT = 0.5
# What each limit is called, and what of it was reached.
_STOPPED_BY = {
    "passes": "the number of passes",
    "time_budget": "the time budget",
    "target_error": "the target error",
    "target_error_trimmed": "the target error without the worst 0.1 % of the pixels",
    "not_finite": "pixels that are not finite, which no error can be estimated of",
    "blur": "the blur",
    "contradicted": "photons, which find light that the target error does not count",
    "interrupted": "Ctrl-C",
    "cluster_lost": "the loss of the cluster",
    "watcher": "the live page",
}


def in_words(report: Report) -> str:
    """Format a render's report as a few lines of text."""
    lines = [f"  WARNING   {words}" for words in warnings_in_words(report)]
    lines += [
        f"  {'note   ' if note.lifted_by > 0.0 else 'WARNING'}   {lamp_in_words(note)}"
        for note in report.lamps_in_surfaces
    ]
    lines += [*_left_out(report), _noise(report), _geometry(report), _cost(report)]
    return "\n".join([*lines, *_cluster(report), _stop(report), *_further(report)])


def _left_out(report: Report) -> list[str]:
    """Return what is not in the picture, with its size."""
    integrator = report.settings.integrator
    lines = [f"  left out  {integrator} does not find {text}" for text in report.light_not_found]
    if report.light_not_found:
        lines.append(f"            {_unfound(report.light_not_found_measured)}")
    return [*lines, *_cut_off(report)]


def _unfound(measured: LightNotFound | None) -> str:
    """Return the size of the light that is not found, as far as it is measured."""
    if measured is None:
        return "its size is not measured: the image mean lacks it, and no error below counts it"
    where = f"{measured.not_measured} are not measured"
    if measured.mean is None:
        return f"its size is not known: {measured.why_unknown};\n            {where}"
    share = measured.share_of_image_mean
    relative = "" if share is None else f", {per_cent(share)} of what is found"
    return (
        f"the image mean lacks {measured.mean:.3g} +- {measured.half_interval_95:.1g} (95 %) of it{in_up_to(measured)}{relative}, by "
        f"{measured.photons:,} photons;\n"
        f"            {where}"
    )


def _cut_off(report: Report) -> list[str]:
    """Return what limits of depth and weight have cut off."""
    ended, max_depth = report.ended_branches.by_reason, report.settings.max_depth
    lost, of_photons = report.share_cut_off
    lines = []
    if lost > 0.0:
        n_deep, n_faint = ended.get("at max_depth", 0), ended.get("below least contribution", 0)
        which = [f"{n_deep:,} paths at max_depth {max_depth}"] if n_deep else []
        which += [f"{n_faint:,} faint branches"] if n_faint else []
        which = which or [f"paths at max_depth {max_depth}"]
        lines.append(
            f"  cut off   {' and '.join(which)}, with {per_cent(lost)} of what camera paths carry behind "
            "the first surface: the image mean lacks about that share of its light, less where lamps are in view"
        )
    if of_photons > 0.0:
        lines.append(
            f"  cut off   {ended['photons at max_depth']:,} photons at max_depth {max_depth}, with "
            f"{per_cent(of_photons)} of the power that all photons were sent out with"
        )
    return lines


def _scale(noise: PictureNoise) -> str:
    """Say so where the radiance that relative errors count as dark is far from that of the picture."""
    mean = noise.image_mean
    if mean <= 0.0 or 3e-3 < mean < 300.0:
        return ""
    return (
        f"\n            relative to radiances of about 0.1 or more, far from this picture's mean of {mean:.1g}: "
        "scale the lamps, or read its standard errors"
    )


def _dark(noise: PictureNoise, settings: PictureSettings) -> str:
    """Say so if most of the picture is so dark that its relative errors are larger than they count."""
    n_lit = settings.width * settings.height - noise.pixels_without_light
    if noise.pixels_dark <= MOST_OF_IT * n_lit:
        return ""
    share = noise.pixels_dark / n_lit
    return (
        f"\n            {per_cent(share)} of the pixels with light are darker than {DIM:g}, and their errors count "
        "relative to that:\n            noise may be seen there. Scale the lamps, or look at the output standard_error"
    )


def _not_met(report: Report) -> str:
    """Return how much of the picture no light has reached: its error counts as none."""
    text, photons, dark = "", report.photons, report.share_without_light
    if dark:
        share = per_cent(dark)
        text += f"\n            {share} of the pixels are black in every pass, and count as without noise"
    if photons is None or report.points_missed_by_photons > 0:  # which is warned of
        return text
    n_dark = photons.points_without_photons - photons.points_with_shown_photons_alone
    if n_dark > 0:
        share = per_cent(n_dark / photons.gather_points)
        text += (
            f"\n            {share} of the points that gather light met no photon in their pass: noise "
            "counts that where other passes meet some"
        )
    return text


def _noise(report: Report) -> str:
    noise, error = report.noise, report.relative_error
    if noise is None or error is None:
        return "  noise     unknown after a single pass"
    at_most = "at most about " if noise.errs_on_the_safe_side else ""
    half = noise.half_interval_95_of_image_mean
    unmet = (
        "\n            the interval allows for ways to the brightest lamp or place that no camera ray has "
        "taken yet, in mirrors or glass, as a speck or behind an opening: more passes narrow it"
    )
    return (
        f"  noise     {at_most}{per_cent(noise.relative_rmse)} of the picture (relative RMSE, "
        f"estimated); image mean{', blurred,' if report.picture_is_blurred else ''}"
        f"{of_what(report)} {noise.image_mean:.6g} +- {half:.1g} (95 %)"
        f"{unmet if report.unmet_decides else ''}{_worst_pixels(noise, report.settings.integrator)}"
        f"{_scale(noise) or _dark(noise, report.settings)}{_not_met(report)}{_blur(error)}"
    )


def of_what(report: Report) -> str:
    """Return what light the figures are about, if it is not all: " of the light that ..."."""
    holds = report.picture_holds
    return "" if holds == ALL_LIGHT else f" of {holds}"


def _worst_pixels(noise: PictureNoise, integrator: str) -> str:
    """Return the noise without the worst pixels; nothing where there are no pixels to spare."""
    if not noise.worst_pixels or not math.isfinite(noise.relative_rmse_trimmed):
        return ""
    return (
        f"\n            {per_cent(noise.relative_rmse_trimmed)} without the worst 0.1 % of the "
        f"pixels, which hold {per_cent(noise.worst_pixels_share_of_squared_error)} of the "
        f"squared error{_caution(noise, integrator) if noise.few_decide else ''}"
    )


def _caution(noise: PictureNoise, integrator: str) -> str:
    text = ":\n            so few pixels decide the first figure that it is rough; "
    if noise.rises:
        return text + (
            "the second leaves out light that\n            is still being found, as behind glass or "
            "in a lamp out of focus: with more passes the dots\n            outnumber 0.1 %, and it will "
            f"rise to {per_cent(noise.relative_rmse_trimmed_ahead)} or so"
        )
    by_photons = " (behind glass take ppm)" if integrator == "path" else ""
    return text + (
        "trust the second, but not where\n            only dots carry the light, as behind glass or "
        f"in a lamp out of focus: such places come out\n            too dark at first{by_photons}"
    )


def short_cautions(report: Report) -> list[str]:
    """Return in few words what is to be known of the error of a picture; the full text says more."""
    noise = report.noise
    if noise is None:
        return []
    cautions = []
    if noise.few_decide:
        trimmed = per_cent(noise.relative_rmse_trimmed)
        cautions.append(f"few pixels decide it: noise {trimmed} without the worst 0.1 %")
    if _dark(noise, report.settings):
        cautions.append("relative to 0.1 where pixels are darker, as most are")
    if report.unmet_decides:
        cautions.append("without lamps seen in glass or metal that were not met yet")
    return cautions


def _blur(error: RelativeError) -> str:
    if error.blur_at_most is None:
        why = "no point has met a photon" if math.isfinite(error.noise) else "not finite"
        return f"\n  blur      unknown: {why}"
    if error.blur_at_most == 0.0:
        return ""
    at_most = f"at most about {per_cent(error.blur_at_most)}"
    if error.blur is None:
        size = f"{at_most} of the picture (relative RMSE, 95 %)"
    else:
        size = f"{per_cent(error.blur)} of the picture (relative RMSE, estimated), {at_most} (95 %)"
    passes = "do not lessen it" if error.blur_stays else "lessen it"
    return f"\n  blur      {size}; more passes {passes}"


def _geometry(report: Report) -> str:
    geometry = report.geometry
    hits, unproven = geometry.camera_hits, geometry.camera_hits_without_bound
    text = "  geometry  "
    if hits == 0:
        text += "no camera ray hit anything"
    elif hits == unproven:
        text += "no camera hit has a proven error"
    else:
        # Newton's root is proven to be a root; only the certificate proves that it is the first.
        exact = "exact t" if geometry.accuracy == "certified" else "t of that root"
        text += (
            f"|t - {exact}| <= {geometry.largest_t_bound_of_camera_hits:.1e}, proven for "
            f"{hits - unproven:,} of {hits:,} camera hits"
        )
    text += f"; {geometry.tangent:,} rays decided within rounding"
    wrong = geometry.wrong_first_hits
    if wrong is None:
        return text + (
            f"\n            {geometry.certified_rays:,} rays certified, "
            f"{geometry.changed_by_certificate:,} first hits changed by it, "
            f"{geometry.given_up:,} given up"
        )
    low, high = wrong.interval_95
    return text + (
        f"\n            wrong first hits: {wrong.wrong:,} of {wrong.rays:,} camera rays "
        f"({100 * low:.2g} to {100 * high:.2g} %, 95 %); the others off by {wrong.mean_error:.1e} "
        f"(mean) to {wrong.worst_error:.1e}"
    )


def _cost(report: Report) -> str:
    stages = sorted(
        ((spent, stage) for stage, spent in report.seconds.items() if stage != "total"),
        reverse=True,
    )
    longest = ", ".join(f"{stage} {spent:.2g}" for spent, stage in stages[:4])
    n_rays = report.n_traced
    rays = f"{n_rays / 1e6:.3g} million rays" if n_rays >= 1e5 else f"{n_rays:,} rays"
    return (
        f"  cost      {report.total_seconds:.2f} s ({longest}), {rays}, "
        f"peak memory {report.peak_memory_mib:.0f} MiB{_coarse(report)}"
    )


def _cluster(report: Report) -> list[str]:
    """Return what a cluster did, if there was one."""
    cluster = report.cluster
    if cluster is None:
        return []
    n = cluster.workers
    again = f", {cluster.tried_again} of them again" if cluster.tried_again else ""
    line = (
        f"  cluster   {cluster.address}: {n} process{'' if n == 1 else 'es'}, {cluster.tasks:,} "
        f"tasks{again}, {cluster.mib_received:.3g} MiB received; the seconds of stages are sums "
        "over all processes"
    )
    return [line, *(f"  WARNING   {words}" for words in refused_workers(cluster))]


def _coarse(report: Report) -> str:
    """Return the cost of coarse hits, if there were any."""
    coarse = report.coarse
    if coarse.stage == "none":
        return ""
    text = (
        f"\n            {per_cent(coarse.share_of_seconds)} of it for coarse hits on "
        f"{coarse.triangles:,} triangles (building {coarse.build_seconds:.2g}, tracing "
        f"{coarse.hit_seconds:.2g})"
    )
    if report.geometry.accuracy == "certified":
        text += '; coarse="none" makes the same picture, bit for bit, without them'
    return text


def _stop(report: Report) -> str:
    error, settings = report.relative_error, report.settings
    text = (
        f"  stopped   by {_STOPPED_BY[report.stopped_by]}, after {passes_in_words(report.passes)}, "
        f"{report.total_seconds:.2f} s"
    )
    store = report.store
    if store is not None and store.passes_before:
        now = store.sessions[-1]["seconds"]
        text += f" in {len(store.sessions)} calls ({now:.2f} s in this one)"
    if error is None:
        return text
    noise, blur, at_most = error.noise, error.blur, error.blur_at_most
    if at_most is None:
        return text + f", relative error unknown (noise {noise:.2g})"
    if settings.target_error_trimmed is not None:
        text += f", relative error of most pixels {error.both_trimmed:.2g}, of all {error.both:.2g}"
    else:
        text += f", relative error {error.both:.2g}"
    if at_most > 0.0:
        said = f"blur at most {at_most:.2g}" if blur is None else f"blur {blur:.2g}"
        text += f" (noise {noise:.2g}, {said})"
    text += of_what(report)
    if _spills(report):
        text += (
            f"\n            {settings.target_error_trimmed:g} does not count as reached: the dots "
            "will soon be more than 0.1 % of the pixels"
        )
    for target in settings.targets.values():
        if error.stays > target:
            text += f"\n            the blur alone keeps the target {target:g} out of reach"
    return text


def _spills(report: Report) -> bool:
    """Tell whether the target without the worst pixels is met, but will not be after more passes."""
    error, target = report.relative_error, report.settings.target_error_trimmed
    if target is None or error is None or error.both_trimmed is None:
        return False
    return error.both_trimmed <= target < (error.both_trimmed_ahead or 0.0)


def _further(report: Report) -> list[str]:
    """Return what the target error would cost that is not reached; without one, half the error."""
    found = further(report)
    if found is None:
        return []
    trimmed = "" if found.option == "target_error" else " without the worst 0.1 % of the pixels"
    cost = f"{found.passes:,} passes in all, {duration(found.seconds)}"
    option = f"{found.option.replace('_', ' ')} {found.target:g}"
    return [f"  further   {per_cent(found.target)}{trimmed} takes about {cost}: {option}"]
