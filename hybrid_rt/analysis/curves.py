"""Work-precision curves: cost and error of a method at each of its settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np


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
