"""What runs in the processes of a cluster: a scene is set up once, then passes are made."""

from __future__ import annotations

import math
import pickle
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass, replace
from numbers import Real
from threading import Lock
from typing import Any

import numpy as np

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.workers import Counts, Made, Pass, Run, Workers
from hybrid_rt.rendering.set_up import Ready, set_up
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.passes import GROUPS, RUN


class UnknownIntegratorError(ValueError):
    """A worker has no integrator of that name; what to do depends on how it was started."""


# The scenes of this process by key.
_SCENES: dict[str, PreparedScene] = {}


@dataclass(frozen=True)
class Part:
    """A pass or a whole run: its numbers, what they bring, and what was counted meanwhile."""

    passes: range
    made: Made
    counts: Counts


@dataclass(frozen=True)
class TaskResult:
    """Consecutive passes, as sums of whole runs where that is possible."""

    parts: list[Part]
    seconds: float  # of the passes, without the set-up


def keep_scene(key: str, integrator: str, pickled: bytes) -> None:
    """Keep a pickled scene with its `Settings`, without any work on it: reading it takes its integrator."""
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
    with closing(workers.render_passes(passes)) as found:
        if len(passes) > 1:
            made: Made = _summed(found)
        else:  # a copy, as its arrays are used again by the next one
            (made,) = [deepcopy(one) for one in found]
    return Part(passes, made, workers.counts())


@OVERFLOWS
def _summed(passes: Iterable[Made]) -> Run:
    """Return the passes of one run, added up as `Film` and `BlurSums` would."""
    total: Any = 0.0
    change: Any = None
    means = []
    for one in passes:
        assert isinstance(one, Pass)
        total = total + one.radiance
        means.append(float(one.radiance.mean()))
        if one.blur_change is not None:
            both = np.stack([one.blur_change, one.blur_change * one.blur_change])
            change = both + (0.0 if change is None else change)
    return Run(total, tuple(means), change)


class WrongResultError(ValueError):
    """A result is not what a worker makes of what it was asked for."""


def check_result(
    result: Any, passes: range, shape: tuple[int, int], alike: Counts, has_blur: bool | None
) -> None:
    """Raise WrongResultError, with the reason, unless a result is what a worker makes of a range of passes.

    ``alike`` are counts of other passes; ``has_blur`` tells whether passes before told of the blur.
    """
    if not isinstance(result, TaskResult) or not isinstance(result.parts, list):
        raise WrongResultError(f"it is {type(result).__name__}, no list of passes")
    if not _is_count(result.seconds):
        raise WrongResultError("its seconds are no number from 0 on")
    expected = list(_parts(passes.start, passes.stop))
    sent = [part.passes if isinstance(part, Part) else part for part in result.parts]
    if sent != expected:
        raise WrongResultError(f"it holds the passes {sent}, not each of {expected} once"[:200])
    for part in result.parts:
        has_blur = _check_made(part, shape, has_blur)
        if not _are_alike(part.counts, alike):
            raise WrongResultError("its counts are not those of such a render")


def _check_made(part: Part, shape: tuple[int, int], has_blur: bool | None) -> bool:
    """Return whether a part tells of the blur."""
    made, n, is_run = part.made, shape[0] * shape[1], len(part.passes) > 1
    if not isinstance(made, Run if is_run else Pass):
        raise WrongResultError(f"{part.passes} came as {type(made).__name__}")
    values, change = made.radiance if isinstance(made, Pass) else made.total, made.blur_change
    _check_array(values, (*shape, 3), "radiance")
    if float(values.min()) < 0.0:
        raise WrongResultError("a radiance is negative")
    if has_blur is not None and (change is not None) != has_blur:
        raise WrongResultError("passes do not agree whether there is blur")
    if change is not None:
        _check_array(change, (2, n, 3) if is_run else (n, 3), "blur")
        if is_run and float(change[1].min()) < 0.0:
            raise WrongResultError("a square of the blur is negative")
    means = made.means if isinstance(made, Run) else (0.0,) * RUN
    if not isinstance(means, tuple) or len(means) != RUN or not all(map(_is_count, means)):
        raise WrongResultError(f"it has no mean from 0 on for each of {RUN} passes")
    return change is not None


def _check_array(values: Any, shape: tuple[int, ...], name: str) -> None:
    if type(values) is not np.ndarray or values.dtype != np.float64 or values.shape != shape:
        found = f"{getattr(values, 'dtype', type(values).__name__)} {getattr(values, 'shape', '')}"
        raise WrongResultError(f"its {name} is {found.strip()}, not float64 {shape}")
    if not np.isfinite(values).all():
        raise WrongResultError(f"its {name} is not finite")


def _are_alike(sent: Any, own: Counts) -> bool:
    """Tell whether counts have the names that this render counts by, and numbers from 0 on."""
    if not isinstance(sent, Counts):
        return False
    pairs = [(getattr(sent, name), getattr(own, name)) for name in ("ledger", "work", "own")]
    return (
        all(isinstance(a, dict) and a.keys() == b.keys() for a, b in pairs)
        and all(np.shape(sent.own[name]) == np.shape(own.own[name]) for name in own.own)
        and all(
            isinstance(sent.ledger[name], dict) == isinstance(value, dict)
            for name, value in own.ledger.items()
        )
        and all(map(_is_count, (sent.ledger, sent.work, sent.coarse_seconds)))
    )


def _is_count(value: Any) -> bool:
    """Tell whether a value is a number from 0 on, or a dict of such numbers by name."""
    if isinstance(value, dict):
        names = all(isinstance(name, str | int | np.integer) for name in value)
        return names and all(map(_is_count, value.values()))
    return isinstance(value, Real) and 0.0 <= float(value) < math.inf


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
                raise UnknownIntegratorError(
                    f"workers do not know the integrator {self._integrator!r}"
                )
            scene, settings = pickle.loads(self._pickled)
            if self._ready is None:
                self._ready = set_up(scene, settings, 1, Ledger())
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
            return settings.declared.make(own, 1)

    def give_back(self, workers: Workers) -> None:
        """Let others use them."""
        with self._lock:
            self._idle.append(workers)
