"""The answer of a picture study: which method reaches an error soonest, or why none is named."""

import math
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass

from hybrid_rt.analysis.method_forecast import MethodForecast, forecasts_of
from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.reference import FEWER_TO_CHECK, JUDGES, LEAST_TO_CHECK, Reference
from hybrid_rt.analysis.units import asked, number, percent, seconds
from hybrid_rt.analysis.work_precision import PictureStudy
from hybrid_rt.integrators import INTEGRATORS, OWN
from hybrid_rt.rendering.units import passes_in_words

# Hits without proof are named only if they save more than this, and more than runs differ by.
WORTH_A_DOUBT = 1.1
# Seconds that nobody waits for a reference.
PATIENCE = 6.0 * 3600.0
# Targets offered where the one asked for cannot be judged.
ROUND = tuple(digit / 10.0**k for k in (4, 3, 2, 1) for digit in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0))
FIRST_SEED = 1


@dataclass(frozen=True)
class Advice:
    """An answer."""

    headline: str
    command: str  # renders to the target; "" if no method is named
    details: list[str]  # how it is known, what it costs at other sizes, what to do
    target: float  # the one that the forecasts are for
    forecasts: list[MethodForecast]


def advise(
    study: PictureStudy, target: float, scene: str, full_size: tuple[int, int] | None = None
) -> Advice:
    """Name the cheapest method that reaches a relative RMSE, if the reference can judge that.

    ``scene`` is its file, for commands; ``full_size`` are the pixels of its camera if the study's are fewer.
    """
    reference = study.reference
    wanted = asked(target)
    if reference.light_not_found:
        return Advice(
            f"No method is named for {wanted}: the reference itself leaves out light of this scene.",
            "",
            [
                (
                    f"It is {reference.made_by}, and does not find "
                    f"{without_examples(reference.light_not_found)}{_measured(reference)}. Errors below are "
                    "against that reference, so they do not show what it lacks."
                ),
                (
                    "What to do: pass --reference FILE.npz, a picture that has all light, or give point "
                    "and spot lights a small area (SphereLight), which more integrators find."
                ),
            ],
            target,
            forecasts_of(study, target),
        )
    if reference.own_error * JUDGES > target:
        return _with_poor_reference(study, target, scene, full_size)
    return _recommended(study, target, scene, full_size)


def _measured(reference: Reference) -> str:
    """Return how much of the light that a reference leaves out was found by photons."""
    measured = reference.measured
    if measured is None:
        return ", how much of it is not measured"
    mean, half, share = (measured[k] for k in ("mean", "half_interval_95", "share_of_image_mean"))
    by = f"by {measured['photons']:,} photons"
    if half is None:
        return f", how much of it is not known ({measured['why_unknown']})"
    if share is None:
        return (
            f": on surfaces seen directly alone {mean:.3g} +- {half:.1g} (95 %, {by}); it is black"
        )
    return (
        f": on surfaces seen directly alone {percent(share)} +- {percent(share * half / mean)} (95 %, {by}) "
        "of its mean"
    )


def without_examples(sentences: Sequence[str]) -> str:
    """Join declarations of light that is not found, without the examples in Heckbert's notation."""
    return "; ".join(re.sub(r" \([A-Z, .]*\)$", "", text) for text in sentences)


def _with_poor_reference(
    study: PictureStudy, target: float, scene: str, full_size: tuple[int, int] | None
) -> Advice:
    """Say that the reference cannot judge a target, and answer for one that it can."""
    reference = study.reference
    cannot = (
        f"{asked(target)} cannot be judged: the reference is itself off by "
        f"{percent(reference.own_error)}."
    )
    todo = (
        f"To judge {asked(target)} the reference may be off by {percent(target / JUDGES)} at most. What "
        f"to do: {_longer(reference, target)}"
    )
    other = next((t for t in ROUND if t >= reference.own_error * JUDGES), None)
    if other is None:
        return Advice(cannot, "", [todo], target, forecasts_of(study, target))
    found = _recommended(study, other, scene, full_size)
    return Advice(
        f"{cannot} {found.headline}", found.command, [*found.details, todo], other, found.forecasts
    )


def _longer(reference: Reference, target: float) -> str:
    own_picture = "pass a better picture of your own, --reference FILE.npz"
    if not reference.passes:
        return f"{own_picture}."
    check = reference.check
    # Name, error, passes, seconds: the reference, and what checks it with fewer passes.
    name = reference.made_by.partition(",")[0]
    makers = [(name, reference.own_error, reference.passes, reference.seconds, reference.power)]
    checks = {name: 0.0}
    if check is not None:
        checks[name] = check["seconds"] / check["passes"]
        other = check["made_by"].partition(",")[0]
        if other != name and not math.isnan(check["own_error"]):
            power = Method(other, other).power
            makers.append((other, check["own_error"], check["passes"], check["seconds"], power))
            checks[other] = reference.seconds / reference.passes
    alone, checked = [], []
    for maker, error, done, spent, power in makers:
        worse = JUDGES * error / target
        # Fewer passes have more noise, whose square falls as one over them, whatever the blur does.
        passes = _rounded_up(done * float(worse ** (2.0 / power if worse > 1.0 else 2.0)))
        needed = spent * passes / done
        alone.append((needed, maker, passes))
        # As `make_reference` does it: a quarter as many, or as many as take as long.
        of_check = min(checks[maker] * passes / FEWER_TO_CHECK, needed)
        of_check = max(of_check, checks[maker] * LEAST_TO_CHECK)
        checked.append((needed + of_check, maker, passes))
    needed, maker, passes = min(alone)
    own_picture += f" (not checked; by {maker}, {passes} passes, about {seconds(needed)})"
    needed, maker, passes = min(checked)
    option = f"--reference-passes {passes}"
    if check is not None:
        option = f"--reference-by {maker} {option}"
    spent = reference.seconds + (0.0 if check is None else check["seconds"])
    option += f", about {seconds(needed)} instead of {seconds(spent)}"
    if needed > PATIENCE:
        return f"ask for less with --target, or {own_picture} ({option}, are out of reach)."
    return f"a longer reference, {option}; or {own_picture}."


def _rounded_up(passes: float) -> int:
    """Return a number of two digits and zeros."""
    unit: int = 10 ** max(len(str(math.ceil(passes))) - 2, 0)
    return math.ceil(passes / unit) * unit


def _recommended(
    study: PictureStudy, target: float, scene: str, full_size: tuple[int, int] | None
) -> Advice:
    forecasts = forecasts_of(study, target)
    best = _chosen(forecasts, study.runs)
    if best is None:
        return Advice(
            f"No method here reaches {asked(target)}.",
            "",
            [f"{f.method}: {f.obstacle}." for f in forecasts],
            target,
            forecasts,
        )
    command = command_of(study, best, scene)
    details = [
        _how_known(best, study.runs), *_not_told_apart(best, forecasts, study.runs),
        *_at_full_size(study, best, full_size),
    ]  # fmt: skip
    if (name := best.integrator) not in OWN:
        details.append(
            f"The script declares {name!r}: let it say INTEGRATOR = {name!r} for this command."
        )
    if best.left_out:
        details.append(
            f"{best.method} leaves out {without_examples(best.left_out)}; in this picture that is less than "
            f"{asked(target)}, as measured."
        )
    if not best.is_certified:
        details.append(
            "Its hits are not proven. If there is a section on first hits, it says how often they are wrong."
        )
    if math.isnan(study.reference.own_error):
        details.append("How far the reference itself is off is unknown: it came without a report.")
    cheaper = forecasts[0]
    if cheaper is not best:
        details.append(
            f"{cheaper.method} would take {seconds(cheaper.seconds.median)}, "
            + ("by one run" if study.runs == 1 else "which is the same within what runs differ by")
            + ", and its hits are not proven."
        )
    hits = "certified hits" if best.is_certified else "hits without proof"
    return Advice(
        f"For {asked(target)}: {best.method}, {passes_in_words(best.passes or 0)}, about "
        f"{seconds(best.seconds.median)} ({hits}).",
        command,
        details,
        target,
        forecasts,
    )


def _chosen(forecasts: Sequence[MethodForecast], runs: int) -> MethodForecast | None:
    """Return the cheapest; certified hits rather than others that save next to nothing, or may save nothing."""
    within = [f for f in forecasts if f.passes is not None]
    if not within or within[0].is_certified:
        return within[0] if within else None
    best = within[0]

    def is_beaten(certified: MethodForecast) -> bool:
        # One run tells nothing of what runs differ by.
        saves = certified.seconds.median > WORTH_A_DOUBT * best.seconds.median
        return saves and runs > 1 and certified.seconds.least > best.seconds.most

    return next((f for f in within if f.is_certified and not is_beaten(f)), best)


def _not_told_apart(
    best: MethodForecast, forecasts: Sequence[MethodForecast], runs: int
) -> list[str]:
    """Name the methods whose seconds overlap with those of the best one."""
    others = [
        f"{f.method} ({seconds(f.seconds.least)} to {seconds(f.seconds.most)})"
        for f in forecasts
        if f is not best and f.passes is not None and f.seconds.least <= best.seconds.most
    ]
    if runs == 1 or not others:
        return []
    return [f"These runs do not tell it apart from {', '.join(others)}: take more --runs."]


def command_of(study: PictureStudy, found: MethodForecast, scene: str) -> str:
    """Return the command that renders what was measured: same pixels, threads and first seed."""
    width, height = study.size
    flags = found.flags.split()
    if found.integrator not in OWN:
        flags = flags[2:]
    words = ["hybrid-rt render", shlex.quote(scene), *flags, f"--passes {found.passes}"]
    size = f"--width {width} --height {height}"
    return " ".join([*words, size, f"--threads {study.threads} --seed {FIRST_SEED}"])


def _how_known(found: MethodForecast, runs: int) -> str:
    of_runs = (
        f"by what {runs} runs differ, {seconds(found.seconds.least)} to {seconds(found.seconds.most)}"
        if runs > 1
        else "one run each, so how far seconds vary is not known"
    )
    if found.is_measured:
        return f"Interpolated between numbers of passes that were measured; {of_runs}."
    ratio = (found.passes or 0) / found.measured_to
    return (
        f"Extrapolated: {found.measured_to} passes were measured, this is {number(ratio, 2)} times as "
        f"many; {of_runs}."
    )


def _at_full_size(
    study: PictureStudy, found: MethodForecast, full_size: tuple[int, int] | None
) -> list[str]:
    if full_size is None or full_size == study.size:
        return []
    width, height = full_size
    ratio = width * height / (study.size[0] * study.size[1])
    longer = f"{number(ratio, 2)} times as long, {seconds(found.seconds.median * ratio)}"
    about = (
        f"up to {longer}: photons cost the same, rays from the camera more"
        if INTEGRATORS[found.integrator].sends_photons
        else f"about {longer}"
    )
    return [
        (
            f"The command renders {study.size[0]} x {study.size[1]} pixels, as measured. The scene's own "
            f"{width} x {height} pixels (leave out --width and --height) take {about}."
        )
    ]
