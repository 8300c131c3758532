"""Compilation of kernels by several processes while the kernel cache is cold.

numba compiles one function at a time in a process. So at the first kernel that is not in the cache,
helper processes, as many as there are cores, do in small what this process has announced by `want`.
They compile what they come to, except what another process has begun: they wait for that
(`meshing.kernels.cache`), as this process waits for them. If helpers fail, only time is lost.
"""

import atexit
import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any
from weakref import WeakMethod

from meshing.kernels import cache

# Beyond that the longest chain of kernels takes longer than all others together.
MOST_HELPERS = 8
# Finds the packages where this process has found them.
_CODE = "import sys; sys.path[:] = sys.argv[1:]; from hybrid_rt.core.precompile import work; work()"

Task = tuple[Callable[..., Any], Any]
"""A function of a module and its arguments, all of which can be pickled."""

_wanted: list[WeakMethod[Callable[[], Iterable[Task]]]] = []
_helpers: list[subprocess.Popen[bytes]] = []
_is_helper = False


def want(tasks: Callable[[], Iterable[Task]]) -> None:
    """Announce small tasks that call the kernels which this process will need.

    ``tasks``, bound method without arguments: asked for them when a kernel is missing, if its
    object lives still.
    """
    if _is_helper or not _is_python(sys.executable) or _most_helpers() < 2:
        return
    _wanted[:] = [*(one for one in _wanted if one() is not None), WeakMethod(tasks)]
    cache.on_miss = _begin


def work() -> None:
    """Do the tasks on standard input; whatever goes wrong, its owner hears of it by doing them."""
    global _is_helper  # noqa: PLW0603
    _is_helper = True
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # ends silently with the parent process
    tasks: Any = sys.stdin.buffer
    while tasks.peek(1):
        with contextlib.suppress(Exception):
            do, arguments = pickle.load(tasks)
            do(*arguments)


def _begin() -> None:
    """Let helpers do what was announced since the last time."""
    asked, _wanted[:] = [one() for one in _wanted], []
    tasks = []
    for method in asked:
        for task in method() if method is not None else ():
            with contextlib.suppress(Exception):  # what cannot be pickled is compiled here
                tasks.append(pickle.dumps(task))
    n = min(_most_helpers(), len(tasks))
    for i in range(n):
        with contextlib.suppress(OSError):  # no process can be started
            _helpers.append(_start(tasks[i::n]))


def _start(tasks: Iterable[bytes]) -> subprocess.Popen[bytes]:
    with tempfile.TemporaryFile() as file:
        file.writelines(tasks)
        file.seek(0)
        return subprocess.Popen(
            [sys.executable, "-c", _CODE, *sys.path],
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )


def _is_python(executable: str | None) -> bool:
    """Tell whether a program starts Python, not one that Python is built into."""
    is_built_in = getattr(sys, "frozen", False)
    return not is_built_in and "python" in Path(executable or "").name.lower()


def _most_helpers() -> int:
    from hybrid_rt.core.threads import available_threads

    return min(available_threads(), MOST_HELPERS)


@atexit.register
def _stop() -> None:
    for helper in _helpers:
        helper.terminate()
    for helper in _helpers:
        helper.wait()


if hasattr(os, "register_at_fork"):  # not so on Windows
    os.register_at_fork(after_in_child=_helpers.clear)
