"""Forecast of the passes and seconds that a method needs to reach an error.

`hybrid_rt.analysis.work_precision` measures curves; here they are interpolated and extrapolated.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.analysis.curves import Curve, Spread
from hybrid_rt.analysis.units import percent
from hybrid_rt.analysis.work_precision import PictureStudy

# A bias below half of the whole error cannot be told from noise by two points.
SURE_BIAS = 0.5
# From one point to the next the square of a bias does not rise; that of noise has been seen to rise further.
MOST_RISE = 1.21

# A line through two meshes is followed for so many times the way between them.
MOST_STEPS = 16.0


@dataclass(frozen=True)
class MethodForecast:
    """Passes and seconds of a method to reach an error."""

    method: str
    flags: str
    passes: int | None  # None: out of reach
    seconds: Spread  # nan if out of reach; least and most by the errors of the runs
    bias: float  # error that passes do not reduce, as far as it is above the noise
    is_measured: bool  # whether ``passes`` lies within the measured range
    obstacle: str = ""  # why it is out of reach
    left_out: list[str] = field(default_factory=list)
    measured_to: int = 0  # the most passes that were measured

    @property
    def integrator(self) -> str:
        """Its name, which the flags begin with."""
        return self.flags.split()[1]

    @property
    def is_certified(self) -> bool:
        """Whether its hits are."""
        return "--accuracy" not in self.flags


def forecast(curve: Curve, target: float, reference_error: float = 0.0) -> MethodForecast:
    """Predict passes and seconds to a relative RMSE.

    The square of the error is taken as b^2 + c / n^k: between two measured points as measured (a line in
    logarithms, once all later ones are as small), beyond the last with the curve's k, and b from the last
    two points, at least the curve's own; where all error falls with the passes, or pictures told what
    triangles change, b is the curve's own. The reference's noise is subtracted from the squares first.
    Nothing beyond the measured range is promised of a method that leaves out light, nothing at all where the
    lack of what photons found of it makes an error above the target, or where its mesh may change the picture
    by more.
    """
    own = 0.0 if math.isnan(reference_error) else reference_error
    passes = np.array([p.setting for p in curve.points])
    middle, least, most = (
        np.maximum(np.array([getattr(p.error, name) for p in curve.points]) ** 2 - own**2, 1e-30)
        for name in ("median", "least", "most")
    )
    # Bright dots, which come late, bend a curve as a bias does.
    is_measured = curve.converges or curve.bias_at_most > 0.0
    bias = curve.bias if is_measured else max(curve.bias, _bias(passes**curve.power, middle))

    def result(obstacle: str = "") -> MethodForecast:
        whole, spread = None, Spread(math.nan, math.nan, math.nan)
        if not obstacle:
            whole = int(needed)
            fewest, most_passes = (
                _passes_to(target, bias, passes, squares, curve.power) for squares in (least, most)
            )
            spread = _seconds_of(curve, fewest, whole, most_passes)
        return MethodForecast(
            curve.name, curve.flags, whole, spread, bias, not obstacle and needed <= passes[-1],
            obstacle, curve.left_out, int(passes[-1]),
        )  # fmt: skip

    if curve.bias >= target:
        return result(curve.bias_known_by or "its error does not fall below this")
    if curve.error_by_unfound >= target:
        return result(
            f"does not find light that is {percent(curve.unfound)} of the mean, as photons measure"
        )
    if curve.bias_at_most >= target:
        return result(f"triangles may change it by {percent(curve.bias_at_most)}")
    needed = _passes_to(target, bias, passes, middle, curve.power)
    if needed > passes[-1] and curve.left_out:
        return result("leaves out light")
    if math.isinf(needed):
        return result("its error no longer falls with the passes")
    return result()


def _passes_to(
    target: float,
    bias: float,
    passes: NDArray[np.float64],
    squares: NDArray[np.float64],
    power: float,
) -> float:
    """Return the whole passes to a target by the squared errors of points; inf if no number is enough."""
    # Few passes may be lucky and meet no bright dot: an error counts if all later ones are as small.
    lasting = np.maximum.accumulate(squares[::-1])[::-1]
    reached = np.flatnonzero(lasting <= target**2)
    if len(reached):
        k = int(reached[0])
        if k == 0:
            return max(float(passes[0]), 1.0)
        share = math.log(lasting[k - 1] / target**2) / math.log(lasting[k - 1] / lasting[k])
        return float(np.ceil(passes[k - 1] * (passes[k] / passes[k - 1]) ** share - 1e-9))
    left = target**2 - bias**2
    if left <= 0.0:
        return math.inf
    more = max((squares[-1] - bias**2) / left, 1.0)
    return float(np.ceil(passes[-1] * more ** (1.0 / power) - 1e-9))


def _bias(passes: NDArray[np.float64], squares: NDArray[np.float64]) -> float:
    """Return the error that does not fall as one over the given numbers, by the last two points."""
    # An error that more passes raise is noise of bright dots, of which nothing follows.
    if len(passes) < 2 or squares[-1] > MOST_RISE * squares[-2]:
        return 0.0
    n, m = passes[-2], passes[-1]
    noise = (squares[-2] - squares[-1]) / (1.0 / n - 1.0 / m)
    rest = squares[-1] - max(noise, 0.0) / m
    return math.sqrt(rest) if rest > SURE_BIAS**2 * squares[-1] else 0.0


def _seconds_of(curve: Curve, fewest: float, passes: int, most: float) -> Spread:
    """Return the seconds of passes, and of the fewest and most that runs ask for in the fastest and slowest."""
    settings = np.array([p.setting for p in curve.points])
    seconds = growing_seconds(curve)
    last = curve.points[-1].seconds
    runs = next((p.seconds for p in curve.points if p.setting == passes), last)
    return Spread(
        _seconds(settings, seconds, passes),
        _seconds(settings, seconds, min(fewest, passes)) * runs.least / runs.median,
        _seconds(settings, seconds, max(most, passes)) * runs.most / runs.median,
    )


def growing_seconds(curve: Curve) -> NDArray[np.float64]:
    """Return the seconds of a curve's points, made to grow with the passes, (n,) float64.

    On a busy machine fewer passes may have taken longer: such neighbours get their mean (isotonic regression
    by pooling adjacent violators; Barlow, Bartholomew, Bremner, Brunk 1972).
    """
    blocks: list[list[float]] = []
    for point in curve.points:
        blocks.append([point.seconds.median])
        while len(blocks) > 1 and np.mean(blocks[-2]) > np.mean(blocks[-1]):
            last = blocks.pop()
            blocks[-1] += last
    return np.concatenate([np.full(len(block), np.mean(block)) for block in blocks])


def seconds_fall(curve: Curve) -> bool:
    """Tell whether more passes took less time somewhere, as happens on a busy machine."""
    seconds = [point.seconds.median for point in curve.points]
    return any(after < before for before, after in pairwise(seconds))


def _seconds(passes: NDArray[np.float64], seconds: NDArray[np.float64], n: float) -> float:
    """Return the seconds of n passes: between points a line, beyond the last its slope.

    Where the last two points do not differ, the slope is that from the first to the last, and where
    none differ, all seconds are those of passes.
    """
    if n <= passes[-1]:
        return float(np.interp(n, passes, seconds))
    each = seconds[-1] / passes[-1]
    for k in (0, -2):
        if len(passes) > 1 and seconds[-1] > seconds[k]:
            each = (seconds[-1] - seconds[k]) / (passes[-1] - passes[k])
    return float(seconds[-1] + each * (n - passes[-1]))


def at_equal_time(curves: Sequence[Curve]) -> tuple[float, list[float]]:
    """Return the most seconds that all methods were measured for, and the relative RMSE of each then.

    Errors are interpolated between points by a line in logarithms; nan where the first point took longer.
    """
    times = [growing_seconds(curve) for curve in curves]
    seconds = min(float(grown[-1]) for grown in times)
    errors = [
        math.exp(
            np.interp(
                math.log(seconds),
                np.log(grown),
                [math.log(max(p.error.median, 1e-300)) for p in curve.points],
            )
        )
        if grown[0] <= seconds
        else math.nan
        for curve, grown in zip(curves, times, strict=True)
    ]
    return seconds, errors


def forecasts_of(study: PictureStudy, target: float) -> list[MethodForecast]:
    """Return what each method needs for a relative RMSE, the cheapest first."""
    own = study.reference.own_error
    forecasts = [forecast(curve, target, own) for curve in study.curves]
    return sorted(forecasts, key=lambda f: (f.passes is None, f.seconds.median))


def triangles_for(meshes: Sequence[dict[str, Any]], target: float) -> float:
    """Return the number of triangles at which the mesh error of a picture falls to a target.

    A log-log line through the two nearest meshes whose error is above the noise; nan if there are
    not two, or the error does not fall, or so slowly that the target is too far away to tell.
    """
    rows = sorted((row for row in meshes if row["error"] > 0.0), key=lambda row: row["triangles"])
    if len(rows) < 2:
        return math.nan
    k = next((i for i, row in enumerate(rows) if row["error"] <= target), len(rows) - 1)
    a, b = rows[max(k, 1) - 1], rows[max(k, 1)]
    if not (0.0 < b["error"] < a["error"] and a["triangles"] < b["triangles"]):
        return math.nan
    share = math.log(a["error"] / target) / math.log(a["error"] / b["error"])
    if abs(share) > MOST_STEPS:
        return math.nan
    return float(a["triangles"] * (b["triangles"] / a["triangles"]) ** share)
