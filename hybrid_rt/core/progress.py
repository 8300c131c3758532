"""The protocol of progress, and the time that compilation takes."""

import logging
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO

from hybrid_rt.core.interrupts import held_back

# Shorter compilations are not worth a message; a long one says so often how far it is, seconds.
ANNOUNCE_AFTER, AGAIN_AFTER = 0.5, 0.5
# Where nobody has asked to hear of it, a terminal shows what takes longer than this; elsewhere only what
# takes long is said, and once for compilations that follow on each other within so many seconds.
SHOW_AFTER, WARN_AFTER, SAME_WITHIN = 1.0, 5.0, 10.0

COMPILING = "Preparing kernels (the first run compiles them)"

LOG = logging.getLogger(__name__)

Say = Callable[[str], None]
"""Callback that receives progress messages of a long study."""


class Progress(Protocol):
    """The callback for the progress of a render.

    Three more methods are optional. ``close()`` is called when the render ends, for whatever
    reason. ``note_error(error, trimmed, is_limit)`` is called with the estimated relative error of
    the picture, over all pixels and without the worst 0.1 %; ``is_limit`` says that the blur in
    them is an upper limit and not an estimate. ``note_out_of_reach(blur)`` is called with the blur
    if it keeps every target error out of reach, whatever the number of passes.
    """

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Hear that ``done`` of ``total`` parts of a stage are done; (0, 0): it has begun."""


class CompileWatch:
    """Measures the seconds during which at least one kernel is being compiled.

    ``progress``: called when compilation takes long, and while it does.
    ``is_logged``: whether that is logged as well, once, as information.
    ``announce_after``: seconds of compilation before the first message.
    """

    def __init__(
        self,
        progress: Progress | None,
        is_logged: bool = False,
        announce_after: float | None = None,
    ) -> None:
        self._after = ANNOUNCE_AFTER if announce_after is None else announce_after
        self._is_logged = is_logged
        self._progress = progress
        # Whoever hears of progress may compile something.
        self._lock = threading.RLock()
        self._depth = 0
        self._began = 0.0
        self._total = 0.0
        self._is_announced = False
        self._timer: threading.Timer | None = None

    @property
    def seconds(self) -> float:
        """Seconds so far, including a compilation in progress."""
        with self._lock:
            running = time.perf_counter() - self._began if self._depth else 0.0
            return self._total + running

    def on_start(self, _event: Any) -> None:
        """Handle numba's event that a compilation begins; those of called kernels are nested."""
        with self._lock:
            self._depth += 1
            if self._depth > 1:
                return
            self._began = time.perf_counter()
            # Counted over all kernels: many short compilations are a long one.
            self._announce_after(
                AGAIN_AFTER if self._is_announced else max(self._after - self._total, 0.0)
            )

    def on_end(self, _event: Any) -> None:
        """Handle numba's event that a compilation has ended."""
        with self._lock:
            self._depth -= 1
            if self._depth > 0:
                return
            self._total += time.perf_counter() - self._began
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def _announce_after(self, seconds: float) -> None:
        self._timer = threading.Timer(seconds, self._announce)
        self._timer.daemon = True
        with held_back():
            self._timer.start()

    def _announce(self) -> None:
        # Held while it is said: a next stage begins after this one's end only.
        with self._lock:
            if self._depth == 0:
                return
            is_new, self._is_announced = not self._is_announced, True
            if self._is_logged and is_new:
                self._log()
            if self._progress is not None:
                self._progress(COMPILING, 0, 0)
                self._announce_after(AGAIN_AFTER)

    def _log(self) -> None:
        LOG.info("%s ...", COMPILING)


class _WatchOutside(CompileWatch):
    """Tells of kernels that compile for long while nobody else does: a terminal, or else the log."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._terminal = stream if stream is not None and stream.isatty() else None
        if self._terminal is None:
            super().__init__(None, is_logged=True, announce_after=WARN_AFTER)
        else:
            super().__init__(self._show, announce_after=SHOW_AFTER)
        self._ended, self._shown = 0.0, ""

    def on_start(self, event: Any) -> None:
        """Handle numba's event that a compilation begins."""
        with self._lock:
            if self._depth == 0 and time.perf_counter() - self._ended > SAME_WITHIN:
                self._is_announced, self._total = False, 0.0
            super().on_start(event)

    def on_end(self, event: Any) -> None:
        """Handle numba's event that a compilation has ended."""
        with self._lock:
            super().on_end(event)
            self._ended = time.perf_counter()
            if self._depth == 0:
                self._write("")

    def _show(self, stage: str, done: int, total: int) -> None:
        del done, total
        if not _is_watching:
            self._write(f"{stage} ... {self.seconds:.0f} s")

    def _write(self, line: str) -> None:
        """Replace the line in the terminal."""
        if self._terminal is not None and (line or self._shown):
            with suppress(OSError, ValueError):  # it is gone
                self._terminal.write("\r" + " " * len(self._shown) + "\r" + line)
                self._terminal.flush()
            self._shown = line

    def _log(self) -> None:
        if not _is_watching:
            LOG.warning("%s: this may take minutes ...", COMPILING)


_is_watching = False
_outside: _WatchOutside | None = None


def warn_of_compilation() -> None:
    """From now on tell of long compilations that no `watch_compilation` tells of."""
    from numba.core import event

    global _outside  # noqa: PLW0603
    if _outside is None:
        _outside = _WatchOutside(sys.stderr)
        register: Any = event.register
        register("numba:compile", _listener(_outside))


def _listener(watch: CompileWatch) -> Any:
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            watch.on_start(event)

        def on_end(self, event: Any) -> None:
            watch.on_end(event)

    return Listener()


@contextmanager
def watch_compilation(
    progress: Progress | None = None, tells: bool = True
) -> Iterator[CompileWatch]:
    """Measure the compilation time within this block, and announce it if it is long.

    Kernels loaded from the cache do not count. Of blocks within each other only the outermost logs.

    ``tells``: False: nobody hears of it by way of this block, so that `warn_of_compilation` does
    what it does outside.
    """
    from numba.core import event

    global _is_watching  # noqa: PLW0603
    before = _is_watching
    watch = CompileWatch(progress, tells and not before)

    _is_watching = before or tells
    try:
        with event.install_listener("numba:compile", _listener(watch)):
            yield watch
    finally:
        _is_watching = before
