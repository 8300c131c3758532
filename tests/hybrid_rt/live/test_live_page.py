"""A page beside a render: what it may cost, say and stop."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from importlib.resources import files
from urllib.parse import urlsplit

import imageio.v3 as imageio
import numpy as np
import pytest
from ball_script import SCRIPT

from hybrid_rt import Camera, Lambertian, Object, Plane, PPMOptions, RectangleLight, Scene, Sphere
from hybrid_rt.cli import program as cli
from hybrid_rt.intersection import Intersector
from hybrid_rt.live.picture import Pictures
from hybrid_rt.live.watch import LINGER, LivePage
from hybrid_rt.rendering import summary
from hybrid_rt.rendering.renderer import render
from hybrid_rt.sensor.film import Film

WIDTH, HEIGHT = 24, 16
BALL, FLOOR = Sphere((0, 0, 0), 1), Plane((0, 0, -1), (0, 0, 1))
LAMP = RectangleLight((-1, -1, 4), (0, 1, 0), (1, 0, 0), 20.0)


def ball():
    camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=WIDTH, height=HEIGHT)
    objects = [Object(BALL, Lambertian(0.5), "ball"), Object(FLOOR, Lambertian((0.1, 0.2, 0.3)))]
    return Scene(camera, objects, [LAMP])


def ask(page, path, method="GET"):
    parts = urlsplit(page.address)
    link = http.client.HTTPConnection(parts.hostname, parts.port, timeout=10)
    try:
        link.request(method, f"{path}{'&' if '?' in path else '?'}{parts.query}")
        answer = link.getresponse()
        return answer.status, answer.read()
    finally:
        link.close()


class Stopper:
    """Progress that asks a page something after some passes."""

    def __init__(self, after, act):
        self.after, self.act, self.is_done = after * WIDTH * HEIGHT, act, False

    def __call__(self, stage, done, total):
        del total
        if stage == "Rendering" and done > self.after and not self.is_done:
            self.is_done = True
            self.act()


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(
    ("integrator", "options"), [("path", None), ("ppm", PPMOptions(2000, initial_radius=0.3))]
)
def test_watching_changes_no_bit_and_no_count(integrator, options, threads):
    """Not even while pages ask for everything all the time."""
    settings = {"options": options, "threads": threads, "seed": 3}
    alone = render(ball(), integrator, 40, **settings)
    is_over, answers = threading.Event(), []

    def curious(page):
        while not is_over.is_set():
            for path in ("/probe?column=12&row=6", "/picture", "/about"):
                answers.append(ask(page, path)[0])

    with LivePage() as page:
        reader = threading.Thread(target=curious, args=(page,))
        reader.start()
        try:
            watched = render(ball(), integrator, 40, watch=page, **settings)
        finally:
            is_over.set()
            reader.join()
    np.testing.assert_array_equal(watched.image, alone.image)
    for name in ("rays", "hits", "intersection", "ended_branches", "noise", "relative_error"):
        assert watched.report[name] == alone.report[name], name
    assert watched.report["stopped_by"] == "passes"
    assert set(answers) <= {200, 204, 503}
    assert 200 in answers


def test_a_probe_says_what_the_channels_say():
    with LivePage() as page:
        result = render(
            ball(), "path", 20, watch=page, outputs=["half_interval", "depth", "position", "normal"]
        )
        for column, row in ((12, 8), (0, 0), (WIDTH - 1, HEIGHT - 1), (3, 14)):
            found = page.probe(column, row)
            assert found["passes"] == 20
            assert found["value"] == result.image[row, column].tolist()
            # The figures of a file have the digits of float32.
            expected = result.channels["half_interval"][row, column]
            np.testing.assert_allclose(found["half_interval"], expected, rtol=1e-6)
            hit = found["hit"]
            if hit is None:
                assert result.channels["depth"][row, column] == np.inf
                continue
            assert np.float32(hit["t"]) == result.channels["depth"][row, column]
            assert np.float32(hit["position"]).tolist() == (
                result.channels["position"][row, column].tolist()
            )
            ray = found["ray"]
            truth = Intersector([BALL, FLOOR]).intersect(ray["origin"], ray["direction"])
            assert (hit["t"], hit["t_bound"]) == (truth.t[0], truth.t_bound[0])
        names = [page.probe(12, 8)["hit"], page.probe(3, 14)["hit"]]
        assert [hit["object"] for hit in names] == ["ball", "objects[1] (a Plane)"]
        assert names[0]["material"] == "Lambertian, colour 0.5"
        assert names[1]["material"] == "Lambertian, colour (0.1, 0.2, 0.3)"
        status, body = ask(page, f"/probe?column={WIDTH}&row=0")
        assert status == 400
        assert b"pass a column below 24" in body


def test_the_state_says_what_the_report_says():
    with LivePage(title="a ball") as page:
        assert page.now()["phase"] == "preparing"
        assert page.probe(0, 0) is None
        result = render(ball(), "whitted", 8, watch=page)
        state, about = page.now(), page.about()
    report = result.report
    assert (about["title"], about["settings"]) == ("a ball", report["settings"])
    assert about["left_out"] == report["light_not_found"]
    assert about["plan"] == report["plan"]
    assert (state["phase"], state["passes"], state["stopped_by"]) == ("done", 8, "passes")
    assert state["counts"]["rays"] == report["rays"]
    assert state["counts"]["certified"] == report["geometry"]["certified_rays"]
    last = state["errors"][-1]
    assert last["passes"] == 8
    assert last["whole"] == report["relative_error"]["both"]
    assert [point["passes"] for point in state["errors"]] == sorted(
        {point["passes"] for point in state["errors"]}
    )


def test_the_page_knows_every_end_of_a_render():
    script = (files("hybrid_rt.live") / "page" / "live.js").read_text("utf-8")
    reasons = script.split("const REASONS = {")[1].split("};")[0]
    assert set(re.findall(r"(\w+): \"", reasons)) == set(summary._STOPPED_BY)


@pytest.mark.parametrize("integrator", ["path", "ppm"])
def test_a_page_stops_a_render_at_a_complete_pass(integrator):
    options = PPMOptions(2000, initial_radius=0.3) if integrator == "ppm" else None
    with LivePage() as page:
        stop = Stopper(8, lambda: ask(page, "/stop", "POST"))
        found = render(
            ball(), integrator, target_error=1e-9, options=options, watch=page, progress=stop
        )
    passes = found.report["passes"]
    assert found.report["stopped_by"] == "watcher"
    assert 1 <= passes <= 16  # what is begun together when 8 are done
    whole = render(ball(), integrator, passes, options=options)
    np.testing.assert_array_equal(found.image, whole.image)
    assert found.report["noise"] == whole.report["noise"]


def test_a_stop_before_the_first_pass_waits_for_it():
    with LivePage() as page:
        page.ask_to_stop()
        report = render(ball(), "path", 400, threads=1, watch=page).report
    assert report["stopped_by"] == "watcher"
    assert report["passes"] >= 1


def test_a_page_hears_of_a_failure():
    page = LivePage()
    with pytest.raises(ValueError, match="no scene"), page:
        raise ValueError("no scene")
    assert (page.now()["phase"], page.now()["words"]) == ("failed", "the terminal says why")


def test_pictures_are_not_sent_oftener_than_they_are_worth(monkeypatch):
    film, clock, worked = Film(2, 3), [100.0], [50.0]
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(time, "process_time", lambda: worked[0])
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    pictures = Pictures(film, threading.Lock())
    assert pictures.newer_than(0) is None
    film.add(np.ones((2, 3, 3)))
    assert pictures.newer_than(0).passes == 1
    film.add(np.ones((2, 3, 3)))
    clock[0] += 0.9
    assert pictures.newer_than(1) is None  # not within a second
    clock[0] += 0.2
    assert pictures.newer_than(1).passes == 2
    pictures.add_cost(0.075)  # 0.75 per cent of 10 s
    film.add(np.ones((2, 3, 3)))
    clock[0], worked[0] = clock[0] + 60.0, worked[0] + 9.9
    assert pictures.newer_than(2) is None
    worked[0] += 0.2
    assert pictures.newer_than(2).passes == 3
    film.add(np.ones((2, 3, 3)))
    pictures.is_final = True
    assert pictures.newer_than(3).passes == 4


def test_closing_does_not_wait_for_a_page_that_holds_on():
    with LivePage() as page:
        parts = urlsplit(page.address)
        link = http.client.HTTPConnection(parts.hostname, parts.port, timeout=10)
        link.request("GET", f"/events?{parts.query}")
        assert link.getresponse().status == 200
        render(ball(), "path", 8, watch=page)
        began = time.monotonic()
    assert time.monotonic() - began < LINGER + 0.7  # the machine may be busy
    link.close()


# --- as a command


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "ball.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_nothing_of_it_is_imported_without_a_page(folder):
    code = (
        "import sys; from hybrid_rt.cli import main; main(['render', 'ball.py', '--passes', '1']);"
        "sys.exit(any(name.startswith(('hybrid_rt.live', 'http.server')) for name in sys.modules))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=folder, timeout=120)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--live-compare", "a.png"],
            "--live-compare: there is no page to show it on, pass --live",
        ),
        (["--live", "--live-compare", "a.png"], "picture 'a.png': there is no such file"),
        (["--live", "PORT"], "is in use: name another, or none for a free one"),
    ],
)
def test_bad_input_is_told_before_any_work(folder, capsys, arguments, words):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = str(other.getsockname()[1])
        arguments = [port if x == "PORT" else x for x in arguments]
        assert cli.main(["render", "ball.py", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["ball.py"]


def test_what_is_no_port(capsys):
    for text in ("65536", "-1", "ball.py", "8.5"):
        with pytest.raises(SystemExit) as ended:
            cli.main(["render", f"--live={text}", "ball.py"])
        assert ended.value.code == 2
        assert f"{text!r} is no port: pass 0 (a free one) to 65535" in capsys.readouterr().err


def test_a_picture_of_another_size_is_not_compared_with(folder, capsys):
    imageio.imwrite("a.png", np.zeros((5, 7, 3), np.uint8))
    assert cli.main(["render", "ball.py", "--live", "--live-compare", "a.png", "--quiet"]) == 2
    assert "is 7 x 5, the picture 64 x 48: pass one of the same size" in capsys.readouterr().err
    assert not (folder / "ball.png").exists()


def test_a_render_that_a_page_has_stopped_goes_on_from_its_store(folder, capsys, monkeypatch):
    monkeypatch.setattr(LivePage, "note", lambda page, *_: page.ask_to_stop())
    arguments = ["--threads", "1", "--quiet", "--store", "kept", "--time-budget", "60"]
    assert cli.main(["render", "ball.py", "--live", *arguments]) == 3
    out = capsys.readouterr().out
    assert "stopped   by the live page, after " in out
    command = re.search(r"go on     (.*)", out)[1]
    assert "--resume" in command
    assert "--passes" not in command  # what was asked for still holds
    report = json.loads((folder / "ball.json").read_text())
    assert report["stopped_by"] == "watcher"


class Command:
    """``hybrid-rt render ball.py --live`` with a page that listens and never hangs up."""

    def __init__(self, folder, *arguments):
        # Shells start what runs in the background with Ctrl-C ignored.
        code = (
            "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
            "from hybrid_rt.cli import main; sys.exit(main(sys.argv[1:]))"
        )
        command = [sys.executable, "-c", code, "render", "ball.py", "--live", "--quiet", *arguments]
        self.process = subprocess.Popen(
            command, cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        line = self.process.stderr.readline()
        self.address = re.fullmatch(r"live page: (http://127\.0\.0\.1:\d+/\?token=\S+)\n", line)[1]
        parts = urlsplit(self.address)
        self._link = http.client.HTTPConnection(parts.hostname, parts.port, timeout=60)
        self._link.request("GET", f"/events?{parts.query}")
        self._stream = self._link.getresponse()

    def wait_for(self, is_it):
        for line in iter(self._stream.readline, b""):
            if line.startswith(b'data: {"phase"') and is_it(state := json.loads(line[6:])):
                return state
        raise AssertionError("the stream has ended")

    def seconds_to_exit(self):
        began = time.monotonic()
        self.process.communicate(timeout=30)
        return time.monotonic() - began


def test_it_ends_although_a_page_holds_on(folder):
    """By Ctrl-C and by the page; the picture is there each time."""
    for arguments, code, reason in (
        (["--time-budget", "60"], 130, "interrupted"),
        (["--time-budget", "60"], 3, "watcher"),
    ):
        command = Command(folder, *arguments)
        command.wait_for(lambda state: state["passes"] > 0)
        if code == 130:
            os.kill(command.process.pid, signal.SIGINT)
        elif code == 3:
            assert ask(command, "/stop", "POST")[0] == 200
        state = command.wait_for(lambda state: state["phase"] == "ended")
        # A second where the machine is free; what hangs does so for ever.
        assert command.seconds_to_exit() < 10.0
        assert command.process.returncode == code
        assert (state["stopped_by"], state["words"]) == (reason, "saved as ball.png")
        assert imageio.imread("ball.png").shape == (48, 64, 3)
        (folder / "ball.png").unlink()
