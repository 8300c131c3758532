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
    """One setting of a method.

    Attributes
    ----------
    setting : float
        Passes, or the tolerance of a mesh in scene units.
    seconds, error : Spread
        For pictures, wall seconds and relative RMSE; for hits, seconds per ray and the fraction of
        wrong first hits.
    more : dict
        Other values by name, medians over the runs.
    """

    setting: float
    seconds: Spread
    error: Spread
    more: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """A method and its points, in order of cost.

    Attributes
    ----------
    name, flags : str
        ``flags`` are the command-line options of the method.
    points : list of Point
    bias : float
        Least error known that more passes do not reduce.
    bias_known_by : str
        How that is known, in words.
    left_out : list of str
        Light of the scene that the method does not find, as it declares.
    bias_at_most : float
        Upper 95 % limit of what its mesh changes; 0 without a mesh.
    power : float
        The square of the rest of the error falls as passes ** -power.
    unfound : float
        Light that the method does not find but photons do, over the mean of the picture; 0 if
        none, or not measured.
    error_by_unfound : float
        The least relative RMSE of a picture that lacks as much; 0 if it is not known.
    converges : bool
        Whether all of its error falls with the passes, but for light that ``max_depth`` cuts off: certified
        hits, all light, and no blur that stays.
    """

    name: str
    flags: str
    points: list[Point]
    bias: float = 0.0
    power: float = 1.0
    bias_known_by: str = ""
    left_out: list[str] = field(default_factory=list)
    bias_at_most: float = 0.0
    unfound: float = 0.0
    error_by_unfound: float = 0.0
    converges: bool = False


def renamed(curves: Sequence[Curve], prefix: str) -> list[Curve]:
    """Return curves with longer names, to be drawn with others."""
    return [replace(curve, name=f"{prefix}: {curve.name}") for curve in curves]
