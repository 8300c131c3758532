"""Runs mutants: each traces hard rays, and rows that differ from the original's are judged.

`hybrid_rt.verify.cases.mutants` has the mutants, and says what detects one.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import HitRecord
from hybrid_rt.verify.cases.mutants import PACKAGES, Mutant, applied

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


@dataclass
class Notice:
    """How one set of rays detected a mutant.

    Attributes
    ----------
    set_name : str
    rays : int
        Rays traced up to the first that detects it.
    telling, judged : int
        Rows with new faults, and rows that were judged: differing rows up to the given number.
    faults : dict of int
        Counts of their faults.
    """

    set_name: str
    rays: int
    telling: int
    judged: int
    faults: dict[str, int] = field(default_factory=dict)


@dataclass
class MutantResult:
    """Result of one mutant.

    Attributes
    ----------
    mutant : Mutant
    notices : list of Notice
        Of the sets that detected it.
    differing : int
        Differing rows of all sets.
    failed : str
        End of the error output if the tracer failed; "" otherwise.
    seconds : float
    """

    mutant: Mutant
    notices: list[Notice]
    differing: int
    failed: str
    seconds: float

    @property
    def is_noticed(self) -> bool:
        """Whether any set detected it."""
        return bool(self.notices) or bool(self.failed)


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
    from hybrid_rt.verify.cases.campaign import SCENES
    from hybrid_rt.verify.cases.rays import hard_rays
    from hybrid_rt.verify.cases.singular_campaign import placed_surfaces, trace_cell
    from hybrid_rt.verify.cases.singular_sets import DISTANCES, PLACEMENTS, SETS

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
        for mutant in mutants:
            began = time.perf_counter()
            if mutant.kinds not in baselines:
                found, words = _trace_copy(root, Path(folder), None, mutant.kinds, n, seed)
                if found is None:
                    raise ValueError(f"the packages as they are do not trace: {words}")
                baselines[mutant.kinds] = found
            before = baselines[mutant.kinds]
            after, words = _trace_copy(root, Path(folder), mutant, mutant.kinds, n, seed)
            if after is None:
                yield MutantResult(mutant, [], 0, words, time.perf_counter() - began)
                continue
            notices, differing = compared(before, after, judged, judges)
            yield MutantResult(mutant, notices, differing, "", time.perf_counter() - began)


def _trace_copy(
    root: Path, folder: Path, mutant: Mutant | None, kinds: Sequence[str], n: int, seed: int
) -> tuple[dict[str, NDArray[Any]] | None, str]:
    """Trace by a copy of the packages; return what it wrote, or its last words."""
    copy = folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    for package in PACKAGES:
        shutil.copytree(
            root / package, copy / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    if mutant is not None:
        file, text = applied(copy, mutant)
        file.write_text(text, "utf-8")
    out = folder / "traced.npz"
    out.unlink(missing_ok=True)
    code = (
        "import sys; from hybrid_rt.verify.cases.mutant_campaign import trace_all; "
        f"trace_all({tuple(kinds)!r}, {n}, {seed}, {str(out)!r})"
    )
    # Its own kernels: numba does not see that a function which a kernel calls has changed.
    settings = {
        **os.environ, "PYTHONPATH": str(copy), "NUMBA_CACHE_DIR": str(copy / "kernels"),
    }  # fmt: skip
    try:
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=copy, env=settings, check=False,
            capture_output=True, text=True, timeout=TIMEOUT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None, f"no end within {TIMEOUT:.0f} s"
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
        return None, lines[-1]
    with np.load(out) as file:
        return {key: file[key] for key in file.files}, ""


COLUMNS = ("t", "t_bound", "object_id", "patch_id", "u", "v", "status")


def compared(
    before: dict[str, NDArray[Any]],
    after: dict[str, NDArray[Any]],
    judged: int,
    judges: dict[tuple[str, str], Any],
) -> tuple[list[Notice], int]:
    """Judge rows that differ, set by set."""
    keys = list(dict.fromkeys(key.rsplit("|", 1)[0] for key in after))
    by_set: dict[str, list[str]] = {}
    for key in keys:
        by_set.setdefault(key.split("|")[0], []).append(key)
    notices, differing = [], 0
    for name, cells in by_set.items():
        rows: list[tuple[int, int, str, int]] = []
        passed = 0
        for key in cells:
            changed, decided = _differing(before, after, key)
            differing += len(changed)
            # Other decisions first, then other bounds; in each in the order of the rays.
            rows += [
                (0 if row in decided else 1, passed + row, key, row) for row in changed.tolist()
            ]
            passed += len(after[f"{key}|t"])
        rows.sort()
        notice = Notice(name, 0, 0, 0)
        for _, number, key, row in rows[:judged]:
            notice.judged += 1
            faults = _new_faults(before, after, key, row, judges)
            if faults:
                notice.telling += 1
                notice.rays = min(notice.rays or number + 1, number + 1)
                for fault in faults:
                    notice.faults[fault] = notice.faults.get(fault, 0) + 1
        if notice.telling:
            notices.append(notice)
    return notices, differing


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
    from hybrid_rt.verify.cases.campaign import SCENES
    from hybrid_rt.verify.cases.singular_campaign import placed_surfaces
    from hybrid_rt.verify.exact.judge import ExactJudge

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
