"""The reference of a picture study: a long render, and another by other light transport to check it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.analysis.methods import Method, finds_all_light
from hybrid_rt.analysis.picture_comparison import Picture, is_number, stated_number
from hybrid_rt.analysis.units import percent
from hybrid_rt.analysis.units import seconds as in_seconds
from hybrid_rt.core.progress import Say
from hybrid_rt.integrators import DEFAULT, INTEGRATORS
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.report import Report
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import DARK, relative_mse

Image = NDArray[np.float32]

REFERENCE_SEED, CHECK_SEED = 20_000, 30_000
# Integrators that references are made by, and checked by.
REFERENCES = tuple(name for name, declared in INTEGRATORS.items() if declared.finds_light_of_lamps)
# What is judged must be so many times as far off as the reference itself: then the reference adds
# a twentieth to an error, sqrt(1 + 1 / 9).
JUDGES = 3.0
# The picture that checks a reference has so many passes less, or still less if they would take longer than the
# reference; but from so many on its noise and blur are known well.
FEWER_TO_CHECK, LEAST_TO_CHECK = 4, 8
# The seconds of a render are forecast by one of so many times fewer passes at most.
WORTH_A_FORECAST = 16
# The next setting of a method has so many times the passes, and so has a short render, until its passes took so
# many seconds.
GROWTH, LONG_ENOUGH = 4, 0.5


@dataclass(frozen=True)
class Reference:
    """The reference of a picture study; nan where a figure is unknown."""

    made_by: str
    own_error: float  # its own relative RMSE, estimated, without what is left out of errors
    mean: float
    mean_half_interval: float  # half its 95 % interval: noise, blur of photons, lamps not met
    seconds: float
    check: dict[str, Any] | None  # another method's picture, see `_checked`
    passes: int = 0  # 0: unknown
    is_given: bool = False  # passed, and not made
    power: float = 1.0  # the square of its error falls as passes ** -power
    light_not_found: list[str] = field(default_factory=list)
    measured: dict[str, Any] | None = None  # how much of that few photons found
    mean_noise: float = math.nan  # of the interval, that of the noise alone


def make_reference(
    scene: Scene,
    maker: str | None,
    passes: int,
    threads: int | None,
    say: Say,
    keep: Callable[[RenderResult], None] = lambda _: None,
    part: str = "both",
) -> tuple[Reference, RenderResult]:
    """Render long by one integrator; and by another that shares no light transport, to check that.

    Photons check paths and paths photons, where both find all light; unless one was asked for, the one that
    states the smaller error is the reference. Where only one finds all light it is checked by itself, if it has
    another way to find the same (`Declaration.other_way`). The check takes no longer than the long render, but
    for its first passes. ``keep`` gets the long render at once, and the other one if that becomes the reference;
    ``part`` names the error that counts, see `stated_error`. Raises ValueError if the reference is black.
    """
    is_free = maker is None
    complete = [name for name in REFERENCES if finds_all_light(scene, name)]
    if maker is None:
        maker = complete[0] if complete else DEFAULT
    method = Method(maker, maker)
    cost = _cost(scene, method, passes, threads)
    say(f"reference of {passes} passes by {maker}{_about(cost, passes)}")
    main = run_method(scene, method, passes, REFERENCE_SEED, threads, "standard_error")
    if not main.image.any():
        raise ValueError(
            f"the reference is black: {maker} finds no light in this scene, so no picture can be compared "
            "with it. Give the scene a lamp or a sky, or turn the camera or the lamps"
        )
    keep(main)
    check, n_main, name = None, passes, maker
    others = [Method(name, name) for name in complete if name != maker]
    way = INTEGRATORS[maker].other_way
    if complete == [maker] and way is not None and finds_all_light(scene, maker, way.options):
        others = [Method(f"{maker}, {way.name}", maker, options=way.options)]
    if others and maker in complete:
        n = max(passes // FEWER_TO_CHECK, min(passes, 2))
        cost = _cost(scene, others[0], n, threads)
        if cost is not None:
            as_long = int(main.report.seconds_of_passes / cost[1])
            n = min(n, max(as_long, LEAST_TO_CHECK))
        say(f"the same by {others[0].name}, {n} passes{_about(cost, n)}")
        other = run_method(scene, others[0], n, CHECK_SEED, threads, "standard_error")
        # Of light that paths find by rare chance alone photons are the better judges.
        is_free &= others[0].integrator != maker
        if is_free and stated_error(other.report, part) < stated_error(main.report, part):
            main, other, n_main, n = other, main, n, passes
            name, others = others[0].name, [Method(maker, maker)]
            keep(main)
        check = _checked(main, other, others[0].name, n, part)
    return (
        Reference(
            f"{name}, certified, {n_main} passes",
            stated_error(main.report, part),
            float(main.image.mean(dtype=np.float64)),
            main.mean_half_interval,
            main.report.total_seconds,
            check,
            n_main,
            power=Method(name, name).power,
            light_not_found=main.report.light_not_found,
            measured=main.report["light_not_found_measured"],
            mean_noise=noise_of_mean(main.report),
        ),
        main,
    )


def _cost(
    scene: Scene, method: Method, passes: int, threads: int | None
) -> tuple[float, float] | None:
    """Return the seconds of a render that its passes do not take, and those of a pass, by short renders.

    None if these are not short beside it.
    """
    probe = short_render(scene, method, 1, passes // WORTH_A_FORECAST, REFERENCE_SEED, threads)
    if probe is None:
        return None
    report, n = probe
    return report.seconds_once, max(report.seconds_of_passes, 1e-6) / n


def _about(cost: tuple[float, float] | None, passes: int) -> str:
    """Say how long a render will take."""
    return "" if cost is None else f", about {in_seconds(cost[0] + cost[1] * passes)}"


def _checked(
    main: RenderResult, other: RenderResult, name: str, passes: int, part: str
) -> dict[str, Any]:
    """Return how far a picture is from one by another method, and what explains that.

    The ``gap`` of the means with its 95 % half interval, and the ``difference`` of the pictures (relative RMSE)
    with what their noise and the blur of photons explain.
    """
    weight = main.image.astype(np.float64) ** 2 + DARK
    variance = sum(
        float((result.channels["standard_error"].astype(np.float64) ** 2 / weight).mean())
        for result in (main, other)
    )
    means = [float(result.image.mean(dtype=np.float64)) for result in (main, other)]
    return {
        "made_by": f"{name}, {passes} passes",
        "passes": passes,
        "seconds": other.report.total_seconds,
        "own_error": stated_error(other.report, part),
        "gap": means[1] - means[0],
        "gap_half_interval": math.hypot(main.mean_half_interval, other.mean_half_interval),
        "difference": math.sqrt(relative_mse(other.image, main.image)),
        "by_noise": math.sqrt(variance),
        "by_blur": math.hypot(*(stated_error(result.report, "blur") for result in (main, other))),
    }


def stated_error(report: dict[str, Any], part: str = "both") -> float:
    """Return the relative RMSE estimated in a report: "noise", "blur", "both" or "both_trimmed"; nan if unknown.

    If only an upper limit of the blur is known, that is used.
    """
    stated = stated_number(report, "relative_error", part)
    if stated is None and part == "blur":
        stated = stated_number(report, "relative_error", "blur_at_most")
    return math.nan if stated is None else stated


def off_itself(reference: Reference) -> str:
    """Say how far a reference is off itself, and what it can therefore not judge."""
    own = reference.own_error
    if math.isnan(own):
        return "how far it is off itself is unknown"
    return (
        f"it is off by {percent(own)} itself (estimated), so errors below {percent(JUDGES * own)} cannot be "
        "judged"
    )


def noise_of_mean(report: dict[str, Any]) -> float:
    """Return half the 95 % interval of a picture's mean by its noise alone; nan if unknown."""
    factor, one = (
        stated_number(report, "noise", name)
        for name in ("interval_factor", "standard_error_of_image_mean")
    )
    return math.nan if factor is None or one is None else factor * one


def given_reference(picture: Picture, part: str = "both") -> Reference:
    """Return what is known of a picture that is to be the reference; its report may be another program's."""
    report = picture.report or {}
    half = stated_number(report, "noise", "half_interval_95_of_image_mean")
    spent = stated_number(report, "seconds", "total")
    settings, passes = report.get("settings"), report.get("passes", 0)
    made_by = settings.get("integrator") if isinstance(settings, dict) else None
    is_known = isinstance(made_by, str) and made_by in INTEGRATORS
    is_known = is_known and is_number(passes) and passes > 0
    left_out, measured = report.get("light_not_found"), report.get("light_not_found_measured")
    return Reference(
        f"the file {picture.name}" + (f" ({made_by}, {passes} passes)" if is_known else ""),
        stated_error(report, part),
        float(picture.image.mean(dtype=np.float64)),
        math.nan if half is None else half,
        math.nan if spent is None else spent,
        None,
        is_given=True,
        light_not_found=left_out if isinstance(left_out, list) else [],
        measured=measured if isinstance(measured, dict) else None,
        mean_noise=noise_of_mean(report),
    )


def run_method(
    scene: Scene, method: Method, passes: int, seed: int, threads: int | None, *outputs: str
) -> RenderResult:
    """Render a scene by a method."""
    return render(
        scene, method.integrator, passes, seed=seed, threads=threads, options=method.options,
        outputs=outputs, accuracy=method.accuracy, tolerance=method.tolerance,
    )  # fmt: skip


def short_render(
    scene: Scene, method: Method, passes: int, most: int, seed: int, threads: int | None
) -> tuple[Report, int] | None:
    """Render with more and more passes, from some on, until they take long enough to tell what one costs.

    Returns the last report and its passes; None if ``passes`` is above ``most``.
    """
    found, spent = None, 0.0
    while passes <= most and spent < LONG_ENOUGH:
        report = run_method(scene, method, passes, seed, threads).report
        found, spent = (report, passes), report.seconds_of_passes
        passes *= GROWTH
    return found
