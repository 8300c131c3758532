"""Cached kernels follow the sources that they are compiled from."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import numba
import pytest

from meshing.kernels import bernstein, cache

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
RUN_BOTH = RUN.replace("f(1.0)", "f(1.0) + f(1)")


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


def run(folder: Path, code: str = RUN) -> tuple[float, int]:
    path = os.pathsep.join([str(folder.parents[1]), str(Path(__file__).parents[2])])
    env = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    out = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
    )
    value, hits = out.stdout.split()
    return float(value), int(hits)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_the_content_of_a_file_decides_and_not_its_time(package):
    """Of one whose function is called by one that the kernel calls."""
    assert run(package) == (6.0, 0)
    write(package, 3.0, 7)
    (package / "outer.py").touch()
    assert run(package) == (6.0, 1)
    write(package, 5.0, 7)  # as large as before, at the same time
    assert run(package) == (10.0, 0)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_code_for_other_arguments_is_compiled_anew(package):
    """As where the files of two caches were copied into one folder."""
    assert run(package, RUN_BOTH) == (12.0, 0)
    assert run(package, RUN_BOTH) == (12.0, 2)
    one, other = sorted((package / "__pycache__").glob("outer.f-*.nbc"))
    content = one.read_bytes()
    one.write_bytes(other.read_bytes())
    other.write_bytes(content)
    assert run(package, RUN_BOTH) == (12.0, 0)


def test_what_this_file_does_changes_no_stamp():
    """It has no part in machine code: all kernels would be compiled again."""
    names = {name for name, _ in cache._stamps(bernstein.__name__)}
    assert {"meshing.kernels.bernstein", "meshing.kernels.jit"} <= names
    assert "meshing.kernels.cache" not in names


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The folder of temporary files, where others may have been before."""
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    deleting = []
    monkeypatch.setattr(cache.atexit, "register", deleting.append)
    yield tmp_path / f"hybrid_rt-kernels-{os.geteuid()}"
    for delete in deleting:
        delete()
    assert not list(tmp_path.glob("hybrid_rt-kernels-[!0-9]*"))


def mode_of(folder: Path) -> int:
    return stat.S_IMODE(folder.stat().st_mode)


def test_kernels_in_a_temporary_folder_are_of_this_user_alone(temporary):
    assert cache._temporary_folder() == temporary
    assert mode_of(temporary) == 0o700
    assert cache._temporary_folder() == temporary  # of an earlier process


def readable(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o755)


def writable(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)


def link(folder: Path) -> None:
    (folder.parent / "theirs").mkdir(mode=0o700)
    folder.symlink_to(folder.parent / "theirs")


@pytest.mark.parametrize("make", [readable, writable, link, Path.touch])
def test_a_folder_that_others_may_have_made_is_not_used(temporary, make):
    """Their pickles would run as this user's."""
    make(temporary)
    found = cache._temporary_folder()
    assert found != temporary
    assert found.parent == temporary.parent
    assert mode_of(found) == 0o700
    assert not list(found.iterdir())


def test_a_folder_of_another_user_is_not_used(temporary, monkeypatch):
    temporary.mkdir(mode=0o700)
    name, other = temporary.name, os.geteuid() + 1
    temporary.rename(temporary.with_name(name.replace(str(os.geteuid()), str(other))))
    monkeypatch.setattr(cache.os, "geteuid", lambda: other)
    assert cache._temporary_folder().name != f"hybrid_rt-kernels-{other}"


@pytest.mark.parametrize("is_own", [True, False])
def test_a_home_that_others_can_write_to_is_not_used(tmp_path, temporary, monkeypatch, is_own):
    """With a read-only installation, kernels go to the user's cache, and else to a temporary folder."""
    home = tmp_path / "home"
    home.mkdir()
    home.chmod(0o700 if is_own else 0o777)
    monkeypatch.setenv("XDG_CACHE_HOME", str(home / ".cache"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr(cache.config, "CACHE_DIR", "")
    monkeypatch.setattr(cache, "_can_write", lambda folder: folder != Path(cache.__file__).parent)
    cache._choose_folder()
    expected = "" if is_own else str(temporary)
    assert expected == cache.config.CACHE_DIR
    assert os.environ["NUMBA_CACHE_DIR"] == cache.config.CACHE_DIR


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_cache_that_cannot_be_written_is_done_without(package):
    """As on a full disk: files there have no room for a byte."""
    full = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    full += "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)); "
    assert run(package, full + RUN) == (6.0, 0)
    assert run(package, full + RUN) == (6.0, 0)
