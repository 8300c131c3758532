"""The pass store: a folder from which a render goes on after whatever ended it.

A pass is a pure function of its number, so the sums over passes are all that a render has to keep.
Two files take turns, each written under another name and renamed: whatever moment the process
ends in, one of them is whole. Each ends with a checksum of all that is before it, and nothing of a
file is interpreted before that is compared. Each says what its sums are of, as ``render.json``
does: a store is refused to another scene, other settings or other versions. As long as no sums were
ever saved there is nothing to lose, and any render may begin.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import stat
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.integrators.workers import Counts
from hybrid_rt.rendering.identity import differences
from meshing.checks import as_path

if TYPE_CHECKING:
    from hybrid_rt.rendering.report import Session

# Sums are saved after so many seconds; less often where that takes more than a twentieth of them.
EVERY, SHARE = 10.0, 0.05
IDENTITY, SUMS, LOCK = "render.json", ("sums-0.npz", "sums-1.npz"), "in-use"
FORMAT = 4
# Bytes of the checksum at the end of a file of sums.
CHECKSUM = 32
# No sums are longer than so many bytes for each pixel, and so many besides: those of films take 144,
# those of the blur 96.
MOST_OF_PIXEL, MOST_BESIDES = 4096, 2**26
# So often is a lock tried that others remove meanwhile, as they leave a store without a pass.
TRIES = 100
LOG = logging.getLogger(__name__)
# All files that a store may hold.
_KNOWN = {IDENTITY, LOCK, *SUMS, *(f"{name}.new" for name in (IDENTITY, *SUMS))}


@dataclass
class Saved:
    """What a store holds: sums of the film and of the blur, and what else a render goes on from."""

    passes: int
    arrays: dict[str, NDArray[Any]]
    counts: Counts
    limit: dict[str, Any]  # what the stopping criterion knew
    sessions: list[Session] = field(default_factory=list)  # one for each call that added passes
    identity: dict[str, Any] = field(default_factory=dict)  # of the sums


class StoreError(ValueError):
    """A pass store cannot be used; the message names its folder, and says what to do."""


class PassStore:
    """See the module; the folder is made if it does not exist.

    Raises StoreError if the folder is in use by another render, holds passes although ``resume`` is False, or
    files that are no store's; OSError if nothing can be written there.
    """

    def __init__(self, folder: str | os.PathLike[str], resume: bool = False) -> None:
        self.folder = check_folder(folder, resume)
        self.notes: list[str] = []
        self.not_saved = ""
        self._saved_at, self._took = time.monotonic(), 0.0
        self._next, self._resume = 0, resume
        self._identity: dict[str, Any] = {}
        # Files with sums of this render, the newest first.
        self._places: list[int] = []
        self._lock, self._is_made_here = _locked(self.folder, self.shown)
        # A lock that tells of a process was left behind by one that was killed.
        self._was_killed = bool(self._lock.read())
        self._has_told = False
        self._lock.seek(0)
        began = time.strftime("%Y-%m-%d %H:%M:%S")
        self._lock.write(f"process {os.getpid()}, {began}\n".encode())
        self._lock.truncate()
        self._lock.flush()

    @property
    def shown(self) -> str:
        """The folder as messages name it."""
        return repr(str(self.folder))

    def open(self, identity: Mapping[str, Any]) -> Saved | None:
        """Return what the store holds of the render of this `identity`, or None if it holds no pass.

        Raises StoreError if it holds passes of another render; the message says what differs.
        """
        check_folder(self.folder, self._resume)  # nobody else changes it now
        own = self._identity = json.loads(as_json({"format": FORMAT, **identity}))
        if not holds_sums(self.folder):
            _write(self.folder / IDENTITY, as_json(own).encode())
            if self._was_killed:
                self.notes.append(
                    "the last run ended before it saved a pass: nothing of it is left"
                )
            self._has_told = True
            return None
        held: Any = None
        with suppress(StoreError):
            held = self._held()
        if isinstance(held, dict) and held.get("format") in range(1, FORMAT):
            self._check(held)  # of an older version, whose sums have no such checksums
        saved = self._newest()
        if saved is None:
            self._check(self._held())
        self._has_told = True
        return saved

    def older(self, why: str) -> Saved | None:
        """Return the sums before those that `open` or this returned last, which do not fit."""
        self._tell(f"{SUMS[self._places.pop(0)]} does not fit ({why}): not used")
        if not self._places:
            return None
        self._next = 1 - self._places[0]
        return _read(self._content(SUMS[self._places[0]], self._longest))

    def _newest(self) -> Saved | None:
        """Return the newest sums that are whole and of this render; say what others there are."""
        found: list[tuple[int, Saved]] = []
        for place, name in enumerate(SUMS):
            if not (self.folder / name).exists():
                continue
            try:
                found.append((place, _read(self._content(name, self._longest))))
            except (OSError, _DamagedError) as error:
                reason = " ".join(str(error).split())
                self._tell(f"{name} is damaged ({reason}): its passes are made again")
        if self._was_killed:
            self.notes.append(
                "the last run ended without saving: what it made since its last save is made again"
            )
        own = self._identity
        strange = {place: one for place, one in found if own and differences(own, one.identity)}
        found = [(place, one) for place, one in found if place not in strange]
        for place, one in strange.items():
            # A file of another render among those of this one, or a store of another render.
            self._check(self._held() if found else one.identity)
            self._tell(f"{SUMS[place]} is of another render: not used")
        if not found:
            return None
        if own and not strange:
            self._mend_identity()
        found.sort(key=lambda one: -one[1].passes)
        self._places = [place for place, _ in found]
        self._next = 1 - self._places[0]
        return found[0][1]

    @property
    def _longest(self) -> int | None:
        """Bytes beyond which a file holds no sums of this render; None: unknown."""
        size = self._identity.get("settings", {})
        if not {"width", "height"} <= size.keys():
            return None
        return MOST_BESIDES + MOST_OF_PIXEL * int(size["width"] * size["height"])

    def _held(self) -> Any:
        """Return what ``render.json`` says that the sums are of."""
        try:
            return json.loads(self._content(IDENTITY, MOST_BESIDES))
        except FileNotFoundError:
            raise StoreError(
                f"store {self.shown} has lost its {IDENTITY}, which says of what its sums are: "
                "name another folder"
            ) from None
        except (OSError, ValueError, RecursionError) as error:
            raise StoreError(
                f"store {self.shown}: {IDENTITY} is damaged ({error}): name another folder"
            ) from None

    def _content(self, name: str, longest: int | None) -> bytes:
        """Return the bytes of a file; one that must not be read must not be overwritten either."""
        try:
            return _content(self.folder / name, longest)
        except PermissionError as error:
            raise StoreError(
                f"store {self.shown}: {name} cannot be read ({error.strerror}): make it "
                "readable, or name another folder"
            ) from None

    def _check(self, held: Any) -> None:
        """Refuse a store that holds another render."""
        found = differences(self._identity, held) if isinstance(held, dict) else ["what it holds"]
        if found:
            raise StoreError(
                f"store {self.shown} holds another render: {'; '.join(found)}. Name another "
                "folder, or render what it holds"
            )

    def _mend_identity(self) -> None:
        """Write ``render.json`` again if it is damaged, as all sums say that they are of this render.

        It is damaged as well if one byte makes it that of another render.
        """
        file, whole, content = self.folder / IDENTITY, as_json(self._identity).encode(), b""
        with suppress(FileNotFoundError, _DamagedError):
            content = self._content(IDENTITY, MOST_BESIDES)
        n_wrong = sum(a != b for a, b in zip(content, whole, strict=False))
        if _is_json(content) and (len(content) != len(whole) or n_wrong != 1):
            self._check(json.loads(content))
            return
        self._tell(f"{IDENTITY} was damaged: it is written again")
        with suppress(OSError):  # on a full disk, say
            _write(file, whole)

    def _tell(self, note: str) -> None:
        self.notes.append(note)
        LOG.warning("store %s: %s", self.shown, note)

    def is_due(self) -> bool:
        """Tell whether it is time to save."""
        return time.monotonic() - self._saved_at >= max(EVERY, self._took / SHARE)

    def save(self, saved: Saved) -> None:
        """Write the sums; if that fails, the older ones stay and ``not_saved`` says why."""
        began = time.monotonic()
        file = self.folder / SUMS[self._next]
        held = {"passes": saved.passes, "counts": asdict(saved.counts)}
        held |= {"limit": saved.limit, "sessions": saved.sessions, "identity": self._identity}
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
            # What the last run lost is still to be said if this one was refused.
            if not self.not_saved and (self._has_told or not self._was_killed):
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
    for name in sorted(found & _KNOWN):
        if not stat.S_ISREG((path / name).lstat().st_mode):
            raise StoreError(
                f"store {shown}: {name} is no regular file (a link, a pipe, a folder): name another "
                "folder"
            )
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


class _DamagedError(ValueError):
    """A file is not what was written."""


def _locked(folder: Path, shown: str) -> tuple[BinaryIO, bool]:
    """Open the lock of a folder; tell whether that was made here. The lock ends with the process.

    A render that ends without a pass removes its lock, and the folder: whoever had opened that
    before locks what nobody else can find, and begins again.
    """
    file = folder / LOCK
    for _ in range(TRIES):
        is_new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        try:
            lock = os.fdopen(_opened(file, os.O_RDWR | os.O_CREAT | os.O_APPEND), "a+b")
        except FileNotFoundError:  # the folder is gone
            continue
        lock.seek(0)
        try:
            import fcntl
        except ImportError:  # not on this system: nothing guards the folder
            return lock, is_new
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = lock.read().decode(errors="replace").strip() or "another process"
            lock.close()
            raise StoreError(
                f"store {shown} is in use by {holder}: wait until it ends, or name another folder"
            ) from None
        except OSError:  # a file system without locks
            return lock, is_new
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock.fileno()), file.stat()):
                return lock, is_new
        lock.close()
    raise StoreError(f"store {shown} is in use by renders that begin and end: name another folder")


def _opened(file: Path, flags: int) -> int:
    """Open a regular file; never wait for what is none, or follow a link to one."""
    safe = ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")  # not all systems have all of them
    for name in safe:
        flags |= getattr(os, name, 0)
    opened = os.open(file, flags, 0o666)
    if not stat.S_ISREG(os.fstat(opened).st_mode):
        os.close(opened)
        raise OSError(f"{file.name} is no regular file")
    return opened


def _content(file: Path, longest: int | None) -> bytes:
    """Return the bytes of a file that is not too long."""
    with os.fdopen(_opened(file, os.O_RDONLY), "rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        if longest is not None and size > longest:
            raise _DamagedError(f"it has {size} bytes, where at most {longest} can be")
        return stream.read()


def _is_json(content: bytes) -> bool:
    try:
        json.loads(content)
    except (ValueError, RecursionError):
        return False
    return True


def _write(file: Path, content: bytes | Mapping[str, NDArray[Any]]) -> None:
    """Replace a file by a whole new one, or leave it as it was; a checksum follows arrays."""
    new = file.with_name(f"{file.name}.new")
    try:
        new.unlink(missing_ok=True)
        with os.fdopen(_opened(new, os.O_RDWR | os.O_CREAT | os.O_EXCL), "w+b") as stream:
            if isinstance(content, bytes):
                stream.write(content)
            else:
                np.savez(stream, allow_pickle=False, **content)
                stream.seek(0)
                checksum = hashlib.file_digest(stream, _checksum).digest()
                stream.seek(0, os.SEEK_END)
                stream.write(checksum)
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


def _checksum(content: Any = b"") -> Any:
    return hashlib.blake2b(content, digest_size=CHECKSUM)


def _read(file: Path | bytes) -> Saved:
    """Return the sums in a file, or in its content; raise _DamagedError if they are not what was written."""
    content = file if isinstance(file, bytes) else _content(file, None)
    if len(content) <= CHECKSUM:
        raise _DamagedError("it is empty, or cut off")
    if _checksum(memoryview(content)[:-CHECKSUM]).digest() != content[-CHECKSUM:]:
        raise _DamagedError("its checksum differs")
    # From here on it is what some render wrote, or what somebody made to look like that.
    try:
        return _parsed(content)
    except Exception as error:
        raise _DamagedError(str(error) or type(error).__name__) from error


def _parsed(content: bytes) -> Saved:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        # Sums are not compressed: what unpacks to more than there is would fill the memory.
        if sum(info.file_size for info in arrays.zip.infolist()) > len(content):
            raise ValueError("it unpacks to more than it holds")
        held = {name: arrays[name] for name in arrays.files}
    about = json.loads(held.pop("about").tobytes().decode())
    counts = Counts(**about["counts"])
    names = ("limit", "sessions", "identity")
    return Saved(int(about["passes"]), held, counts, *(about[name] for name in names))
