"""What a smaller error of a render will cost, from its report."""

import math
from typing import NamedTuple

from hybrid_rt.rendering.limits import times_the_passes
from hybrid_rt.rendering.report import Report

# The target to be trusted, if a few pixels decide or not.
_TRUSTED = {False: "target_error", True: "target_error_trimmed"}
# A render so many times longer is not worth a forecast.
MOST_TIMES = 1e9


class Forecast(NamedTuple):
    """What a relative error costs, all passes and seconds from the first one on."""

    target: float
    option: str  # "target_error" or, without the worst 0.1 % of the pixels, "target_error_trimmed"
    passes: int
    seconds: float


def forecast(report: Report, target: float, *, trimmed: bool = False) -> Forecast | None:
    """Return what a relative error costs; None if no number of passes brings it, or nothing is known.

    Noise and blur fall by their laws from what they were estimated to be, and passes take as long as they
    did. Dots that grow in number count as far as twice the passes will bring them.
    """
    option = _TRUSTED[trimmed]
    if report.relative_error is None or report.relative_error.both is None:
        return None
    times = _times(report, option, target)
    if not times < MOST_TIMES:
        return None
    once = report.seconds_once
    seconds = once + (report.total_seconds - once) * times
    return Forecast(target, option, math.ceil(report.passes * times), seconds)


def further(report: Report) -> Forecast | None:
    """Return what the target error costs that is not reached; without one, half of the error there is."""
    error, noise, targets = report.relative_error, report.noise, report.settings.targets
    if error is None or noise is None or error.both is None:
        return None
    missed = [name for name, target in targets.items() if error.of(name) > target]
    will_rise = noise.few_decide and noise.rises
    if will_rise and "target_error_trimmed" in targets:
        # That figure does not fall yet, so nothing follows from it.
        missed = [name for name in missed if name == "target_error"]
    if missed:
        name = max(missed, key=lambda one: (_times(report, one, targets[one]), one))
        target = targets[name]
    else:
        trusted = _TRUSTED[noise.few_decide and not will_rise]
        name = trusted if will_rise else next(iter(targets), trusted)
        half = error.of(name) / 2
        if not 0.0 < half < math.inf:
            return None
        target = float(f"{half:.1g}")
    return forecast(report, target, trimmed=name == "target_error_trimmed")


def _times(report: Report, option: str, target: float) -> float:
    """Return how many times the passes bring an error to a target; inf: no number does, or unknown."""
    error, noise = report.relative_error, report.noise
    if error is None or noise is None:
        return math.inf
    left = target**2 - error.stays**2
    more = error.of(option) ** 2 - error.stays**2
    if left <= 0.0 or not 0.0 < more < math.inf:
        return math.inf
    power = error.error_power
    if option == "target_error_trimmed" and noise.few_decide:
        # Dots that become more than the worst 0.1 % join the others: what twice the passes will bring.
        ahead = (error.both_trimmed_ahead or 0.0) ** 2 - error.stays**2
        power = min(power, math.log2(more / ahead)) if 0.0 < ahead < more else 0.0
    return times_the_passes(more / left, power) if power > 0.0 else math.inf
