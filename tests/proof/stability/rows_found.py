"""Rows G01, G02, ...: cases that random search has found, kept below ``found/`` as G01_what_is_wrong.json."""

from __future__ import annotations

from pathlib import Path

from proof.stability.row import Effort, Outcome, row

FOUND = Path(__file__).parent / "found"


def _register(file: Path) -> None:
    from proof.stability.fuzz import read_failure
    from proof.stability.fuzz_properties import faults_of

    failure = read_failure(file)
    kind = failure.case["kind"]
    row_id, _, title = file.stem.partition("_")

    @row(row_id, title.replace("_", " "), "invariances, an oracle, exact arithmetic")
    def found(effort: Effort) -> Outcome:
        del effort
        faults = faults_of(failure.case)
        n = len(failure.case["origins"]) if kind == "rays" else 1
        return Outcome(rays=n, faults=faults)


for _file in sorted(FOUND.glob("G*.json")):
    _register(_file)
