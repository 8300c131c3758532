"""Parallel compilation of kernels while the kernel cache is cold.

numba compiles one function at a time in a process. So at the first cache miss, worker processes (as
many as there are cores) start to compile every kernel that this process has announced by `want`.
When this process needs a kernel that a worker is compiling, it waits and then loads the result; a
kernel that no worker has begun, it compiles itself. If workers fail, only time is lost. A kernel that
takes long has parts, functions that it links, which are compiled first and by several workers. The
list of kernels and their argument types is made by ``tools/list_kernels.py``.

It is worth its machinery: on two busy cores a cold demo took 156 to 165 s with it, 266 s without.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from hybrid_rt.core.interrupts import LOOK, heard_at_stops, stop_point
from meshing.kernels import cache

# Beyond that the longest compilation takes longer than all others together.
MOST_WORKERS = 8
# A twentieth of the time of compiling goes into looking for garbage, if that is done as often as usual.
GARBAGE = 100_000, 50, 100
# Finds the packages where this process has found them.
_CODE = "import sys; sys.path[:] = sys.argv[1:]; from hybrid_rt.core.precompile import work; work()"
DONE, FAILED = "done\n", "failed\n"
# The most that is said to be done.
NOT_YET_ALL = 0.99
FILE = resources.files("hybrid_rt") / "data" / "kernels.json"


@dataclass
class Listed:
    """A kernel, or a part of kernels, and the types it is compiled for.

    ``groups`` name what needs it; compiling it takes about so many ``seconds``, once the ``parts``
    that it links are compiled, and theirs.
    """

    kernel: str
    types: list[Any]
    groups: list[str]
    seconds: float
    parts: list[str] = field(default_factory=list)


def read_list() -> list[Listed]:
    """Read the list of kernels; those first that the longest work is waiting for."""
    return [Listed(**entry) for entry in json.loads(FILE.read_text("utf-8"))]


def want(*groups: str, but: Collection[str] = ()) -> None:
    """Announce the groups of kernels that this process will need; no effect on a warm cache.

    ``but`` names modules whose kernels are not needed.
    """
    if not _is_python(sys.executable) or _most_workers() < 2:
        return
    cache.on_miss = _on_miss
    _workers.want({(group, tuple(but)) for group in groups})


def fill_cold_cache() -> None:
    """Wait until all that is announced is compiled, unless the cache holds the first of it.

    For programs that start several processes on the same cold cache: each would begin to compile
    everything. Ends without a result if no process can be started.
    """
    _workers.fill()


def how_far() -> tuple[int, int]:
    """Return how much is compiled of what is announced, and all of it; (0, 0) before it begins.

    The unit is a tenth of a second of one processor, about.
    """
    return _workers.how_far()


def type_to_json(numba_type: Any) -> Any:
    """Encode a numba type for JSON; TypeError for types that no kernel takes."""
    from numba import types

    if isinstance(numba_type, types.NamedTuple | types.NamedUniTuple):
        of = numba_type.instance_class
        return [f"{of.__module__}:{of.__qualname__}", *map(type_to_json, numba_type.types)]
    if isinstance(numba_type, types.Array) and numba_type.aligned:
        words = [str(numba_type.dtype), str(numba_type.ndim), numba_type.layout]
        return " ".join(words if numba_type.mutable else [*words, "readonly"])
    if isinstance(numba_type, types.Literal):  # of a call from another kernel
        raise TypeError(f"kernels are not called with a {numba_type}")
    if isinstance(numba_type, types.Number | types.Boolean | types.NoneType):
        return str(numba_type)
    raise TypeError(f"kernels are not called with a {numba_type}")


def type_from_json(words: Any) -> Any:
    """Decode a type that `type_to_json` encoded."""
    from numba import types

    if isinstance(words, list):
        make: Any = types.BaseTuple.from_types
        return make([type_from_json(word) for word in words[1:]], named(words[0]))
    name, *array = words.split()
    plain = {"bool": types.boolean, "none": types.none}.get(name) or getattr(types, name)
    if not array:
        return plain
    return types.Array(plain, int(array[0]), array[1], readonly="readonly" in array)


def work() -> None:
    """Compile kernels read from standard input, one JSON line each: name and argument types."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends silently with the parent process
    gc.set_threshold(*GARBAGE)
    for line in sys.stdin:
        reply = FAILED  # the parent compiles it itself, and gets the error
        with contextlib.suppress(Exception):
            kernel, types = json.loads(line)
            named(kernel).compile(tuple(map(type_from_json, types)))
            reply = DONE
        sys.stdout.write(reply)
        sys.stdout.flush()


def named(words: str) -> Any:
    """Import the object that ``module:name`` denotes."""
    module, name = words.split(":")
    return getattr(importlib.import_module(module), name)


def _on_miss(kernel: str, types: tuple[Any, ...]) -> bool:
    """Tell whether another process has compiled a kernel, after waiting for it if need be."""
    from numba.core import event

    number = _workers.number_of(kernel, types)
    if number is None:
        return False
    # For listeners this is a compilation: it is announced, and its time counts as such.
    what = {"dispatcher": named(kernel), "args": types, "return_type": None}
    with heard_at_stops(), event.trigger_event("numba:compile", data=what):
        return _workers.wait_for(number)


class _Workers:
    """Processes that compile; a thread each hands them their work."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._wanted: set[tuple[str, tuple[str, ...]]] = set()
        self._listed: list[Listed] = []
        self._numbers: dict[tuple[str, str], int] = {}
        self._known: set[int] = set()
        self._queue: list[int] = []
        self._at_work: set[int] = set()
        self._done: set[int] = set()
        self._processes: list[subprocess.Popen[str]] = []
        self._n_threads = 0

    def want(self, wanted: set[tuple[str, tuple[str, ...]]]) -> None:
        with self._changed:
            self._wanted |= wanted
            if self._known:
                self._begin(self._wanted_numbers())

    def number_of(self, kernel: str, types: tuple[Any, ...]) -> int | None:
        """Return the number of a kernel if it is wanted: then all that is wanted is begun."""
        with self._changed:
            if not self._listed:
                self._listed = read_list()
                self._numbers = {
                    (entry.kernel, json.dumps(entry.types)): i
                    for i, entry in enumerate(self._listed)
                }
                atexit.register(self._stop)
            try:
                words = json.dumps([type_to_json(x) for x in types])
            except TypeError:
                return None
            number = self._numbers.get((kernel, words))
            of_use = self._wanted_numbers()
            if number not in of_use:
                return None
            self._begin(of_use)
            return number

    def wait_for(self, number: int) -> bool:
        """Wait for a kernel that is being compiled, or whose parts are.

        What others could begin, and nobody has begun, is left to the caller.
        """
        with self._changed:
            while number in self._queue and self._n_threads and not self._is_ready(number):
                stop_point()
                self._changed.wait(LOOK)  # a process that dies tells nobody
            if number in self._queue:
                self._queue.remove(number)
            while number in self._at_work:
                stop_point()
                self._changed.wait(LOOK)
            return number in self._done

    def how_far(self) -> tuple[int, int]:
        with self._changed:
            total = sum(map(self._work_of, self._known))
            done = total - sum(map(self._work_of, {*self._queue, *self._at_work}))
            # This process may have a kernel left to do by itself: what compiles is not complete.
            return min(done, int(NOT_YET_ALL * total)), total

    def fill(self) -> None:
        """Load the first kernel that is wanted; if that begins the work, wait for its end."""
        listed = read_list()
        parts = _parts_in(listed)
        first = next((x for x in listed if self._is_wanted(x) and x.kernel not in parts), None)
        if first is None:
            return
        named(first.kernel).compile(tuple(map(type_from_json, first.types)))
        with self._changed:
            while self._n_threads and (self._queue or self._at_work):
                self._changed.wait(1.0)  # a process that dies tells nobody

    def _is_wanted(self, entry: Listed) -> bool:
        module = entry.kernel.split(":")[0]
        return any(group in entry.groups and module not in but for group, but in self._wanted)

    def _wanted_numbers(self) -> set[int]:
        """Return what is wanted and is no part, and the parts that it links."""
        groups = {group for group, _ in self._wanted}
        parts = _parts_in(self._listed)
        wholes = {
            i for i, x in enumerate(self._listed) if x.kernel not in parts and self._is_wanted(x)
        }
        linked = _parts_in(self._listed[i] for i in wholes)
        return wholes | {
            i
            for i, x in enumerate(self._listed)
            if x.kernel in linked and not groups.isdisjoint(x.groups)
        }

    def _work_of(self, number: int) -> int:
        return max(round(10.0 * self._listed[number].seconds), 1)

    def _is_ready(self, number: int) -> bool:
        """Tell whether nobody has parts of it still to compile."""
        left = {self._listed[i].kernel for i in (*self._queue, *self._at_work)}
        return left.isdisjoint(self._listed[number].parts)

    def _begin(self, of_use: set[int]) -> None:
        """Queue what is newly of use, and let as many threads run as there is work for."""
        new = of_use - self._known
        self._known |= new
        self._queue = sorted([*self._queue, *new])
        with contextlib.suppress(RuntimeError):  # no thread can be started
            while self._n_threads < min(_most_workers(), len(self._queue)):
                threading.Thread(target=self._drive, daemon=True).start()
                self._n_threads += 1

    def _drive(self) -> None:
        """Let a process of its own compile what is next, until nothing is left."""
        with contextlib.suppress(OSError), _start() as process:  # or it cannot be, or is gone
            self._processes.append(process)
            while (number := self._next()) is not None:
                reply = _ask(process, self._listed[number])
                self._end(number, reply == DONE)
                if not reply:
                    break
            else:
                return
        with self._changed:
            self._n_threads -= 1

    def _next(self) -> int | None:
        """Return what is next; None: nothing is left, and the thread that asks counts no more."""
        with self._changed:
            while self._queue:
                number = next(filter(self._is_ready, self._queue), None)
                if number is not None:
                    self._queue.remove(number)
                    self._at_work.add(number)
                    return number
                self._changed.wait()  # for a part that another process compiles
            self._n_threads -= 1
            return None

    def _end(self, number: int, is_done: bool) -> None:
        with self._changed:
            self._at_work.discard(number)
            if is_done:
                self._done.add(number)
            self._changed.notify_all()

    def _stop(self) -> None:
        with self._changed:
            self._queue.clear()
        for process in self._processes:
            process.terminate()
        for process in self._processes:
            process.wait()


def _parts_in(listed: Iterable[Listed]) -> set[str]:
    return {part for entry in listed for part in entry.parts}


def _is_python(executable: str | None) -> bool:
    """Tell whether a program starts Python, not one that Python is built into."""
    is_built_in = getattr(sys, "frozen", False)
    return not is_built_in and "python" in Path(executable or "").name.lower()


def _most_workers() -> int:
    from hybrid_rt.core.threads import available_threads

    return min(available_threads(), MOST_WORKERS)


def _start() -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _CODE, *sys.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )


def _ask(process: subprocess.Popen[str], entry: Listed) -> str:
    """Return a process's reply; that of one that has died is empty."""
    assert process.stdin is not None
    assert process.stdout is not None
    with contextlib.suppress(OSError):
        process.stdin.write(json.dumps([entry.kernel, entry.types]) + "\n")
        process.stdin.flush()
        return process.stdout.readline()
    return ""


def _forget() -> None:
    """Begin anew in a forked process, which has none of these threads."""
    global _workers  # noqa: PLW0603
    _workers = _Workers()


_workers = _Workers()
if hasattr(os, "register_at_fork"):  # not so on Windows
    os.register_at_fork(after_in_child=_forget)
