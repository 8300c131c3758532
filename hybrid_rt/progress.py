"""What the user sees while a picture is made, and the time that compilation takes."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO

from hybrid_rt.numbers import per_cent

# Shorter compilations are not worth a message.
ANNOUNCE_AFTER = 0.5
# Often enough to look alive, seldom enough to cost nothing.
REDRAW_INTERVAL = 0.1
BAR_WIDTH = 30
COMPILING = "Compiling kernels (first run only)"

Say = Callable[[str], None]
"""Hears in words what a long study is doing."""


class Progress(Protocol):
    """Whoever wants to know how a render is getting on.

    If it also has a method ``note_error``, that hears the picture's estimated relative error from
    time to time; one called ``note_out_of_reach`` hears the blur that keeps a target error out of
    reach, however many passes there are.
    """

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Hear that ``done`` of ``total`` parts of a stage are done; (0, 0): it has begun."""


class TerminalProgress:
    """A bar on a terminal; plain lines, one per stage, anywhere else.

    Parameters
    ----------
    stream : text file
        Usually ``sys.stderr``, so that output stays clean.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._is_terminal = stream.isatty()
        self._lock = threading.Lock()
        self._stage = ""
        self._began = 0.0
        self._drawn = -1.0
        self._is_open = False
        self._error = ""

    def note_error(self, error: float) -> None:
        """Show from now on that the picture has this relative error."""
        self._error = f", error {per_cent(error)}"

    def note_out_of_reach(self, blur: float) -> None:
        """Show beside the error that its target cannot be reached."""
        self._error += f": the blur alone has {per_cent(blur)}, the target is out of reach"

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Draw the state of a stage."""
        with self._lock:
            now = time.perf_counter()
            if stage != self._stage:
                self._finish_line()
                self._stage, self._began, self._drawn = stage, now, -1.0
                self._error = ""
                if not self._is_terminal:
                    self._write(f"{stage} ...\n")
            is_end = 0 < total <= done
            if self._is_terminal and (is_end or now - self._drawn >= REDRAW_INTERVAL):
                self._drawn = now
                self._draw(done, total, now - self._began)

    def close(self) -> None:
        """Leave the last line as it is and the cursor below it."""
        with self._lock:
            self._finish_line()
            self._stage = ""

    def _draw(self, done: int, total: int, seconds: float) -> None:
        line = f"{self._stage} ..."
        if total > 0:
            filled = BAR_WIDTH * done // total
            bar = "#" * filled + "." * (BAR_WIDTH - filled)
            line = f"{self._stage} [{bar}] {100 * done // total:3d} %  {seconds:.1f} s"
            if 0 < done < total:
                line += f", {seconds * (total - done) / done:.0f} s left"
            line += self._error
        self._write(f"\r\x1b[K{line}")
        self._is_open = True

    def _finish_line(self) -> None:
        if self._is_open:
            self._write("\n")
            self._is_open = False

    def _write(self, text: str) -> None:
        # Nobody may be listening any more: no reason to end what is shown.
        with suppress(OSError):
            self._stream.write(text)
            self._stream.flush()


class CompileWatch:
    """Counts the seconds during which at least one kernel was being compiled.

    Parameters
    ----------
    progress : Progress or None
        Hears of it when it takes long.
    """

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._lock = threading.Lock()
        self._depth = 0
        self._began = 0.0
        self._total = 0.0
        self._is_announced = False
        self._timer: threading.Timer | None = None

    @property
    def seconds(self) -> float:
        """Seconds so far, a compilation that is still going on included."""
        with self._lock:
            running = time.perf_counter() - self._began if self._depth else 0.0
            return self._total + running

    def on_start(self, _event: Any) -> None:
        """Hear from numba that a compilation begins; those of called kernels are nested."""
        with self._lock:
            self._depth += 1
            if self._depth > 1:
                return
            self._began = time.perf_counter()
            if self._progress is not None and not self._is_announced:
                # Counted over all kernels: many short compilations are a long one.
                self._timer = threading.Timer(
                    max(ANNOUNCE_AFTER - self._total, 0.0), self._announce
                )
                self._timer.daemon = True
                self._timer.start()

    def on_end(self, _event: Any) -> None:
        """Hear from numba that a compilation has ended."""
        with self._lock:
            self._depth -= 1
            if self._depth > 0:
                return
            self._total += time.perf_counter() - self._began
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def _announce(self) -> None:
        with self._lock:
            if self._depth == 0 or self._is_announced:
                return
            self._is_announced = True
        assert self._progress is not None
        self._progress(COMPILING, 0, 0)


@contextmanager
def watch_compilation(progress: Progress | None = None) -> Iterator[CompileWatch]:
    """Measure, and announce when it is long, what numba compiles within this block.

    Kernels that come from the cache are not compiled and cost nothing here.
    """
    from numba.core import event

    watch = CompileWatch(progress)

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            watch.on_start(event)

        def on_end(self, event: Any) -> None:
            watch.on_end(event)

    with event.install_listener("numba:compile", Listener()):
        yield watch
