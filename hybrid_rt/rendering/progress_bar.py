"""Progress for people: a bar on a terminal or in a notebook, plain lines in a log.

A library would save some fifteen lines and cost 0.07 (rich) to 0.13 s (tqdm) of import time,
measured on a busy machine.
"""

from __future__ import annotations

import html
import importlib
import math
import os
import shutil
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TextIO

from hybrid_rt.core import checks
from hybrid_rt.rendering.units import per_cent

MODES = ("auto", "bar", "plain", "none")
# Often enough to look alive, seldom enough to cost nothing; a notebook sends each of them, seconds.
REDRAW_INTERVAL, NOTEBOOK_INTERVAL = 0.1, 0.25
# A log gets a line when the stage has gone on by a fifth of its time, within these limits, seconds.
SHARE_OF_TIME, LEAST_PAUSE, LONGEST_PAUSE = 0.2, 10.0, 600.0
# Letters; a bar shorter than the second tells less than words in its place.
BAR_WIDTH, LEAST_BAR = 30, 10


def progress_bar(mode: str = "auto", stream: TextIO | None = None) -> ProgressDisplay | None:
    """Return a display of a render's progress, for its argument ``progress``.

    Parameters
    ----------
    mode : {"auto", "bar", "plain", "none"}
        "bar": one line that is redrawn; in a notebook, one output. "plain": lines without control
        characters, for logs: one when a stage begins, the next after 10 s, then whenever the stage
        has taken a fifth longer, but at least every 10 minutes. "auto": a bar on terminals and in
        notebooks, plain lines elsewhere and if TERM is "dumb". "none": no display.
    stream : text file, optional
        Where to write, also from a notebook. Default: standard error.

    Returns
    -------
    ProgressDisplay or None
        None for the mode "none". `render` closes the display at its end; it may be used again.

    Raises
    ------
    ValueError
        If the mode is unknown.

    Examples
    --------
    >>> result = render(scene, progress=progress_bar())  # doctest: +SKIP
    """
    checks.choice(mode, "progress mode", MODES)
    if mode in {"auto", "bar"} and stream is None and in_notebook():
        return NotebookBar()
    stream = sys.stderr if stream is None else stream
    if mode == "none" or stream is None:
        return None
    is_terminal = stream.isatty() and os.environ.get("TERM") != "dumb"
    if mode == "bar" or (mode == "auto" and is_terminal):
        return TerminalBar(stream)
    return PlainLines(stream)


def in_notebook() -> bool:
    """Tell whether this process is a notebook's kernel; IPython is not imported for that."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


class ProgressDisplay:
    """What all displays share: the present stage, the error, and when to draw again."""

    interval = REDRAW_INTERVAL

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._lock = threading.RLock()
        self._stage = ""  # none yet
        # What was done already when the stage began, as in a render that goes on, is not its work.
        self._done = self._total = self._before = 0  # a total of 0: unknown
        self._began = self._seconds = self._drawn = 0.0
        self._is_behind = False
        self._error = self._short_error = ""

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Show the state of a stage; see `hybrid_rt.core.progress.Progress`."""
        with self._lock:
            now = self._clock()
            is_new = stage != self._stage
            was_full = not is_new and self._is_full
            if is_new:
                self._end_stage()
                self._stage, self._began, self._before = stage, now, done
                self._error = self._short_error = ""
            self._done, self._total, self._seconds = done, total, now - self._began
            self._is_behind = True
            is_end = self._is_full and not was_full
            if is_new or is_end or now - self._drawn >= self.interval:
                self._redraw(is_new)

    def note_error(self, error: float, trimmed: float, is_limit: bool) -> None:
        """Show this relative error of the picture from now on; see `Progress`."""
        with self._lock:
            self._is_behind = True
            if not math.isfinite(error):
                self._error = self._short_error = ", error unknown"
                return
            at_most = "at most " if is_limit else ""
            self._error = self._short_error = f", error {at_most}{per_cent(error)}"
            if per_cent(trimmed) != per_cent(error):
                self._error += f" ({per_cent(trimmed)} without the worst 0.1 % of pixels)"

    def note_out_of_reach(self, blur: float) -> None:
        """Show next to the error that the target cannot be reached."""
        with self._lock:
            self._error += f": the blur alone has {per_cent(blur)}, the target is out of reach"
            self._short_error += ", target out of reach"

    def close(self) -> None:
        """Show the last state, and leave it as it is."""
        with self._lock:
            self._end_stage()
            self._stage = ""

    @property
    def _is_full(self) -> bool:
        return 0 < self._total <= self._done

    def _words(self, error: str, percent: str = "d") -> str:
        """Return share done, seconds taken, seconds left, and an error, as far as they are known."""
        done, total = self._done, self._total
        if not total:
            return f"... {self._seconds:.0f} s" if self._seconds >= 1.0 else "..."
        text = f"{100 * done // total:{percent}} %  {self._seconds:.1f} s"
        now = done - self._before
        if now > 0 and 0 < done < total:
            text += f", {self._seconds * (total - done) / now:.0f} s left"
        return text + error

    def _redraw(self, is_new: bool) -> None:
        self._drawn, self._is_behind = self._clock(), False
        self._draw(is_new)

    def _draw(self, is_new: bool) -> None:
        raise NotImplementedError

    def _end_stage(self) -> None:
        """Draw what has not been drawn yet."""
        if self._stage and self._is_behind:
            self._redraw(False)


class StreamDisplay(ProgressDisplay):
    """A display that writes to a text file; write errors are ignored."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__(clock)
        self._stream = stream

    def say(self, text: str) -> None:
        """Write a line of its own."""
        with self._lock:
            self._write(f"{text}\n")

    def _write(self, text: str) -> None:
        with suppress(OSError):
            self._stream.write(text)
            self._stream.flush()


class TerminalBar(StreamDisplay):
    """A line that is redrawn by carriage returns and spaces alone, and never wider than the terminal."""

    _n_shown = 0

    def say(self, text: str) -> None:
        """Write a line above the bar."""
        with self._lock:
            n_shown, self._n_shown = self._n_shown, 0
            self._write("\r" + " " * n_shown + "\r" if n_shown else "")
            super().say(text)
            if n_shown and self._stage:
                self._redraw(False)

    def _draw(self, is_new: bool) -> None:
        del is_new
        # The last column stays free: some terminals go on to the next line with it.
        line = self._fitted(max(columns(self._stream) - 1, 1))
        self._write("\r" + line.ljust(self._n_shown))
        self._n_shown = len(line)

    def _fitted(self, width: int) -> str:
        """Return the line, with a shorter error, without its bar, or cut, as far as need be."""
        for error in (self._error, self._short_error) if self._total else ():
            words = self._words(error, "3d")
            room = min(width - len(f"{self._stage} [] {words}"), BAR_WIDTH)
            if room >= LEAST_BAR:
                filled = room * self._done // self._total
                return f"{self._stage} [{'#' * filled}{'.' * (room - filled)}] {words}"
        line = f"{self._stage} {self._words(self._short_error)}"
        return line if len(line) <= width else (line[: max(width - 3, 0)] + "...")[:width]

    def _end_stage(self) -> None:
        super()._end_stage()
        if self._n_shown:
            self._write("\n")
            self._n_shown = 0


class PlainLines(StreamDisplay):
    """Lines for a log: one as a stage begins, further ones at growing intervals."""

    interval = LEAST_PAUSE

    def _draw(self, is_new: bool) -> None:
        self.interval = min(max(SHARE_OF_TIME * self._seconds, LEAST_PAUSE), LONGEST_PAUSE)
        if is_new:
            self._write(f"{self._stage} ...\n")
        # The end of a short stage is no news: the next begins.
        elif self._seconds >= LEAST_PAUSE:
            self._write(f"{self._stage} {self._words(self._error)}\n")


class NotebookBar(ProgressDisplay):
    """One output of a notebook's cell, updated in place."""

    interval = NOTEBOOK_INTERVAL
    _handle: Any = None

    def close(self) -> None:
        """Leave the last state as it is; a next render has an output of its own."""
        with self._lock:
            super().close()
            self._handle = None

    def _draw(self, is_new: bool) -> None:
        del is_new
        shown = _Shown(f"{self._stage} {self._words(self._error)}", self._done, self._total)
        if self._handle is None:
            display = importlib.import_module("IPython.display").display
            self._handle = display(shown, display_id=True)
        else:
            self._handle.update(shown)


class _Shown:
    """A state as notebooks show it; colours are the page's."""

    def __init__(self, words: str, done: int, total: int) -> None:
        self._words, self._done, self._total = words, done, total

    def __repr__(self) -> str:
        return self._words

    def _repr_html_(self) -> str:
        style = "width:15em;max-width:40%;vertical-align:middle"
        bar = f'<progress value="{self._done}" max="{self._total}" style="{style}"></progress> '
        return f"<div>{bar if self._total else ''}{html.escape(self._words)}</div>"


def columns(stream: TextIO) -> int:
    """Return the width of a terminal: COLUMNS, or what the terminal says, or 80."""
    # shutil asks only the standard output, which may be a file while the bar is on a terminal.
    with suppress(OSError, ValueError, AttributeError):
        n = os.get_terminal_size(stream.fileno()).columns
        if n > 0 and not os.environ.get("COLUMNS"):
            return n
    return shutil.get_terminal_size().columns
