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
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import HitRecord
from proof.cases.mutants import PACKAGES, Mutant, applied

Traced: TypeAlias = dict[str, NDArray[Any]]
"""Columns of hits, and rays, by ``set|place|distance|column``."""

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
    """Trace n rays of all cells of some kinds, and write hits and rays to a .npz file."""
    from hybrid_rt.intersection import Intersector
    from proof.cases.campaign import placed_surfaces, trace_cell
    from proof.cases.rays import hard_rays
    from proof.cases.scenes import SCENES
    from proof.cases.singular_sets import DISTANCES, PLACEMENTS, SETS

    arrays: Traced = {}

    def keep(key: str, hits: HitRecord, origins: Any, directions: Any) -> None:
        for item in fields(hits):
            arrays[f"{key}|{item.name}"] = getattr(hits, item.name)
        arrays[f"{key}|origins"], arrays[f"{key}|directions"] = origins, directions

    for name, entry in SETS.items():
        for place in PLACEMENTS if entry.kind in kinds else ():
            try:
                tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
            except ValueError:
                break  # refused
            for distance in DISTANCES:
                cell = trace_cell(tracer, name, distance, place, n, seed)
                key = f"{name}|{place}|{distance!r}"
                keep(key, cell.hits, cell.origins, cell.directions)
                if cell.leaves is not None:
                    arrays[f"{key}|leaves"] = cell.leaves
    for scene in (scene for kind in kinds for scene in ORDINARY[kind]):
        surfaces = SCENES[scene]()
        rays = hard_rays(surfaces, ORDINARY_SHARE * n, seed)
        tracer = Intersector(surfaces, coarse="none", threads=1)
        hits = tracer.intersect(rays.origins, rays.directions)
        keep(f"hard rays, {scene}|home|1.0", hits, rays.origins, rays.directions)
    np.savez(out, **arrays)  # type: ignore[arg-type]


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
    out = packages / "traced.npz"
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
    with np.load(out) as file:
        return {key: file[key] for key in file.files}, ""


def compared(
    before: Traced, after: Traced, judged: int, judges: dict[tuple[str, str], Any]
) -> tuple[Notice | None, int, int]:
    """Judge rows that differ, until one tells; return how many differ, and how many were judged."""
    for key in before:
        if key not in after:
            return Notice(key.split("|")[0], 0, ["its surfaces are refused"]), 0, 0
    # Other decisions first, then other bounds; in each a row of every set by turns.
    rows: list[tuple[bool, int, int, str, int]] = []
    traced: Counter[str] = Counter()
    of_set: Counter[tuple[str, bool]] = Counter()
    for key in dict.fromkeys(key.rsplit("|", 1)[0] for key in after):
        name = key.split("|")[0]
        differs, decides = _differing(before, after, key)
        for row in np.flatnonzero(differs).tolist():
            kind = name, bool(decides[row])
            rows.append((not kind[1], of_set[kind], traced[name] + row, key, row))
            of_set[kind] += 1
        traced[name] += len(after[f"{key}|t"])
    judged_of: Counter[str] = Counter()
    for _, _, number, key, row in sorted(rows):
        name = key.split("|")[0]
        if judged_of[name] >= judged:
            continue
        judged_of[name] += 1
        old, new = (_faults(traced, key, row, judges) for traced in (before, after))
        if new - old:
            return Notice(name, number, sorted(new - old)), len(rows), judged_of.total()
    return None, len(rows), judged_of.total()


def _differing(before: Traced, after: Traced, key: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """Tell of the same rays of a cell whose rows differ, and whose decisions do."""
    count = min(len(before.get(f"{key}|t", ())), len(after[f"{key}|t"]))

    def differ(name: str) -> NDArray[Any]:
        a, b = before[f"{key}|{name}"][:count], after[f"{key}|{name}"][:count]
        return np.asarray((a != b) & ~((a != a) & (b != b)))  # noqa: PLR0124

    same = ~(differ("origins").any(axis=1) | differ("directions").any(axis=1))
    differs = same & np.any([differ(name) for name in COLUMNS], axis=0)
    a, b = before[f"{key}|t"][:count], after[f"{key}|t"][:count]
    with np.errstate(invalid="ignore"):
        decides = differ("object_id") | differ("status") | (np.abs(a - b) > 1e-9 * np.abs(a))
    return differs, decides


def _faults(
    traced: Traced, key: str, row: int, judges: dict[tuple[str, str], Any]
) -> set[str]:  # fmt: skip
    """Return what exact arithmetic finds wrong with a row."""
    from proof.cases.campaign import HARD, SINGULAR, placed_surfaces
    from proof.exact.judge import ExactJudge

    name, place, distance = key.split("|")
    if (name, place) not in judges:
        scene = name.removeprefix("hard rays, ")
        sort = SINGULAR if scene == name else HARD
        judges[name, place] = ExactJudge(placed_surfaces(scene, place, sort))
    judge, one = judges[name, place], slice(row, row + 1)
    leaves = traced.get(f"{key}|leaves")
    verdict = judge.judge(
        HitRecord(**{item.name: traced[f"{key}|{item.name}"][one] for item in fields(HitRecord)}),
        traced[f"{key}|origins"][one],
        traced[f"{key}|directions"][one],
        distance=np.array([float(distance) * judge.scene.size]),
        leaves=None if leaves is None else leaves[one],
    )
    return set(verdict.examples) - {"left open"}
