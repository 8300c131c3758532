"""Ctrl-C and SIGTERM: raised once, where nothing can be lost by it, and recorded everywhere else.

Python calls a signal's handler between any two instructions of the main thread. An exception from
there breaks what is at work just then: a lock is not given back, a sum is added by half, and what
cleans up after a first interrupt is broken off by a second one. Therefore ours raises once, for
the first signal, and where the present `Level` allows it; others wait for a `stop_point`, or for
the end of the block that holds them back. All of this is about the main thread; in others these
blocks do nothing.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import Any

Came = list[tuple[int, None]]
STOPS = (signal.SIGINT, signal.SIGTERM)
# Seconds after which who waits for other threads passes a `stop_point` again.
LOOK = 0.05


class Level(IntEnum):
    """Where an interrupt may be raised."""

    NOWHERE = 0
    AT_STOPS = 1
    ANYWHERE = 2


class _State:
    """What is known of signals: our handlers, and what they have heard."""

    def __init__(self) -> None:
        self.level, self.is_over = Level.ANYWHERE, False
        self.pending: Came = []
        self.listeners: list[_Block] = []
        self.handlers: dict[int, Callable[..., Any]] = {}


_state = _State()


def _hear(number: int, _frame: Any) -> None:
    """Handle a signal."""
    for block in _state.listeners:
        if number in block.recorded:
            block.came.append((number, None))
    if _state.is_over:
        return
    if _state.level == Level.ANYWHERE:
        _deliver(number)
    else:
        _state.pending.append((number, None))


def _deliver(number: int) -> None:
    # Before the handler raises: what is between here and the one who catches it is not disturbed.
    _state.is_over = True
    _state.pending.clear()
    _state.handlers[number](number, None)
    _state.is_over = False  # a handler of others, which raises nothing


def stop_point() -> None:
    """Raise an interrupt that has come, if that is allowed here."""
    if _state.pending and _state.level >= Level.AT_STOPS and _is_main():
        _deliver(_state.pending[0][0])


def hear_again() -> None:
    """Let the next signal interrupt, whatever was raised before: work begins that can be lost."""
    if _is_main():
        _state.is_over = False


def is_heard() -> bool:
    """Tell whether this thread is in one of these blocks."""
    return bool(_state.handlers) and _is_main()


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


class _Block:
    """A block with a level of its own; it has our handler, and yields the signals that come.

    No generator, since an interrupt may be raised before the first instruction of ``__exit__``:
    then the block around restores its own level, and nothing of this one is left to be done later.
    """

    def __init__(
        self,
        level: Level,
        takes_up: bool = False,
        recorded: tuple[int, ...] = STOPS,
        as_ctrl_c: tuple[int, ...] = (),
    ) -> None:
        self._asked, self._takes_up, self.recorded = level, takes_up, recorded
        self._as_ctrl_c = as_ctrl_c
        self.came: Came = []
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Came:
        self._is_idle = not _is_main()
        if self._is_idle:
            return self.came
        if self._asked == Level.ANYWHERE:
            stop_point()
        self._level, self._handlers = _state.level, dict(_state.handlers)
        is_open = _state.level >= Level.AT_STOPS
        try:
            _state.level = Level.NOWHERE
            for number in STOPS:
                now = signal.getsignal(number)
                is_free = number in self._as_ctrl_c and now is signal.SIG_DFL
                called = signal.default_int_handler if is_free else now
                # What is no function is not Python's to hold back.
                if now is not _hear and callable(called):
                    _state.handlers[number] = called
                    self._before[number] = now
                    signal.signal(number, _hear)
        except BaseException:  # by the handler that was to be replaced
            self._restore()
            raise
        if self._takes_up:
            self.came += _state.pending
        _state.listeners.append(self)
        _state.level = min(self._asked, self._level)
        if self._asked == Level.ANYWHERE and is_open:
            _state.level = Level.ANYWHERE
        return self.came

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._is_idle:
            return
        _state.level = Level.NOWHERE
        _state.listeners[:] = [one for one in _state.listeners if one is not self]
        if self._takes_up and self.came:
            _state.pending.clear()
            _state.is_over = True
        pending, handlers = list(_state.pending), dict(_state.handlers)
        self._restore()
        # Whoever raised something else has said enough.
        if kind is None and pending and not _state.handlers:
            handlers[pending[0][0]](*pending[0])
        elif kind is None and _state.level == Level.ANYWHERE:
            stop_point()

    def _restore(self) -> None:
        for number, handler in reversed(self._before.items()):
            signal.signal(number, handler)
        _state.handlers = self._handlers
        if not _state.handlers:  # nobody listens any more
            _state.is_over = False
            _state.pending.clear()
            _state.listeners.clear()
        _state.level = self._level


def held_back() -> _Block:
    """Hold them back to the end of this block."""
    return _Block(Level.NOWHERE)


def kept_back() -> _Block:
    """Suppress them in this block; each one, also one that still waits, is in the list that is yielded."""
    return _Block(Level.NOWHERE, takes_up=True)


def heard_at_stops() -> _Block:
    """Raise them at each `stop_point` of this block, and at its end."""
    return _Block(Level.AT_STOPS)


def heard_anywhere() -> _Block:
    """Raise the first of them wherever it comes in this block, unless they are held back around it.

    For long work whose results are lost anyway, and which takes no lock that others need.
    """
    return _Block(Level.ANYWHERE)


def sigterm_as_ctrl_c() -> _Block:
    """Raise KeyboardInterrupt on SIGTERM, as batch systems send it, if it would only end the process.

    Each one is recorded in the list that is yielded.
    """
    return _Block(Level.ANYWHERE, recorded=(signal.SIGTERM,), as_ctrl_c=(signal.SIGTERM,))


@contextmanager
def unheard_by_others() -> Iterator[None]:
    """Let threads and processes that begin in this block never hear Ctrl-C.

    A terminal sends it to all processes of a command, and this one tells the others to end.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    # Whoever starts this one unblocks the signal in its thread.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
