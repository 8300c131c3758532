"""Saving the sums of a render in a store, and going on from them."""

import time

import numpy as np

from hybrid_rt.integrators.workers import Counts, Workers
from hybrid_rt.rendering.limits import Clock, Limit
from hybrid_rt.rendering.report import Session, StoreFigures
from hybrid_rt.rendering.store import PassStore, Saved, StoreError
from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.passes import GROUPS, RUN


class Keeper:
    """Takes up what a store holds, and saves what a render makes."""

    def __init__(
        self,
        store: PassStore,
        film: Film,
        workers: Workers,
        limit: Limit,
        clock: Clock,
        threads: int,
    ) -> None:
        self._store, self._film, self._workers = store, film, workers
        self._limit, self._clock, self._threads = limit, clock, threads
        self._before: list[Session] = []
        self._first, self._began = 0, time.time()

    def take_up(self, saved: Saved) -> None:
        """Go on from saved sums, or from those before them; raise StoreError if none fit the picture."""
        while why := self._misfit(saved):
            older = self._store.older(why)
            if older is None:
                raise self._unfit(why)
            saved = older
        try:
            self._film.restore(saved.arrays)
            self._workers.restore(saved.arrays)
            self._carry(saved.counts)
            self._limit.restore(saved.limit)
        except (KeyError, ValueError, TypeError) as error:
            raise self._unfit(error) from None
        self._before, self._first = saved.sessions, self._film.n_passes
        self._clock.earlier = sum(one["seconds"] for one in saved.sessions)
        self._clock.earlier_compilation = sum(
            one["kernel_compilation_seconds"] for one in saved.sessions
        )

    def _unfit(self, why: object) -> StoreError:
        return StoreError(
            f"store {self._store.shown} holds sums that do not fit its render ({why}): name another "
            "folder"
        )

    def _misfit(self, saved: Saved) -> str:
        """Say in which array saved sums differ from those of this render in kind; "": in none."""
        own = {**self._film.state(), **self._workers.state()}
        found = dict(saved.arrays)
        if "squares" not in found:  # once the groups tell the noise
            del own["squares"]
        # As long as it has passes.
        own["first_means"] = np.zeros(min(saved.passes, GROUPS * RUN))
        for name in sorted(own.keys() | found.keys()):
            a, b = (arrays.get(name) for arrays in (own, found))
            if a is None or b is None or (a.shape, a.dtype) != (b.shape, b.dtype):
                there = "missing" if b is None else f"{b.dtype} {b.shape}"
                return f"{name} is {there}"
        n_passes = int(found["counts"].sum())
        return "" if n_passes == saved.passes else f"{saved.passes} passes of which are {n_passes}"

    def _carry(self, counts: Counts) -> None:
        """Take saved counts in place of those of this call's set-up, but add its seconds."""
        own, context = self._workers.counts(), self._workers.context
        self._workers.forget()
        self._workers.carry(counts)
        for stage, seconds in own.ledger["seconds"].items():
            context.ledger.seconds[stage] += seconds
        context.tracer.coarse_seconds += own.coarse_seconds

    def is_due(self) -> bool:
        """Tell whether it is time to save."""
        return self._store.is_due()

    def save(self) -> None:
        """Write the sums of all passes so far; no thread may be at work."""
        arrays = {**self._film.state(), **self._workers.state()}
        counts, limit = self._workers.counts(), self._limit.state()
        saved = Saved(self._film.n_passes, arrays, counts, limit, self.sessions)
        self._store.save(saved)

    @property
    def sessions(self) -> list[Session]:
        """All calls that added passes; see `Saved`."""
        now: Session = {
            "began": round(self._began, 1),
            "passes": [self._first, self._film.n_passes],
            "seconds": round(self._clock.seconds, 4),
            "kernel_compilation_seconds": round(self._clock.compile_seconds, 4),
            "threads": self._threads,
        }
        return [*self._before, now]

    def report(self) -> StoreFigures:
        """Return the report's entry: the folder, its sessions, and what was lost or not saved."""
        store = self._store
        return StoreFigures(
            str(store.folder), self._first, self.sessions, store.notes, store.not_saved
        )
