"""Where compiled kernels are kept: a cache that several processes may fill at the same time.

A kernel compiles once per machine: numba keeps the machine code beside the source or, where that
folder cannot be written, in the user's cache folder. Where neither can be written it would refuse
to compile at all; a folder for temporary files then takes their place.

numba replaces its files whole, but reads, changes and writes the index of a function's signatures
without a lock: of two processes that add to it at once one may be forgotten, or both may give their
machine code the same file name (numba issue 10128 is of this kind). Here a lock is held meanwhile.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core import config
from numba.core.caching import FunctionCache

LOCK_FILE = "kernels.lock"

on_miss: Callable[[str, tuple[Any, ...]], bool] | None = None
"""Asked for a kernel, by its name and argument types, that is not in the cache: is it now?"""


def name_of(function: Any) -> str:
    """Return the name by which a kernel is known in all processes."""
    return f"{function.__module__}:{function.__qualname__}"


class SharedCache(FunctionCache):
    """Where one kernel's machine code is kept, a file for each tuple of argument types."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._kernel = name_of(function)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return compiled code, or None where it has to be compiled here."""
        found = self._load(sig, target_context)
        if found is None and on_miss is not None and on_miss(self._kernel, sig):
            found = self._load(sig, target_context)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep compiled code."""
        self._impl.locator.ensure_cache_path()
        with _locked(Path(self.cache_path), "ab"):
            super().save_overload(sig, data)

    def _load(self, sig: Any, target_context: Any) -> Any:
        with _locked(Path(self.cache_path), "rb"):
            return super().load_overload(sig, target_context)


@contextmanager
def _locked(folder: Path, mode: str) -> Iterator[None]:
    """Hold a folder's lock, to read or to write; where there can be none, go on without it."""
    with ExitStack() as stack:
        # Nothing cached so far, a folder that cannot be written, or a file system without locks.
        with suppress(OSError):
            file = stack.enter_context((folder / LOCK_FILE).open(mode))  # closing it unlocks
            fcntl.flock(file, fcntl.LOCK_SH if mode == "rb" else fcntl.LOCK_EX)
        yield


def _can_write(folder: Path) -> bool:
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK)


def _choose_folder() -> None:
    numba_settings: Any = config
    if numba_settings.CACHE_DIR or _can_write(Path(__file__).parent):
        return
    with suppress(RuntimeError):  # a user without a home
        if _can_write(Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")):
            return
    name = f"hybrid_rt-kernels-{os.getuid()}"
    folder = str(Path(tempfile.gettempdir()) / name)
    # For this process, and for those that it starts.
    numba_settings.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = folder


_choose_folder()
