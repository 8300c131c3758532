"""The warnings of a report as text: what no error estimate counts, and how to mend it."""

import math

from hybrid_rt.integrators.photons.figures import LightNotFound
from hybrid_rt.rendering.limits import DEFAULT_DEPTH
from hybrid_rt.rendering.report import ClusterFigures, Report
from hybrid_rt.rendering.units import per_cent
from hybrid_rt.scene.lint.faults import Faults
from hybrid_rt.scene.lint.lamps_in_surfaces import lamp_in_words
from hybrid_rt.sensor.film import ACROSS

# Of the light that was followed: that much cut off is worth a warning.
MUCH = 0.01
# Of the mean: that much lost or won by blur is worth one too.
MUCH_BLUR = 0.05

# What unmet lamps may add is worth a warning if it is so many times the image mean.
MANY_TIMES = 30.0
_HOLLOW_OR_NESTED = (
    "if it is meant to be the hollow of another body, give it the same material object as that body), or "
    "more than eight clear bodies are nested in each other"
)
_TURNED_OR_NESTED = f"its normals point inward (pass it .flipped(); {_HOLLOW_OR_NESTED}"
_PARTS_TURNED_OR_NESTED = (
    "normals point inward, of the whole (pass it .flipped()), of one of its surfaces (flip that one), or "
    "of single patches (compare surface.normal(0.5, 0.5, i) of each patch i, and transpose the nets of "
    f"those that point inward; {_HOLLOW_OR_NESTED}"
)


def warnings_in_words(report: Report) -> list[str]:
    """Return warnings about errors that the noise estimate does not cover, a line each."""
    lines = []
    if report.pixels_not_finite:
        lines.append(
            f"{report.pixels_not_finite:,} pixels are not finite (nan, or brighter "
            "than float32 holds): lower the radiance of the lights, scale the scene, or see whether "
            "an integrator or material of your own returns nan"
        )
    if report.points_missed_by_photons and report.photons is not None:
        share = report.points_missed_by_photons / report.photons.gather_points
        lines.append(
            f"{100.0 * share:.4g} % of the points that gather light have met no photon: "
            "unless no light comes to them by way of other surfaces, light is missing that no error "
            "estimate counts: pass more photons_per_pass (for ppm, also a larger initial_radius, or none), or take path, where the "
            "view is small beside what the photons light"
        )
    lines += [
        f"{name!r} is clear: {n_rays:,} rays left it without entering it, or never left it: it is not "
        f"closed (all surfaces of a body take one and the same material object), or {_PARTS_TURNED_OR_NESTED}"
        for name, n_rays in report.clear_bodies_not_closed.items()
    ]
    lines += [
        f"{name!r} is clear: {n_rays:,} rays left it without entering it, or never left it: "
        f"{_TURNED_OR_NESTED}"
        for name, n_rays in report.clear_bodies_lost.items()
    ]
    lines += scene_warnings(report.faults)
    lost, max_depth = max(report.share_cut_off), report.settings.max_depth
    by_depth = report.depth_cuts_off
    if lost >= MUCH and not by_depth:
        lines.append(
            f"faint branches, of less than a thousandth of a camera ray, were ended with {per_cent(lost)} of "
            "the light that was followed, which no error estimate counts: take path"
        )
    # A smaller max_depth than the default has been asked for, with what it cuts off.
    elif lost >= MUCH and max_depth >= DEFAULT_DEPTH:
        lines.append(
            f"max_depth {max_depth} cut off {per_cent(lost)} of the light that was followed, which no "
            f"error estimate counts: pass max_depth {2 * max_depth} or more (paths that end before that cost the same)"
        )
    without = _much_left_out(report)
    lines += without
    is_explained = without or report.faults.lamps_turned_away or report.faults.lamps_in_bodies
    if not is_explained and report.share_without_light == 1.0:
        # From the default on, the warning above says so.
        is_cut_off = by_depth and lost >= MUCH and max_depth < DEFAULT_DEPTH
        larger = (
            f"Pass max_depth {DEFAULT_DEPTH}: {max_depth} cut off {per_cent(lost)} of the light that was "
            "followed. Else look"
            if is_cut_off
            else "Look"
        )
        by_photons = ""
        if report.photons is not None and report.photons.emitted:
            by_photons = ". Or take path: photons may have missed what the camera sees"
        elif report.settings.integrator == "path":
            by_photons = (
                ". Or take ppm: paths meet a small lamp behind mirrors or glass by chance alone"
            )
        lines.append(
            f"the picture is black: no light arrives. {larger} for lamps inside of bodies or turned away, "
            "a camera within a surface or on the unlit side of what it looks at, and for light that the "
            f"integrator leaves out{by_photons}"
        )
    return [
        *lines,
        *_contradicted(report),
        *_unmet_lamps(report),
        *_blurred_mean(report),
        *_single_pass(report),
    ]


def scene_warnings(faults: Faults) -> list[str]:
    """Return warnings about what a scene alone tells, before anything is rendered, a line each."""
    lines = [
        f"{name} lights nothing: its light comes to no object. {_how_to_turn(name, faults)}"
        for name in faults.lamps_turned_away
    ]
    lines += [
        f"{note.lamp} lights nothing: it lies inside of {note.body}, which is opaque, and the camera "
        "lies outside. Move one of them, or make the body of glass"
        for note in faults.lamps_in_bodies
    ]
    lines += [
        f"{one} and {other} lie in one plane and overlap: only one of them is seen there. Move one out, "
        "by a thousandth of its size or so"
        for one, other in faults.surfaces_in_one_plane
    ]
    lines += [
        f"{one} and {other} are clear, overlap in part and have the same priority: what fills the space "
        "that they share depends on the side from which light comes. Give one of them a higher priority"
        for one, other in faults.clear_bodies_overlap
    ]
    lines += [
        f"{name} is a TriangleMesh with a texture over (u, v), which repeats on every triangle, as the "
        "mesh has no texture coordinates: pass TriangleMesh(mesh, texture_coordinates=...), or a file "
        'with UV coordinates, or take a CheckerTexture in "world"'
        for name in faults.pictures_on_meshes
    ]
    fov = faults.narrow_view
    if fov is not None:
        lines.append(
            f"the camera's vertical_fov is {fov:g} degrees, and no object fits into the picture: if radians are "
            f"meant, pass {math.degrees(fov):.4g}"
        )
    return lines


def _blurred_mean(report: Report) -> list[str]:
    """Warn of a picture whose mean is off by what photons blur; before eight passes that is not known."""
    photons, noise = report.photons, report.noise
    if photons is None or noise is None:
        return []
    shift, error = photons.blur_of_image_mean, photons.blur_of_image_mean_standard_error
    if shift is None or error is None:
        return []
    true = noise.image_mean - shift
    if abs(shift) < 3.0 * error or not abs(shift) >= MUCH_BLUR * true > 0.0:
        return []
    side = "dark" if shift < 0.0 else "bright"
    words = (
        f"discs of photons make the mean of the picture about {per_cent(abs(shift) / true)} too {side}: "
        "they spread the light of spots and edges that are narrower than they are, and reach through "
        "walls. Pass more photons_per_pass, or for ppm a smaller initial_radius"
    )
    return [words]


def all_warnings(report: Report) -> list[str]:
    """Return all warnings of a render: those of `warnings_in_words`, of lamps, and of its cluster."""
    stuck = [note for note in report.lamps_in_surfaces if note.lifted_by == 0.0]
    lines = [*map(lamp_in_words, stuck), *warnings_in_words(report)]
    cluster = report.cluster
    if cluster is not None:
        lines += [*refused_workers(cluster), *([cluster.lost] if cluster.lost else [])]
    return lines


def _how_to_turn(name: str, faults: Faults) -> str:
    """Return how a lamp is turned; swapped edges would lay a picture on its side."""
    if name in faults.pictures_turned_away:
        return (
            "A rectangle shines on the side of edge_u x edge_v: to turn it with its picture upright, "
            "begin at the other end of edge_u and negate edge_u"
        )
    return (
        "A rectangle shines on the side of edge_u x edge_v (swap its edges to turn it), a spot light "
        "along its direction"
    )


def _much_left_out(report: Report) -> list[str]:
    """Return a warning if much light is missing that the integrator does not find.

    That is known of Whitted's method, which leaves out most indirect light: there it is more than all
    that it finds.
    """
    measured, integrator = report.light_not_found_measured, report.settings.integrator
    if measured is None or measured.mean is None:
        return []
    mean, half, share = measured.mean, measured.half_interval_95, measured.share_of_image_mean
    least = 1.0 if integrator == "whitted" else MUCH
    if half is None or mean <= half or (share is not None and share < least):
        return []
    relative = "" if share is None else f", {per_cent(share)} of what it finds"
    if share is not None and share > 10.0:
        relative = f", {share:,.0f} times what it finds"
    words = (
        f"{integrator} does not find {'; '.join(report.light_not_found)}: the image mean lacks "
        f"{mean:.2g} +- {half:.1g} of it (95 %){in_up_to(measured)}{relative}, which no error estimate counts: "
        "take ppm"
    )
    return [words]


def _contradicted(report: Report) -> list[str]:
    """Return a warning if photons find more light than the picture holds."""
    check, noise = report.cross_check, report.noise
    if check is None or noise is None or not check.contradicts:
        return []
    if check.region is not None:
        row, column = divmod(check.region, ACROSS)
        words = (
            f"the part of the picture in row {row + 1} and column {column + 1} of {ACROSS} x {ACROSS} lacks light: "
            f"{check.photons:,} photons add up to {check.regions_lack_at_most[check.region]:.2g} to its mean, by ways that few "
            "camera rays meet. The relative error does not count it: take ppm, which sends photons from the lamps, "
            "or pass many more passes"
        )
        return [words]
    low, high = check.interval_95
    by_highlights = check.of_highlights > 0.5 * check.mean
    remedy = (
        "give the lamps an area (SphereLight), the surfaces more roughness, or pass many more passes"
        if by_highlights
        else "take ppm, which sends photons from the lamps, or pass many more passes"
    )
    words = (
        f"the image mean of {noise.image_mean:.3g} lacks light: {check.photons:,} photons say "
        f"{check.mean:.2g} ({low:.2g} to {high:.2g}, 95 %), which comes by ways that few camera rays meet"
        f"{', as highlights of lamps without area' if by_highlights else ''}. The relative error does not count "
        f"it: {remedy}"
    )
    return [words]


def _unmet_lamps(report: Report) -> list[str]:
    """Return a warning of lamps that no camera ray has met, if they decide the interval and may matter."""
    noise = report.noise
    if noise is None or not report.unmet_decides:
        return []
    if report.stopped_by in report.settings.targets:
        return _target_without_lamps(report, noise.image_mean)
    unmet, mean = noise.unmet_lamps_95, noise.image_mean
    if not unmet > MANY_TIMES * mean > 0.0:
        return []
    is_path = report.settings.integrator == "path"
    words = (
        "lamps, or a sun in the sky, that camera rays meet by chance alone, in mirrors or glass or as "
        f"specks, may not have been met yet: the brightest may add up to {unmet:.2g} to the image mean of "
        f"{mean:.3g} (a limit, by the brightest alone: often far more than they add)"
        f"{': take ppm, which sends photons from there' if is_path else ''}"
    )
    return [words]


def _target_without_lamps(report: Report, mean: float) -> list[str]:
    """Return a warning if a target was reached that lamps that no camera ray has met may exceed."""
    unmet, target = report.unmet_at_most, report.settings.targets[report.stopped_by]
    if unmet <= target * mean:
        return []
    relative, passes = "", "more passes"
    needed = report.passes * (unmet / mean / target if mean > 0.0 else math.inf)
    if needed < math.inf:
        relative = f", {per_cent(unmet / mean)} of it"
        passes = f"about {float(f'{needed:.2g}'):,.0f} passes"
    by = "" if report.settings.integrator == "path" else " (integrator path makes them soonest)"
    words = (
        f"the target error {target:g} does not count lamps, a sun in the sky, or bright places, that camera "
        "rays meet by chance alone (in mirrors or glass, as specks, behind openings), and have not met yet: "
        f"the brightest may add up to {unmet:.2g} to the image mean of {mean:.3g}{relative}. Pass no target, but {passes}{by}"
    )
    return [words]


def _single_pass(report: Report) -> list[str]:
    """Return a warning if a time budget was enough for one pass only."""
    spent, budget = report.total_seconds, report.settings.time_budget
    if report.passes != 1 or report.stopped_by != "time_budget" or budget is None:
        return []
    return [
        (
            f"the time budget of {budget:g} s was enough for one pass, of which no error is known: pass "
            f"{math.ceil(2.0 * max(spent, budget))} s or fewer pixels"
        )
    ]


def in_up_to(measured: LightNotFound) -> str:
    """Return how many bounces the light that photons measured has, if much has more."""
    if measured.lost_share < MUCH:
        return ""
    return f" in up to {measured.max_depth} bounces"


def refused_workers(cluster: ClusterFigures) -> list[str]:
    """Return which workers made no passes, and why."""
    return [f"{who} made no passes: {why}" for who, why in cluster.refused.items()]
