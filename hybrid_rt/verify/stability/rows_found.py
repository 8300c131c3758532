"""Rows G01, G02, ...: cases that random search has found, kept below ``found/``."""

from __future__ import annotations

from pathlib import Path

from hybrid_rt.verify.stability.row import Effort, Outcome, row

FOUND = Path(__file__).parent / "found"


def _register(number: int, file: Path) -> None:
    from hybrid_rt.verify.stability.fuzz import faults_of, read_failure

    failure = read_failure(file)
    kind = failure.case["kind"]

    @row(f"G{number:02d}", f"found by random search: {file.stem}", "invariances and an oracle")
    def found(effort: Effort) -> Outcome:
        del effort
        faults = faults_of(failure.case)
        n = len(failure.case["origins"]) if kind == "rays" else 1
        return Outcome(rays=n, faults=faults)


for _number, _file in enumerate(sorted(FOUND.glob("*.json")), start=1):
    _register(_number, _file)
