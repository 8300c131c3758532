"""What runs in the processes of a cluster: a scene is set up once, then passes are made."""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.workers import Counts, Made, Pass, Run, Workers
from hybrid_rt.rendering.set_up import Ready, Request, set_up
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.passes import GROUPS, RUN

# The scenes of this process by key.
_SCENES: dict[str, PreparedScene] = {}


@dataclass(frozen=True)
class Part:
    """A pass or a whole run, and what was counted while it was made."""

    made: Made
    counts: Counts


@dataclass(frozen=True)
class TaskResult:
    """Consecutive passes, as sums of whole runs where that is possible.

    Attributes
    ----------
    parts : list of Part
    seconds : float
        Wall seconds of the passes, without the set-up.
    """

    parts: list[Part]
    seconds: float


def keep_scene(key: str, integrator: str, pickled: bytes) -> None:
    """Keep a scene in this process, without any work on it.

    Parameters
    ----------
    key : str
    integrator : str
    pickled : bytes
        A `Request`, which only a process that knows its integrator can read.
    """
    _SCENES.setdefault(key, PreparedScene(integrator, pickled))


def forget_scene(key: str) -> None:
    """Forget a scene."""
    _SCENES.pop(key, None)


def set_up_scene(key: str) -> None:
    """Set a scene up, so that the first pass takes no longer than others."""
    prepared = _SCENES[key]
    prepared.give_back(prepared.take())


def make_passes(key: str, first: int, stop: int) -> TaskResult:
    """Make the passes from ``first`` to ``stop`` - 1 of a scene, in this process."""
    prepared = _SCENES[key]
    workers = prepared.take()
    try:
        began = time.perf_counter()
        parts = [_part(workers, passes) for passes in _parts(first, stop)]
        return TaskResult(parts, time.perf_counter() - began)
    finally:
        prepared.give_back(workers)


def _parts(first: int, stop: int) -> Iterator[range]:
    """Yield whole runs, but for the first of each group, and what is left pass by pass."""
    while first < stop:
        is_run = first % RUN == 0 and first >= GROUPS * RUN and first + RUN <= stop
        part = range(first, first + (RUN if is_run else 1))
        yield part
        first = part.stop


def _part(workers: Workers, passes: range) -> Part:
    """Make a pass, or the passes of a whole run.

    They are counted by themselves, since a render may end before the other passes of a task.
    """
    workers.forget()
    run, made = _OpenRun(), None
    with closing(workers.render_passes(passes)) as found:
        for one in found:
            assert isinstance(one, Pass)
            if len(passes) == 1:
                change = None if one.blur_change is None else one.blur_change.copy()
                made = Pass(one.radiance.copy(), change)
            else:
                run.add(one)
    return Part(made or run.closed(), workers.counts())


class _OpenRun:
    """The passes of one run, added up as `Film` and `BlurSums` would."""

    def __init__(self) -> None:
        self.means: list[float] = []
        self._total: FloatArray | None = None
        self._change: FloatArray | None = None

    @OVERFLOWS
    def add(self, one: Pass) -> None:
        if self._total is None:
            self._total = np.zeros_like(one.radiance)
            if one.blur_change is not None:
                self._change = np.zeros((2, *one.blur_change.shape))
        self._total += one.radiance
        self.means.append(float(one.radiance.mean()))
        if self._change is not None and one.blur_change is not None:
            self._change[0] += one.blur_change
            self._change[1] += one.blur_change * one.blur_change

    def closed(self) -> Run:
        assert self._total is not None
        return Run(self._total, tuple(self.means), self._change)


class PreparedScene:
    """A scene in this process: set up when the first task asks, with `Workers` for each thread."""

    def __init__(self, integrator: str, pickled: bytes) -> None:
        self._integrator, self._pickled = integrator, pickled
        self._lock = Lock()
        self._ready: Ready | None = None
        self._idle: list[Workers] = []

    def take(self) -> Workers:
        """Return workers that no other thread uses."""
        with self._lock:
            if self._integrator not in INTEGRATORS:
                raise ValueError(
                    f"workers do not know the integrator {self._integrator!r}: declare it in a "
                    "module and start them by `dask worker --preload MODULE`, or leave out cluster="
                )
            request: Request = pickle.loads(self._pickled)
            if self._ready is None:
                self._ready = set_up(request, 1, Ledger())
                return self._ready.workers
            if self._idle:
                return self._idle.pop()
            context = self._ready.context
            own = replace(
                context,
                tracer=context.tracer.with_own_counters(),
                plan=deepcopy(self._ready.plan),
                ledger=Ledger(),
            )
            return request.declared.make(own, 1)

    def give_back(self, workers: Workers) -> None:
        """Let others use them."""
        with self._lock:
            self._idle.append(workers)
