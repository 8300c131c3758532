"""The rows of the catalogue of hard cases: their type, their outcome, and the register.

A row is a function that takes an `Effort` and returns an `Outcome`; the decorator `row` registers it
under its id. `all_rows` imports the modules ``rows_*`` of this package, so a new row is one
function in one of them.
"""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from hybrid_rt.core.records import FloatArray

# Every row that there must be: patches, surfaces of revolution, spheres, rays and light, resources,
# faults that were met once, flat faces, and light at its extremes.
COUNTS = {"A": 36, "B": 19, "C": 14, "D": 34, "E": 11, "F": 15, "H": 3, "L": 16}
IDS = tuple(f"{section}{k:02d}" for section, n in COUNTS.items() for k in range(1, n + 1))
TESTS = Path(__file__).parents[2]
# Marks without need break no promise. Beside singular sets 8 of 10 000 rays have one, as where pieces seen
# with parallel tangents are not halved below 64 roundings. A row may have one, and more of this share of
# its rays.
MOST_NEEDLESS = 1e-3
NOT_BUILT = {"D29": "normal maps"}


@dataclass(frozen=True)
class Effort:
    """The size of a run, and its seed; factor 1 on rays, passes and photons is a full run."""

    factor: float = 1.0
    seed: int = 0

    def count(self, n: int, least: int = 1) -> int:
        """Return n scaled by the effort."""
        return max(round(self.factor * n), least)

    def rng(self, stream: int = 0) -> np.random.Generator:
        """Return a generator of this seed."""
        return np.random.default_rng([self.seed, stream])


@dataclass
class Plot:
    """Error and work against the difficulty of a case; both axes are logarithmic."""

    against: str  # label of the x axis with its unit: "distance from tangency / size"
    label: str  # what was traced
    unit: str = "size"  # of errors
    x: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)  # the largest at each x ...
    expected: list[float] = field(default_factory=list)  # ... and what theory allows that one
    work: list[float] = field(default_factory=list)  # pieces of one search

    def add(self, x: float, error: FloatArray, expected: FloatArray, work: float = 0.0) -> Outcome:
        """Add a point: the largest of some errors, and what is expected of that one."""
        if len(error):
            k = int(np.argmax(error))
            self.x.append(float(x))
            self.error.append(float(error[k]))
            self.expected.append(float(expected[k]))
            self.work.append(float(work))
        # No error where none is expected is none; any other one is too large.
        none = np.where(error == 0.0, 0.0, np.inf)
        ratio = np.divide(error, expected, out=none, where=expected > 0.0)
        return Outcome(error=float(ratio.max(initial=0.0)))


@dataclass(frozen=True)
class Outcome:
    """What running a row yields; sums of outcomes keep the worst."""

    rays: int = 0  # rays, photons, or values that were compared
    wrong: int = 0  # decisions that differ from the truth where rounding leaves no choice
    # The largest error, in units of what is expected there; above 1, or nan, the row fails. None: nothing
    # is measured.
    error: float | None = None
    broken: int = 0  # errors above the bound that was stated with the result
    undecided: int = 0  # rows marked TANGENT; none of them counts as wrong
    needless: int = 0  # of these, rows that no ray around explains
    work: int = 0  # the largest work of one search, in pieces
    faults: tuple[str, ...] = ()  # any fails the row
    notes: tuple[str, ...] = ()
    curves: tuple[Plot, ...] = ()

    def __add__(self, other: Outcome) -> Outcome:
        """Put two outcomes together."""
        return Outcome(
            self.rays + other.rays,
            self.wrong + other.wrong,
            _larger(self.error, other.error),
            self.broken + other.broken,
            self.undecided + other.undecided,
            self.needless + other.needless,
            max(self.work, other.work),
            self.faults + other.faults,
            self.notes + other.notes,
            self.curves + other.curves,
        )

    @property
    def holds(self) -> bool:
        """Whether the row passes."""
        is_small = self.error is None or self.error <= 1.0
        is_clear = self.needless <= 1 + MOST_NEEDLESS * self.rays
        return is_small and is_clear and not (self.wrong or self.broken or self.faults)

    def checked(self, ok: bool, fault: str) -> Outcome:
        """Return this outcome, with a fault added if a condition does not hold."""
        return self if ok else replace(self, faults=(*self.faults, fault))


def _larger(a: float | None, b: float | None) -> float | None:
    """Return the larger of two errors: of those that are measured, and nan if one is."""
    measured = [error for error in (a, b) if error is not None]
    return float(np.max(measured)) if measured else None


@dataclass(frozen=True)
class Row:
    """One row of the catalogue."""

    id: str
    title: str  # the case, in a few words
    truth: str  # a closed form, high precision, an identity, a refusal
    run: Callable[[Effort], Outcome]
    tests: tuple[str, ...] = ()  # of the suite, which hold the row: `run` has pytest run them


_ROWS: dict[str, Row] = {}


def row(
    row_id: str, title: str, truth: str
) -> Callable[[Callable[[Effort], Outcome]], Callable[[Effort], Outcome]]:
    """Register a function as a row of the catalogue."""

    def register(run: Callable[[Effort], Outcome]) -> Callable[[Effort], Outcome]:
        if row_id in _ROWS:
            raise ValueError(f"row {row_id} is registered twice")
        _ROWS[row_id] = Row(row_id, title, truth, run)
        return run

    return register


def tested(row_id: str, title: str, truth: str, *tests: str) -> None:
    """Register a row that tests of the suite hold, named by file and function."""

    def run(effort: Effort) -> Outcome:
        del effort
        command = [sys.executable, "-m", "pytest", "-q", "-m", "", "-p", "no:cacheprovider"]
        names = [str(TESTS / "hybrid_rt" / test) for test in tests]
        done = subprocess.run(
            [*command, *names], check=False, cwd=TESTS.parent, capture_output=True, text=True
        )
        return Outcome(rays=len(tests)).checked(done.returncode == 0, done.stdout[-500:])

    row(row_id, title, truth)(run)
    _ROWS[row_id] = replace(_ROWS[row_id], tests=tests)


def all_rows() -> dict[str, Row]:
    """Return every row by its id, in order."""
    room = importlib.import_module(__package__ or "")
    for module in pkgutil.iter_modules(room.__path__):
        if module.name.startswith("rows_"):
            importlib.import_module(f"{room.__name__}.{module.name}")
    return dict(sorted(_ROWS.items()))


def all_ids() -> tuple[str, ...]:
    """Return the ids of the catalogue, and of what random search has found."""
    return (*IDS, *(row_id for row_id in all_rows() if row_id not in IDS))
