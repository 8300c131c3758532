"""Progress on a terminal: one bar per stage, with the picture's error; plain lines elsewhere.

A library would save some fifteen lines and cost 0.07 (rich) to 0.13 s (tqdm) of import time,
measured on a busy machine.
"""

from __future__ import annotations

import math
import threading
import time
from contextlib import suppress
from typing import TextIO

from hybrid_rt.rendering.summary import per_cent

# Often enough to look alive, seldom enough to cost nothing.
REDRAW_INTERVAL = 0.1
BAR_WIDTH = 30


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

    def note_error(self, error: float, trimmed: float, is_limit: bool) -> None:
        """Show this relative error of the picture from now on; see `Progress`."""
        if not math.isfinite(error):
            self._error = ", error unknown"
            return
        at_most = "at most " if is_limit else ""
        self._error = f", error {at_most}{per_cent(error)}"
        if per_cent(trimmed) != per_cent(error):
            self._error += f" ({per_cent(trimmed)} without the worst 0.1 % of pixels)"

    def note_out_of_reach(self, blur: float) -> None:
        """Show next to the error that the target cannot be reached."""
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
        """Keep the last line, and move the cursor below it."""
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
