"""Error against run time: work-precision diagrams of methods that render the same picture.

Every method runs at several settings, all of them in turn, so that changes of machine speed affect
all alike; errors are against a long render. Kernels are compiled beforehand; surfaces are built
within each run and that time is reported. `hybrid_rt.analysis.hit_study` does the same for first
hits.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.analysis.bias import least_by_mean, least_by_tiles
from hybrid_rt.analysis.curves import Curve, Point, spread
from hybrid_rt.analysis.mesh_pictures import mesh_errors, steadiest
from hybrid_rt.analysis.methods import (
    Method,
    curved_surfaces,
    default_methods,
    finds_all_light,
    uncertified_methods,
)
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.reference import (
    REFERENCES,
    Image,
    Reference,
    given_reference,
    make_reference,
    off_itself,
    run_method,
)
from hybrid_rt.analysis.study_runs import Runs, add_pictures
from hybrid_rt.analysis.units import percent, signed_percent
from hybrid_rt.core import checks
from hybrid_rt.core.interrupts import heard_anywhere, heard_at_stops
from hybrid_rt.core.progress import Say
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.intervals import STUDENT

# The stated error that counts, of all pixels, or without the worst 0.1 % of them.
STATED = {False: "both", True: "both_trimmed"}


@dataclass(frozen=True)
class PictureStudy:
    """Curves of pictures of one scene."""

    size: tuple[int, int]  # width and height
    compile_seconds: float
    reference: Reference
    curves: list[Curve]
    meshes: list[dict[str, Any]]  # see `mesh_errors`
    images: dict[str, Image]  # by method, the first run at its dearest setting; and "reference"
    threads: int
    runs: int
    trimmed: bool = False  # all errors leave out the worst 0.1 % of the pixels


class StudyInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a study after at least one picture; ``study`` has no meshes, and no methods that made none."""

    def __init__(self, study: PictureStudy) -> None:
        super().__init__()
        self.study = study


def study_picture(
    scene: Scene,
    passes: Sequence[int] | None = None,
    *,
    seconds: float | None = None,
    runs: int = 3,
    reference_passes: int = 1024,
    reference: Picture | None = None,
    reference_by: str | None = None,
    methods: Sequence[Method] | None = None,
    certified_only: bool = False,
    meshes_by: str | None = None,
    trimmed: bool = False,
    threads: int | None = None,
    say: Say = lambda _: None,
    keep: Callable[[RenderResult], None] = lambda _: None,
) -> PictureStudy:
    """Measure error against seconds of all methods on one scene.

    Each method makes these ``passes``, or 1, 4, 16 ... until a render takes about so many ``seconds``: either the
    one or the other. Each setting has ``runs`` seeds. A ``reference`` of the camera's size may be given; else one is
    made by the method ``reference_by``, and checked by another one; by default, of those that find all light, the
    one with the smaller estimated error. ``keep`` gets it, with its ``standard_error``, when it is made, and again if
    the one that was to check it takes its place. Meshes are measured by ``meshes_by``, by default the one that
    states the smallest error without the worst pixels in as much time. ``trimmed`` leaves the worst 0.1 % of each
    picture's pixels out of all errors.

    On Ctrl-C after the first picture a StudyInterrupted holds what was measured. A ValueError or TypeError names
    what is out of range, or an integrator of the reference that does not find all light.
    """
    _check_settings(passes, seconds)
    _check_picture_study(scene, runs, reference, reference_by)
    chosen = list(default_methods(scene) if methods is None else methods)
    of_meshes = [m for m in chosen if meshes_by in (None, m.integrator)]
    if not of_meshes:
        raise ValueError(
            f"meshes_by is {meshes_by!r}, which is none of the integrators of this study: pass "
            + " or ".join(dict.fromkeys(m.integrator for m in chosen))
        )
    camera = scene.camera
    say("compiling kernels")
    compile_seconds = _compiled(scene, chosen, threads)
    if reference is None:
        found, made = make_reference(
            scene, reference_by, reference_passes, threads, say, keep, STATED[trimmed]
        )
        truth = made.image
    else:
        found, truth = given_reference(reference, STATED[trimmed]), reference.image
    say(f"the reference: {off_itself(found)}")
    certified, on_meshes = chosen[0], []
    if not certified_only and curved_surfaces(scene):
        certified = steadiest(scene, of_meshes, threads)
        on_meshes = uncertified_methods(scene, certified)
    compile_seconds += _compiled(scene, on_meshes, threads)
    chosen += on_meshes
    found_of: dict[str, Runs] = {}
    meshes: list[dict[str, Any]] = []

    def study() -> PictureStudy:
        images = {"reference": truth, **{name: of.images[0] for name, of in found_of.items()}}
        curves = [
            _curve(m, found_of[m.name], meshes, found, truth, trimmed)
            for m in chosen
            if m.name in found_of
        ]
        return PictureStudy(
            (camera.width, camera.height), compile_seconds, found, curves, meshes, images,
            Pool(threads).threads, runs, trimmed,
        )  # fmt: skip

    with heard_at_stops():  # a second one must not take what was measured
        try:
            with heard_anywhere():
                add_pictures(
                    found_of, scene, chosen, passes or (), seconds, runs, truth, threads, say
                )
                if on_meshes:
                    dearest = max(found_of[certified.name].rows)
                    meshes = mesh_errors(
                        scene, truth, certified, on_meshes, dearest, trimmed, threads, say
                    )
        except KeyboardInterrupt:
            if not found_of:
                raise
            raise StudyInterrupted(study()) from None
        return study()


def _compiled(scene: Scene, methods: Sequence[Method], threads: int | None) -> float:
    """Compile what methods need, and return the seconds."""
    small = scene.with_camera(scene.camera.resized(16, 12))
    reports = [run_method(small, method, 1, 0, threads).report for method in methods]
    return sum(report.kernel_compilation_seconds for report in reports)


def _curve(
    method: Method,
    of: Runs,
    meshes: Sequence[dict[str, Any]],
    reference: Reference,
    truth: Image,
    trimmed: bool,
) -> Curve:
    """Return the points of a method, and what is known of its bias."""
    points = [_point(n, rows, reference, trimmed) for n, rows in of.rows.items()]
    mesh = next((row for row in meshes if row["method"] == method.name), None)
    biases = [(0.0, "")]
    if mesh is not None:
        biases.append((mesh["error"], f"triangles change it by {percent(mesh['error'])}"))
    declared = INTEGRATORS[method.integrator]
    options = method.options or declared.options()
    # Blur that falls with the passes is error, but none that stays.
    has_falling_blur = declared.sends_photons and not options.blur_stays
    # Means are of all pixels: of the errors without the worst they tell nothing.
    if not has_falling_blur and not trimmed:
        last = points[-1].more
        error, noise = last["mean_error"], last["mean_error_noise"]
        mean = reference.mean
        told = f"its mean is off by {signed_percent(error)} +- {percent(noise)}"
        by_mean = least_by_mean(error * mean, noise * abs(mean), truth)
        by_tiles = least_by_tiles(of.images, truth, reference.own_error)
        biases.append((by_mean, told))
        biases.append((by_tiles, "parts of it are too dark or bright in all runs"))
    bias, known_by = max(biases, key=lambda pair: pair[0])
    at_most = 0.0 if mesh is None else mesh["error_at_most"]
    is_known = of.unfound and reference.mean > 0.0
    unfound = float(np.mean(of.unfound)) / reference.mean if is_known else 0.0
    by_unfound = 0.0 if trimmed else least_by_mean(unfound * reference.mean, 0.0, truth)
    converges = (
        method.accuracy == "certified"
        and not of.left_out
        and (has_falling_blur or not declared.sends_photons)
    )
    return Curve(
        method.name, method.flags, points, bias, method.power, known_by, of.left_out, at_most, unfound,
        by_unfound, converges,
    )  # fmt: skip


def _check_settings(passes: Sequence[int] | None, seconds: float | None) -> None:
    if (passes is None) == (seconds is None):
        raise ValueError(f"passes are {passes}, seconds {seconds}: pass the one or the other")
    if seconds is not None:
        checks.number(seconds, "seconds", above=0.0)
    if passes is not None:
        for n in passes:
            checks.whole(n, "passes", at_least=1)
        if list(passes) != sorted(set(passes)) or not passes:
            raise ValueError(
                f"passes are {list(passes)}: pass one or more, each above the one before"
            )


def _check_picture_study(
    scene: Scene, runs: int, reference: Picture | None, reference_by: str | None
) -> None:
    checks.whole(runs, "runs", at_least=1)
    if reference is not None and reference.image.shape[:2] != (
        scene.camera.height,
        scene.camera.width,
    ):
        raise ValueError(
            f"reference {reference.name} has {reference.image.shape[1]} x "
            f"{reference.image.shape[0]} pixels, the camera {scene.camera.width} x "
            f"{scene.camera.height}: pass a picture of that size"
        )
    if reference_by is not None and (
        reference_by not in REFERENCES or not finds_all_light(scene, reference_by)
    ):
        raise ValueError(
            f"reference_by is {reference_by!r}, which does not find all light of this scene: pass "
            + (" or ".join(n for n in REFERENCES if finds_all_light(scene, n)) or "a reference")
        )


def _point(
    setting: float, rows: Sequence[dict[str, float]], reference: Reference, trimmed: bool
) -> Point:
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    seconds, means = columns.pop("seconds"), columns["mean_error"]
    halves, noises = columns.pop("half_interval"), columns.pop("noise_of_mean")
    more = {name: float(np.median(values)) for name, values in columns.items()}
    more["mean_error"] = float(np.mean(means))
    brightness = abs(reference.mean) or math.nan

    def of_mean(halves: list[float], own: float) -> float:
        """Return the half interval of the mean error, of those of runs and of the reference."""
        # Means average over the runs; a single pass states no noise, but runs differ by it.
        of_runs = math.sqrt(sum(half * half for half in halves)) / len(halves)
        if math.isnan(of_runs) and len(means) > 2:
            student = STUDENT[min(len(means) - 1, len(STUDENT)) - 1]
            of_runs = student * brightness * float(np.std(means, ddof=1)) / math.sqrt(len(means))
        return math.hypot(of_runs, 0.0 if math.isnan(own) else own) / brightness

    more["mean_error_noise"] = of_mean(halves, reference.mean_half_interval)
    more["mean_error_by_noise"] = of_mean(noises, reference.mean_noise)
    error = spread(columns["error_of_most" if trimmed else "error_of_all"])
    return Point(setting, spread(seconds), error, more)
