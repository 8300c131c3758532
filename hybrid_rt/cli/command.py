"""Shared by all command lines: exit codes, Ctrl-C, messages of the library, JSON results."""

import argparse
import importlib.util
import io
import json
import logging
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from hybrid_rt.core.interrupts import sigterm_as_ctrl_c
from meshing.outputs import check_writable, make_folder, replacing

BAD_INPUT, STOPPED, INTERRUPTED, CLOSED_PIPE, TERMINATED = 2, 3, 130, 141, 143
REFUSALS = (ValueError, TypeError, OSError, ImportError, MemoryError, OverflowError)


def run_tool(main: Callable[[], int | None], name: str = "") -> int:
    """Run a tool; return its exit code, also after argument errors and Ctrl-C.

    Messages begin with ``name``, or with that of the script.
    """
    from hybrid_rt.core.progress import watch_compilation

    def run() -> int | None:
        with watch_compilation():
            return main()

    def told(_: KeyboardInterrupt) -> str:
        return "interrupted: what was found so far stands above, and in the files asked for"

    return guarded(name or Path(sys.argv[0]).name, run, told, logging.INFO)


def guarded(
    name: str,
    run: Callable[[], int | None],
    told: Callable[[KeyboardInterrupt], str],
    level: int = logging.WARNING,
) -> int:
    """Run a command; return its exit code, also after errors, Ctrl-C, SIGTERM and closed pipes.

    Messages begin with ``name``; ``told`` words that of an interrupt. From ``level`` on messages of the
    library are shown.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Letters that the output does not have are shown as their numbers.
        sys.stdout.reconfigure(errors="backslashreplace")
    with sigterm_as_ctrl_c() as terminations:
        try:
            with _plain_warnings(name), _shown_log(name, level):
                code = run()
            if sys.stdout is not None:
                sys.stdout.flush()  # now, while a failure can still be told
            return code or 0
        except BrokenPipeError:
            # The reader (``head``, say) closed the pipe: end silently, as programs do. What is still to be
            # written at the end of Python goes nowhere.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return CLOSED_PIPE
        except KeyboardInterrupt as interrupt:
            tell(f"\n{told(interrupt)}")
            return TERMINATED if terminations else INTERRUPTED
        except REFUSALS as error:
            tell(f"{name}: {_words_of(error)}")
            return BAD_INPUT


def _words_of(error: BaseException) -> str:
    """Return the message of an error; its type if the message is empty or cannot be formatted."""
    with suppress(Exception):
        return str(error) or type(error).__name__
    return type(error).__name__


@contextmanager
def _plain_warnings(name: str) -> Iterator[None]:
    """Print this project's warnings as lines of a command, without a place in its code."""
    with warnings.catch_warnings():
        as_before = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *place: Any, **of: Any) -> None:
            if category is UserWarning:
                tell(f"{name}: warning: {message}")
            else:
                as_before(message, category, *place, **of)

        warnings.showwarning = show
        yield


class _Messages(logging.Handler):
    """Shows what the library logs; but not what the report says, which commands print."""

    def __init__(self, name: str, level: int) -> None:
        super().__init__(level)
        self._name = name
        self.addFilter(lambda record: record.name != "hybrid_rt.report")

    def emit(self, record: logging.LogRecord) -> None:
        is_warning = record.levelno >= logging.WARNING
        prefix = f"{self._name}: {record.levelname.lower()}: " if is_warning else ""
        tell(f"{prefix}{record.getMessage()}")


@contextmanager
def _shown_log(name: str, level: int) -> Iterator[None]:
    """Show messages of the logger "hybrid_rt" as lines of a command."""
    log, handler = logging.getLogger("hybrid_rt"), _Messages(name, level)
    as_before = log.level
    log.addHandler(handler)
    log.setLevel(min(level, log.getEffectiveLevel()))
    try:
        yield
    finally:
        log.removeHandler(handler)
        log.setLevel(as_before)


@contextmanager
def said_by(say: Callable[[str], None]) -> Iterator[None]:
    """Leave messages within this block to a function, such as one that knows of an open line."""
    _speakers.append(say)
    try:
        yield
    finally:
        _speakers.remove(say)


_speakers: list[Callable[[str], None]] = []


def one_or_more(text: str) -> int:
    """Parse an argument that is an integer of at least 1."""
    if not (text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r}: pass a whole number from 1 on")
    return int(text)


def say_if_no_plots(what: str) -> None:
    """Announce, before the work, the plots that will be missing if matplotlib is not installed."""
    if importlib.util.find_spec("matplotlib") is None:
        tell(f"no {what} without matplotlib: pip install 'hybrid-rt[plot]'")


def check_results(folder: Path, names: Sequence[str], is_ours: Callable[[Any], bool]) -> None:
    """Make a folder for results, and say before the work if a file in it must not be replaced.

    The first of ``names`` holds the figures, as JSON; ``is_ours`` tells whether these are of an earlier run.
    """
    make_folder(folder)
    for name in names:
        check_writable(folder / name)
    held = None
    with suppress(OSError, ValueError, RecursionError):
        held = json.loads((folder / names[0]).read_bytes())
    if (there := [name for name in names if (folder / name).exists()]) and not is_ours(held):
        raise FileExistsError(
            f"output folder {str(folder)!r} has a file {there[0]!r}, and {names[0]!r} there is not of an "
            "earlier run: name another folder"
        )


@contextmanager
def kept(file: Path | None, figures: Callable[[], Any]) -> Iterator[None]:
    """Write results as JSON at the end of a block, also if Ctrl-C or an error ends it.

    Without a file nothing is written, nor are empty results: a file of an earlier run stays as it is.
    """
    if file is not None:
        check_writable(file)
    try:
        yield
    except BaseException:
        _write(file, figures())
        raise
    _write(file, figures())


def _write(file: Path | None, figures: Any) -> None:
    if file is not None and figures:
        from hybrid_rt.core.plain_records import as_json

        with replacing(file) as opened:
            opened.write(as_json(figures).encode())


def earlier_rows(file: Path, key: str, what: str, name: str) -> list[dict[str, Any]]:
    """Return the rows that an earlier run wrote as JSON, each with an entry ``key``.

    Else a ValueError calls them ``what``, and the file to pass ``name``.
    """
    with suppress(ValueError):
        rows = json.loads(file.read_text("utf-8"))
        if isinstance(rows, list) and rows and all(key in row for row in rows):
            return rows
    raise ValueError(f"{file} holds no {what}: pass the {name} of an earlier run")


def say(text: str) -> None:
    """Print a result on the standard output."""
    print(text, flush=True)  # noqa: T201


def tell(text: str) -> None:
    """Print a message on the standard error."""
    if _speakers:
        _speakers[-1](text)
        return
    with suppress(OSError):  # nobody need listen
        print(text, file=sys.stderr, flush=True)  # noqa: T201
