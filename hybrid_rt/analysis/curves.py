"""Work-precision curves: cost and error of a method at each of its settings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hybrid_rt.core.records import FloatArray


@dataclass(frozen=True)
class Spread:
    """A value over several runs: median, least and most, and the value of each run."""

    median: float
    least: float
    most: float
    runs: tuple[float, ...] = ()


def spread(values: Sequence[float]) -> Spread:
    """Return median, least and most of the values of runs."""
    return Spread(
        float(np.median(values)), float(min(values)), float(max(values)), tuple(map(float, values))
    )


@dataclass(frozen=True)
class Point:
    """One setting of a method."""

    setting: float  # passes, or the tolerance of a mesh in scene units
    seconds: Spread  # wall time of a picture, or of a ray
    error: Spread  # relative RMSE, or the share of wrong first hits
    more: dict[str, float]  # medians over the runs, by name


@dataclass(frozen=True)
class Curve:
    """A method and its points, in order of cost."""

    name: str
    flags: str  # the command-line options of the method
    points: list[Point]
    bias: float = 0.0  # least error known that more passes do not reduce
    power: float = 1.0  # the square of the rest of the error falls as passes ** -power
    bias_known_by: str = ""
    left_out: list[str] = field(default_factory=list)  # as it declares
    bias_at_most: float = 0.0  # 95 % limit of what its mesh changes
    unfound: float = 0.0  # light that photons find and it does not, over the mean
    error_by_unfound: float = 0.0  # least relative RMSE by that; 0: not known
    converges: bool = False  # certified hits, all light, no blur that stays


def renamed(curves: Sequence[Curve], prefix: str) -> list[Curve]:
    """Return curves with longer names, to be drawn with others."""
    return [replace(curve, name=f"{prefix}: {curve.name}") for curve in curves]


@dataclass(frozen=True)
class Slope:
    """The exponents b of error ~ passes ** b and ~ seconds ** b, each with its standard error; nan: unknown."""

    method: str
    by_passes: tuple[float, float]
    by_seconds: tuple[float, float]
    of_noise: float  # the exponent of noise alone


def fitted_slope(curve: Curve, reference_error: float = 0.0) -> Slope:
    """Fit power laws to all runs of a picture curve, without the reference's own error (nan: not known).

    Runs of which it is more than half of the square are left out. With less than three numbers of passes nothing is
    known.
    """
    own = 0.0 if math.isnan(reference_error) else reference_error * reference_error
    rows = []
    for p in curve.points:
        runs = zip(p.seconds.runs, p.error.runs, strict=True)
        for seconds, error in list(runs) or [(p.seconds.median, p.error.median)]:
            square = error * error - own
            if square > own:
                rows.append((p.setting, seconds, math.sqrt(square)))
    passes, times, errors = np.array(rows).reshape(-1, 3).T
    known = np.unique(passes).size >= 3
    fits = [power_law(x, errors) if known else (math.nan, math.nan) for x in (passes, times)]
    return Slope(curve.name, fits[0], fits[1], -0.5 * curve.power)


def power_law(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """Return b of y ~ x ** b by least squares of the logarithms, and its standard error.

    It is that of n - 2 degrees of freedom, n >= 3.
    """
    log_x, log_y = np.log(x) - np.log(x).mean(), np.log(y) - np.log(y).mean()
    b = float(log_x @ log_y / (log_x @ log_x))
    rest = log_y - b * log_x
    return b, math.sqrt(float(rest @ rest / (log_x @ log_x)) / (x.size - 2))
