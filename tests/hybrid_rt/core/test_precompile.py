"""Kernels that several processes compile: what is listed, what is waited for, what is left."""

import errno
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from hybrid_rt import demo
from hybrid_rt.core import precompile
from hybrid_rt.core import threads as pool
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.intersection.kinds.registry import kernel_groups
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.plan import KERNELS_FOR, make_plan
from meshing.kernels import cache
from meshing.kernels.cache import SharedCache, name_of

ROOT = Path(__file__).parents[3]
LISTED = precompile.read_list()


def test_every_entry_names_a_kernel_and_types_that_numba_knows():
    for entry in LISTED:
        kernel = precompile.named(entry.kernel)
        assert isinstance(kernel._cache, SharedCache)
        assert name_of(kernel.py_func) == entry.kernel
        types = [precompile.type_from_json(words) for words in entry.types]
        assert [precompile.type_to_json(numba_type) for numba_type in types] == entry.types
        assert len(types) == kernel.py_func.__code__.co_argcount


def test_a_file_system_without_locks_is_no_obstacle(tmp_path, monkeypatch):
    def no_locks(*arguments):
        del arguments
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(cache.fcntl, "flock", no_locks)
    with cache._locked(tmp_path, "ab"):
        pass


def test_kernels_compile_again_where_the_cache_names_a_type_that_has_moved(tmp_path):
    (tmp_path / "kernel.py").write_text(
        "from meshing.kernels.jit import kernel\n@kernel\ndef double(row):\n    return 2 * row.x\n"
    )
    run = "from {0} import Row; from kernel import double; print(double(Row(21)))"
    row = "from typing import Any, NamedTuple\nclass Row(NamedTuple):\n    x: Any\n"
    for module in ("old_place", "new_place"):
        (tmp_path / f"{module}.py").write_text(row)
        done = subprocess.run(
            [sys.executable, "-c", run.format(module)], check=False, cwd=tmp_path, capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        )  # fmt: skip
        assert done.stdout == "42\n", done.stderr
        (tmp_path / f"{module}.py").unlink()


@pytest.mark.parametrize(
    ("executable", "frozen", "starts_python"),
    [
        ("/usr/bin/python3", False, True),
        ("C:\\Python\\python.exe", False, True),
        ("/opt/renderer", False, False),
        ("/opt/python-app", True, False),
        ("", False, False),
        (None, False, False),
    ],
)
def test_programs_that_python_is_built_into_are_not_started(
    monkeypatch, executable, frozen, starts_python
):
    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    assert precompile._is_python(executable) == starts_python


def test_entries_are_distinct():
    assert len({(e.kernel, json.dumps(e.types)) for e in LISTED}) == len(LISTED)


def test_what_the_demo_announces_is_what_it_needs():
    """It is announced before the first surface exists; here the surfaces are asked."""
    scene = demo.scene()
    surfaces = compile_scene(scene).surfaces
    asked = {*kernel_groups(surfaces, "certified", "embree"), "whitted"}
    of_mesh = {name for name in demo.KERNELS if name.endswith(", mesh")}
    assert set(demo.KERNELS) - of_mesh == asked
    assert of_mesh < set(kernel_groups(surfaces, "mesh", "embree"))


def test_modules_and_decisions_exist():
    plan = make_plan(compile_scene(demo.scene()), INTEGRATORS["path"])
    for module, decision in KERNELS_FOR.items():
        importlib.import_module(module)
        assert plan[decision] in (True, False)


@pytest.mark.slow
def test_the_list_holds_what_kernels_are_called_with():
    """If not: python tools/list_kernels.py. The scenes of this case have all sorts of surfaces."""
    listed = {(e.kernel, json.dumps(e.types)) for e in LISTED}
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "list_kernels.py", "--case", "path"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        check=True,
    )
    used = {(e["kernel"], json.dumps(e["types"])) for e in json.loads(done.stdout)}
    assert used <= listed
    assert len(used) > 40  # curved surfaces, lights and paths from them are among it


# Calls two small kernels, which it has announced, and prints which it has compiled itself.
CALLS = """
import json, sys
import numpy as np
from hybrid_rt.core import precompile
from hybrid_rt.core import threads as pool
from hybrid_rt.integrators.kernels.compaction import add_to_pixels
from hybrid_rt.integrators.kernels.compaction import add_unblocked

pool.available_threads = lambda: 2
precompile._CODE = sys.argv[1] or precompile._CODE
listed = [e for e in precompile.read_list() if e.kernel.split(":")[1] in sys.argv[2:]]
precompile.read_list = lambda: listed
precompile.want("path")
precompile.fill_cold_cache()
image, radiance = np.zeros((2, 3)), np.zeros((2, 3))
add_to_pixels(np.array([1, 1, 0]), np.ones((3, 3)), image)
blocked = np.array([True, False])
add_unblocked(np.array([1, 0]), np.zeros(2, dtype=bool), blocked, np.full((2, 3), 5.0), radiance)
assert image.tolist() == [[1] * 3, [2] * 3]
assert radiance.tolist() == [[5] * 3, [0] * 3]
kernels = (add_to_pixels, add_unblocked)
print(json.dumps([[k.__name__ for k in kernels if k.stats.cache_misses],
                  len(precompile._workers._processes)]))
"""


def run_cold(folder, code=""):
    """Return which kernels a process has compiled itself, and how many processes it started."""
    done = subprocess.run(
        [sys.executable, "-c", CALLS, code, "add_to_pixels", "add_unblocked"],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    compiled, n_processes = json.loads(done.stdout)
    return compiled, n_processes


def test_a_cold_cache_is_filled_by_others_and_a_warm_one_starts_nobody(tmp_path):
    """While one kernel is compiled here, another process compiles the other."""
    compiled, n_processes = run_cold(tmp_path)
    assert len(compiled) < 2
    assert n_processes >= 1
    assert run_cold(tmp_path) == ([], 0)


def test_where_others_fail_everything_is_compiled_here(tmp_path):
    compiled, n_processes = run_cold(tmp_path, code="import sys; sys.stdin.readline(); sys.exit(3)")
    assert compiled == ["add_to_pixels", "add_unblocked"]
    assert n_processes >= 1


def of_kernels(*seconds, parts=()):
    """Return workers that know kernels 0, 1, ... of a list; ``parts`` are those of kernel 0."""
    workers = precompile._Workers()
    workers._listed = [
        precompile.Listed(f"kernels:{i}", [], ["path"], each, list(parts) if i == 0 else [])
        for i, each in enumerate(seconds)
    ]
    workers.want({("path", ())})
    workers._known, workers._queue = set(range(len(seconds))), list(range(len(seconds)))
    return workers


def test_what_is_left_counts_by_the_time_it_takes():
    assert precompile._Workers().how_far() == (0, 0)
    workers = of_kernels(4.0, 2.0, 0.01)
    assert workers.how_far() == (0, 61)
    workers._queue, workers._at_work = [1, 2], {0}
    assert workers.how_far() == (0, 61)
    workers._at_work = set()
    assert workers.how_far() == (40, 61)
    workers._queue = []
    assert workers.how_far() == (60, 61)  # this process may still compile


def test_parts_are_compiled_before_what_links_them():
    workers = of_kernels(4.0, 2.0, 1.0, 3.0, parts=["kernels:1", "kernels:2"])
    assert [workers._next(), workers._next()] == [1, 2]
    assert workers._next() == 3  # the parts are at work still
    workers._end(1, True)
    assert not workers._is_ready(0)
    workers._end(2, False)  # it could not be compiled: the kernel compiles it for itself
    assert workers._next() == 0
    assert workers._next() is None


def test_only_parts_of_what_is_wanted_are_compiled():
    workers = of_kernels(4.0, 2.0, 1.0, parts=["kernels:1"])
    workers._listed[1].groups.append("ppm")
    workers._listed.append(precompile.Listed("others:whole", [], ["path"], 1.0, ["others:part"]))
    workers._listed.append(precompile.Listed("others:part", [], ["path"], 1.0))
    assert workers._wanted_numbers() == {0, 1, 2, 3, 4}
    workers._wanted = {("path", ("others",))}
    assert workers._wanted_numbers() == {0, 1, 2}
    workers._wanted = {("ppm", ())}
    assert workers._wanted_numbers() == set()  # nothing that links the part is wanted


def test_a_part_is_loaded_from_the_cache_by_what_links_it(tmp_path):
    """The kernel is compiled anew, the part is not."""
    (tmp_path / "parts.py").write_text(
        "from meshing.kernels.jit import inlined\n@inlined(cached=True)\ndef square(x):\n    return x * x\n"
    )
    kernel = (
        "from meshing.kernels.jit import kernel\nfrom parts import square\n"
        "@kernel\ndef total(x):\n    return square(x) + {}\n"
    )
    run = (
        "import linking; print(linking.total(3.0), linking.total.stats.cache_misses.total(), "
        "linking.square.stats.cache_misses.total(), linking.square(2.0))"
    )
    for added, printed in ((1, "10.0 1 1 4.0\n"), (100, "109.0 1 0 4.0\n")):
        (tmp_path / "linking.py").write_text(kernel.format(added))
        done = subprocess.run(
            [sys.executable, "-c", run], check=False, cwd=tmp_path, capture_output=True, text=True,
            env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        )  # fmt: skip
        assert done.stdout == printed, done.stderr


def test_one_core_compiles_for_itself(monkeypatch):
    monkeypatch.setattr(pool, "available_threads", lambda: 1)
    monkeypatch.setattr(cache, "on_miss", None)
    precompile.want("spheres")
    assert cache.on_miss is None


# Without the right to write anywhere; numba has been imported by somebody else before.
NOWHERE = """
import os
os.access = lambda *_: False
import numba
from hybrid_rt.integrators.kernels.compaction import add_to_pixels
print(add_to_pixels._cache.cache_path, os.environ["NUMBA_CACHE_DIR"], sep="\\n")
"""


def test_what_cannot_be_written_is_replaced_by_a_folder_for_temporary_files(tmp_path):
    """Processes that this one starts use it as well."""
    settings = {"TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    run = [sys.executable, "-c", NOWHERE]
    done = subprocess.run(
        run, env=environment | settings, capture_output=True, text=True, check=True
    )
    for folder in done.stdout.splitlines():
        assert Path(folder).is_relative_to(tmp_path)
    assert len(done.stdout.splitlines()) == 2
