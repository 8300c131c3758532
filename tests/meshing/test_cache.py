"""Cached kernels follow the sources that they are compiled from."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest

INNER = """
from meshing.kernels.jit import inlined

@inlined
def factor(x):
    return {} * x
"""
MIDDLE = """
from mine.kernels.inner import factor
from meshing.kernels.jit import inlined

@inlined
def twice(x):
    return 2.0 * factor(x)
"""
OUTER = """
from meshing.kernels.jit import kernel
from mine.kernels.middle import twice

@kernel
def f(x):
    return twice(x)
"""
RUN = "from mine.kernels.outer import f; print(f(1.0), sum(f.stats.cache_hits.values()))"


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "mine" / "kernels"
    folder.mkdir(parents=True)
    for empty in (folder.parent, folder):
        (empty / "__init__.py").write_text("")
    (folder / "middle.py").write_text(MIDDLE)
    (folder / "outer.py").write_text(OUTER)
    write(folder, 3.0, 1)
    return folder


def write(folder: Path, factor: float, time: int) -> None:
    (folder / "inner.py").write_text(INNER.format(factor))
    os.utime(folder / "inner.py", (time, time))


def run(folder: Path) -> tuple[float, int]:
    path = os.pathsep.join([str(folder.parents[1]), str(Path(__file__).parents[2])])
    env = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    out = subprocess.run(
        [sys.executable, "-c", RUN], env=env, capture_output=True, text=True, check=True
    )
    value, hits = out.stdout.split()
    return float(value), int(hits)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_kernel_is_compiled_anew_if_what_it_calls_has_changed(package):
    """The function that changes is called by one that the kernel calls."""
    assert run(package) == (6.0, 0)
    assert run(package) == (6.0, 1)
    write(package, 5.0, 2)
    assert run(package) == (10.0, 0)
    assert run(package) == (10.0, 1)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_the_content_of_a_file_decides_and_not_its_time(package):
    assert run(package) == (6.0, 0)
    write(package, 3.0, 7)
    (package / "outer.py").touch()
    assert run(package) == (6.0, 1)
    write(package, 5.0, 7)  # as large as before, at the same time
    assert run(package) == (10.0, 0)
