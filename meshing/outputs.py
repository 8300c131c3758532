"""Files and folders that a caller asks for: written as a whole, or left as they were.

A new file gets a random name in the folder of the old one, is opened only if nothing has that name
(so no symbolic link is followed), and replaces the old file when it is complete. It keeps the mode
and, where the system allows it, the owner of the old file.
"""

import errno
import os
import secrets
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

# A disk with less room than this is as good as full, bytes.
TRIAL_SIZE = 2**14


def check_writable(file: Path) -> None:
    """Raise OSError, which names the file and the remedy, if it cannot be written or replaced.

    Only a regular file that may be written is replaced: no folder, symbolic link, device or FIFO, and
    no file that is read-only.
    """
    if not file.parent.is_dir():
        raise FileNotFoundError(
            f"output {str(file)!r} has no folder {str(file.parent)!r}: make it, or name another file"
        )
    with _named(file):
        old = _old(file)
        # A trial tells more than permissions do: full disks, say. An empty file fits on a full disk.
        with _new(file, old) as trial:
            trial.write(bytes(TRIAL_SIZE))


def check_outputs(outputs: Sequence[Path], inputs: Sequence[Path]) -> None:
    """Check that all outputs can be written, see `check_writable`, and that none replaces an input or another."""
    taken = [file.resolve() for file in inputs]
    for file in outputs:
        if file.resolve() in taken:
            what = "read" if file.resolve() in taken[: len(inputs)] else "written"
            raise ValueError(
                f"output {str(file)!r} is a file that is {what}, too: name another file"
            )
        taken.append(file.resolve())
        check_writable(file)


@contextmanager
def replacing(file: Path) -> Iterator[BinaryIO]:
    """Open a new file that replaces one, if there is one, when it is complete; see `check_writable`."""
    with _named(file):
        old = _old(file)
        with _new(file, old) as new:
            yield new
            new.close()  # an error of the disk may come only now
            _old(file)  # not what was put there in the meantime
            Path(new.name).replace(file)


def make_folder(folder: Path) -> None:
    """Make a folder for outputs, and those that it is in, if there is none."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise type(error)(
            error.errno,
            f"output folder {str(folder)!r} cannot be made ({error.strerror}): name another folder",
        ) from error


class _Refusal(OSError):
    """Something that is not replaced: with a reason, and a remedy."""


def _old(file: Path) -> os.stat_result | None:
    """Return what is known of the file that is to be replaced; None if there is none."""
    try:
        old = file.lstat()
    except FileNotFoundError:
        return None
    kind = old.st_mode
    if stat.S_ISLNK(kind):
        target = str(file.readlink())
        raise _Refusal(
            errno.EEXIST,
            f"it is a symbolic link to {target!r}",
            "name that file itself, or remove the link",
        )
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, "it is a folder")
    if not stat.S_ISREG(kind):
        raise _Refusal(errno.EEXIST, "it is a device, FIFO or socket", "name another file")
    # To root nothing is read-only; a mode without any bit for writing was set on purpose.
    if not kind & 0o222 or not os.access(file, os.W_OK):
        raise _Refusal(errno.EACCES, "it is read-only", "make it writable, or name another file")
    return old


@contextmanager
def _new(file: Path, old: os.stat_result | None) -> Iterator[BinaryIO]:
    """Open a new file beside another, with the mode of an old one; delete it unless it was renamed."""
    mode = 0o666 if old is None else stat.S_IMODE(old.st_mode) & 0o777

    def create(name: str, flags: int) -> int:
        return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0), mode)

    # Not derived from the name of the file, which may be as long as names can be.
    temporary = file.with_name(f".{secrets.token_hex(12)}.part")
    with open(temporary, "xb", opener=create) as new:
        try:
            if old is not None and hasattr(os, "fchown"):  # not so on Windows
                with suppress(OSError):  # only root may give files away
                    os.fchown(new.fileno(), old.st_uid, -1)
                with suppress(OSError):
                    os.fchown(new.fileno(), -1, old.st_gid)
                os.fchmod(new.fileno(), mode)  # whatever the umask is
            yield new
        finally:
            temporary.unlink(missing_ok=True)


@contextmanager
def _named(file: Path) -> Iterator[None]:
    """Have an OSError name the file and the remedy."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        remedy = "name another file"
        kind: type[OSError] = type(error)
        if isinstance(error, _Refusal):
            remedy = str(error.filename)
            kind = PermissionError if error.errno == errno.EACCES else FileExistsError
        raise kind(f"output {str(file)!r} cannot be written ({reason}): {remedy}") from error
