"""Runs rows of the catalogue one by one in a child process, each within a time limit.

A row that exceeds its limit or kills the process fails; a new child runs the remaining rows.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from proof.stability.row import NOT_BUILT, Effort, Outcome, Row, all_ids, all_rows

# Seconds for one row, its compilations included.
LIMIT = 900.0
# Seconds for a child to begin: it imports all rows.
START = 300.0
HOLDS, FAILS, MISSING, NOT_YET = "holds", "fails", "missing", "not built: "
ENDLESS, CRASHED = "does not end", "crashed"
Rows = Callable[[], dict[str, Row]]


@dataclass(frozen=True)
class Result:
    """Result of a row; title and truth are empty where there is none."""

    id: str
    title: str
    truth: str
    verdict: str  # "holds", "fails", "not built: ...", "missing", "does not end", "crashed"
    outcome: Outcome = field(default_factory=Outcome)
    seconds: float = 0.0

    @property
    def is_right(self) -> bool:
        """Whether the row holds, or is declared as not built."""
        return self.verdict == HOLDS or self.verdict.startswith(NOT_YET)

    def figures(self) -> dict[str, Any]:
        """Return all as a flat dictionary, for JSON."""
        head = {name: getattr(self, name) for name in ("id", "title", "truth", "verdict")}
        return {**head, **asdict(self.outcome), "seconds": self.seconds}


def expand(only: Sequence[str], ids: Sequence[str] = ()) -> list[str]:
    """Return the ids (default: `all_ids`) that begin with one of some words; all without words."""
    ids = ids or all_ids()
    words = [word.strip() for word in only if word.strip()]
    for word in words:
        if not any(entry.startswith(word) for entry in ids):
            raise ValueError(
                f"--only names {word!r}: pass ids such as {ids[0]}, or their first letters"
            )
    return [entry for entry in ids if not words or any(entry.startswith(w) for w in words)]


def run_rows(
    only: Sequence[str] = (),
    effort: Effort | None = None,
    *,
    limit: float = LIMIT,
    rows: Rows = all_rows,
    ids: Sequence[str] = (),
) -> Iterator[Result]:
    """Run rows in order; yield the result of each as it ends.

    ``only`` has ids or how they begin; ``rows`` returns the rows by their ids, and must be picklable: the
    child calls it as well; ``ids`` are those that there must be. Raises ValueError if a word of ``only``
    selects nothing.
    """
    known, worker = rows(), None
    try:
        for row_id in expand(only, ids):
            if row_id in known:
                worker = worker or _Worker(rows)
                result = worker.run(known[row_id], effort or Effort(), limit)
                if result.verdict in (ENDLESS, CRASHED):
                    worker.stop()
                    worker = None
                yield result
            elif row_id in NOT_BUILT:
                yield Result(row_id, "", "", NOT_YET + NOT_BUILT[row_id])
            else:
                yield Result(row_id, "", "", MISSING, Outcome(faults=("there is no such row",)))
    finally:
        if worker is not None:
            worker.stop()


class _Worker:
    """A process that runs rows by their ids."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
        self._pid = self._pool.submit(_ready, rows).result(START)

    def run(self, row: Row, effort: Effort, limit: float) -> Result:
        """Run one row; after "does not end" and "crashed" this process is of no more use."""
        began = time.perf_counter()
        try:
            outcome = self._pool.submit(_outcome, self._rows, row.id, effort).result(limit)
            verdict = HOLDS if outcome.holds else FAILS
        except TimeoutError:
            verdict, outcome = ENDLESS, Outcome(faults=(f"no answer within {limit:g} s",))
        except BrokenProcessPool:
            verdict, outcome = CRASHED, Outcome(faults=("the process ended",))
        return Result(
            row.id, row.title, row.truth, verdict, outcome, time.perf_counter() - began
        )  # fmt: skip

    def stop(self) -> None:
        """Kill the process: a row may hang in a kernel, which hears no other signal."""
        with suppress(ProcessLookupError):
            os.kill(self._pid, signal.SIGKILL)
        self._pool.shutdown(cancel_futures=True)


def _ready(rows: Rows) -> int:
    """Import the rows; return the number of this process."""
    rows()
    return os.getpid()


def _outcome(rows: Rows, row_id: str, effort: Effort) -> Outcome:
    """Run a row; one that raises fails, and the others go on."""
    try:
        return rows()[row_id].run(effort)
    except Exception as error:  # noqa: BLE001
        where = traceback.format_exc(limit=-3)
        return Outcome(faults=(f"raised {type(error).__name__}: {error}",), notes=(where,))
