"""What a smaller error of a render will cost, from its report."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from hybrid_rt.rendering.limits import times_the_passes

# The figure that each target error is about; and the one to be trusted, if a few pixels decide or not.
ERRORS = {"target_error": "both", "target_error_trimmed": "both_trimmed"}
_TRUSTED = {False: "target_error", True: "target_error_trimmed"}
# If the worst 0.1 % of the pixels hold this share of the squared error, the noise of all is rough.
SHARE_OF_FEW = 0.5
# The stages of which the seconds do not grow with the passes.
_ONCE = (
    "scene",
    "build",
    "set-up",
    "cluster",
    "audit",
    "light not found",
    "cross-check",
    "channels",
)
# A render so many times longer is not worth a forecast.
MOST_TIMES = 1e9


class Forecast(NamedTuple):
    """What a relative error costs, all passes and seconds from the first one on.

    Attributes
    ----------
    target : float
    option : str
        "target_error" or, without the worst 0.1 % of the pixels, "target_error_trimmed".
    passes : int
    seconds : float
    """

    target: float
    option: str
    passes: int
    seconds: float


def forecast(report: dict[str, Any], target: float, *, trimmed: bool = False) -> Forecast | None:
    """Return what a relative error costs; None if no number of passes brings it, or nothing is known.

    Noise and blur fall by their laws from what they were estimated to be, and passes take as long as they
    did. Dots that grow in number count as far as twice the passes will bring them.

    Parameters
    ----------
    report : dict
        Of a render.
    target : float
    trimmed : bool
        Whether the worst 0.1 % of the pixels are left out.
    """
    option = _TRUSTED[trimmed]
    error = report["relative_error"]
    if error is None or error[ERRORS[option]] is None:
        return None
    times = _times(report, option, target)
    if not times < MOST_TIMES:
        return None
    total = report["seconds"]["total"]
    once = seconds_once(report["seconds"])
    passes = math.ceil(report["passes"] * times)
    return Forecast(target, option, passes, once + (total - once) * times)


def seconds_once(seconds: dict[str, float]) -> float:
    """Return the seconds of a render, of those by stage, that do not grow with its passes."""
    return min(sum(seconds.get(stage, 0.0) for stage in _ONCE), seconds["total"])


def further(report: dict[str, Any]) -> Forecast | None:
    """Return what the target error costs that is not reached; without one, half of the error there is."""
    error, settings = report["relative_error"], report["settings"]
    if error is None or error["both"] is None:
        return None
    names = [name for name in ERRORS if settings[name] is not None]
    missed = [name for name in names if error[ERRORS[name]] > settings[name]]
    will_rise = few_decide(report["noise"]) and rises(report["noise"])
    if will_rise and "target_error_trimmed" in names:
        # That figure does not fall yet, so nothing follows from it.
        names, missed = [], [name for name in missed if name == "target_error"]
    if missed:
        name = max(missed, key=lambda one: (_times(report, one, settings[one]), one))
        target = settings[name]
    else:
        name = names[0] if names else _TRUSTED[few_decide(report["noise"]) and not will_rise]
        half = error[ERRORS[name]] / 2
        if not 0.0 < half < math.inf:
            return None
        target = float(f"{half:.1g}")
    return forecast(report, target, trimmed=name == "target_error_trimmed")


def few_decide(noise: dict[str, Any]) -> bool:
    """Tell whether the noise of all pixels is that of a few bright specks."""
    few: bool = (
        noise["worst_pixels"] > 0
        and math.isfinite(noise["relative_rmse_trimmed"])
        and noise["worst_pixels_share_of_squared_error"] >= SHARE_OF_FEW
    )
    return few


def rises(noise: dict[str, Any]) -> bool:
    """Tell whether more passes will bring more dots than there are worst pixels."""
    return bool(noise["relative_rmse_trimmed_ahead"] > noise["relative_rmse_trimmed"])


def _times(report: dict[str, Any], option: str, target: float) -> float:
    """Return how many times the passes bring an error to a target; inf: no number does, or unknown."""
    error = report["relative_error"]
    stays = (error["blur"] or 0.0) if error["blur_stays"] else 0.0
    left = target**2 - stays**2
    more = error[ERRORS[option]] ** 2 - stays**2
    if left <= 0.0 or not 0.0 < more < math.inf:
        return math.inf
    power = error["error_power"]
    if option == "target_error_trimmed" and few_decide(report["noise"]):
        # Dots that become more than the worst 0.1 % join the others: what twice the passes will bring.
        ahead = error["both_trimmed_ahead"] ** 2 - stays**2
        power = min(power, math.log2(more / ahead)) if 0.0 < ahead < more else 0.0
    return times_the_passes(more / left, power) if power > 0.0 else math.inf
