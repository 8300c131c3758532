"""Passes by real processes of dask.distributed on this machine: killed, added, refused, lost."""

import pickle
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Lambertian,
    Object,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
)
from hybrid_rt.cli.program import main
from hybrid_rt.core.ledger import Ledger
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.options import PPMOptions
from hybrid_rt.primitives.rectangle import Rectangle
from hybrid_rt.rendering import cluster
from hybrid_rt.rendering.cluster import check_address
from hybrid_rt.rendering.cluster_tasks import _SCENES, PreparedScene, forget_scene
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.run import ClusterLost
from hybrid_rt.rendering.set_up import set_up
from hybrid_rt.rendering.settings import Settings

distributed = pytest.importorskip("distributed")

RUN_SCHEDULER = "from distributed.cli.dask_scheduler import main; main()"
RUN_WORKER = "from distributed.cli.dask_worker import main; main()"
OTHER_VERSION = "import hybrid_rt.rendering.versions as v; v.__version__ = '0.0.1'; " + RUN_WORKER
WITHOUT = "import sys; sys.modules['hybrid_rt'] = None; " + RUN_WORKER
SCRIPT = """
from test_cluster import scene
"""


def scene(width=40):
    matt = Lambertian((0.7, 0.6, 0.5))
    return Scene(
        Camera((0, 2, 6), (0, 0.5, 0), (0, 1, 0), width=width, height=30),
        [
            Object(Rectangle((-4, -1, -4), (0, 0, 8), (8, 0, 0)), matt, "floor"),
            Object(Sphere((0, 0, 0), 1.0), matt, "ball"),
        ],
        [RectangleLight((-1, 4, -1), (2, 0, 0), (0, 0, 2), (9, 9, 9))],
    )


class Processes:
    """A scheduler and workers; all end with the test."""

    def __init__(self, folder):
        self.folder, self.file = folder, folder / "scheduler.json"
        self.all = []
        self.scheduler = self._start(
            RUN_SCHEDULER, "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)
        )
        until = time.monotonic() + 60
        while not self.file.exists() or not self.file.read_text().strip().endswith("}"):
            assert self.scheduler.poll() is None
            assert time.monotonic() < until
            time.sleep(0.05)

    @property
    def address(self):
        import json

        return json.loads(self.file.read_text())["address"].replace("0.0.0.0", "127.0.0.1")

    def worker(self, code=RUN_WORKER):
        return self._start(
            code, self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard",
            "--local-directory", str(self.folder),
        )  # fmt: skip

    def _start(self, code, *arguments):
        with (self.folder / f"log{len(self.all)}").open("w") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", code, *arguments], stdout=log, stderr=log
            )
        self.all.append(process)
        return process

    def end(self):
        for process in self.all:
            process.kill()
            process.wait()


@pytest.fixture
def processes(tmp_path):
    (tmp_path / "dask").mkdir()
    started = Processes(tmp_path / "dask")
    yield started
    started.end()


@pytest.fixture
def small_tasks(monkeypatch):
    """Tasks of one run each, so that there are many."""
    monkeypatch.setattr(cluster, "MOST_RUNS", 1)


def when(passes, act):
    """Return a progress function that acts once, when so many passes are done."""
    acted = []

    def progress(stage, done, _total):
        if stage == "Rendering" and done >= passes * 40 * 30 and not acted:
            acted.append(True)
            act()

    progress.acted = acted
    return progress


def test_threads_of_a_process_make_the_same_bits():
    """Also where a pilot leaves light paths out: a small lamp behind a pane."""
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.7), "floor")
    pane = Object(Box((-1, -1, 0.5), (1, 1, 0.6)), Dielectric(1.5), "pane")
    behind = Scene(
        Camera((0, -3, 3), (0, 0, 0), (0, 0, 1), width=12, height=9),
        [floor, pane],
        [SphereLight((0, 0, 10), 0.04, 1e4)],
    )
    prepared = PreparedScene("path", pickle.dumps((behind, Settings(coarse="none"))))
    # Each at work when the other is asked for, as in two threads.
    first, second = prepared.take(), prepared.take()
    assert not first.context.plan["light paths"]
    a, b = (
        [made.radiance for made in workers.render_passes(range(4))] for workers in (first, second)
    )
    np.testing.assert_array_equal(a, b)


@pytest.mark.usefixtures("small_tasks")
def test_workers_killed_and_added_change_no_bit(processes):
    """By ppm, whose blur comes back as well: two workers, one is killed, one comes later."""
    settings = {"integrator": "ppm", "options": PPMOptions(photons_per_pass=2000), "seed": 2}
    first, _second = processes.worker(), processes.worker()

    def change():
        first.kill()
        processes.worker()

    progress = when(40, change)
    part = render(scene(), passes=302, cluster=processes.address, progress=progress, **settings)
    assert progress.acted
    assert part.report["cluster"]["workers"] >= 2
    whole = render(scene(), passes=302, **settings)
    np.testing.assert_array_equal(part.image, whole.image)
    assert part.report["relative_error"] == whole.report["relative_error"]
    assert part.report["noise"] == whole.report["noise"]


@pytest.mark.usefixtures("small_tasks")
def test_a_lost_scheduler_leaves_the_picture_and_a_store_that_goes_on(processes, tmp_path):
    processes.worker()
    progress = when(40, processes.scheduler.kill)
    part = render(
        scene(), passes=4000, cluster=processes.address, progress=progress, store=tmp_path / "s"
    )
    assert part.report["stopped_by"] == "cluster_lost"
    assert "scheduler is gone" in part.report["cluster"]["lost"]
    done = part.report["passes"]
    assert 40 <= done < 4000
    np.testing.assert_array_equal(part.image, render(scene(), passes=done).image)
    more = render(scene(), passes=done + 5, store=tmp_path / "s", resume=True)
    assert more.report["store"]["passes_before"] == done
    assert more.report["store"]["lost"] == []
    np.testing.assert_array_equal(more.image, render(scene(), passes=done + 5).image)


@pytest.mark.usefixtures("small_tasks")
@pytest.mark.nightly
def test_a_render_ends_when_no_worker_is_left(processes, monkeypatch):
    """Until then progress is told that it is still there, so that a watcher may end it earlier."""
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    kill, heard = when(40, processes.worker().kill), []

    def progress(stage, done, total):
        heard.append(done)
        kill(stage, done, total)

    part = render(scene(), passes=4000, cluster=processes.address, progress=progress)
    assert part.report["stopped_by"] == "cluster_lost"
    assert "no worker is left" in part.report["cluster"]["lost"]
    assert part.report["passes"] >= 40
    assert heard[-3:] == [heard[-1]] * 3


def scenes_set_up():
    return [prepared._ready is not None for prepared in _SCENES.values()]


@pytest.mark.nightly
def test_workers_set_the_scene_up_before_the_first_pass():
    """Or that would count as the slowest pass, by which a time budget is judged."""
    asked = scene(), Settings(passes=16, coarse="none")
    here = set_up(*asked, 1, Ledger()).workers
    with cluster.Cluster("local:1", *asked, here) as source:
        assert list(source._client.run(scenes_set_up).values()) == [[True]]


@pytest.mark.nightly
def test_a_worker_that_was_restarted_gets_the_scene_again():
    """Its address may be the same. Tasks that it fails in between are made again."""
    asked = scene(), Settings(passes=16, coarse="none")
    here = set_up(*asked, 1, Ledger()).workers
    with cluster.Cluster("local:1", *asked, here) as source:
        source._client.run(forget_scene, source._key)
        made = [one.radiance for one in source.render_passes(range(16))]
        assert source.about("").tried_again > 0
    np.testing.assert_array_equal(made, [one.radiance for one in here.render_passes(range(16))])


def hears_ctrl_c():
    return signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


@pytest.mark.nightly
def test_processes_of_this_machine_do_not_hear_ctrl_c():
    """A terminal sends it to them as well, and each printed a traceback; this process ends them."""
    asked = scene(), Settings(passes=16, coarse="none")
    here = set_up(*asked, 1, Ledger()).workers
    with cluster.Cluster("local:2", *asked, here) as source:
        assert list(source._client.run(hears_ctrl_c).values()) == [False, False]
    assert hears_ctrl_c()


def test_a_class_that_no_worker_can_import_is_refused():
    class Brand(Lambertian):
        pass

    camera, light = scene().camera, scene().lights
    branded = Scene(camera, [Object(Sphere((0, 0, 0), 1.0), Brand(0.5), "ball")], light)
    words = r"cannot be sent to other processes \(.*Brand.*\): put the classes and functions"
    with pytest.raises(ValueError, match=words):
        render(branded, passes=1, cluster="local:1")


def test_workers_of_other_versions_are_refused(processes, monkeypatch):
    """And those that do not know this program at all."""
    others = processes.worker(OTHER_VERSION), processes.worker(WITHOUT)
    with distributed.Client(processes.address) as client:
        client.wait_for_workers(2, timeout=60)
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    with pytest.raises(
        ClusterLost, match=r"no worker of these versions .* hybrid_rt 0\.0\.1 there"
    ):
        render(scene(), passes=4, cluster=processes.address)
    processes.worker()
    monkeypatch.setattr(cluster, "PATIENCE", 60.0)
    part = render(scene(), passes=40, cluster=processes.address)
    assert [other.poll() for other in others] == [None, None]
    assert part.report["cluster"]["workers"] == 1
    assert any("hybrid_rt" in why for why in part.report["cluster"]["refused"].values())
    assert len(part.report["cluster"]["refused"]) == 2
    np.testing.assert_array_equal(part.image, render(scene(), passes=40).image)


def test_processes_of_this_machine_by_the_command(tmp_path, capsys):
    script = tmp_path / "ball.py"
    script.write_text(f"import sys; sys.path.append({__file__.rsplit('/', 1)[0]!r})\n{SCRIPT}")
    out = tmp_path / "ball.npz"
    words = ["--passes", "17", "--quiet", "--out", str(out)]
    assert main(["render", str(script), "--cluster", "local:1", *words]) == 0
    assert "local:1: 1 process," in capsys.readouterr().out
    np.testing.assert_array_equal(np.load(out)["image"], render(scene(), passes=17).image)


@pytest.mark.nightly
def test_passes_that_are_not_in_the_picture_are_not_counted():
    """A target ends a render while tasks have made more; by as many as the report counts of itself."""
    settings = {"integrator": "ppm", "options": PPMOptions(photons_per_pass=2000)}
    part = render(scene(), target_error=0.035, cluster="local:1", **settings).report
    whole = render(scene(), target_error=0.035, **settings).report
    for name in ("passes", "hits", "intersection", "photons", "rays"):
        assert part[name] == whole[name]


@pytest.mark.nightly
def test_an_integrator_that_workers_do_not_know_is_named(processes, monkeypatch):
    own = replace(INTEGRATORS["whitted"], name="own")
    monkeypatch.setitem(INTEGRATORS, "own", own)
    processes.worker()
    with pytest.raises(ClusterLost, match=r"workers do not know the integrator 'own': declare it"):
        render(scene(), "own", passes=4, cluster=processes.address)


@pytest.mark.nightly
def test_a_script_without_main_guard_is_told_so(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text(
        f"import sys; sys.path.append({__file__.rsplit('/', 1)[0]!r})\n{SCRIPT}"
        "from hybrid_rt import render\nrender(scene(), passes=4, cluster='local:1')\n"
    )
    ended = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False, timeout=120
    )
    assert ended.returncode == 1
    last = ended.stderr.strip().splitlines()[-1]
    assert "its processes did not start" in last
    assert 'a script must render under `if __name__ == "__main__":`' in last


@pytest.mark.parametrize("address", ["", "local:0", "local:x", "tcp://host"])
def test_addresses_are_checked_before_any_work(address):
    with pytest.raises(ValueError, match=r"pass 'tcp://HOST:PORT' or 'local:N'"):
        render(scene(), passes=1, cluster=address)


def test_nobody_there(monkeypatch):
    check_address("tcp://127.0.0.1:1")
    monkeypatch.setattr(cluster, "ANSWER", 1.0)
    with pytest.raises(ClusterLost, match="no scheduler answers"):
        render(scene(), passes=1, cluster="tcp://127.0.0.1:1")
