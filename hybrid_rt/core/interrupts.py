"""Ctrl-C and SIGTERM: the one counts as the other, and both wait while sums are updated."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

Came = list[tuple[Any, ...]]
STOPS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def held_back() -> Iterator[None]:
    """Defer Ctrl-C, and a SIGTERM that counts as one, to the end of this block."""
    handlers = {number: signal.getsignal(number) for number in STOPS}
    with kept_back() as came:
        yield
    if came:
        handler = handlers[came[0][0]]
        if callable(handler):
            handler(*came[0])


@contextmanager
def kept_back() -> Iterator[Came]:
    """Suppress them in this block; each one is recorded in the list that is yielded.

    A SIGTERM is recorded by a `sigterm_as_ctrl_c` around the block as well.
    """
    came: Came = []
    # Python raises them in the main thread only. What is no function is not Python's to hold back.
    handlers = {
        number: handler for number in STOPS if callable(handler := signal.getsignal(number))
    }
    if threading.current_thread() is not threading.main_thread():
        handlers = {}
    for number in handlers:
        signal.signal(number, lambda *signal_and_frame: came.append(signal_and_frame))
    try:
        yield came
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
            if isinstance(handler, _Stop):
                handler.came += [one for one in came if one[0] == number]


class _Stop:
    """A handler that records a signal and raises KeyboardInterrupt."""

    def __init__(self) -> None:
        self.came: Came = []

    def __call__(self, *signal_and_frame: Any) -> None:
        self.came.append(signal_and_frame)
        signal.default_int_handler(*signal_and_frame)


@contextmanager
def sigterm_as_ctrl_c() -> Iterator[Came]:
    """Raise KeyboardInterrupt on SIGTERM, as batch systems send it, if it would only end the process.

    Each one is recorded in the list that is yielded.
    """
    stop = _Stop()
    is_free = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if not is_free or threading.current_thread() is not threading.main_thread():
        yield stop.came
        return
    signal.signal(signal.SIGTERM, stop)
    try:
        yield stop.came
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def unheard_by_others() -> Iterator[None]:
    """Let threads and processes that begin in this block never hear Ctrl-C.

    A terminal sends it to all processes of a command, and this one tells the others to end.
    """
    from multiprocessing import resource_tracker

    # Whoever starts this one unblocks the signal in its thread.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
