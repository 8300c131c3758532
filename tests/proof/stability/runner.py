"""Runs rows of the catalogue one by one in a child process, each within a time limit.

A row that exceeds its limit or kills the process fails; a new child runs the remaining rows.
"""

from __future__ import annotations

import multiprocessing
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from proof.stability.row import (
    NOT_BUILT,
    Curve,
    Effort,
    Outcome,
    Row,
    all_ids,
    all_rows,
)

# Seconds for one row, its compilations included.
LIMIT = 900.0
# Seconds for a child to begin: it imports all rows.
START = 300.0
HOLDS, FAILS, MISSING, NOT_YET = "holds", "fails", "missing", "not built: "
ENDLESS, CRASHED = "does not end", "crashed"
Rows = Callable[[], dict[str, Row]]


@dataclass(frozen=True)
class Result:
    """Result of a row.

    Attributes
    ----------
    id, title, truth : str
        As in `Row`; the last two are empty where there is no row.
    verdict : str
        "holds", "fails", "not built: ..." with what is not, "missing", "does not end", "crashed".
    outcome : Outcome
    seconds : float
    """

    id: str
    title: str
    truth: str
    verdict: str
    outcome: Outcome = field(default_factory=Outcome)
    seconds: float = 0.0

    @property
    def is_right(self) -> bool:
        """Whether the row holds, or is declared as not built."""
        return self.verdict == HOLDS or self.verdict.startswith(NOT_YET)

    @property
    def curves(self) -> tuple[Curve, ...]:
        """Curves to plot."""
        return self.outcome.curves

    def figures(self) -> dict[str, Any]:
        """Return all as a flat dictionary, for JSON."""
        head = {name: getattr(self, name) for name in ("id", "title", "truth", "verdict")}
        return {**head, **asdict(self.outcome), "seconds": self.seconds}


def expand(only: Sequence[str], ids: Sequence[str] = ()) -> list[str]:
    """Return the ids (default: `all_ids`) that begin with one of some words; all without words.

    Raises
    ------
    ValueError
        If no id begins with one of them.
    """
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

    Parameters
    ----------
    only : sequence of str
        Ids or how they begin; all where there are none.
    effort : Effort, optional
        Default: a full run.
    limit : float
        Seconds for one row.
    rows : callable
        Returns the rows by their ids. Must be picklable: the child calls it as well.
    ids : sequence of str
        Required rows. Default: `all_ids`.

    Raises
    ------
    ValueError
        If a word of ``only`` selects nothing.
    """
    selected = expand(only, ids)
    known = rows()
    child = _Child(rows, effort or Effort())
    try:
        for row_id in selected:
            if row_id in known:
                yield child.run(known[row_id], limit)
            elif row_id in NOT_BUILT:
                yield Result(row_id, "", "", NOT_YET + NOT_BUILT[row_id])
            else:
                yield Result(row_id, "", "", MISSING, Outcome(faults=("there is no such row",)))
    finally:
        child.stop()


class _Child:
    """A process that runs rows by their ids, started when it is needed."""

    def __init__(self, rows: Rows, effort: Effort) -> None:
        self._rows, self._effort = rows, effort
        self._process: Any = None
        self._pipe: Any = None

    def run(self, row: Row, limit: float) -> Result:
        """Run one row, in a new process if the last one has ended."""
        if self._process is None:
            self._start()
        began = time.perf_counter()
        answer: tuple[Outcome, float] | None = None
        verdict, fault = ENDLESS, f"no answer within {limit:g} s"
        try:
            self._pipe.send(row.id)
            if self._pipe.poll(limit):
                answer = self._pipe.recv()
        except (EOFError, OSError):
            self._process.join(10.0)
            verdict, fault = CRASHED, f"the process ended with {self._process.exitcode}"
        if answer is None:
            self.stop()
            seconds = time.perf_counter() - began
            return Result(row.id, row.title, row.truth, verdict, Outcome(faults=(fault,)), seconds)
        outcome, seconds = answer
        found = HOLDS if outcome.holds else FAILS
        return Result(row.id, row.title, row.truth, found, outcome, seconds)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        # No daemon: rows may start processes of their own.
        self._process = context.Process(target=_serve, args=(other, self._rows, self._effort))
        self._process.start()
        other.close()
        if not self._pipe.poll(START):
            self.stop()
            raise OSError(f"no process could be started within {START:g} s")
        try:
            self._pipe.recv()
        except EOFError:
            self.stop()
            raise OSError("the process that runs rows ended before it began") from None

    def stop(self) -> None:
        """Terminate the process."""
        if self._process is None:
            return
        self._pipe.close()
        self._process.join(1.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process = self._pipe = None


def _serve(pipe: Any, rows: Rows, effort: Effort) -> None:
    """Run rows whose ids come through a pipe, until it is closed."""
    known = rows()
    pipe.send("ready")
    while True:
        try:
            row_id = pipe.recv()
        except (EOFError, OSError, KeyboardInterrupt):
            return
        began = time.perf_counter()
        try:
            outcome = known[row_id].run(effort)
        except KeyboardInterrupt:
            return
        except Exception as error:  # noqa: BLE001  # a row that raises fails, the others go on
            where = traceback.format_exc(limit=-3)
            outcome = Outcome(faults=(f"raised {type(error).__name__}: {error}",), notes=(where,))
        pipe.send((outcome, time.perf_counter() - began))
