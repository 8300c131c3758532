"""Interleaved timing of several methods in one process, and a stopwatch.

Of interleaved timings only ratios within a run mean anything.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Self, TypeVar

import numpy as np

Name = TypeVar("Name", bound=Hashable)
Built = TypeVar("Built")


@dataclass(frozen=True)
class Timing:
    """Seconds of one method over several rounds."""

    median: float
    least: float
    most: float
    rounds: tuple[float, ...]

    def ratios(self, base: Timing) -> tuple[float, float, float]:
        """Return the median, least and greatest speed over that of ``base``, round by round."""
        ratios = np.array(base.rounds) / np.array(self.rounds)
        return float(np.median(ratios)), float(ratios.min()), float(ratios.max())


class Stopwatch:
    """Sums the seconds of all blocks that run in it; for one thread."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self.seconds = 0.0
        self._now = now
        self._began = 0.0

    def __enter__(self) -> Self:
        """Start."""
        self._began = self._now()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop."""
        self.seconds += self._now() - self._began


def in_turn(contestants: Mapping[Name, Callable[[], object]], rounds: int) -> dict[Name, Timing]:
    """Run all methods once for warm-up, then ``rounds`` times in turn: changes of speed affect all alike."""
    for run in contestants.values():
        run()
    seconds: dict[Name, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            began = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - began)
    return {
        name: Timing(float(np.median(found)), min(found), max(found), tuple(found))
        for name, found in seconds.items()
    }


def timed(build: Callable[[], Built]) -> tuple[Built, float]:
    """Return the result of a call and its seconds."""
    began = time.perf_counter()
    built = build()
    return built, time.perf_counter() - began
