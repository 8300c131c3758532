"""The ledger of a render: ray counts by kind, seconds by stage."""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from hybrid_rt.core.records import HitRecord, Status

_COUNTERS = ("seconds", "rays", "hits", "ended", "unclosed")
_NUMBERS = (
    "lost_weight", "carried", "camera_hits", "camera_hits_without_bound", "largest_t_bound",
)  # fmt: skip


class Ledger:
    """Seconds per stage, by a clock, and counts by name, summed over a render."""

    def __init__(self, now: Callable[[], float] = time.perf_counter) -> None:
        self.now = now
        self.forget()

    def forget(self) -> None:
        """Reset all counts and seconds."""
        self.seconds: dict[str, float] = defaultdict(float)
        self.rays: Counter[str] = Counter()
        self.hits: Counter[str] = Counter({status.name.lower(): 0 for status in Status})
        self.ended: Counter[str] = Counter()
        self.unclosed: Counter[int] = Counter()  # by dielectric lobe
        self.lost_weight = 0.0
        # What paths from the camera carried behind the first surface that spreads light; 0: not counted.
        self.carried = 0.0
        self.camera_hits = 0
        self.camera_hits_without_bound = 0
        self.largest_t_bound = 0.0
        self._within = 0.0  # seconds of the stages inside the present one

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the seconds of a block to a stage, without those of stages nested in it."""
        began = self.now()
        outer, self._within = self._within, 0.0
        try:
            yield
        finally:
            spent = self.now() - began
            self.seconds[name] += spent - self._within
            self._within = outer + spent

    def add(self, other: Ledger, share: float = 1.0) -> None:
        """Add the counts of another thread, and a share of its seconds, as threads overlap."""
        for stage, seconds in other.seconds.items():
            self.seconds[stage] += share * seconds
        for name in _COUNTERS[1:]:
            getattr(self, name).update(getattr(other, name))
        for name in _NUMBERS[:-1]:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.largest_t_bound = max(self.largest_t_bound, other.largest_t_bound)

    def as_dict(self) -> dict[str, Any]:
        """Return all counts and seconds, as JSON types."""
        counts = {name: dict(getattr(self, name)) for name in _COUNTERS}
        return {**counts, **{name: getattr(self, name) for name in _NUMBERS}}

    @classmethod
    def from_dict(cls, counts: dict[str, Any]) -> Ledger:
        """Return the ledger of which `as_dict` made these counts."""
        ledger = cls()
        for name in _COUNTERS:
            # JSON has words for keys only; those of bodies are numbers.
            found = {int(k) if name == "unclosed" else k: n for k, n in counts[name].items()}
            getattr(ledger, name).update(found)
        for name in _NUMBERS:
            setattr(ledger, name, counts[name])
        return ledger

    def lost_share(self) -> float:
        """Return the weight that was lost over what paths carried: about what the image mean lacks."""
        n_camera = self.rays["camera"]
        return self.lost_weight / (self.carried or n_camera) if n_camera else 0.0

    def count_hits(self, hits: HitRecord) -> None:
        """Count first hits by status."""
        counts = np.bincount(hits.status, minlength=len(Status))
        for status in Status:
            self.hits[status.name.lower()] += int(counts[status])

    def note_camera_hits(self, hits: HitRecord) -> None:
        """Keep the largest proven error of the first hits of rays that leave the camera."""
        bounds = hits.t_bound[hits.hit]
        proven = bounds[np.isfinite(bounds)]
        self.camera_hits += bounds.size
        self.camera_hits_without_bound += bounds.size - proven.size
        self.largest_t_bound = max(self.largest_t_bound, float(proven.max(initial=0.0)))


def twelve_digits(value: float) -> float:
    """Round a sum over threads to the digits that do not depend on the order of its terms."""
    return float(f"{value:.12g}")
