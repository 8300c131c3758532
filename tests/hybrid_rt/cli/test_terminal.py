import io
import math
import time

import numba
import pytest

from hybrid_rt.cli import terminal as progress
from hybrid_rt.cli.terminal import TerminalProgress
from hybrid_rt.core import progress as core_progress
from hybrid_rt.core.progress import COMPILING, CompileWatch, watch_compilation


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_plain_lines_where_there_is_no_terminal():
    stream = io.StringIO()
    show = TerminalProgress(stream)
    for done in (0, 5, 10):
        show("Rendering", done, 10)
    show("Writing", 0, 0)
    show.close()
    assert stream.getvalue() == "Rendering ...\nWriting ...\n"


def test_nobody_need_listen():
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError(text)

    show = TerminalProgress(Closed())
    show("Rendering", 0, 10)
    show("Writing", 0, 0)
    show.close()


def test_bar_on_a_terminal_ends_full_and_on_a_line_of_its_own(monkeypatch):
    monkeypatch.setattr(progress, "REDRAW_INTERVAL", 0.0)
    stream = Terminal()
    show = TerminalProgress(stream)
    show("Rendering", 5, 10)
    show("Rendering", 10, 10)
    show.close()
    half, full = stream.getvalue().split("\r\x1b[K")[1:]
    assert half.startswith("Rendering [###############...............]  50 %")
    assert "left" in half
    assert full.startswith(f"Rendering [{'#' * 30}] 100 %")
    assert full.endswith("\n")


def test_error_is_shown_until_the_next_stage(monkeypatch):
    monkeypatch.setattr(progress, "REDRAW_INTERVAL", 0.0)
    stream = Terminal()
    show = TerminalProgress(stream)
    show("Rendering", 1, 10)
    show.note_error(0.0345, 0.0345, False)
    show("Rendering", 2, 10)
    show("Writing", 1, 10)
    lines = stream.getvalue().split("\r\x1b[K")[1:]
    assert ["error 3.5 %" in line for line in lines] == [False, True, False]


def test_target_out_of_reach_is_shown_with_its_reason(monkeypatch):
    monkeypatch.setattr(progress, "REDRAW_INTERVAL", 0.0)
    stream = Terminal()
    show = TerminalProgress(stream)
    show("Rendering", 1, 10)
    show.note_error(0.05, 0.05, False)
    show.note_out_of_reach(0.04)
    show("Rendering", 2, 10)
    last = stream.getvalue().split("\r\x1b[K")[-1]
    assert last.endswith("error 5 %: the blur alone has 4 %, the target is out of reach")


@pytest.mark.parametrize(
    ("noted", "words"),
    [
        ((0.9, 0.31, False), "error 90 % (31 % without the worst 0.1 % of pixels)"),
        ((0.05, 0.05, True), "error at most 5 %"),
        ((0.05, 0.04, True), "error at most 5 % (4 % without the worst 0.1 % of pixels)"),
        ((math.inf, math.inf, True), "error unknown"),
        ((math.nan, math.nan, False), "error unknown"),
    ],
)
def test_errors_are_shown_as_what_they_are(monkeypatch, noted, words):
    monkeypatch.setattr(progress, "REDRAW_INTERVAL", 0.0)
    stream = Terminal()
    show = TerminalProgress(stream)
    show("Rendering", 1, 10)
    show.note_error(*noted)
    show("Rendering", 2, 10)
    assert stream.getvalue().endswith(f"left, {words}")


def test_nested_compilations_count_once_and_long_ones_are_announced(monkeypatch):
    monkeypatch.setattr(core_progress, "ANNOUNCE_AFTER", 0.01)
    heard = []
    watch = CompileWatch(lambda *event: heard.append(event))
    began = time.perf_counter()
    watch.on_start(None)
    watch.on_start(None)
    time.sleep(0.1)
    watch.on_end(None)
    watch.on_end(None)
    # Counted twice, it would be more than all the time there was.
    assert 0.1 <= watch.seconds <= time.perf_counter() - began
    assert heard == [(COMPILING, 0, 0)]


def test_compilation_of_kernels_is_measured():
    with watch_compilation() as watch:
        assert watch.seconds == 0.0

        def half(x):
            return 0.5 * x

        assert numba.njit(half)(4.0) == 2.0
        seconds = watch.seconds
    if not numba.config.DISABLE_JIT:
        assert seconds > 0.0
