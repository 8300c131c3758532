"""Error against run time: work-precision diagrams of methods that render the same picture.

Every method runs at several settings, all of them in turn, so that changes of machine speed affect
all alike; errors are against a long render. Kernels are compiled beforehand; surfaces are built
within each run and that time is reported. `hybrid_rt.analysis.hit_study` does the same for first
hits.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from typing import Any

import numpy as np

from hybrid_rt.analysis.bias import least_by_mean, least_by_tiles, shared_error
from hybrid_rt.analysis.curves import Curve, Point, spread
from hybrid_rt.analysis.methods import (
    Method,
    curved_surfaces,
    default_methods,
    finds_all_light,
    uncertified_methods,
)
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.reference import (
    LONG_ENOUGH,
    REFERENCES,
    Image,
    Reference,
    given_reference,
    make_reference,
    noise_of_mean,
    off_itself,
    run_method,
    stated_error,
)
from hybrid_rt.analysis.units import percent, signed_percent
from hybrid_rt.analysis.units import seconds as in_seconds
from hybrid_rt.core import checks
from hybrid_rt.core.progress import Say
from hybrid_rt.core.threads import Pool
from hybrid_rt.core.timing import timed
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.forecast import seconds_once
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.rendering.units import passes_in_words
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import DARK, picture_errors

# Half a 95 % interval of a mean of four groups of passes in standard errors (Student, 3 degrees).
INTERVAL = 3.182
# The stated error that counts, of all pixels, or without the worst 0.1 % of them.
PARTS = {False: "both", True: "both_trimmed"}
# The method for meshes is chosen by renders of so many passes, as take at least half a second.
FEWEST_PASSES, MOST_PASSES, PROBE_SEED = 4, 256, 40_000
# From one setting to the next, the passes of a method grow by this factor.
GROWTH = 4
# A render that takes so much of the seconds asked for is the last; so is one before less than so many times its passes.
NEARLY, BARELY_MORE = 0.9, 1.15


@dataclass(frozen=True)
class PictureStudy:
    """Curves of pictures of one scene.

    Attributes
    ----------
    size : (width, height)
    compile_seconds : float
    reference : Reference
    curves : list of Curve
    meshes : list of dict
        By ``method`` on uncertified hits: ``accuracy``, ``tolerance``, ``triangles``,
        ``build_seconds``, and the ``error`` of its pictures that passes do not remove (0 if it is not seen above
        the noise), with the upper 95 % limit ``error_at_most``.
    images : dict of (height, width, 3) float32
        By method, the first run at its dearest setting; "reference" the reference.
    threads, runs : int
    trimmed : bool
        Whether all errors leave out the worst 0.1 % of the pixels.
    """

    size: tuple[int, int]
    compile_seconds: float
    reference: Reference
    curves: list[Curve]
    meshes: list[dict[str, Any]]
    images: dict[str, Image]
    threads: int
    runs: int
    trimmed: bool = False


class StudyInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a study after at least one picture.

    Attributes
    ----------
    study : PictureStudy
        Of the pictures made, without those of meshes; methods that made none are not there.
    """

    def __init__(self, study: PictureStudy) -> None:
        super().__init__()
        self.study = study


@dataclass
class _Runs:
    """What the runs of one method gave: figures by passes, pictures at its dearest setting.

    ``unfound`` is radiance that photons found and the method does not, as each such run measured
    that knows its size.
    """

    rows: dict[int, list[dict[str, float]]] = field(default_factory=dict)
    images: list[Image] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    unfound: list[float] = field(default_factory=list)

    def add_dearest(self, result: RenderResult) -> None:
        """Keep what the render of the dearest setting tells."""
        self.images.append(result.image)
        self.left_out = result.report["light_not_found"]
        measured = result.report["light_not_found_measured"]
        if measured is not None and measured["mean"] is not None:
            self.unfound.append(measured["mean"])


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

    Parameters
    ----------
    scene : Scene
    passes : sequence of int, optional
        Increasing; the settings of each method. Either these or ``seconds``.
    seconds : float, optional
        Each method is measured with 1, 4, 16 ... passes until a render takes about so long, so that all can be
        compared at equal time.
    runs : int
        Number of runs per setting, each with its own seed.
    reference_passes : int
        Passes of the reference, unless one is given.
    reference : Picture, optional
        Must have the camera's resolution.
    reference_by : one of `REFERENCES`, optional
        Method of the reference; it is checked by another one. Default: of the methods that find all
        light the one with the smaller estimated error.
    methods : sequence of Method, optional
        With certified hits. Default: `default_methods`.
    certified_only : bool
        Measure neither uncertified hits nor what meshes do to the picture.
    meshes_by : str, optional
        The integrator that these are measured by. Default: the one of ``methods``, of those that find all
        light, that states the smallest error, without the worst 0.1 % of the pixels, in as much time.
    trimmed : bool
        Leave the worst 0.1 % of the pixels out of all errors, each picture its own.
    threads : int, optional
    say : callable, optional
        Called with progress messages.
    keep : callable, optional
        Called with the render that is the reference, with its ``standard_error``, when it is made, and again
        if the one that was to check it turns out better and takes its place.

    Raises
    ------
    StudyInterrupted
        A KeyboardInterrupt that holds what was measured, on Ctrl-C after the first picture.
    ValueError, TypeError
        If passes are not increasing, a setting is out of range, or the integrator of the reference
        does not find all light of the scene.
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
            scene, reference_by, reference_passes, threads, say, keep, PARTS[trimmed]
        )
        truth = made.image
    else:
        found, truth = given_reference(reference, PARTS[trimmed]), reference.image
    say(f"the reference: {off_itself(found)}")
    certified, on_meshes = chosen[0], []
    if not certified_only and curved_surfaces(scene):
        certified = _steadiest(scene, of_meshes, threads)
        on_meshes = uncertified_methods(scene, certified)
    compile_seconds += _compiled(scene, on_meshes, threads)
    chosen += on_meshes
    found_of: dict[str, _Runs] = {}
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

    try:
        _add_pictures(found_of, scene, chosen, passes or (), seconds, runs, truth, threads, say)
        if on_meshes:
            dearest = max(found_of[certified.name].rows)
            meshes = _meshes(scene, truth, certified, on_meshes, dearest, trimmed, threads, say)
    except KeyboardInterrupt:
        if not found_of:
            raise
        raise StudyInterrupted(study()) from None
    return study()


def _compiled(scene: Scene, methods: Sequence[Method], threads: int | None) -> float:
    """Compile what methods need, and return the seconds."""
    small = scene.with_camera(scene.camera.resized(16, 12))
    reports = [run_method(small, method, 1, 0, threads).report for method in methods]
    return float(sum(report["kernel_compilation_seconds"] for report in reports))


def _steadiest(scene: Scene, methods: Sequence[Method], threads: int | None) -> Method:
    """Return the method, of those that find all light if any does, with the least noise in as much time."""
    complete = [m for m in methods if finds_all_light(scene, m.integrator, m.options)]
    methods = complete or methods

    def squared_error_times_seconds(method: Method) -> float:
        passes, spent = FEWEST_PASSES, 0.0
        while spent < LONG_ENOUGH and passes <= MOST_PASSES:
            report = run_method(scene, method, passes, PROBE_SEED, threads).report
            spent = report["seconds"]["total"] - seconds_once(report["seconds"])
            passes *= GROWTH
        work = spent * stated_error(report, PARTS[True]) ** 2
        return math.inf if math.isnan(work) else work

    return methods[0] if len(methods) == 1 else min(methods, key=squared_error_times_seconds)


def _curve(
    method: Method,
    of: _Runs,
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
    if not has_falling_blur:
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
    converges = (
        method.accuracy == "certified"
        and not of.left_out
        and (has_falling_blur or not declared.sends_photons)
    )
    return Curve(
        method.name, method.flags, points, bias, method.power, known_by, of.left_out, at_most, unfound,
        converges,
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


def next_passes(spent: Mapping[int, float], seconds: float) -> int | None:
    """Return how many passes a method is measured with next, so that a render takes about ``seconds``.

    Parameters
    ----------
    spent : mapping of int to float
        Seconds of the renders made, by their passes.
    seconds : float

    Returns
    -------
    int or None
        Four times as many as before, or those that fill the seconds; None if they are filled.
    """
    if not spent:
        return 1
    (fewer, before), (n, took) = sorted([(0, 0.0), *spent.items()])[-2:]
    if took >= NEARLY * seconds:
        return None
    each = (took - before) / (n - fewer)
    # More passes that took no longer tell nothing of what one costs.
    last = n + math.ceil((seconds - took) / each) if each > 0.0 else math.inf
    if last < BARELY_MORE * n:
        return None
    return int(last) if last <= 2 * GROWTH * n else GROWTH * n


def _setting(
    runs: _Runs | None,
    k: int,
    passes: Sequence[int],
    seconds: float | None,
) -> int | None:
    """Return the passes of a method's render number k of a run; None if there is no such render.

    By seconds, the first run finds out, and later runs repeat it.
    """
    rows = {} if runs is None else runs.rows
    if seconds is not None and k == len(rows):
        return next_passes({n: of_runs[0]["seconds"] for n, of_runs in rows.items()}, seconds)
    settings = passes if seconds is None else list(rows)
    return settings[k] if k < len(settings) else None


def _add_pictures(
    found: dict[str, _Runs],
    scene: Scene,
    methods: Sequence[Method],
    passes: Sequence[int],
    seconds: float | None,
    runs: int,
    truth: Image,
    threads: int | None,
    say: Say,
) -> None:
    """Run all methods in turn; add by method what its runs gave."""
    say(f"{len(methods)} methods: {'; '.join(method.name for method in methods)}")
    if seconds is not None:
        # The renders before the last of a method take a quarter, a sixteenth ... of its time.
        all_together = runs * len(methods) * seconds * GROWTH / (GROWTH - 1)
        say(f"each up to about {in_seconds(seconds)}, together about {in_seconds(all_together)}")
    spent, of_passes = 0.0, 0
    for run in range(runs):
        latest: dict[str, RenderResult] = {}
        try:
            for k in count():
                now = [(m, _setting(found.get(m.name), k, passes, seconds)) for m in methods]
                numbers = [n for _, n in now if n is not None]
                if not numbers:
                    break
                is_known = of_passes > 0 and seconds is None
                about = (
                    f", about {in_seconds(spent / of_passes * sum(numbers))}" if is_known else ""
                )
                say(f"run {run + 1} of {runs}: {_in_words(numbers)}{about}")
                began = time.perf_counter()
                for method, n in now:
                    if n is not None:
                        result = run_method(scene, method, n, run + 1, threads)
                        latest[method.name] = result
                        rows = found.setdefault(method.name, _Runs()).rows
                        rows.setdefault(n, []).append(_row(result, truth))
                spent, of_passes = spent + time.perf_counter() - began, of_passes + sum(numbers)
        finally:
            # Ctrl-C may have come before the figures of the last one were noted.
            for name in latest.keys() & found.keys():
                found[name].add_dearest(latest[name])


def _in_words(numbers: Sequence[int]) -> str:
    """Name the passes of the next renders."""
    if len(set(numbers)) == 1:
        return f"{passes_in_words(numbers[0])} of each"
    return f"{min(numbers):,} to {passes_in_words(max(numbers))}"


def _row(result: RenderResult, truth: Image) -> dict[str, float]:
    """Return the figures of one run."""
    errors, report = picture_errors(result.image, truth), result.report
    stages = report["seconds"]
    noise = report["noise"] or {}
    of_mean = noise.get("half_interval_95_of_image_mean", math.nan)
    return {
        # The audit of uncertified hits is not part of making the picture.
        "seconds": stages["total"] - stages.get("audit", 0.0),
        "error_of_all": errors.relative_rmse,
        "error_of_most": errors.relative_rmse_of_most,
        "mean_error": errors.relative_mean_error,
        "half_interval": of_mean,
        "noise_of_mean": noise_of_mean(report),
        "stated_error": stated_error(report),
        "stated_error_of_most": stated_error(report, PARTS[True]),
        "build_seconds": stages.get("build", 0.0),
        "rays": float(sum(report["rays"].values())),
    }


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
            of_runs = INTERVAL * brightness * float(np.std(means, ddof=1)) / math.sqrt(len(means))
        return math.hypot(of_runs, 0.0 if math.isnan(own) else own) / brightness

    more["mean_error_noise"] = of_mean(halves, reference.mean_half_interval)
    more["mean_error_by_noise"] = of_mean(noises, reference.mean_noise)
    error = spread(columns["error_of_most" if trimmed else "error_of_all"])
    return Point(setting, spread(seconds), error, more)


def _meshes(
    scene: Scene,
    truth: Image,
    certified: Method,
    methods: Sequence[Method],
    passes: int,
    trimmed: bool,
    threads: int | None,
    say: Say,
) -> list[dict[str, Any]]:
    """Measure what meshes, and hits that are not certified, do to a picture.

    The differences between such pictures and certified ones, made with the same random numbers,
    still hold noise; but that of one seed is independent of that of another.
    """
    surfaces = curved_surfaces(scene)
    say("pictures of meshes, each twice, with the random numbers of certified ones")
    exact = [run_method(scene, certified, passes, seed, threads).image for seed in (1, 2)]
    # Not by the certified pictures: where these happen to be dark, both differences are positive.
    weight = truth.astype(np.float64) ** 2 + DARK
    rows = []
    for method in methods:
        one, other = (
            run_method(scene, method, passes, seed, threads).image.astype(np.float64)
            - exact[seed - 1]
            for seed in (1, 2)
        )
        error, at_most = shared_error(one, other, weight, trimmed)
        tracer, seconds = timed(
            partial(Intersector, surfaces, method.accuracy, tolerance=method.tolerance, threads=1)
        )
        rows.append(
            {
                "method": method.name,
                "accuracy": method.accuracy,
                "tolerance": method.tolerance,
                "triangles": float(tracer.n_triangles),
                "build_seconds": seconds,
                "error": error,
                "error_at_most": at_most,
            }
        )
    return rows
