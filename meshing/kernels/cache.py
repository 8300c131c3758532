"""The cache of compiled kernels, safe for several processes that write to it at the same time.

A kernel compiles once per machine: numba stores the machine code beside the source or, if that
folder is read-only, in the user's cache folder. If both are read-only numba would refuse to
compile; then a temporary folder is used, which belongs to the user alone.

numba replaces its files atomically, but updates the index of a function's signatures without a
lock. Of two processes that update it at once, one entry may be lost, or both may give their machine
code the same file name (numba issue 10128 is of this kind). Here a lock is held during the update.
And what one process compiles, others that need it wait for: it has a file that is locked meanwhile.

The functions that a kernel calls are compiled into it. So it is compiled again if the content of its
own file has changed, or of a file that its file imports from a folder ``kernels``, directly or not.
Times of files do not count: a fresh clone or installation can use a cache that was copied to it.
"""

import atexit
import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from numba.core import config, event
from numba.core.caching import FunctionCache, IndexDataCacheFile

from meshing.kernels.link_only import CacheOfLinked

try:
    import fcntl
except ImportError:  # Windows: an entry may be lost there, and is compiled again
    fcntl = None  # type: ignore[assignment]

LOCK_FILE = "kernels.lock"
KERNELS = "kernels"
_IMPORT = re.compile(r"^\s*(?:from|import)\s+([\w.]+)", re.MULTILINE)

# Of several processes that need a kernel one compiles it and the others wait, in seconds at most so
# long: a process may be stopped.
LONGEST_WAIT, LOOK = 300.0, 0.02

on_miss: Callable[[], None] | None = None
"""Called when a kernel is not in the cache."""


class SharedCache(FunctionCache):
    """The cache of one kernel's machine code, one file for each tuple of argument types."""

    def __init__(self, function: Any) -> None:
        try:
            super().__init__(function)
        except (
            RuntimeError
        ) as error:  # of numba's variables, or where no folder at all can be written
            raise ImportError(f"compiled kernels have no place: {error}") from None
        self._claims: dict[tuple[Any, ...], ExitStack] = {}
        self._cache_file = IndexDataCacheFile(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=_stamps(function.__module__) or self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code, or None if this process has to compile it."""
        found = self._load(sig, target_context)
        if found is not None:
            return found
        if on_miss is not None:
            on_miss()
        self._claim(sig)
        found = self._load(sig, target_context)
        if found is not None:
            self.give_up_claims()
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store compiled code; on a disk that is full, say, do without."""
        with suppress(OSError):
            self._impl.locator.ensure_cache_path()
            with _locked(Path(self.cache_path), "ab"):
                super().save_overload(sig, data)
        self.give_up_claims()

    def _claim(self, sig: tuple[Any, ...]) -> None:
        """Make other processes wait until a kernel is saved; first wait for one that has done so."""
        _forget_failed()
        if sig in self._claims:
            return
        words = f"{self._impl.filename_base}-{hashlib.sha256(repr(sig).encode()).hexdigest()[:16]}"
        path, began = Path(self.cache_path) / f"{words}.claim", time.monotonic()
        # Without a folder, or locks, this process does for itself.
        with suppress(OSError), ExitStack() as stack:
            self._impl.locator.ensure_cache_path()
            file = stack.enter_context(path.open("ab"))  # closing it gives the claim up
            if not _can_lock(file):
                # For listeners this is a compilation.
                with event.trigger_event("numba:compile"):
                    while not _can_lock(file) and time.monotonic() < began + LONGEST_WAIT:
                        time.sleep(LOOK)
            stack.callback(path.unlink, missing_ok=True)
            self._claims[sig] = stack.pop_all()

    def give_up_claims(self) -> None:
        """Let others look for what is saved, or compile what this process could not."""
        while self._claims:
            with suppress(OSError):
                self._claims.popitem()[1].close()

    def _load(self, sig: Any, target_context: Any) -> Any:
        try:
            with _locked(Path(self.cache_path), "rb"):
                found = super().load_overload(sig, target_context)
        except (ImportError, AttributeError):
            # It names types of an older version of this package that are not there any more.
            with _locked(Path(self.cache_path), "ab"), suppress(OSError):
                self.flush()
            return None
        # Files copied from several places may be the code of other argument types.
        return found if found is None or found.signature.args == tuple(sig) else None


class CacheOfParts(SharedCache):
    """The cache of a function that kernels link; see `meshing.kernels.link_only`."""

    _impl_class: Any = CacheOfLinked


def _stamps(module: str) -> tuple[tuple[str, bytes], ...]:
    """Return name and digest of each file that a module and its functions are compiled from.

    This file has no part in machine code. Of a module without a file, as in a notebook, nothing is
    known.
    """
    if _source(module) is None:
        return ()
    found = {__name__}
    left = {module}
    while left:
        name = left.pop()
        found.add(name)
        left |= _imported(name) - found
    return tuple((name, _digest(name)) for name in sorted(found - {__name__}))


@functools.cache
def _imported(module: str) -> frozenset[str]:
    """Return the modules below a folder ``kernels`` that a loaded module imports."""
    file = _source(module)
    names = [] if file is None else _IMPORT.findall(file.read_text("utf-8"))
    return frozenset(name for name in names if KERNELS in name.split(".") and name in sys.modules)


@functools.cache
def _digest(module: str) -> bytes:
    file = _source(module)
    return b"" if file is None else hashlib.sha256(file.read_bytes()).digest()


def _source(module: str) -> Path | None:
    """Return the file of a loaded module; None if it has none, as in a notebook."""
    file = getattr(sys.modules.get(module), "__file__", None)
    return Path(file) if file is not None and Path(file).is_file() else None


@contextmanager
def _locked(folder: Path, mode: str) -> Iterator[None]:
    """Hold a folder's lock, to read or to write; where there can be none, go on without it."""
    with ExitStack() as stack:
        # Nothing cached so far, a folder that cannot be written, or a file system without locks.
        with suppress(OSError):
            file = stack.enter_context((folder / LOCK_FILE).open(mode))  # closing it unlocks
            if fcntl is not None:
                fcntl.flock(file, fcntl.LOCK_SH if mode == "rb" else fcntl.LOCK_EX)
        yield


def _can_lock(file: IO[bytes]) -> bool:
    """Try to lock a file for this process alone; where there are no locks, it counts as locked."""
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


class _Failures(event.Listener):
    """Hears of kernels that could not be compiled, or were interrupted."""

    def on_start(self, event: Any) -> None:
        """Hear nothing."""

    def on_end(self, event: Any) -> None:
        """Give up the claims of a kernel that failed."""
        # (numba's `is_failed` says the opposite.)
        if sys.exc_info()[0] is not None and event.data is not None:
            cache = event.data["dispatcher"]._cache
            if isinstance(cache, SharedCache):
                cache.give_up_claims()


@functools.cache
def _forget_failed() -> None:
    register: Any = event.register
    register("numba:compile", _Failures())


def _can_write(folder: Path) -> bool:
    return os.access(_nearest(folder), os.W_OK)


def _nearest(folder: Path) -> Path:
    """Return a folder if it exists, or else the nearest of those that it is to be in."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder


def _choose_folder() -> None:
    numba_settings: Any = config
    if numba_settings.CACHE_DIR or _can_write(Path(__file__).parent):
        return
    with suppress(RuntimeError):  # a user without a home
        users = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        if _can_write(users) and _is_private(_nearest(users), 0o002):
            return
    # For this process, and for those that it starts.
    numba_settings.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(_temporary_folder())


def _temporary_folder() -> Path:
    """Return a folder that nobody else can write to: machine code that is loaded from it is run.

    Its name is the same for all processes of a user; where somebody else has taken that name, it is a
    folder of this process alone.
    """
    folder = Path(tempfile.gettempdir()) / f"hybrid_rt-kernels-{_user()}"
    with suppress(OSError):
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        if _is_private(folder, 0o077):
            return folder
    own, process = Path(tempfile.mkdtemp(prefix="hybrid_rt-kernels-")), os.getpid()

    def delete() -> None:
        if os.getpid() == process:  # not of one that was forked
            shutil.rmtree(own, ignore_errors=True)

    atexit.register(delete)
    return own


def _user() -> int:
    return os.geteuid() if hasattr(os, "geteuid") else 0  # as `os.stat` says on Windows


def _is_private(folder: Path, others: int) -> bool:
    """Tell whether a path is a folder, no link to one, of this user, without any of some mode bits."""
    found = folder.lstat()
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == _user()
    return is_ours and not found.st_mode & others


_choose_folder()
