"""The pass store: a folder from which a render goes on after whatever ended it.

A pass is a pure function of its number, so the sums over passes are all that a render has to keep.
Two files take turns, each written under another name and renamed: whatever moment the process
ends in, one of them is whole, and says so by its checksums. ``render.json`` says what the sums
are of: a store is refused to another scene, other settings or other versions. As long as no sums
were ever saved there is nothing to lose, and any render may begin.
"""

from __future__ import annotations

import io
import json
import os
import time
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.ledger import as_json
from hybrid_rt.integrators.workers import Counts
from hybrid_rt.rendering.identity import differences
from meshing.checks import as_path

# Sums are saved after so many seconds; less often where that takes more than a twentieth of them.
EVERY, SHARE = 10.0, 0.05
IDENTITY, SUMS, LOCK = "render.json", ("sums-0.npz", "sums-1.npz"), "in-use"
FORMAT = 3
# All files that a store may hold.
_KNOWN = {IDENTITY, LOCK, *SUMS, *(f"{name}.new" for name in (IDENTITY, *SUMS))}


@dataclass
class Saved:
    """What a store holds.

    Attributes
    ----------
    passes : int
    arrays : dict of ndarray
        Sums of the film and of the blur, by name.
    counts : Counts
    limit : dict
        What the stopping criterion knew.
    sessions : list of dict
        One for each call that added passes: when it ``began`` (seconds since 1970), ``passes``
        (first, stop), ``seconds``, ``kernel_compilation_seconds``, ``threads``.
    """

    passes: int
    arrays: dict[str, NDArray[Any]]
    counts: Counts
    limit: dict[str, Any]
    sessions: list[dict[str, Any]] = field(default_factory=list)


class StoreError(ValueError):
    """A pass store cannot be used; the message names its folder, and says what to do."""


class PassStore:
    """See the module.

    Parameters
    ----------
    folder : path
        Made if it does not exist.
    resume : bool
        Whether to go on with what it holds.

    Raises
    ------
    StoreError
        If the folder is in use by another render, holds passes although ``resume`` is False, or
        files that are no store's.
    OSError
        If nothing can be written there.

    Attributes
    ----------
    notes : list of str
        What was lost, and why; empty if nothing was.
    not_saved : str
        Why the latest sums could not be written; "" if they were.
    """

    def __init__(self, folder: str | os.PathLike[str], resume: bool = False) -> None:
        self.folder = check_folder(folder, resume)
        self._is_made_here = not self.folder.exists()
        self.notes: list[str] = []
        self.not_saved = ""
        self._saved_at, self._took = time.monotonic(), 0.0
        self._next = 0
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = _locked(self.folder / LOCK, self.shown)
        # A lock that tells of a process was left behind by one that was killed.
        self._was_killed = bool(self._lock.read())
        self._lock.seek(0)
        self._lock.write(f"process {os.getpid()}, {_clock(time.time())}\n".encode())
        self._lock.truncate()
        self._lock.flush()

    @property
    def shown(self) -> str:
        """The folder as messages name it."""
        return repr(str(self.folder))

    def open(self, identity: Mapping[str, Any]) -> Saved | None:
        """Return what the store holds of a render, or None if it holds no pass.

        Parameters
        ----------
        identity : dict
            What decides the bits of a pass: dicts of JSON types by heading.

        Raises
        ------
        StoreError
            If it holds passes of another render; the message says what differs.
        """
        file = self.folder / IDENTITY
        own = json.loads(as_json({"format": FORMAT, **identity}))
        if not holds_sums(self.folder):
            _write(file, as_json(own).encode())
            if self._was_killed:
                self.notes.append(
                    "the last run ended before it saved a pass: nothing of it is left"
                )
            return None
        try:
            held = json.loads(file.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise StoreError(
                f"store {self.shown} has lost its {IDENTITY}, which says of what its sums are: "
                "name another folder"
            ) from None
        except (ValueError, UnicodeDecodeError) as error:
            raise StoreError(
                f"store {self.shown}: {IDENTITY} is damaged ({error}): name another folder"
            ) from None
        if found := differences(own, held):
            raise StoreError(
                f"store {self.shown} holds another render: {'; '.join(found)}. Name another "
                "folder, or render what it holds"
            )
        return self._newest()

    def _newest(self) -> Saved | None:
        """Return the newest sums that are whole."""
        found: list[tuple[int, int, Saved]] = []
        for place, name in enumerate(SUMS):
            if not (self.folder / name).exists():
                continue
            try:
                saved = _read(self.folder / name)
            except (
                OSError,
                ValueError,
                KeyError,
                TypeError,
                EOFError,
                zipfile.BadZipFile,
            ) as error:
                reason = " ".join(str(error).split()) or type(error).__name__
                self.notes.append(f"{name} is damaged ({reason}): its passes are made again")
                continue
            found.append((saved.passes, place, saved))
        if self._was_killed:
            self.notes.append(
                "the last run ended without saving: what it made since its last save is made again"
            )
        if not found:
            return None
        _, place, saved = max(found, key=lambda one: one[0])
        self._next = 1 - place
        return saved

    def is_due(self) -> bool:
        """Tell whether it is time to save."""
        return time.monotonic() - self._saved_at >= max(EVERY, self._took / SHARE)

    def save(self, saved: Saved) -> None:
        """Write the sums; if that fails, the older ones stay and ``not_saved`` says why."""
        began = time.monotonic()
        file = self.folder / SUMS[self._next]
        held = {"passes": saved.passes, "counts": asdict(saved.counts)}
        held |= {"limit": saved.limit, "sessions": saved.sessions}
        # With inf and nan, which JSON proper lacks, and with NumPy's numbers.
        about = json.dumps(held, default=lambda number: number.item()).encode()
        arrays = {**saved.arrays, "about": np.frombuffer(about, dtype=np.uint8)}
        try:
            _write(file, arrays)
        except OSError as error:
            self.not_saved = f"store {self.shown}: {file.name} cannot be written ({error.strerror})"
        else:
            self.not_saved, self._next = "", 1 - self._next
        self._saved_at = time.monotonic()
        self._took = self._saved_at - began

    def close(self) -> None:
        """Let others use the folder; say that nothing was lost if everything is saved.

        Without sums nothing came of it, and nothing of the store is left.
        """
        with suppress(OSError, ValueError):
            if not self.not_saved:
                self._lock.truncate(0)
            if not holds_sums(self.folder):
                # While it is locked, so that no other render has begun there.
                for name in sorted(_KNOWN - {LOCK}):
                    (self.folder / name).unlink(missing_ok=True)
                (self.folder / LOCK).unlink()
                if self._is_made_here:
                    self.folder.rmdir()
            self._lock.close()


def check_folder(folder: str | os.PathLike[str], resume: bool = False) -> Path:
    """Return the folder of a store, as `PassStore` takes it; nothing is written."""
    path = as_path(folder, "store")
    checks.flag(resume, "resume")
    shown = repr(str(path))
    if path.exists() and not path.is_dir():
        raise StoreError(f"store {shown} is a file: name a folder")
    found = {item.name for item in path.iterdir()} if path.exists() else set()
    if found & set(SUMS) and not resume:
        raise StoreError(
            f"store {shown} holds passes of a render: resume it (--resume, resume=True), or name "
            "another folder"
        )
    # What others put into a store, a file browser say, does no harm.
    is_a_store = resume and not found.isdisjoint((IDENTITY, *SUMS))
    if (strange := sorted(found - _KNOWN)) and not is_a_store:
        raise StoreError(
            f"store {shown} holds {strange[0]!r}, which is no part of a store: name an empty folder"
        )
    return path


def holds_sums(folder: Path) -> bool:
    """Tell whether sums were ever saved in a folder, be they whole or damaged by now."""
    return any((folder / name).exists() for name in SUMS)


def _locked(file: Path, shown: str) -> BinaryIO:
    """Open a file that no other process has open; the lock ends with the process."""
    lock = file.open("a+b")
    lock.seek(0)
    try:
        import fcntl
    except ImportError:  # not on this system: nothing guards the folder
        return lock
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = lock.read().decode(errors="replace").strip() or "another process"
        lock.close()
        raise StoreError(
            f"store {shown} is in use by {holder}: wait until it ends, or name another folder"
        ) from None
    except OSError:  # a file system without locks
        pass
    return lock


def _write(file: Path, content: bytes | Mapping[str, NDArray[Any]]) -> None:
    """Replace a file by a whole new one, or leave it as it was."""
    new = file.with_name(f"{file.name}.new")
    try:
        with new.open("wb") as stream:
            if isinstance(content, bytes):
                stream.write(content)
            else:
                np.savez(stream, allow_pickle=False, **content)
            stream.flush()
            os.fsync(stream.fileno())
        new.replace(file)
    except OSError:
        with suppress(OSError):
            new.unlink(missing_ok=True)
        raise
    with suppress(OSError):  # not every system can
        folder = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _read(file: Path) -> Saved:
    """Read sums; zipfile compares the checksum of each array."""
    with np.load(io.BytesIO(file.read_bytes()), allow_pickle=False) as arrays:
        held = {name: arrays[name] for name in arrays.files}
    about = json.loads(held.pop("about").tobytes().decode())
    counts = Counts(**about["counts"])
    return Saved(about["passes"], held, counts, about["limit"], about["sessions"])


def _clock(seconds: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))
