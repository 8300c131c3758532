"""Runs mutants: each traces hard rays, and rows that differ from the original's are judged.

`proof.cases.mutants` has the mutants, and says what detects one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import HitRecord
from proof.cases.mutants import PACKAGES, Mutant, applied

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


@dataclass(frozen=True)
class Notice:
    """The ray that detected a mutant.

    Attributes
    ----------
    set_name : str
    row : int
        Its number among the rays of the set, from 0.
    faults : list of str
        Faults that its row does not have without the mutant.
    """

    set_name: str
    row: int
    faults: list[str]


@dataclass(frozen=True)
class MutantResult:
    """Result of one mutant.

    Attributes
    ----------
    mutant : Mutant
    notice : Notice or None
    differing, judged : int
        Rows of all sets that differ from the original's, and those that were judged.
    failed : str
        End of the error output if the tracer failed; "" otherwise.
    seconds : float
    """

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
    """Trace the rays of all cells of some kinds, and write hits and rays to a file.

    Parameters
    ----------
    kinds : sequence of str
    n, seed : int
        Rays of a cell.
    out : str
        A .npz file; keys are ``set|place|distance|column``.
    """
    from hybrid_rt.intersection import Intersector
    from proof.cases.campaign import SCENES
    from proof.cases.rays import hard_rays
    from proof.cases.singular_campaign import placed_surfaces, trace_cell
    from proof.cases.singular_sets import DISTANCES, PLACEMENTS, SETS

    arrays: dict[str, NDArray[Any]] = {}

    def keep(key: str, hits: HitRecord, origins: Any, directions: Any) -> None:
        for item in fields(hits):
            arrays[f"{key}|{item.name}"] = getattr(hits, item.name)
        arrays[f"{key}|origins"], arrays[f"{key}|directions"] = origins, directions

    for name, entry in SETS.items():
        if entry.kind not in kinds:
            continue
        for place in PLACEMENTS:
            try:
                tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
            except ValueError:
                break  # refused
            for distance in DISTANCES:
                cell = trace_cell(tracer, name, distance, place, n, seed)
                key = f"{name}|{place}|{distance!r}"
                keep(key, cell.hits, cell.origins, cell.directions)
                if cell.source is not None:
                    arrays[f"{key}|leaves"] = cell.source.object_id
    for kind in kinds:
        for scene in ORDINARY[kind]:
            surfaces = SCENES[scene]()
            rays = hard_rays(surfaces, ORDINARY_SHARE * n, seed)
            hits = Intersector(surfaces, coarse="none", threads=1).intersect(
                rays.origins, rays.directions
            )
            keep(f"hard rays, {scene}|home|1.0", hits, rays.origins, rays.directions)
    np.savez(out, **arrays)  # type: ignore[arg-type]


def run_mutants(
    mutants: Sequence[Mutant], n: int, seed: int, judged: int = 100
) -> Iterator[MutantResult]:
    """Run mutants, one after the other.

    Parameters
    ----------
    mutants : sequence of Mutant
    n, seed : int
        Rays of a cell.
    judged : int
        Largest number of rows of each set to be judged.
    """
    root = Path(__file__).resolve().parents[3]
    baselines: dict[tuple[str, ...], dict[str, NDArray[Any]]] = {}
    judges: dict[tuple[str, str], Any] = {}
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copy = _Copy(root, Path(folder))
        for mutant in mutants:
            began = time.perf_counter()
            if mutant.kinds not in baselines:
                found, words = copy.trace(None, mutant.kinds, n, seed)
                if found is None:
                    raise ValueError(f"the packages as they are do not trace: {words}")
                baselines[mutant.kinds] = found
            after, words = copy.trace(mutant, mutant.kinds, n, seed)
            if after is None:
                yield MutantResult(mutant, None, 0, 0, words, time.perf_counter() - began)
                continue
            found_by = compared(baselines[mutant.kinds], after, judged, judges)
            yield MutantResult(mutant, *found_by, "", time.perf_counter() - began)


class _Copy:
    """A copy of the packages, in which one mutant at a time is applied.

    Compiled kernels are copied with them, and are stamped by the content of the files that they are
    compiled from: those that a mutant concerns are compiled anew.

    Parameters
    ----------
    root : Path
        Folder of the packages.
    folder : Path
    """

    def __init__(self, root: Path, folder: Path) -> None:
        self.root, self.original, self.copy = root, folder / "original", folder / "copy"
        for package in PACKAGES:
            shutil.copytree(root / package, self.original / package)

    def trace(
        self, mutant: Mutant | None, kinds: Sequence[str], n: int, seed: int
    ) -> tuple[dict[str, NDArray[Any]] | None, str]:
        """Trace rays by the copy; return what it wrote, or its last words."""
        copy = self.original
        if mutant is not None:
            copy = self.copy
            shutil.rmtree(copy, ignore_errors=True)
            shutil.copytree(self.original, copy)
            changed, text = applied(copy, mutant)
            changed.write_text(text, "utf-8")
        out = copy / "traced.npz"
        code = (
            "import sys; from proof.cases.mutant_campaign import trace_all; "
            f"trace_all({tuple(kinds)!r}, {n}, {seed}, {str(out)!r})"
        )
        path = os.pathsep.join([str(copy), str(self.root / "tests")])
        settings = {**os.environ, "PYTHONPATH": path}
        try:
            done = subprocess.run(
                [sys.executable, "-c", code], cwd=copy, env=settings, check=False,
                capture_output=True, text=True, timeout=TIMEOUT,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return None, f"no end within {TIMEOUT:.0f} s"
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            is_broken = any(error in done.stderr for error in NO_PROGRAM)
            return None, f"{BROKEN}: {lines[-1]}" if is_broken else lines[-1]
        with np.load(out) as file:
            return {key: file[key] for key in file.files}, ""


BROKEN = "does not compile"
# What Python and numba raise for code that cannot run.
NO_PROGRAM = ("SyntaxError", "NameError", "ImportError", "TypingError", "LoweringError")
COLUMNS = ("t", "t_bound", "object_id", "patch_id", "u", "v", "status")


def compared(
    before: dict[str, NDArray[Any]],
    after: dict[str, NDArray[Any]],
    judged: int,
    judges: dict[tuple[str, str], Any],
) -> tuple[Notice | None, int, int]:
    """Judge rows that differ, until one tells.

    Returns
    -------
    notice : Notice or None
    differing, judged : int
        Rows that differ, and those that were judged.
    """
    keys = dict.fromkeys(key.rsplit("|", 1)[0] for key in after)
    for key in before:
        if key not in after:
            return Notice(key.split("|")[0], 0, ["its surfaces are refused"]), 0, 0
    # Other decisions first, then other bounds; in each a row of every set by turns.
    rows: list[tuple[bool, int, int, str, int]] = []
    differing = 0
    traced: Counter[str] = Counter()
    of_set: Counter[tuple[str, bool]] = Counter()
    for key in keys:
        name = key.split("|")[0]
        changed, decided = _differing(before, after, key)
        differing += len(changed)
        for row in changed.tolist():
            kind = name, row in decided
            rows.append((not kind[1], of_set[kind], traced[name] + row, key, row))
            of_set[kind] += 1
        traced[name] += len(after[f"{key}|t"])
    judged_of: Counter[str] = Counter()
    for _, _, number, key, row in sorted(rows):
        name = key.split("|")[0]
        if judged_of[name] >= judged:
            continue
        judged_of[name] += 1
        faults = _new_faults(before, after, key, row, judges)
        if faults:
            return Notice(name, number, faults), differing, judged_of.total()
    return None, differing, judged_of.total()


def _differing(
    before: dict[str, NDArray[Any]], after: dict[str, NDArray[Any]], key: str
) -> tuple[NDArray[np.int64], set[int]]:
    """Return rows of a cell that differ, of the same rays; and those whose decision does."""
    count = min(len(before.get(f"{key}|t", ())), len(after[f"{key}|t"]))
    same = np.ones(count, np.bool_)
    for name in ("origins", "directions"):
        same &= (before[f"{key}|{name}"][:count] == after[f"{key}|{name}"][:count]).all(axis=1)
    differs, decides = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    for name in COLUMNS:
        a, b = before[f"{key}|{name}"][:count], after[f"{key}|{name}"][:count]
        differs |= (a != b) & ~((a != a) & (b != b))  # noqa: PLR0124
    for name in ("object_id", "status"):
        decides |= before[f"{key}|{name}"][:count] != after[f"{key}|{name}"][:count]
    a, b = before[f"{key}|t"][:count], after[f"{key}|t"][:count]
    with np.errstate(invalid="ignore"):
        decides |= np.abs(a - b) > 1e-9 * np.abs(a)
    return np.flatnonzero(same & differs), set(np.flatnonzero(same & decides).tolist())


def _new_faults(
    before: dict[str, NDArray[Any]],
    after: dict[str, NDArray[Any]],
    key: str,
    row: int,
    judges: dict[tuple[str, str], Any],
) -> list[str]:
    """Return the faults of a row that it did not have before."""
    old, new = (_faults(traced, key, row, judges) for traced in (before, after))
    return sorted(new - old)


def _faults(
    traced: dict[str, NDArray[Any]], key: str, row: int, judges: dict[tuple[str, str], Any]
) -> set[str]:
    from proof.cases.campaign import SCENES
    from proof.cases.singular_campaign import placed_surfaces
    from proof.exact.judge import ExactJudge

    name, place, distance = key.split("|")
    if (name, place) not in judges:
        scene = name.removeprefix("hard rays, ")
        surfaces = SCENES[scene]() if scene != name else placed_surfaces(name, place)
        judges[name, place] = ExactJudge(surfaces)
    judge = judges[name, place]
    columns = {item.name: traced[f"{key}|{item.name}"][row : row + 1] for item in fields(HitRecord)}
    leaves = traced.get(f"{key}|leaves")
    verdict = judge.judge(
        HitRecord(**columns),
        traced[f"{key}|origins"][row : row + 1],
        traced[f"{key}|directions"][row : row + 1],
        distance=np.array([float(distance) * judge.scene.size]),
        leaves=None if leaves is None else leaves[row : row + 1],
    )
    return set(verdict.examples) - {"left open"}
