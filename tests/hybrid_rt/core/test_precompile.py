"""A cold kernel cache is filled by all cores, and safe for several processes."""

import errno
import os
import select
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from hybrid_rt import Intersector, Sphere, demo
from hybrid_rt.core import precompile
from hybrid_rt.core import threads as pool
from meshing.kernels import cache

ROOT = Path(__file__).parents[3]


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
        ("/opt/renderer", False, False),
        ("/opt/python-app", True, False),
    ],
)
def test_programs_that_python_is_built_into_are_not_started(
    monkeypatch, executable, frozen, starts_python
):
    monkeypatch.setattr(sys, "frozen", frozen, raising=False)
    assert precompile._is_python(executable) == starts_python


# Calls two small kernels, as a task of its own does, and prints which it has compiled itself.
CALLS = '''
import json, sys
import numpy as np
from hybrid_rt.core import precompile
from hybrid_rt.core import threads as pool
from hybrid_rt.integrators.kernels.compaction import add_to_pixels, add_unblocked

TASK = """
import numpy as np
from hybrid_rt.integrators.kernels.compaction import add_to_pixels
add_to_pixels(np.array([1, 1, 0]), np.ones((3, 3)), np.zeros((2, 3)))
"""
pool.available_threads = lambda: 2
precompile._CODE = sys.argv[1] or precompile._CODE

class Owner:
    def tasks(self):
        yield print, ("a helper says nothing",)
        yield print, (lambda: "cannot be pickled",)
        yield exec, (TASK,)

owner, forgotten = Owner(), Owner()
precompile.want(forgotten.tasks)
del forgotten
precompile.want(owner.tasks)
image, radiance = np.zeros((2, 3)), np.zeros((2, 3))
blocked = np.array([True, False])
add_unblocked(np.array([1, 0]), np.zeros(2, dtype=bool), blocked, np.full((2, 3), 5.0), radiance)
for helper in precompile._helpers:
    helper.wait()
add_to_pixels(np.array([1, 1, 0]), np.ones((3, 3)), image)
assert image.tolist() == [[1] * 3, [2] * 3]
assert radiance.tolist() == [[5] * 3, [0] * 3]
kernels = (add_to_pixels, add_unblocked)
print(json.dumps([[k.__name__ for k in kernels if k.stats.cache_misses],
                  len(precompile._helpers)]))
'''


def run_cold(folder, code=""):
    """Return which kernels a process has compiled itself, and how many helpers it started."""
    done = subprocess.run(
        [sys.executable, "-c", CALLS, code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return done.stdout.strip()


def test_helpers_do_what_is_announced_and_a_warm_cache_starts_none(tmp_path):
    assert run_cold(tmp_path) == '[["add_unblocked"], 2]'
    assert run_cold(tmp_path) == "[[], 0]"
    assert not list(tmp_path.rglob("*.claim"))


def test_where_helpers_fail_everything_is_compiled_here(tmp_path):
    assert (
        run_cold(tmp_path, "import sys; sys.exit(3)") == '[["add_to_pixels", "add_unblocked"], 2]'
    )


def test_of_each_kind_of_a_scene_there_are_tasks():
    tracer = Intersector([Sphere((0, 0, 0), 1.0), demo.vase(3.0, 0.0, 1.0), Sphere((0, 5, 0), 1.0)])
    tasks = [(len(surfaces), *ways) for _, (surfaces, *ways) in tracer._rehearsals()]
    ways = [("certified", "none"), ("mesh", "embree")]
    assert tasks == [(n, *way) for way in ways for n in (1, 2)]
    for do, arguments in tracer._rehearsals():
        do(*arguments)


# Says when it needs a kernel, and when it begins to compile it; goes on when it is told.
STEPS = """
import sys
from meshing.kernels.cache import SharedCache
from kernel import double
claim = SharedCache._claim
def told(self, sig):
    print("needs", flush=True)
    claim(self, sig)
    print("begins", flush=True)
    sys.stdin.readline()
SharedCache._claim = told
print(double(21), double.stats.cache_misses.total())
"""


@pytest.fixture
def one_kernel(tmp_path):
    """Return what starts a process that needs a kernel."""
    (tmp_path / "kernel.py").write_text(
        "from meshing.kernels.jit import kernel\n@kernel\ndef double(x):\n    return 2 * x\n"
    )
    with ExitStack() as stack:

        def start():
            process = subprocess.Popen(
                [sys.executable, "-c", STEPS],
                cwd=tmp_path, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
            )  # fmt: skip
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield start


def test_what_one_process_compiles_another_waits_for(one_kernel):
    first = one_kernel()
    assert [first.stdout.readline() for _ in range(2)] == ["needs\n", "begins\n"]
    second = one_kernel()
    assert second.stdout.readline() == "needs\n"
    assert not select.select([second.stdout], [], [], 0.1)[0]
    assert first.communicate("\n")[0] == "42 1\n"
    assert second.communicate("\n")[0] == "begins\n42 0\n"


def test_nobody_waits_for_a_process_that_has_ended(one_kernel):
    first = one_kernel()
    assert [first.stdout.readline() for _ in range(2)] == ["needs\n", "begins\n"]
    second = one_kernel()
    assert second.stdout.readline() == "needs\n"
    first.kill()
    assert second.communicate("\n")[0] == "begins\n42 1\n"


def test_who_fails_to_compile_lets_others_try(monkeypatch, tmp_path):
    (tmp_path / "fails.py").write_text(
        "from meshing.kernels.jit import kernel\n@kernel\ndef fail(x):\n    return x.nothing\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from fails import fail

    for _ in range(2):
        with pytest.raises(Exception, match="nothing"):
            fail(1)
        assert not fail._cache._claims
        assert not list(tmp_path.rglob("*.claim"))


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
    Intersector(Sphere((0, 0, 0), 1.0))
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
