"""Deferral of Ctrl-C while sums are updated."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

Came = list[tuple[Any, ...]]


@contextmanager
def held_back() -> Iterator[None]:
    """Defer Ctrl-C to the end of this block."""
    handler = signal.getsignal(signal.SIGINT)
    with kept_back() as came:
        yield
    if came and callable(handler):
        handler(*came[0])


@contextmanager
def kept_back() -> Iterator[Came]:
    """Suppress Ctrl-C in this block; each one is recorded in the list that is yielded."""
    handler = signal.getsignal(signal.SIGINT)
    came: Came = []
    # Python raises it in the main thread only. What is no function is not Python's to hold back.
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield came
        return
    signal.signal(signal.SIGINT, lambda *signal_and_frame: came.append(signal_and_frame))
    try:
        yield came
    finally:
        signal.signal(signal.SIGINT, handler)
