"""Runs mutants: each traces hard rays, and rows that differ from the original's are judged.

`proof.cases.mutants` has the mutants, and says what detects one.
"""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from hybrid_rt.core.records import BoolArray
from hybrid_rt.intersection import Intersector
from proof.cases.campaign import HARD, SINGULAR, Batch, placed_surfaces, trace_cell
from proof.cases.mutants import PACKAGES, Mutant, applied
from proof.cases.rays import hard_rays
from proof.cases.scenes import SCENES
from proof.cases.singular_sets import DISTANCES, PLACEMENTS, SETS
from proof.exact.judge import ExactJudge

Key: TypeAlias = tuple[str, str, float]
"""A singular set, or a scene of `HARD` rays; its placement; the distance."""
Traced: TypeAlias = dict[Key, "Batch"]

# Ordinary hard rays of `rays.hard_rays`, besides those at singular sets: scenes of each kind.
ORDINARY = {
    "patches": ("teapot", "patches"),
    "rational": (),
    "turned": ("vase", "torus"),
    "closed": ("closed forms",),
    "mesh": ("mesh",),
}
# So many ordinary rays for each ray of a cell.
ORDINARY_SHARE = 200
# A search without end is noticed as well.
TIMEOUT = 1800.0
BROKEN = "does not compile"
# What Python and numba raise for code that cannot run.
NO_PROGRAM = ("SyntaxError", "NameError", "ImportError", "TypingError", "LoweringError")
COLUMNS = ("t", "t_bound", "object_id", "patch_id", "u", "v", "status")


@dataclass(frozen=True)
class Notice:
    """The ray that detected a mutant: its number in a set, and faults that it has by the mutant."""

    set_name: str
    row: int
    faults: list[str]


@dataclass(frozen=True)
class MutantResult:
    """Result of one mutant: rows that differ, those that were judged, the tracer's last words."""

    mutant: Mutant
    notice: Notice | None
    differing: int
    judged: int
    failed: str
    seconds: float

    @property
    def is_noticed(self) -> bool:
        """Whether any ray detected it, or the tracer failed; what does not compile tells nothing."""
        return self.notice is not None or bool(self.failed and not self.is_broken)

    @property
    def is_broken(self) -> bool:
        """Whether the mutant is no program, so that it was not tried."""
        return self.failed.startswith(BROKEN)


def trace_all(kinds: Sequence[str], n: int, seed: int, out: str) -> None:
    """Trace n rays of all cells of some kinds, and pickle the batches."""
    found: Traced = {}
    for name, entry in SETS.items():
        for place in PLACEMENTS if entry.kind in kinds else ():
            try:
                tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
            except ValueError:
                break  # refused
            for distance in DISTANCES:
                found[name, place, distance] = trace_cell(tracer, name, distance, place, n, seed)
    for scene in (scene for kind in kinds for scene in ORDINARY[kind]):
        surfaces = SCENES[scene]()
        rays = hard_rays(surfaces, ORDINARY_SHARE * n, seed)
        tracer = Intersector(surfaces, coarse="none", threads=1)
        hits = tracer.intersect(rays.origins, rays.directions)
        found[f"hard rays, {scene}", "home", 1.0] = Batch("", hits, rays.origins, rays.directions)
    Path(out).write_bytes(pickle.dumps(found))


def run_mutants(
    mutants: Sequence[Mutant], n: int, seed: int, judged: int = 100
) -> Iterator[MutantResult]:
    """Run mutants, one after the other, by n rays of a cell; judge at most so many rows of each set.

    Each is applied to a copy of the packages. Compiled kernels are copied with them, and are stamped by
    the content of the files that they are compiled from: those that a mutant concerns are compiled anew.
    """
    root = Path(__file__).resolve().parents[3]
    baselines: dict[tuple[str, ...], Traced] = {}
    judges: dict[tuple[str, str], Any] = {}
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        original, copy = Path(folder) / "original", Path(folder) / "copy"
        for package in PACKAGES:
            shutil.copytree(root / package, original / package)
        for mutant in mutants:
            began = time.perf_counter()
            if mutant.kinds not in baselines:
                found, words = _traced(original, mutant.kinds, n, seed)
                if found is None:
                    raise ValueError(f"the packages as they are do not trace: {words}")
                baselines[mutant.kinds] = found
            shutil.rmtree(copy, ignore_errors=True)
            shutil.copytree(original, copy)
            changed, text = applied(copy, mutant)
            changed.write_text(text, "utf-8")
            after, words = _traced(copy, mutant.kinds, n, seed)
            told: tuple[Notice | None, int, int] = None, 0, 0
            if after is not None:
                told = compared(baselines[mutant.kinds], after, judged, judges)
            yield MutantResult(mutant, *told, words, time.perf_counter() - began)


def _traced(packages: Path, kinds: Sequence[str], n: int, seed: int) -> tuple[Traced | None, str]:
    """Trace rays by packages in a folder; return what was written, or the process' last words."""
    out = packages / "traced.pickle"
    code = (
        "from proof.cases.mutant_campaign import trace_all; "
        f"trace_all({tuple(kinds)!r}, {n}, {seed}, {str(out)!r})"
    )
    path = os.pathsep.join([str(packages), str(Path(__file__).resolve().parents[2])])
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=packages, env={**os.environ, "PYTHONPATH": path},
            check=False, capture_output=True, text=True, timeout=TIMEOUT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None, f"no end within {TIMEOUT:.0f} s"
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        is_broken = any(error in done.stderr for error in NO_PROGRAM)
        return None, f"{BROKEN}: {last}" if is_broken else last
    return pickle.loads(out.read_bytes()), ""


def compared(
    before: Traced, after: Traced, judged: int, judges: dict[tuple[str, str], Any]
) -> tuple[Notice | None, int, int]:
    """Judge rows that differ, until one tells; return how many differ, and how many were judged."""
    for key in before:
        if key not in after:
            return Notice(key[0], 0, ["its surfaces are refused"]), 0, 0
    # Other decisions first, then other bounds; in each a row of every set by turns.
    rows: list[tuple[bool, int, int, Key, int]] = []
    traced: Counter[str] = Counter()
    of_set: Counter[tuple[str, bool]] = Counter()
    for key, batch in before.items():
        differs, decides = _differing(batch, after[key])
        for row in np.flatnonzero(differs).tolist():
            kind = key[0], bool(decides[row])
            rows.append((not kind[1], of_set[kind], traced[key[0]] + row, key, row))
            of_set[kind] += 1
        traced[key[0]] += len(after[key].hits)
    judged_of: Counter[str] = Counter()
    for _, _, number, key, row in sorted(rows):
        if judged_of[key[0]] >= judged:
            continue
        judged_of[key[0]] += 1
        old, new = (_faults(key, batches[key], row, judges) for batches in (before, after))
        if new - old:
            return Notice(key[0], number, sorted(new - old)), len(rows), judged_of.total()
    return None, len(rows), judged_of.total()


def _differing(before: Batch, after: Batch) -> tuple[BoolArray, BoolArray]:
    """Tell of the same rays of a cell whose rows differ, and whose decisions do."""
    count = min(len(before.hits), len(after.hits))
    one, two = before.hits[:count], after.hits[:count]

    def differ(name: str) -> BoolArray:
        a, b = getattr(one, name), getattr(two, name)
        return np.asarray((a != b) & ~((a != a) & (b != b)))  # noqa: PLR0124

    same = (before.origins[:count] == after.origins[:count]).all(axis=1)
    same &= (before.directions[:count] == after.directions[:count]).all(axis=1)
    differs = same & np.any([differ(name) for name in COLUMNS], axis=0)
    with np.errstate(invalid="ignore"):
        is_far = np.abs(one.t - two.t) > 1e-9 * np.abs(one.t)
    return differs, differ("object_id") | differ("status") | is_far


def _faults(key: Key, batch: Batch, row: int, judges: dict[tuple[str, str], Any]) -> set[str]:
    """Return what exact arithmetic finds wrong with a row."""
    name, place, distance = key
    if (name, place) not in judges:
        scene = name.removeprefix("hard rays, ")
        sort = SINGULAR if scene == name else HARD
        judges[name, place] = ExactJudge(placed_surfaces(scene, place, sort))
    judge, one = judges[name, place], slice(row, row + 1)
    verdict = judge.judge(
        batch.hits[one], batch.origins[one], batch.directions[one],
        distance=np.array([distance * judge.scene.size]),
        leaves=None if batch.leaves is None else batch.leaves[one],
    )  # fmt: skip
    return set(verdict.examples) - {"left open"}
