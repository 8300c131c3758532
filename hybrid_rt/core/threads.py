"""One pool of threads for all work on slices of a batch of rays.

Kernels and Embree release the GIL and work on the slice they are given; they start no threads of
their own. The result of a slice depends on its rays only, so the number of threads changes no
result.
"""

import os
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import nullcontext
from queue import Empty, SimpleQueue
from typing import Any

from hybrid_rt.core.interrupts import LOOK, heard_at_stops, held_back, is_heard, stop_point
from meshing.checks import whole

# Long enough to hide the cost of a call from Python, short enough to share the work evenly.
SLICE = 16384
# More than any machine has processors; a slip of the keyboard starts no million threads.
MOST_THREADS = 4096


def available_threads() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def result_of(future: Future[Any]) -> Any:
    """Wait for a result; interrupts are raised meanwhile.

    It belongs into a block `heard_at_stops`, as `as_done` does: a thread that waits for a lock loses
    it if an interrupt is raised at any other moment.
    """
    while True:
        stop_point()
        try:
            return future.result(LOOK)
        except TimeoutError:
            if future.done():  # it is the result, or has come just now
                return future.result()


def as_done(futures: Collection[Future[Any]]) -> Iterator[Future[Any]]:
    """Yield futures in the order in which they are done; see `result_of`."""
    done: SimpleQueue[Future[Any]] = SimpleQueue()
    for future in futures:
        future.add_done_callback(done.put)
    left = len(futures)
    while left:
        stop_point()
        try:
            future = done.get(timeout=LOOK)
        except Empty:
            continue
        left -= 1
        yield future


class Pool:
    """Runs a function over slices of ``range(n)``; the threads start with the first long batch.

    Raises ValueError or TypeError unless ``threads`` is an integer from 1 to `MOST_THREADS`, or None: as many
    as this process may use.
    """

    def __init__(self, threads: int | None = None) -> None:
        if threads is not None:
            whole(threads, "threads", at_least=1, up_to=MOST_THREADS)
        self.threads = int(threads or available_threads())
        self._executor: ThreadPoolExecutor | None = None

    def run(self, work: Callable[[int, int], None], n: int, longest: int = SLICE) -> None:
        """Call a function with (begin, end) for slices that cover ``range(n)``, several at once.

        Its exceptions propagate.
        """
        if n <= longest // 8 or self.threads == 1:
            for begin in range(0, n, longest):
                work(begin, min(begin + longest, n))
            return
        # At least four slices a thread, so that a slow one does not hold up the batch.
        size = max(min(longest, -(-n // (4 * self.threads))), 256)
        # Of itself a batch does without, as short ones would take a tenth longer.
        with heard_at_stops() if is_heard() else nullcontext():
            if self._executor is None:
                self._executor = ThreadPoolExecutor(self.threads, thread_name_prefix="hybrid_rt")
            futures = [
                self._executor.submit(work, begin, min(begin + size, n))
                for begin in range(0, n, size)
            ]
            try:
                for future in futures:
                    result_of(future)
            except BaseException:  # no thread writes into arrays that others have by now
                with held_back():
                    wait([future for future in futures if not future.cancel()])
                raise

    def __getstate__(self) -> dict[str, object]:
        """Threads stay behind; an unpickled pool starts its own."""
        return {"threads": self.threads, "_executor": None}
