"""Random surfaces, rays and scenes, and what must be true of all of them.

`run_fuzz` tries new ones for some minutes and keeps each case that fails as a file of numbers;
`strategy` hands the same cases to hypothesis. A kept case below ``found/`` is a row of the catalogue.
"""

from __future__ import annotations

import hashlib
import json
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import hypothesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from meshing.outputs import make_folder, replacing
from proof.stability.fuzz_cases import Case, Draws, build, ray_case, surface_case
from proof.stability.fuzz_properties import REFUSALS, faults_of
from proof.stability.fuzz_scenes import scene_case

# Rays of a case, about: half of them hard, the others on lattices and along axes.
N_RAYS = 40
# Shares of the time of `run_fuzz`.
SHARES = ("surfaces", "surfaces", "mixed", "mixed", "scene", "scene")


@dataclass(frozen=True)
class Failure:
    """A case for which something does not hold, and what."""

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


def make_case(draws: Draws, kind: str) -> Case:
    """Draw surfaces of one class, a mixture of them, or a scene script."""
    if kind == "scene":
        return scene_case(draws)
    case: Case = {"kind": "rays", "surfaces": surface_case(draws, kind == "mixed")}
    try:
        surfaces = [build(item) for item in case["surfaces"]]
    except REFUSALS:
        return case | {"origins": [], "directions": []}
    rays = ray_case(draws, surfaces, N_RAYS)
    # Sometimes few of them, so that a case that fails can be cut down.
    are_few, some = draws.whole(0, 7) == 0, draws.whole(1, N_RAYS)
    count = some if are_few else N_RAYS
    return case | {name: rows[:count] for name, rows in rays.items()}


@st.composite
def strategy(draw: st.DrawFn, kind: str) -> Case:
    """Cases of a kind, for hypothesis; see `make_case`."""
    return make_case(Draws(draw), kind)


def run_fuzz(minutes: float, seed: int = 0, out: Path | None = None) -> list[Failure]:
    """Try new cases for some minutes; return one failure of each kind, cut down.

    They are written below ``out``, to ``failures/``.
    """
    end, found = time.monotonic() + 60.0 * minutes, dict[str, Failure]()
    number = 0
    while time.monotonic() < end:
        kind = SHARES[number % len(SHARES)]
        failure = searched(kind, 1_000_003 * seed + number)
        number += 1
        if failure is None or _kind_of_fault(failure) in found:
            continue
        found[_kind_of_fault(failure)] = failure
        if out is not None:
            failure.save(out / "failures")
    return list(found.values())


def searched(kind: str, seed: int, n: int = 10) -> Failure | None:
    """Try n cases of a kind; return the smallest that hypothesis finds for which something fails."""
    last: list[Failure] = []

    @hypothesis.seed(seed)
    @settings(
        max_examples=n, database=None, deadline=None, report_multiple_bugs=False,
        phases=(Phase.generate, Phase.shrink), suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(strategy(kind))
    def holds(case: Case) -> None:
        faults = faults_of(case)
        if faults:
            last[:] = [Failure(case, faults)]
            raise AssertionError(faults[0])

    # It runs the smallest case last.
    with suppress(AssertionError, hypothesis.errors.Flaky):
        holds()
    return last[0] if last else None


def _kind_of_fault(failure: Failure) -> str:
    classes = sorted({item["class"] for item in failure.case.get("surfaces", [])})
    words = "".join(c for c in failure.faults[0] if not c.isdigit())
    return f"{' '.join(classes)} {words[:60]}"
