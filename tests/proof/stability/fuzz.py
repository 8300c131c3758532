"""Random surfaces, rays, scenes and files, and what must be true of all of them.

`run_fuzz` tries new ones for some minutes and keeps each case that fails as a file of numbers;
`strategy` hands the same cases to hypothesis. A kept case below ``found/`` is a row of the catalogue.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshing.outputs import make_folder, replacing
from proof.stability.fuzz_cases import (
    Case,
    Draws,
    NumpyDraws,
    build,
    ray_case,
    surface_case,
)
from proof.stability.fuzz_light import light_case
from proof.stability.fuzz_properties import READERS, REFUSALS, Readers, faults_of
from proof.stability.fuzz_scenes import file_case, scene_case

# Rays of a case, about: half of them hard, the others on lattices and along axes.
N_RAYS = 40
# Steps that cutting down a case may take.
MOST_CUTS = 400
KINDS = ("surfaces", "mixed", "scene", "light", "file")
# Shares of the time of `run_fuzz`.
SHARES = ("surfaces", "surfaces", "mixed", "mixed", "scene", "scene", "light", "file")


@dataclass(frozen=True)
class Failure:
    """A case for which something does not hold.

    Attributes
    ----------
    case : dict
        See `proof.stability.fuzz_cases`.
    faults : tuple of str
    """

    case: Case
    faults: tuple[str, ...]

    def save(self, folder: Path) -> Path:
        """Write it to a file of its own, named by its content."""
        make_folder(folder)
        text = json.dumps({"case": self.case, "faults": list(self.faults)})
        file = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:12]}.json"
        with replacing(file) as opened:
            opened.write(f"{text}\n".encode())
        return file


def read_failure(file: Path) -> Failure:
    """Return what `Failure.save` wrote."""
    kept = json.loads(file.read_text())
    return Failure(kept["case"], tuple(kept["faults"]))


def make_case(draws: Draws, kind: str, endings: tuple[str, ...] = tuple(READERS)) -> Case:
    """Draw a case.

    Parameters
    ----------
    draws : Draws
    kind : "surfaces", "mixed", "scene", "light" or "file"
        Surfaces of one class, a mixture of them, a scene script, a sound one, a damaged file.
    endings : tuple of str
        Of the files.
    """
    if kind == "scene":
        return scene_case(draws)
    if kind == "light":
        return light_case(draws)
    if kind == "file":
        return file_case(draws, endings)
    case: Case = {"kind": "rays", "surfaces": surface_case(draws, kind == "mixed")}
    try:
        surfaces = [build(item) for item in case["surfaces"]]
    except REFUSALS:
        return case | {"origins": [], "directions": []}
    return case | ray_case(draws, surfaces, N_RAYS)


def strategy(kind: str, endings: tuple[str, ...] = tuple(READERS)) -> Any:
    """Return a strategy of hypothesis for cases of a kind; see `make_case`."""
    from hypothesis import strategies as st

    class Drawn:
        def __init__(self, draw: Any) -> None:
            self._draw = draw

        def whole(self, low: int, high: int) -> int:
            return int(self._draw(st.integers(low, high)))

        def one_of(self, choices: Any) -> Any:
            return choices[self.whole(0, len(choices) - 1)]

    @st.composite
    def cases(draw: Any) -> Case:
        return make_case(Drawn(draw), kind, endings)

    return cases()


def run_fuzz(
    minutes: float, seed: int = 0, out: Path | None = None, readers: Readers = READERS
) -> list[Failure]:
    """Try new cases for some minutes.

    Parameters
    ----------
    minutes : float
    seed : int
        Other seeds, other cases.
    out : Path, optional
        Failures are written below it, to ``failures/``.
    readers : mapping, optional
        What reads files, by ending.

    Returns
    -------
    list of Failure, cut down to what is needed to see them.
    """
    end, found, seen = time.monotonic() + 60.0 * minutes, list[Failure](), Counter[str]()
    number = 0
    while time.monotonic() < end:
        draws = NumpyDraws(np.random.default_rng([seed, number]))
        kind = SHARES[number % len(SHARES)]
        number += 1
        failure = tried(draws, kind, readers)
        if failure is None:
            continue
        # The same fault again and again is told a few times.
        seen[_kind_of_fault(failure)] += 1
        if seen[_kind_of_fault(failure)] > 3:
            continue
        small = cut_down(failure, readers)
        found.append(small)
        if out is not None:
            small.save(out / "failures")
    return found


def tried(draws: Draws, kind: str, readers: Readers = READERS) -> Failure | None:
    """Draw a case and return it if something does not hold."""
    case = make_case(draws, kind, tuple(readers))
    faults = faults_of(case, readers)
    return Failure(case, faults) if faults else None


def _kind_of_fault(failure: Failure) -> str:
    classes = sorted({item["class"] for item in failure.case.get("surfaces", [])})
    words = "".join(c for c in failure.faults[0] if not c.isdigit())
    return f"{' '.join(classes)} {words[:60]}"


def cut_down(failure: Failure, readers: Readers = READERS) -> Failure:
    """Leave out surfaces and rays for as long as something still does not hold."""
    if failure.case["kind"] != "rays":
        return failure
    best, cuts = failure, 0
    for key in ("surfaces", "rays"):
        size = max(_count(best.case, key) // 2, 1)
        while size and cuts < MOST_CUTS:
            shrunk, first = False, 0
            while (
                first < _count(best.case, key) and _count(best.case, key) > 1 and cuts < MOST_CUTS
            ):
                case = _without(best.case, key, first, first + size)
                cuts += 1
                faults = faults_of(case, readers) if _count(case, key) else ()
                if faults:
                    best, shrunk = Failure(case, faults), True
                else:
                    first += size
            if not shrunk or size == 1:
                size //= 2
    return best


def _count(case: Case, key: str) -> int:
    return len(case["origins" if key == "rays" else key])


def _without(case: Case, key: str, first: int, stop: int) -> Case:
    keys = ("origins", "directions") if key == "rays" else (key,)
    return case | {name: case[name][:first] + case[name][stop:] for name in keys}
