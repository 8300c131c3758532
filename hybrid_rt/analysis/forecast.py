"""Forecast of the passes and seconds that a method needs to reach an error.

`hybrid_rt.analysis.work_precision` measures curves; here they are interpolated and extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.analysis.curves import Curve, Spread
from hybrid_rt.analysis.work_precision import PictureStudy

# A bias below half of the whole error cannot be told from noise by two points.
SURE_BIAS = 0.5


@dataclass(frozen=True)
class Forecast:
    """Passes and seconds of a method to reach an error.

    Attributes
    ----------
    method : str
    flags : str
    passes : int or None
        None: out of reach.
    seconds : Spread
        Scaled from the runs; nan if out of reach.
    bias : float
        Error that more passes do not reduce, estimated from two points; 0 if not above the noise.
    is_measured : bool
        Whether ``passes`` lies within the measured range.
    """

    method: str
    flags: str
    passes: int | None
    seconds: Spread
    bias: float
    is_measured: bool


def forecast(curve: Curve, target: float, reference_error: float = 0.0) -> Forecast:
    """Predict passes and seconds to a relative RMSE.

    The square of the error is taken as b^2 + c / n^k: between two measured points as measured (a
    line in logarithms), beyond the last with the curve's k, and b from the last two points, at
    least the curve's own. The reference's noise is subtracted from the squares first.
    """
    own = 0.0 if math.isnan(reference_error) else reference_error
    passes = np.array([p.setting for p in curve.points])
    squares = np.array([max(p.error.median**2 - own**2, 1e-30) for p in curve.points])
    seconds = np.array([p.seconds.median for p in curve.points])
    last = curve.points[-1].seconds
    bias = max(_bias(passes**curve.power, squares), curve.bias)

    def result(n: float, is_measured: bool) -> Forecast:
        whole = max(math.ceil(n - 1e-9), 1)
        median = _seconds(passes, seconds, whole)
        spread = Spread(median, median * last.least / last.median, median * last.most / last.median)
        return Forecast(curve.name, curve.flags, whole, spread, bias, is_measured)

    reached = np.flatnonzero(squares <= target**2)
    if len(reached):
        k = int(reached[0])
        if k == 0:
            return result(float(passes[0]), True)
        share = math.log(squares[k - 1] / target**2) / math.log(squares[k - 1] / squares[k])
        return result(float(passes[k - 1] * (passes[k] / passes[k - 1]) ** share), True)
    left = target**2 - bias**2
    if left <= 0.0:
        return Forecast(
            curve.name, curve.flags, None, Spread(math.nan, math.nan, math.nan), bias, False
        )
    more = max((squares[-1] - bias**2) / left, 1.0)
    return result(float(passes[-1] * more ** (1.0 / curve.power)), False)


def _bias(passes: NDArray[np.float64], squares: NDArray[np.float64]) -> float:
    """Return the error that does not fall as one over the given numbers, by the last two points."""
    if len(passes) < 2:
        return 0.0
    n, m = passes[-2], passes[-1]
    noise = (squares[-2] - squares[-1]) / (1.0 / n - 1.0 / m)
    rest = squares[-1] - max(noise, 0.0) / m
    return math.sqrt(rest) if rest > SURE_BIAS**2 * squares[-1] else 0.0


def _seconds(passes: NDArray[np.float64], seconds: NDArray[np.float64], n: float) -> float:
    """Return the seconds of n passes: between points a line, beyond the last its slope."""
    if n <= passes[-1] or len(passes) < 2:
        return float(np.interp(n, passes, seconds))
    each = (seconds[-1] - seconds[-2]) / (passes[-1] - passes[-2])
    return float(seconds[-1] + each * (n - passes[-1]))


def recommend(study: PictureStudy, target: float) -> list[Forecast]:
    """Return what each method needs for a relative RMSE, the cheapest first."""
    own = study.reference.own_error
    forecasts = [forecast(curve, target, own) for curve in study.curves]
    return sorted(forecasts, key=lambda f: (f.passes is None, f.seconds.median))


def triangles_for(meshes: Sequence[dict[str, Any]], target: float) -> float:
    """Return the number of triangles at which the mesh error of a picture falls to a target.

    A log-log line through the two nearest meshes whose error is above the noise; nan if there are
    not two, or the error does not fall.
    """
    rows = sorted((row for row in meshes if row["error"] > 0.0), key=lambda row: row["triangles"])
    if len(rows) < 2:
        return math.nan
    k = next((i for i, row in enumerate(rows) if row["error"] <= target), len(rows) - 1)
    a, b = rows[max(k, 1) - 1], rows[max(k, 1)]
    if not (0.0 < b["error"] < a["error"] and a["triangles"] < b["triangles"]):
        return math.nan
    share = math.log(a["error"] / target) / math.log(a["error"] / b["error"])
    return float(a["triangles"] * (b["triangles"] / a["triangles"]) ** share)
