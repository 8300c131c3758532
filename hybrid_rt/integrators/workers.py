"""Worker threads of a render: each has its own integrator and traces blocks of camera rays."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from threading import local
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.interrupts import heard_anywhere, heard_at_stops, held_back
from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.threads import as_done
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import BLOCK, Integrator
from hybrid_rt.integrators.photons.figures import NO_BLUR, Blur, PhotonFigures

# Camera rays of the passes that are traced together: enough blocks for every thread, while the
# radiances of all of them stay small.
TOGETHER = 2**19
# Smaller blocks cost more in calls than they gain by being shared.
LEAST = 1024

# Hands work and an item to the next free integrator.
Submit = Callable[[Callable[[Any, Any], Any], Any], "Future[Any]"]


@dataclass(frozen=True)
class Pass:
    """What one pass brings."""

    # (height, width, 3): means of the samples of each pixel: one, but for `PPMOptions` more if that
    # pays
    radiance: FloatArray
    blur_change: FloatArray | None = None  # (height * width, 3): what the blur is estimated from


@dataclass(frozen=True)
class Run:
    """What the passes of a whole run bring together."""

    total: FloatArray  # (height, width, 3): sum of their radiances, in their order
    means: tuple[float, ...]  # of each, over the picture
    # (2, height * width, 3): sums of what the blur is estimated from, and of its squares
    blur_change: FloatArray | None = None


Made = Pass | Run


@dataclass(frozen=True)
class Counts:
    """What was counted while passes were made, in plain types."""

    ledger: dict[str, Any]  # that of `Ledger.as_dict`
    work: dict[str, int]  # dict of int: counters of the intersector
    coarse_seconds: float  # what of the intersector's seconds was spent on coarse hits
    own: dict[str, Any]  # what the integrator counts by itself


class Workers:
    """Integrators that run in parallel.

    ``context``: its tracer and sampler run in the calling thread.
    ``make``: takes a context, returns an `Integrator`.
    """

    def __init__(
        self, context: RenderContext, threads: int, make: Callable[[RenderContext], Integrator]
    ) -> None:
        self.context = context
        self._contexts = [context.with_own_counts() for _ in range(threads)]
        self._integrators = [make(own) for own in self._contexts]
        self._submit: Submit | None = None
        self._integrators[0].begin()
        for integrator in self._integrators[1:]:
            integrator.follow(self._integrators[0])
        # What all looked up alike counts once.
        for own in self._contexts[1:]:
            own.ledger.forget()
            own.tracer.counters.update(dict.fromkeys(own.tracer.counters, 0))

    def forget_seconds(self) -> None:
        """Reset the seconds of all threads: set-up time is counted by the caller."""
        for own in self._contexts:
            own.ledger.seconds.clear()

    def at_once(self) -> int:
        """Return how many passes to ask for at a time: enough blocks for every thread."""
        camera = self.context.scene.camera
        together = max(TOGETHER // (camera.width * camera.height), 1)
        return min(together, self._integrators[0].most_at_once)

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Generator[Made, None, None]:
        """Yield the passes in their order, to be handed to `keep` once they are on the film.

        After each block ``on_rays`` is called with the number of camera rays done.
        """
        camera = self.context.scene.camera
        images = np.empty((len(passes), camera.height, camera.width, 3))
        rows = images.reshape(-1, 3)
        n = len(rows)
        size = self._block_size(n)
        blocks = [(first, min(first + size, n)) for first in range(0, n, size)]
        shares = self._shares(passes)
        prepared: list[Any] = [None] * len(shares)
        # Closed, and not left to be: threads would go on counting while others read.
        with closing(
            self._done(lambda worker, i: worker.prepare(*shares[i]), range(len(shares)))
        ) as done_shares:
            for i, found in done_shares:
                prepared[i] = found
        gathered = self._integrators[0].gather(passes, prepared)
        for integrator in self._integrators:
            integrator.take(gathered)
        with closing(
            self._done(lambda worker, block: worker.trace(passes, *block), blocks)
        ) as traced:
            for done, ((first, stop), radiance) in enumerate(traced, start=1):
                rows[first:stop] = radiance
                if on_rays is not None:
                    on_rays(min(done * size, n))
        for (run, _), found in zip(shares, prepared, strict=True):
            first, stop = run.start - passes.start, run.stop - passes.start
            part = images[first:stop].reshape(len(run), -1, 3)
            self._integrators[0].add_prepared(found, part)
        yield from map(Pass, images)

    def keep(self, made: Made) -> None:
        """Add what passes say of the blur, once they are part of the picture."""

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the sums over passes that `restore` goes on from, by name; not the film's."""
        return {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take over the sums of other workers of the same render."""

    def _block_size(self, n: int) -> int:
        # At least four blocks a thread, so that a slow one does not hold up the others.
        return min(BLOCK, max(-(-n // (4 * len(self._integrators))), LEAST))

    def _shares(self, passes: range) -> list[tuple[range, int]]:
        """Return the passes and the part of them that each call of `Integrator.prepare` is for."""
        parts = self._integrators[0].parts
        size = 1 if parts > 1 else -(-len(passes) // len(self._integrators))
        return [
            (passes[i : i + size], part)
            for i in range(0, len(passes), size)
            for part in range(parts)
        ]

    def _done(
        self, work: Callable[[Any, Any], Any], items: Sequence[Any]
    ) -> Generator[tuple[Any, Any], None, None]:
        """Yield items with what was made of them, in the order in which they are done."""
        if len(self._integrators) == 1 or (len(items) == 1 and self._submit is None):
            for item in items:
                with heard_anywhere():
                    made = work(self._integrators[0], item)
                yield item, made
            return
        with self._at_work() as submit:
            item_of = {submit(work, item): item for item in items}
            for future in as_done(item_of):
                yield item_of[future], future.result()

    @contextmanager
    def _at_work(self) -> Iterator[Submit]:
        """Let threads wait for work; whatever is done meanwhile is shared among the same ones."""
        if self._submit is not None:
            yield self._submit
            return
        if len(self._integrators) == 1:
            yield self._at_once
            return
        free, own = list(self._integrators), local()
        with heard_at_stops():
            executor = ThreadPoolExecutor(
                len(free), "hybrid_rt", lambda: setattr(own, "integrator", free.pop())
            )
            self._submit = lambda work, item: executor.submit(lambda: work(own.integrator, item))
            try:
                yield self._submit
            finally:
                self._submit = None
                with held_back():  # or threads would go on counting while others read
                    executor.shutdown(cancel_futures=True)

    def _at_once(self, work: Callable[[Any, Any], Any], item: Any) -> Future[Any]:
        future: Future[Any] = Future()
        with heard_anywhere():
            made = work(self._integrators[0], item)
        future.set_result(made)
        return future

    def blur(self, image: NDArray[np.float32]) -> Blur:
        """Return the estimated bias of a picture (height, width, 3), as far as it is known."""
        del image
        return NO_BLUR

    def photons(self, blur: Blur) -> PhotonFigures | None:
        """Return what the report says of photons; None: there are none."""
        del blur
        return None

    @property
    def n_missed(self) -> int:
        """Points that gather light and met no photon, if these are nearly all; else 0."""
        return 0

    def counts(self) -> Counts:
        """Return what all threads have counted, while none of them is at work.

        Seconds become wall seconds: the sum over threads divided by their number.
        """
        total, work = Ledger(self.context.ledger.now), dict(self.context.tracer.counters)
        total.add(self.context.ledger)
        for own in self._contexts:
            total.add(own.ledger, share=1.0 / len(self._contexts))
            add_work(work, own.tracer.counters)
        coarse_seconds = self.context.tracer.coarse_seconds + sum(
            own.tracer.coarse_seconds for own in self._contexts
        ) / len(self._contexts)
        return Counts(total.as_dict(), work, coarse_seconds, self._own_counts())

    def carry(self, counts: Counts) -> None:
        """Add what others counted for the same render."""
        self.context.ledger.add(Ledger.from_dict(counts.ledger))
        add_work(self.context.tracer.counters, counts.work)
        self.context.tracer.coarse_seconds += counts.coarse_seconds
        self._carry_own(counts.own)

    def forget(self) -> None:
        """Reset all counts."""
        for context in (self.context, *self._contexts):
            context.ledger.forget()
            context.tracer.forget_counters()
        self._forget_own()

    def gather(self) -> None:
        """Move the counts of all threads to the context."""
        counts = self.counts()
        self.forget()
        self.carry(counts)

    def _own_counts(self) -> dict[str, Any]:
        return {}

    def _carry_own(self, counts: dict[str, Any]) -> None:
        """Add counts of the integrator's own."""

    def _forget_own(self) -> None:
        """Reset counts of the integrator's own."""


def add_work(total: dict[str, int], more: Mapping[str, int]) -> None:
    """Add counters of the intersector to others."""
    for name, count in more.items():
        total[name] = max(total[name], count) if name.startswith("most") else total[name] + count
