"""Progress on a terminal, in a log and in a notebook."""

import io
import itertools
import math
import sys
import time
import types

import numba
import pytest

import hybrid_rt as rt
from hybrid_rt.core import progress as core_progress
from hybrid_rt.core.progress import COMPILING, CompileWatch, watch_compilation
from hybrid_rt.rendering import progress_bar as bars
from hybrid_rt.rendering.progress_bar import NotebookBar, PlainLines, TerminalBar, progress_bar

FULL = "#" * 30


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    """A clock that stands still unless it is set."""

    def __init__(self):
        self.seconds = 100.0

    def __call__(self):
        return self.seconds


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture(autouse=True)
def wide(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delitem(sys.modules, "IPython", raising=False)


@pytest.fixture
def often(monkeypatch):
    monkeypatch.setattr(TerminalBar, "interval", 0.0)


def drawn(stream):
    return stream.getvalue().split("\r")[1:]


class TestTerminal:
    @pytest.mark.usefixtures("often")
    def test_bar_ends_full_and_on_a_line_of_its_own(self):
        stream = Terminal()
        show = TerminalBar(stream)
        show("Rendering", 0, 10)
        show("Rendering", 5, 10)
        show("Rendering", 10, 10)
        show.close()
        _, half, full = drawn(stream)
        assert half.startswith("Rendering [###############...............]  50 %")
        assert "left" in half
        assert full.startswith(f"Rendering [{FULL}] 100 %")
        assert full.endswith("\n")
        assert full.rstrip().endswith("s")

    @pytest.mark.usefixtures("often")
    @pytest.mark.parametrize(
        ("noted", "words"),
        [
            ((0.9, 0.31, False), "error 90 % (31 % without the worst 0.1 % of pixels)"),
            ((0.05, 0.05, True), "error at most 5 %"),
            ((0.05, 0.04, True), "error at most 5 % (4 % without the worst 0.1 % of pixels)"),
            ((math.inf, math.inf, True), "error unknown"),
            ((math.nan, math.nan, False), "error unknown"),
            # With a fourth figure, the blur that keeps the target out of reach.
            (
                (0.05, 0.05, False, 0.04),
                "error 5 %: the blur alone has 4 %, the target is out of reach",
            ),
        ],
    )
    def test_errors_are_shown_as_what_they_are(self, noted, words):
        stream = Terminal()
        show = TerminalBar(stream)
        show("Rendering", 1, 10)
        show.note_error(*noted[:3])
        for blur in noted[3:]:
            show.note_out_of_reach(blur)
        show("Rendering", 2, 10)
        assert stream.getvalue().endswith(f"left, {words}")

    @pytest.mark.usefixtures("often")
    @pytest.mark.parametrize("width", [1, 5, 20, 60, 79, 131, 132])
    def test_the_line_fits_any_terminal(self, monkeypatch, width):
        monkeypatch.setenv("COLUMNS", str(width))
        stream = Terminal()
        show = TerminalBar(stream)
        for stage, total in (("Building", 0), ("Rendering", 1000), ("Rendering", 1000)):
            show(stage, 1, total)
            show.note_error(0.9, 0.31, True)
            show.note_out_of_reach(0.4)
        lines = [line for part in drawn(stream) for line in part.split("\n")]
        assert max(map(len, lines)) <= max(width - 1, 1)
        if width >= 60:
            assert "0 %" in lines[-1]
            assert "error at most 90 %" in lines[-1]
        if width >= 79:
            assert "target out of reach" in lines[-1] or "target is out of reach" in lines[-1]
        if width >= 132:
            assert "." * LEAST in lines[-1]

    def test_messages_come_above_the_bar(self):
        stream = Terminal()
        show = TerminalBar(stream)
        show("Rendering", 5, 10)
        bar = stream.getvalue().removeprefix("\r")
        show.say("hybrid-rt: warning: so")
        show.close()
        expected = f"\r{bar}\r{' ' * len(bar)}\rhybrid-rt: warning: so\n\r{bar}\n"
        assert stream.getvalue() == expected
        show.say("later")
        assert stream.getvalue() == f"{expected}later\n"


LEAST = bars.LEAST_BAR


class TestPlain:
    def test_a_line_per_stage_where_there_is_no_terminal(self):
        stream = io.StringIO()
        show = progress_bar(stream=stream)
        for done in (0, 5, 10):
            show("Rendering", done, 10)
        show("Writing", 0, 0)
        show.close()
        assert stream.getvalue() == "Rendering ...\nWriting ...\n"

    def test_lines_come_at_sensible_intervals(self, clock):
        """A day of passes, one a second: after 10 s, then a fifth later, at last every 10 minutes."""
        stream = io.StringIO()
        show, day = PlainLines(stream, clock), 86_400
        times = []
        for second in range(day + 1):
            clock.seconds = 100.0 + second
            before = stream.tell()
            show("Rendering", second, day)
            if stream.tell() > before:
                times.append(second)
        show.close()
        lines = stream.getvalue().splitlines()
        assert lines[1] == "Rendering 0 %  10.0 s, 86390 s left"
        assert lines[-1] == "Rendering 100 %  86400.0 s"
        pauses = [b - a for a, b in itertools.pairwise(times)]
        assert pauses[:5] == [10] * 5
        assert max(pauses) == 600
        assert pauses[:-1] == sorted(pauses[:-1])
        assert len(lines) < 180
        assert all(line.isprintable() for line in lines)

    def test_seconds_left_are_told_by_what_was_done_since_the_stage_began(self, clock):
        """As in a render that goes on from 90 passes of 100: another five take half of its time."""
        stream = io.StringIO()
        show = PlainLines(stream, clock)
        for done in (90, 95):
            show("Rendering", done, 100)
            clock.seconds += 20.0
        show("Rendering", 95, 100)
        assert stream.getvalue().splitlines()[-1] == "Rendering 95 %  40.0 s, 40 s left"

    def test_of_what_has_no_known_end_the_seconds_are_told(self, clock):
        stream = io.StringIO()
        for show in (PlainLines(stream, clock), TerminalBar(stream, clock)):
            for _ in range(2):
                show(COMPILING, 0, 0)
                clock.seconds += 20.0
        plain, bar = stream.getvalue().rstrip().rsplit("\n", 1)
        assert plain == f"{COMPILING} ...\n{COMPILING} ... 20 s"
        assert bar == f"\r{COMPILING} ...\r{COMPILING} ... 20 s"


@pytest.mark.parametrize("kind", [PlainLines, TerminalBar])
def test_nobody_need_listen(kind):
    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError(text)

    show = kind(Closed())
    show("Rendering", 0, 10)
    show("Writing", 0, 0)
    show.say("so")
    show.close()


class TestChoice:
    @pytest.mark.parametrize(
        ("mode", "stream", "term", "expected"),
        [
            ("auto", Terminal(), "xterm", TerminalBar),
            ("auto", Terminal(), "dumb", PlainLines),
            ("auto", Terminal(), None, TerminalBar),
            ("auto", io.StringIO(), "xterm", PlainLines),
            ("bar", io.StringIO(), "dumb", TerminalBar),
            ("plain", Terminal(), "xterm", PlainLines),
            ("none", Terminal(), "xterm", type(None)),
        ],
    )
    def test_of_terminals(self, monkeypatch, mode, stream, term, expected):
        monkeypatch.setenv("TERM", term or "")
        if term is None:
            monkeypatch.delenv("TERM")
        assert type(progress_bar(mode, stream)) is expected

    def test_other_modes_are_refused(self):
        with pytest.raises(ValueError, match="progress mode is 'loud': pass one of auto, bar"):
            progress_bar("loud")

    def test_without_a_standard_error_there_is_none(self, monkeypatch):
        monkeypatch.setattr(sys, "stderr", None)
        assert progress_bar("bar") is None

    @pytest.mark.parametrize(("kernel", "expected"), [(object(), NotebookBar), (None, PlainLines)])
    def test_of_notebooks(self, monkeypatch, kernel, expected):
        """A kernel is known by IPython's shell; IPython on a terminal has none."""
        shell = types.SimpleNamespace(kernel=kernel) if kernel else types.SimpleNamespace()
        ipython = types.SimpleNamespace(get_ipython=lambda: shell)
        monkeypatch.setitem(sys.modules, "IPython", ipython)
        monkeypatch.setattr(sys, "stderr", io.StringIO())
        assert type(progress_bar("auto")) is expected
        assert type(progress_bar("plain")) is PlainLines


class Handle:
    def __init__(self, first):
        self.shown = [first]

    def update(self, thing):
        self.shown.append(thing)


class TestNotebook:
    @pytest.fixture
    def handles(self, monkeypatch):
        made = []

        def display(thing, display_id):
            assert display_id is True
            made.append(Handle(thing))
            return made[-1]

        module = types.SimpleNamespace(display=display)
        monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(display=module))
        monkeypatch.setitem(sys.modules, "IPython.display", module)
        return made

    def test_one_output_is_updated_through_all_stages(self, handles, clock):
        show = NotebookBar(clock)
        show("Building", 0, 0)
        for done in range(1001):  # 10 s
            show("Rendering", done, 1000)
            clock.seconds += 0.01
        show.note_error(0.05, 0.05, False)
        show.close()
        (handle,) = handles
        assert repr(handle.shown[0]) == "Building ..."
        # Not a flood: four a second, and one at the end.
        assert 30 < len(handle.shown) < 45
        assert repr(handle.shown[-1]) == "Rendering 100 %  10.0 s, error 5 %"
        page = handle.shown[-1]._repr_html_()
        assert '<progress value="1000" max="1000"' in page
        show("Rendering", 0, 10)
        assert len(handles) == 2  # the next render has a bar of its own

    def test_names_of_stages_are_text(self, handles):
        NotebookBar()("<b>", 0, 0)
        assert handles[0].shown[0]._repr_html_() == "<div>&lt;b&gt; ...</div>"


class TestRender:
    CAMERA = rt.Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=4, height=3)
    SCENE = rt.Scene(CAMERA, [rt.Object(rt.Sphere((0, 0, 0), 1), rt.Mirror())])

    def test_a_render_that_fails_closes_its_progress(self):
        closed = []

        class Refusing:
            def __call__(self, *_):
                raise RuntimeError("no")

            def close(self):
                closed.append(True)

        with pytest.raises(RuntimeError, match="no"):
            rt.render(self.SCENE, passes=1, threads=1, progress=Refusing())
        assert closed == [True]

    def test_warnings_of_the_report_are_logged(self, caplog):
        """A lamp of 1e30 at a distance of 1e-6 sends 1e42: more than float32 holds."""
        camera = rt.Camera((0, 0, 5e-6), (0, 0, 0), (0, 1, 0), width=4, height=3)
        floor = rt.Object(rt.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), rt.Lambertian(0.5))
        lamp = rt.PointLight((0, 0, 1e-6), 1e30)
        rt.render(rt.Scene(camera, [floor]), passes=1, threads=1)
        assert not caplog.records
        rt.render(rt.Scene(camera, [floor], [lamp]), passes=1, threads=1)
        (record,) = caplog.records
        assert (record.name, record.levelname) == ("hybrid_rt.report", "WARNING")
        assert record.getMessage().startswith("12 pixels are not finite")


def test_nested_compilations_count_once_and_long_ones_are_announced(monkeypatch, caplog):
    monkeypatch.setattr(core_progress, "ANNOUNCE_AFTER", 0.01)
    caplog.set_level("INFO")
    heard = []
    watch = CompileWatch(lambda *event: heard.append(event), is_logged=True)
    began = time.perf_counter()
    watch.on_start(None)
    watch.on_start(None)
    time.sleep(0.1)
    watch.on_end(None)
    watch.on_end(None)
    # Counted twice, it would be more than all the time there was.
    assert 0.1 <= watch.seconds <= time.perf_counter() - began
    assert heard == [(COMPILING, 0, 0)]
    assert [(r.levelname, r.getMessage()) for r in caplog.records] == [("INFO", f"{COMPILING} ...")]


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_terminal_shows_what_compiles_for_long_and_clears_it(monkeypatch, caplog):
    """As for an `Intersector`, which has no callback for progress."""
    monkeypatch.setattr(core_progress, "SHOW_AFTER", 0.01)
    stream = Terminal()
    watch = core_progress._WatchOutside(stream)
    with watch_compilation():  # a command tells of it itself
        compile_for(0.1, watch)
    assert stream.getvalue() == ""
    compile_for(0.1, core_progress._WatchOutside(stream))
    line = f"{COMPILING} ... 0 s"
    assert stream.getvalue() == f"\r\r{line}\r{' ' * len(line)}\r"
    assert not caplog.records


def test_what_compiles_for_long_is_said_once_where_nobody_tells_of_it(monkeypatch, caplog):
    monkeypatch.setattr(core_progress, "WARN_AFTER", 0.01)
    watch = core_progress._WatchOutside()
    for _ in range(2):
        with watch_compilation():  # a command tells of it itself
            compile_for(0.1, watch)
    assert not caplog.records
    watch = core_progress._WatchOutside()
    for _ in range(2):
        with watch_compilation(tells=False):  # a render without progress
            compile_for(0.1, watch)
    (record,) = caplog.records
    assert (record.levelname, record.getMessage()) == (
        "WARNING",
        f"{COMPILING}: this may take minutes ...",
    )


def compile_for(seconds, watch):
    watch.on_start(None)
    time.sleep(seconds)
    watch.on_end(None)


def test_compilation_of_kernels_is_measured():
    with watch_compilation() as watch:
        assert watch.seconds == 0.0

        def half(x):
            return 0.5 * x

        assert numba.njit(half)(4.0) == 2.0
        seconds = watch.seconds
    if not numba.config.DISABLE_JIT:
        assert seconds > 0.0
