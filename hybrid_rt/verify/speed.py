"""Rays per second, in turn and in one process: only ratios of one run mean anything."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timing:
    """Seconds of one contestant over several rounds.

    Attributes
    ----------
    median, least, most : float
        Seconds.
    """

    median: float
    least: float
    most: float


def in_turn(contestants: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, Timing]:
    """Run all contestants once unmeasured, then ``rounds`` times one after the other.

    Returns
    -------
    dict of Timing
        The machine's moods fall on all alike.
    """
    for run in contestants.values():
        run()
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            began = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - began)
    return {
        name: Timing(float(np.median(found)), min(found), max(found))
        for name, found in seconds.items()
    }
