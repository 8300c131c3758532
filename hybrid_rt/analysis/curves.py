"""Curves of methods: what each of their settings costs, and how far it is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Spread:
    """A figure over several runs: median, least and most."""

    median: float
    least: float
    most: float


def spread(values: Sequence[float]) -> Spread:
    """Return median, least and most."""
    return Spread(float(np.median(values)), float(min(values)), float(max(values)))


@dataclass(frozen=True)
class Point:
    """One setting of a method.

    Attributes
    ----------
    setting : float
        Passes, or the tolerance of a mesh in scene units.
    seconds, error : Spread
        Of a picture its wall seconds and relative RMSE; of hits the seconds per ray and the share
        of wrong first hits.
    more : dict
        Other figures by name, medians over the runs.
    """

    setting: float
    seconds: Spread
    error: Spread
    more: dict[str, float]


@dataclass(frozen=True)
class Curve:
    """A method and its points in the order of their cost.

    Attributes
    ----------
    name, flags : str
        ``flags`` choose the method in a command.
    points : list of Point
    bias : float
        Error that passes do not remove, as far as it is known from elsewhere.
    power : float
        The square of the rest of the error falls as passes to the minus this.
    """

    name: str
    flags: str
    points: list[Point]
    bias: float = 0.0
    power: float = 1.0


def renamed(curves: Sequence[Curve], prefix: str) -> list[Curve]:
    """Return curves under longer names, to be drawn beside others."""
    return [replace(curve, name=f"{prefix}: {curve.name}") for curve in curves]
