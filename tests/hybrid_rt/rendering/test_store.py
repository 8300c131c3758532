"""The pass store: the same bits however a render was cut, and nothing lost without a word."""

import contextlib
import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from hybrid_rt import Camera, Lambertian, Object, RectangleLight, Scene, Sphere
from hybrid_rt.integrators import INTEGRATORS, workers
from hybrid_rt.integrators.options import PathOptions, PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.workers import Counts
from hybrid_rt.primitives.rectangle import Rectangle
from hybrid_rt.rendering import store as store_module
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.result import RenderInterrupted
from hybrid_rt.rendering.store import PassStore, Saved, StoreError
from hybrid_rt.rendering.summary import in_words

OPTIONS = {
    "path": None,
    "whitted": None,
    "ppm": PPMOptions(photons_per_pass=500),
    "photon_map": PhotonMapOptions(photons_per_pass=500, nearest=20),
}


def scene(radius=1.0, width=12):
    matt = Lambertian((0.7, 0.6, 0.5))
    return Scene(
        Camera((0, 2, 6), (0, 0.5, 0), (0, 1, 0), width=width, height=9),
        [
            Object(Rectangle((-4, -1, -4), (0, 0, 8), (8, 0, 0)), matt, "floor"),
            Object(Sphere((0, 0, 0), radius), matt, "ball"),
        ],
        [RectangleLight((-1, 4, -1), (2, 0, 0), (0, 0, 2), (9, 9, 9))],
    )


def figures(report):
    """Return what of a report does not depend on time."""
    names = ("passes", "noise", "relative_error", "rays", "hits", "intersection", "ended_branches")
    return {name: report[name] for name in (*names, "geometry")} | {
        "photons": {**report.get("photons", {})}
    }


@pytest.mark.parametrize("integrator", OPTIONS)
def test_a_render_in_parts_has_the_bits_of_one_in_one_go(integrator, tmp_path):
    """Cut within runs of passes, at their ends, before and after 16; with other threads."""
    settings = {"integrator": integrator, "seed": 3, "options": OPTIONS[integrator]}
    whole = render(scene(), passes=22, threads=2, **settings)
    for passes, threads in ((1, 2), (3, 1), (4, 2), (9, 1), (16, 2), (18, 1), (22, 2)):
        part = render(
            scene(), passes=passes, threads=threads, store=tmp_path, resume=True, **settings
        )
        assert part.report["passes"] == passes
    np.testing.assert_array_equal(part.image, whole.image)
    assert figures(part.report) == figures(whole.report)
    assert [one["passes"] for one in part.report["store"]["sessions"]] == [
        [0, 1], [1, 3], [3, 4], [4, 9], [9, 16], [16, 18], [18, 22],
    ]  # fmt: skip
    assert part.report["store"]["lost"] == []


def test_a_target_is_reached_at_the_same_pass(tmp_path):
    settings = {"integrator": "path", "target_error": 0.03, "seed": 1}
    whole = render(scene(), **settings)
    assert whole.report["passes"] > 20
    for passes in (5, 17, 23):
        render(scene(), passes=passes, store=tmp_path, resume=True, **settings)
    part = render(scene(), store=tmp_path, resume=True, **settings)
    assert part.report["passes"] == whole.report["passes"]
    np.testing.assert_array_equal(part.image, whole.image)
    finer = render(scene(), store=tmp_path, resume=True, **{**settings, "target_error": 0.02})
    assert finer.report["passes"] > part.report["passes"]
    assert finer.report["relative_error"]["both"] <= 0.02


@pytest.mark.parametrize("failure", [KeyboardInterrupt, ZeroDivisionError, SystemExit])
@pytest.mark.parametrize("integrator", ["path", "ppm"])
def test_a_render_that_is_cut_short_loses_no_pass(failure, integrator, tmp_path, monkeypatch):
    """Nor are photons of the pass that is given up counted."""
    monkeypatch.setattr(workers, "TOGETHER", 1)

    def fails(stage, done, _total):
        if stage == "Rendering" and done > 5 * 12 * 9:
            raise failure

    settings = {"integrator": integrator, "options": OPTIONS[integrator], "passes": 8, "threads": 1}
    with pytest.raises(RenderInterrupted if failure is KeyboardInterrupt else failure):
        render(scene(), store=tmp_path, progress=fails, **settings)
    part = render(scene(), store=tmp_path, resume=True, **settings)
    assert part.report["store"]["passes_before"] == 5
    assert part.report["store"]["lost"] == []
    assert re.search(r"stopped .* s in 2 calls \(\d+\.\d\d s in this one\)", in_words(part.report))
    whole = render(scene(), **settings)
    np.testing.assert_array_equal(part.image, whole.image)
    for name in ("emitted", "stored", "power_of_all_passes") if integrator == "ppm" else ():
        assert part.report["photons"][name] == whole.report["photons"][name]


OF_PHOTONS = {"integrator": "ppm", "options": PPMOptions(500)}


@pytest.mark.parametrize(
    ("there", "here", "words"),
    [
        ({}, {"scene": scene(radius=0.5)}, r"the scene's objects\[1\] differs"),
        ({}, {"scene": scene(width=13)}, "the scene's camera differs; width 12 there, 13 here"),
        ({}, {"seed": 8}, "seed 7 there, 8 here"),
        ({}, {"max_depth": 3}, "max_depth 16 there, 3 here"),
        ({}, {"integrator": "whitted"}, "integrator 'path' there, 'whitted' here"),
        # Options one by one, with the defaults of what is not given; none of another integrator.
        (OF_PHOTONS, {"options": None}, r"photons_per_pass \(--photons\) 500 there, 200000 here"),
        (
            OF_PHOTONS,
            {"options": PPMOptions(500, 0.5)},
            r"alpha \(--alpha\) 0\.66\d* there, 0\.5 here",
        ),
        (
            OF_PHOTONS,
            {"integrator": "path", "options": None},
            "integrator 'ppm' there, 'path' here",
        ),
    ],
)
def test_another_render_is_refused(there, here, words, tmp_path):
    settings = {"scene": scene(), "seed": 7, "passes": 2, "integrator": "path", **there}
    render(**settings, store=tmp_path)
    with pytest.raises(StoreError, match=rf"holds another render: {words}\. Name another folder"):
        render(**{**settings, **here}, store=tmp_path, resume=True)


def test_default_options_are_those_that_are_not_given(tmp_path):
    render(scene(), "path", passes=1, store=tmp_path)
    settings = {"options": PathOptions(), "store": tmp_path, "resume": True}
    part = render(scene(), "path", passes=2, **settings)
    assert part.report["store"]["passes_before"] == 1


def test_another_version_is_refused(tmp_path):
    render(scene(), passes=1, store=tmp_path)
    held = json.loads((tmp_path / "render.json").read_text())
    held["versions"]["numpy"] = "1.0.0"
    (tmp_path / "render.json").write_text(json.dumps(held))
    with pytest.raises(StoreError, match=r"numpy '1\.0\.0' there"):
        render(scene(), passes=2, store=tmp_path, resume=True)


def test_resume_begins_where_there_is_nothing(tmp_path):
    assert render(scene(), passes=1, store=tmp_path / "new", resume=True).report["passes"] == 1
    with pytest.raises(ValueError, match="there is no store"):
        render(scene(), passes=1, resume=True)


@pytest.mark.parametrize("resume", [False, True])
def test_a_store_without_a_pass_is_as_good_as_empty(resume, tmp_path):
    """What a kill before the first save leaves: any other render may begin there."""
    killed = PassStore(tmp_path)
    killed.open({"settings": {"seed": 1}})
    killed._lock.close()  # as the end of a process does
    assert {path.name for path in tmp_path.iterdir()} == {"in-use", "render.json"}
    (tmp_path / "sums-0.npz.new").write_bytes(b"half a save")
    part = render(scene(width=13), passes=2, store=tmp_path, resume=resume)
    assert part.report["store"]["passes_before"] == 0
    assert "ended before it saved a pass" in part.report["store"]["lost"][0]
    assert json.loads((tmp_path / "render.json").read_text())["settings"]["width"] == 13
    whole = render(scene(width=13), passes=4)
    part = render(scene(width=13), passes=4, store=tmp_path, resume=True)
    assert part.report["store"]["lost"] == []
    np.testing.assert_array_equal(part.image, whole.image)


@pytest.mark.parametrize("identity", ["whole", "damaged"])
def test_torn_sums_are_not_overwritten(identity, tmp_path):
    """They were passes once: only their own render may make them again."""
    render(scene(), passes=2, store=tmp_path)
    (tmp_path / "sums-0.npz").write_bytes(b"")
    if identity == "damaged":
        (tmp_path / "render.json").write_text("{")
    words = "width 12 there, 13 here" if identity == "whole" else r"render\.json is damaged"
    with pytest.raises(StoreError, match="holds passes of a render: resume it"):
        render(scene(width=13), passes=2, store=tmp_path)
    with pytest.raises(StoreError, match=words):
        render(scene(width=13), passes=2, store=tmp_path, resume=True)
    assert {path.name for path in tmp_path.iterdir()} == {"in-use", "render.json", "sums-0.npz"}


@pytest.mark.parametrize("is_there", [False, True])
def test_ctrl_c_before_the_first_pass_leaves_no_store(is_there, tmp_path):
    folder = tmp_path / "kept"
    if is_there:
        folder.mkdir()

    def stop(*_event):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(scene(), store=folder, progress=stop)
    assert folder.exists() == is_there
    assert not is_there or not list(folder.iterdir())
    assert render(scene(width=13), passes=1, store=folder).report["store"]["lost"] == []


def test_strange_folders_are_left_alone(tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(StoreError, match=r"holds 'letter\.txt', which is no part of a store"):
        render(scene(), passes=1, store=tmp_path)
    with pytest.raises(StoreError, match="is a file"):
        render(scene(), passes=1, store=tmp_path / "letter.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_what_others_put_into_a_store_does_not_keep_it_from_going_on(tmp_path):
    render(scene(), passes=1, store=tmp_path)
    (tmp_path / ".DS_Store").write_bytes(b"")
    part = render(scene(), passes=2, store=tmp_path, resume=True)
    assert part.report["store"]["passes_before"] == 1
    with pytest.raises(StoreError, match="holds passes of a render: resume it"):
        render(scene(), passes=2, store=tmp_path)


def test_two_renders_do_not_share_a_folder(tmp_path):
    first = PassStore(tmp_path)
    with pytest.raises(StoreError, match=rf"is in use by process {os.getpid()}"):
        render(scene(), passes=1, store=tmp_path)
    first.close()
    render(scene(), passes=1, store=tmp_path)


def test_a_full_disk_loses_no_picture(tmp_path, monkeypatch):
    render(scene(), passes=6, store=tmp_path)

    def full(*_arguments, **_settings):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(store_module.np, "savez", full)
        part = render(scene(), passes=9, store=tmp_path, resume=True)
    assert part.report["passes"] == 9
    assert "No space left on device" in part.report["store"]["not_saved"]
    after = render(scene(), passes=9, store=tmp_path, resume=True)
    assert after.report["store"]["passes_before"] == 6
    assert after.report["store"]["lost"]
    np.testing.assert_array_equal(after.image, part.image)


KILLED = """
import sys
sys.path[:0] = {path!r}
from test_store import render, workers, scene, store_module
workers.TOGETHER = 4 * 12 * 9
store_module.EVERY = 0.0
store_module.SHARE = 1e9
render(scene(), passes=10**6, store={folder!r}, resume=True, threads=1)
"""


def test_killed_at_any_moment(tmp_path):
    """Kill -9 while it saves after every few passes; the sums that are left are whole."""
    code = KILLED.format(path=[__file__.rsplit("/", 1)[0], *sys.path], folder=str(tmp_path))
    rng, passes = np.random.default_rng(5), 0
    for _ in range(3):
        process = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
        seen = time.monotonic() + 60.0
        before = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("sums-*.npz")}
        while time.monotonic() < seen and process.poll() is None:
            now = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("sums-*.npz")}
            if now != before and len(now) == 2:
                break
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        _, said = process.communicate()
        assert process.returncode == -signal.SIGKILL, said
        found = PassStore(tmp_path, resume=True)
        saved = found._newest()
        found.close()
        assert saved is not None
        assert saved.passes > passes
        passes = saved.passes
    # As if another were killed now: it is said.
    (tmp_path / "in-use").write_text("process 1")
    part = render(scene(), passes=passes + 3, store=tmp_path, resume=True)
    assert part.report["store"]["passes_before"] == passes
    assert "ended without saving" in part.report["store"]["lost"][0]
    np.testing.assert_array_equal(part.image, render(scene(), passes=passes + 3).image)


def two_saves(folder, width=12, **settings):
    """Make a store of 6 and 9 passes, of the film of 12 x 9 pixels: arrays of 10 and 2.6 KiB."""
    for passes in (6, 9):
        render(scene(width=width), passes=passes, store=folder, resume=True, **settings)
    return folder


def resumed(folder, **settings):
    """Go on to 10 passes; return passes that were taken up, what was lost, whether bits are right."""
    part = render(scene(), passes=10, store=folder, resume=True, **settings)
    whole = render(scene(), passes=10, **settings)
    kept = part.report["store"]
    return kept["passes_before"], kept["lost"], np.array_equal(part.image, whole.image)


def test_every_bit_of_sums_counts(tmp_path, monkeypatch):
    """Whichever flips, nothing of the file is interpreted: its checksum is that of all of it."""
    store = PassStore(tmp_path)
    store.open({"scene": {}})
    arrays = {"sums": np.random.default_rng(1).random(600), "run": np.zeros(3)}
    store.save(Saved(9, arrays, Counts({}, {}, 0.0, {}), {}))
    store.close()
    content = bytearray((tmp_path / "sums-0.npz").read_bytes())
    monkeypatch.setattr(store_module, "_parsed", lambda _: "interpreted")
    assert store_module._read(bytes(content)) == "interpreted"
    found = set()
    for i in range(8 * len(content)):
        content[i // 8] ^= 1 << i % 8
        with contextlib.suppress(store_module._DamagedError):
            found.add(store_module._read(bytes(content)))
        content[i // 8] ^= 1 << i % 8
    assert found == set()


def test_a_bit_of_the_identity_does_not_lose_the_sums(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(os, "fsync", lambda _: None)
    file = two_saves(tmp_path) / "render.json"
    whole = file.read_bytes()
    identity = {name: part for name, part in json.loads(whole).items() if name != "format"}
    for i in range(3, 8 * len(whole), 107):
        content = bytearray(whole)
        content[i // 8] ^= 1 << i % 8
        file.write_bytes(content)
        store = PassStore(tmp_path, resume=True)
        assert store.open(identity).passes == 9
        store.close()
        assert file.read_bytes() == whole
        assert store.notes == ["render.json was damaged: it is written again"]
    assert "render.json was damaged" in caplog.text
    file.unlink()
    assert resumed(tmp_path)[::2] == (9, True)


@pytest.mark.parametrize("name", ["sums-0.npz", "sums-1.npz"])
@pytest.mark.parametrize("at", [0, 66, 5000, -1])
def test_a_flipped_bit_costs_a_save_at_most(name, at, tmp_path):
    file = two_saves(tmp_path) / name
    content = bytearray(file.read_bytes())
    content[at] ^= 16
    file.write_bytes(content)
    before = 9 if name == "sums-0.npz" else 6
    damage = f"{name} is damaged (its checksum differs): its passes are made again"
    assert resumed(tmp_path) == (before, [damage], True)


CHANGES = {
    "empty": lambda _: b"",
    "a byte": lambda _: b"P",
    "half": lambda content: content[: len(content) // 2],
    "without its end": lambda content: content[:-1],
    "with more behind": lambda content: content + b"\0",
    "twice": lambda content: 2 * content,
    "of another format": lambda content: content[:-32],
}


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_becomes_of_a_file_the_other_one_is_taken(change, tmp_path):
    file = two_saves(tmp_path) / "sums-1.npz"
    file.write_bytes(CHANGES[change](file.read_bytes()))
    before, lost, is_right = resumed(tmp_path)
    assert (before, is_right) == (6, True)
    assert re.match(r"sums-1\.npz is damaged \(.*\): its passes are made again", lost[0])


def test_a_file_of_another_store_is_not_used(tmp_path):
    two_saves(tmp_path / "own", seed=1)
    two_saves(tmp_path / "other", seed=2)
    other = (tmp_path / "other" / "sums-1.npz").read_bytes()
    (tmp_path / "own" / "sums-1.npz").write_bytes(other)
    lost = ["sums-1.npz is of another render: not used"]
    assert resumed(tmp_path / "own", seed=1) == (6, lost, True)
    # If both are, the store is another one, whatever its render.json says.
    for name in ("sums-0.npz", "sums-1.npz"):
        (tmp_path / "own" / name).write_bytes(other)
    with pytest.raises(StoreError, match="seed 2 there, 1 here"):
        resumed(tmp_path / "own", seed=1)


def test_one_file_in_both_places_is_as_good(tmp_path):
    two_saves(tmp_path)
    (tmp_path / "sums-0.npz").write_bytes((tmp_path / "sums-1.npz").read_bytes())
    assert resumed(tmp_path) == (9, [], True)


def forged(file, **arrays):
    """Write a file of sums with other arrays, compressed, and a checksum that is right."""
    with np.load(file) as held:
        arrays = {**held, **arrays}
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    content = stream.getvalue()
    file.write_bytes(content + store_module._checksum(content).digest())


@pytest.mark.parametrize(
    ("array", "words"),
    [
        ({"sums": np.zeros((4, 9, 13, 3))}, r"does not fit \(sums is float64 \(4, 9, 13, 3\)"),
        ({"sums": np.zeros((4, 9, 12, 3), np.float32)}, r"does not fit \(sums is float32"),
        ({"means": np.zeros(5)}, r"does not fit \(means is float64 \(5,\)"),
        ({"first_means": np.zeros(8)}, r"does not fit \(first_means is float64 \(8,\)"),
        ({"counts": np.array([4, 4, 0, 0])}, "9 passes of which are 8"),
        ({"more": np.zeros(1)}, "does not fit .*more is float64"),
        ({"about": np.zeros(1, np.uint8)}, "is damaged"),
        ({"run": np.array([None])}, "is damaged"),
        ({"run": np.zeros(2**22)}, "it unpacks to more than it holds"),
    ],
)
def test_arrays_that_no_such_render_wrote_are_not_used(array, words, tmp_path, monkeypatch):
    """Not even with the right checksum."""
    if "unpacks" not in words:
        monkeypatch.setattr(np, "savez_compressed", np.savez)
    forged(two_saves(tmp_path) / "sums-1.npz", **array)
    before, lost, is_right = resumed(tmp_path)
    assert (before, is_right) == (6, True)
    assert re.search(words, lost[0])


def test_a_file_longer_than_sums_can_be_is_not_read(tmp_path):
    two_saves(tmp_path)
    with (tmp_path / "sums-1.npz").open("r+b") as file:
        file.truncate(2**40)  # takes no room on the disk
    before, lost, is_right = resumed(tmp_path)
    assert (before, is_right) == (6, True)
    assert "it has 1099511627776 bytes, where at most" in lost[0]


def test_sums_that_may_not_be_read_are_not_overwritten(tmp_path, monkeypatch):
    def refused(file, flags):
        if file.name == "sums-1.npz":
            raise PermissionError(errno.EACCES, "Permission denied")
        return opened(file, flags)

    two_saves(tmp_path)
    opened = store_module._opened
    monkeypatch.setattr(store_module, "_opened", refused)
    with pytest.raises(StoreError, match=r"sums-1\.npz cannot be read \(Permission denied\): make"):
        resumed(tmp_path)
    monkeypatch.undo()
    assert resumed(tmp_path) == (9, [], True)


@pytest.mark.parametrize("name", sorted(store_module._KNOWN))
@pytest.mark.parametrize("kind", ["pipe", "link", "folder"])
def test_what_is_no_file_is_refused_and_not_opened(name, kind, tmp_path):
    """A pipe would be waited for without end; behind a link is a file of somebody else's."""
    folder, letter = two_saves(tmp_path / "store"), tmp_path / "letter"
    (folder / name).unlink(missing_ok=True)
    letter.write_text("dear")
    if kind == "pipe":
        os.mkfifo(folder / name)
    elif kind == "link":
        (folder / name).symlink_to(letter)
    else:
        (folder / name).mkdir()
    with pytest.raises(StoreError, match=rf"{re.escape(name)} is no regular file"):
        render(scene(), passes=10, store=folder, resume=True)
    with pytest.raises(OSError, match=r"no regular file|symbolic link|directory"):
        os.close(store_module._opened(folder / name, os.O_RDWR))
    assert letter.read_text() == "dear"


def test_a_lock_that_was_removed_is_none(tmp_path, monkeypatch):
    """B opens the lock; A leaves no pass, and removes it; what B locks then is in no folder."""
    import fcntl

    first, lock, at_lock = PassStore(tmp_path / "kept"), fcntl.flock, []

    def late(file, how):
        if not at_lock:
            at_lock.append(True)
            first.close()
        return lock(file, how)

    first.open({"scene": {}})
    monkeypatch.setattr(fcntl, "flock", late)
    second = PassStore(tmp_path / "kept")
    with pytest.raises(StoreError, match=rf"is in use by process {os.getpid()}"):
        PassStore(tmp_path / "kept")
    second.close()
    assert not (tmp_path / "kept").exists()


def test_passes_that_came_before_the_lock_are_not_gone_on_from(tmp_path):
    """Without ``resume``: another render may save between the look at a folder and its lock."""
    waiting = PassStore(tmp_path / "new")
    two_saves(tmp_path / "other")
    (tmp_path / "other" / "sums-1.npz").rename(tmp_path / "new" / "sums-1.npz")
    with pytest.raises(StoreError, match="holds passes of a render"):
        waiting.open({"scene": {}})
    waiting.close()


def test_a_refused_resume_leaves_it_to_the_next_to_say_what_was_lost(tmp_path):
    two_saves(tmp_path)
    (tmp_path / "in-use").write_text("process 1")
    with pytest.raises(StoreError, match="seed 0 there, 1 here"):
        render(scene(), passes=10, store=tmp_path, resume=True, seed=1)
    before, lost, _ = resumed(tmp_path)
    assert before == 9
    assert "ended without saving" in lost[0]


def integrator(gain, name="own"):
    """Declare an integrator as a user's script does."""
    names = {"__name__": "__main__"}
    exec(OWN.replace("GAIN", str(gain)), names)  # noqa: S102
    INTEGRATORS[name] = names["OWN"]


OWN = """
from hybrid_rt.integrators import Declaration
from hybrid_rt.integrators.integrator import Integrator
from hybrid_rt.integrators.workers import Workers
import numpy as np


class Constant(Integrator):
    def _radiance(self, block):
        return np.full((len(block.origins), 3), light())


def light():
    return GAIN


OWN = Declaration("own", lambda context, threads: Workers(context, threads, Constant),
                  lambda options: "", without_light_paths="none")
"""


def test_an_integrator_of_ones_own_is_its_code(tmp_path, monkeypatch):
    monkeypatch.setitem(INTEGRATORS, "own", None)
    integrator(1.0)
    render(scene(), "own", passes=2, store=tmp_path)
    integrator(1.0)  # imported again, with the same code
    part = render(scene(), "own", passes=4, store=tmp_path, resume=True)
    assert part.report["store"]["passes_before"] == 2
    assert (part.image == 1.0).all()
    integrator(3.0)
    with pytest.raises(StoreError, match="the code of integrator 'own' differs"):
        render(scene(), "own", passes=8, store=tmp_path, resume=True)
    integrator("__import__('threading').local() or LOCK")
    INTEGRATORS["own"].make.__globals__["LOCK"] = threading.Lock()
    words = (
        "store: whether integrator 'own' stays the same cannot be told .function light uses LOCK"
    )
    with pytest.raises(TypeError, match=words):
        render(scene(), "own", passes=8, store=tmp_path, resume=True)
    assert (render(scene(), "path", passes=1).image > 0).any()
