"""Ctrl-C loses no pass that is complete, and leaves no sum half made."""

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import traceback

import imageio.v3 as imageio
import numpy as np
import pytest
from ball_script import SCRIPT

from hybrid_rt.cli import main
from hybrid_rt.cli import render as cli_render
from hybrid_rt.core.interrupts import (
    heard_anywhere,
    heard_at_stops,
    held_back,
    kept_back,
    sigterm_as_ctrl_c,
    stop_point,
    unheard_by_others,
)
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions, workers
from hybrid_rt.integrators.path.path_tracer import PathTracer
from hybrid_rt.integrators.photons.photon_workers import PhotonWorkers
from hybrid_rt.integrators.workers import Workers
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Lambertian
from hybrid_rt.primitives import Plane, Sphere
from hybrid_rt.rendering import renderer as rendering
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.result import RenderInterrupted
from hybrid_rt.rendering.units import passes_in_words
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera


@pytest.fixture(autouse=True)
def heard():
    """Ctrl-C is heard, also where these tests run in the background of a shell."""
    as_before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, as_before)


def send(number):
    """Send this process a signal, and leave Python time to hear it."""
    os.kill(os.getpid(), number)
    time.sleep(0.01)


def ball():
    camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=24, height=16)
    objects = [
        Object(Sphere((0, 0, 0), 1), Lambertian(0.5)),
        Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5)),
    ]
    lamp = RectangleLight((-1, -1, 4), (0, 1, 0), (1, 0, 0), 20.0)
    return Scene(camera, objects, [lamp])


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    ("integrator", "options"), [("path", None), ("ppm", PPMOptions(2000, initial_radius=0.3))]
)
def test_complete_passes_come_with_the_interrupt(integrator, options, threads):
    """They are the very picture of so many passes, with its noise and blur."""

    def stop_in_the_ninth(stage, done, total):
        del total
        if stage == "Rendering" and done > 8 * 24 * 16:
            raise KeyboardInterrupt

    settings = {"options": options, "outputs": ["samples"], "threads": threads}
    with pytest.raises(RenderInterrupted, match="after 8 passes") as caught:
        render(ball(), integrator, target_error=1e-9, progress=stop_in_the_ninth, **settings)
    found, whole = caught.value.result, render(ball(), integrator, 8, **settings)
    np.testing.assert_array_equal(found.image, whole.image)
    assert (found.channels["samples"] == 8).all()
    assert found.report["stopped_by"] == "interrupted"
    for name in ("passes", "noise", "relative_error"):
        assert found.report[name] == whole.report[name]


STEPS_AT_THE_END = [(Workers, "gather"), (rendering, "compute_channels"), (PhotonWorkers, "blur")]


@pytest.mark.parametrize(("place", "step"), STEPS_AT_THE_END)
@pytest.mark.parametrize("passes", [2, None])
def test_ctrl_c_at_the_end_loses_nothing(monkeypatch, place, step, passes):
    """Once after all passes, or a second time after the first one has ended them."""
    whole = getattr(place, step)

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        return whole(*arguments)

    def stop_in_the_third(stage, done, total):
        del total
        if passes is None and stage == "Rendering" and done > 2 * 24 * 16:
            raise KeyboardInterrupt

    monkeypatch.setattr(place, step, interrupted)
    settings = {"options": PPMOptions(2000, initial_radius=0.3), "outputs": ["depth"]}
    with pytest.raises(KeyboardInterrupt) as caught:
        render(ball(), "ppm", passes, target_error=1e-9, progress=stop_in_the_third, **settings)
    assert isinstance(caught.value, RenderInterrupted)
    assert str(caught.value) == "interrupted after 2 passes"
    monkeypatch.undo()
    found, expected = caught.value.result, render(ball(), "ppm", 2, **settings)
    np.testing.assert_array_equal(found.image, expected.image)
    np.testing.assert_array_equal(found.channels["depth"], expected.channels["depth"])
    assert found.report["relative_error"] == expected.report["relative_error"]
    assert found.report["stopped_by"] == ("interrupted" if passes is None else "passes")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("passes", [4, None])
def test_ctrl_c_while_what_is_around_a_render_closes_loses_nothing(passes):
    """A cluster, say, which takes seconds; here the display of the progress."""

    class Display:
        def __call__(self, stage, done, _total):
            if passes is None and stage == "Rendering" and done > 4 * 24 * 16:
                raise KeyboardInterrupt

        def close(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    with pytest.raises(KeyboardInterrupt, match="after 4 passes") as caught:
        render(ball(), "path", passes, target_error=1e-9, progress=Display())
    np.testing.assert_array_equal(caught.value.result.image, render(ball(), passes=4).image)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_no_thread_works_on_when_the_interrupt_is_heard(monkeypatch):
    """A second Ctrl-C while threads end their blocks: their counters are read afterwards."""
    at_work, main = [], threading.main_thread().ident

    def slow(self, passes, first, stop):
        at_work.append(first)
        if first == 0:
            for _ in range(2):
                time.sleep(0.1)
                signal.pthread_kill(main, signal.SIGINT)
        time.sleep(0.2)
        at_work.remove(first)
        return trace(self, passes, first, stop)

    trace = PathTracer.trace
    monkeypatch.setattr(PathTracer, "trace", slow)
    scene = ball()
    scene = scene.with_camera(scene.camera.resized(64, 48))  # three blocks
    with pytest.raises(KeyboardInterrupt):
        render(scene, passes=1, threads=2)
    assert not at_work


def test_an_interrupt_comes_out_of_other_processes():
    made = RenderInterrupted(render(ball(), passes=1))
    other = pickle.loads(pickle.dumps(made))
    assert str(other) == "interrupted after 1 pass"
    np.testing.assert_array_equal(other.result.image, made.result.image)


def test_without_a_complete_pass_nothing_comes():
    def stop(*_event):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        render(ball(), progress=stop)
    assert not isinstance(caught.value, RenderInterrupted)


@pytest.mark.parametrize(("number", "exit_code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ctrl_c_in_a_terminal_writes_the_picture_of_the_passes_done(tmp_path, number, exit_code):
    (tmp_path / "ball.py").write_text(SCRIPT)
    code = """import sys
from hybrid_rt.cli import main
main(["render", "ball.py", "--passes", "4", "--quiet"])  # compiles
sys.exit(main(sys.argv[1:]))"""
    words = ["render", "ball.py", "--time-budget", "100", "--threads", "1", "--out", "ä b.png"]
    with subprocess.Popen(
        [sys.executable, "-c", code, *words],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
        env={**os.environ, "PYTHONUTF8": "1"},
    ) as command:  # fmt: skip
        heard = []
        while "Rendering ...\n" not in heard:
            heard.append(command.stderr.readline())
            assert heard[-1], heard
        time.sleep(0.5)  # the first pass takes a fiftieth of that
        command.send_signal(number)
        out, error = command.communicate(timeout=60)
    assert command.returncode == exit_code
    assert "\nä b.png  (" in out
    assert "stopped   by Ctrl-C, after" in out
    assert imageio.imread(tmp_path / "ä b.png").shape == (48, 64, 3)
    report = json.loads((tmp_path / "ä b.json").read_text("utf-8"))
    assert report["stopped_by"] == "interrupted"
    passes = passes_in_words(report["passes"])
    assert error.endswith(f"\nhybrid-rt: interrupted after {passes}\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_held_back_until_the_block_is_done(number):
    done = []

    def block():
        with sigterm_as_ctrl_c():
            with held_back():
                os.kill(os.getpid(), number)
                time.sleep(0.01)
                done.append(1)
            done.append(2)

    with pytest.raises(KeyboardInterrupt):
        block()
    assert done == [1]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_sigterm_that_is_kept_back_is_told_to_who_waits_for_one():
    """Or a render that hears it at its end would exit with the code of Ctrl-C."""
    with sigterm_as_ctrl_c() as terminations:
        with kept_back() as came:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)
        assert [number for number, _ in came] == [signal.SIGINT, signal.SIGTERM]
        assert [number for number, _ in terminations] == [signal.SIGTERM]


def test_processes_that_begin_where_others_do_not_hear_ctrl_c():
    code = "import signal; print(signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, ()))"
    with unheard_by_others():
        said = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert said == "True\n"
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_other_threads_and_other_programs_handlers_are_left_alone():
    seen = []

    def note():
        with held_back():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=note)
    thread.start()
    thread.join()
    as_before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        note()
    finally:
        signal.signal(signal.SIGINT, as_before)
    assert seen == [signal.default_int_handler, signal.SIG_IGN]


def test_a_second_interrupt_does_not_disturb_what_ends_after_the_first():
    """Each line after the first signal would be left out if the next one were raised there."""
    done = []
    with sigterm_as_ctrl_c() as terminations, contextlib.suppress(KeyboardInterrupt):
        try:
            send(signal.SIGINT)
            done.append("not interrupted")
        finally:
            send(signal.SIGTERM)
            with held_back():
                send(signal.SIGINT)
                done.append("cleaned up")
            done.append("to the end")
    assert done == ["cleaned up", "to the end"]
    assert terminations == [(signal.SIGTERM, None)]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(KeyboardInterrupt):  # and the next one is heard again
        send(signal.SIGINT)


def test_between_stops_nothing_is_raised():
    done = []

    def at_stops():
        with heard_at_stops():
            send(signal.SIGINT)
            done.append("before the stop")
            stop_point()
            done.append("after it")

    with pytest.raises(KeyboardInterrupt):
        at_stops()
    assert done == ["before the stop"]

    def anywhere():
        with heard_at_stops(), heard_anywhere():
            send(signal.SIGINT)
            done.append("not where it may be raised")

    with pytest.raises(KeyboardInterrupt):
        anywhere()
    with kept_back() as came:
        with heard_anywhere():  # it is kept back around it
            send(signal.SIGINT)
            stop_point()
        done.append("kept back")
    assert done == ["before the stop", "kept back"]
    assert came == [(signal.SIGINT, None)]


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("integrator", ["whitted", "path", "ppm", "photon_map"])
def test_a_burst_of_signals_loses_no_pass(integrator, threads, monkeypatch):
    """Raised in no lock and in no other place that leaves something half done: at stops alone."""
    monkeypatch.setattr(workers, "TOGETHER", 1)
    scene, raised = ball().with_camera(ball().camera.resized(64, 48)), []
    options = {
        "ppm": PPMOptions(500, initial_radius=0.3),
        "photon_map": PhotonMapOptions(photons_per_pass=500, nearest=20),
    }
    settings = {"options": options.get(integrator), "threads": threads}
    trace, main = Workers.render_passes, threading.main_thread().ident

    def burst():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT, signal.SIGINT, signal.SIGTERM):
            signal.pthread_kill(main, number)
            time.sleep(0.002)

    def noted(self, passes, on_rays=None):
        if passes.start == 2:
            sender.start()
        try:
            yield from trace(self, passes, on_rays)
        except KeyboardInterrupt as interrupt:
            raised.extend(frame.name for frame in traceback.extract_tb(interrupt.__traceback__))
            raise

    sender = threading.Thread(target=burst)
    monkeypatch.setattr(Workers, "render_passes", noted)
    with sigterm_as_ctrl_c():
        with pytest.raises(RenderInterrupted) as caught:
            render(scene, integrator, target_error=1e-9, **settings)
        sender.join()
    monkeypatch.undo()
    found = caught.value.result
    whole = render(scene, integrator, found.report["passes"], **settings)
    np.testing.assert_array_equal(found.image, whole.image)
    assert not raised or threads == 1 or raised[-2:] == ["stop_point", "_deliver"]
    assert [one for one in threading.enumerate() if one.name.startswith("hybrid_rt_")] == []


def test_a_pool_writes_no_more_when_the_interrupt_is_heard():
    """Its arrays are somebody else's by then; slices that have not begun are left out."""
    begun, ended, main = [], [], threading.main_thread().ident

    def work(begin, _end):
        begun.append(begin)
        for _ in range(3):
            signal.pthread_kill(main, signal.SIGINT)
            time.sleep(0.03)
        ended.append(begin)

    with sigterm_as_ctrl_c(), pytest.raises(KeyboardInterrupt) as caught:
        Pool(2).run(work, 8 * 256, 256)
    assert len(begun) == len(ended) < 8
    assert [frame.name for frame in traceback.extract_tb(caught.tb)][-2:] == [
        "stop_point",
        "_deliver",
    ]


@pytest.mark.parametrize("place", ["rendered", "_saved"])
def test_ctrl_c_between_a_render_and_its_files_loses_no_picture(place, tmp_path, monkeypatch):
    step = getattr(cli_render, place)

    def interrupted(*arguments, **settings):
        made = step(*arguments, **settings)
        send(signal.SIGINT)
        return made

    monkeypatch.setattr(cli_render, place, interrupted)
    (tmp_path / "ball.py").write_text(SCRIPT)
    words = ["--passes", "1", "--threads", "1", "--quiet", "--out", str(tmp_path / "a.npz")]
    assert main(["render", str(tmp_path / "ball.py"), *words]) == 130
    assert np.load(tmp_path / "a.npz")["image"].shape == (48, 64, 3)


def test_a_render_in_another_thread_is_not_interrupted():
    """As notebooks have it: the main thread's Ctrl-C is the main thread's."""
    made = []
    thread = threading.Thread(target=lambda: made.append(render(ball(), passes=3, threads=2)))
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        send(signal.SIGINT)
    thread.join()
    assert made[0].report["stopped_by"] == "passes"
