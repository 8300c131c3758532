"""Page of a run of the catalogue of hard cases: verdicts, and plots of error and work.

There is one plot for each difficulty parameter. A mark is the largest error measured at its abscissa; its
bar reaches to what theory allows for that very ray.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, save
from hybrid_rt.analysis.page import Study, page
from hybrid_rt.analysis.tables import Table
from meshing.outputs import make_folder

# An error of 0 has no logarithm: it stands here, below any rounding; an expected one above this is none.
NOTHING, ANYTHING = 1e-19, 1e6

HEAD = (
    "row", "verdict", "rays", "wrong", "error", "broken", "TANGENT", "work", "seconds", "case", "truth"
)  # fmt: skip
READ = """
A row holds if no decision is wrong where rounding leaves no choice, no error is above what is expected
there, no bound that was stated with a result is broken, and nothing else that must hold fails.
|rays: rays or values compared. wrong: decisions that differ from the truth. error: the largest, in units
of what is expected there; for first hits of rays that is 64 eps x scale / cos, with scale the larger of
the way to the object and its size. broken: errors above the stated bound. TANGENT: rows that say that
rounding decides. work: the largest search, in pieces.
|In the plots a mark is the largest error measured at its abscissa; its bar reaches to what theory allows
for that very ray. Errors of 0 stand at the lower edge, at 1e-19.
""".strip().split("|")


def summary(rows: Sequence[Mapping[str, Any]], machine: str, version: str, seconds: float) -> str:
    """Summarise a run in one sentence."""
    verdicts = [row["verdict"] for row in rows]
    hold, left = verdicts.count("holds"), sum(v.startswith("not built") for v in verdicts)
    fail, rays = len(rows) - hold - left, sum(row["rays"] for row in rows)
    return (
        f"{hold} rows hold, {fail} fail, {left} not built; {rays:,} rays; {machine}; "
        f"hybrid_rt {version}; {seconds:.0f} s"
    )


def stability_page(rows: Sequence[Mapping[str, Any]], sentence: str) -> str:
    """Return a self-contained HTML page of a run, without plots if matplotlib is not installed."""
    cells = [
        (
            row["id"], row["verdict"], f"{row['rays']:,}", str(row["wrong"]), error_words(row["error"]),
            str(row["broken"]), str(row["undecided"]), str(row["work"]), f"{row['seconds']:.1f}",
            row["title"], row["truth"],
        )
        for row in rows
    ]  # fmt: skip
    said = [(row["id"], words) for row in rows for words in (*row["faults"], *row["notes"])]
    tables = [Table("Rows", HEAD, cells)]
    tables += [Table("Faults and notes", ("row", "what"), said)] if said else []
    found = diagrams(rows) if find_spec("matplotlib") else []
    return page(Study("Hard cases", answer=sentence, details=READ, diagrams=found, tables=tables))


def diagrams(rows: Sequence[Mapping[str, Any]]) -> list[Diagram]:
    """Group the curves of all rows by their x axis and unit."""
    groups: dict[tuple[str, str], list[tuple[str, Mapping[str, Any]]]] = {}
    for row in rows:
        for curve in row["curves"]:
            if curve["x"]:
                group = groups.setdefault((curve["against"], curve["unit"]), [])
                group.append((f"{row['id']} {curve['label']}", curve))
    found = []
    for (against, unit), curves in groups.items():
        lines = [Line(name, _marks(curve)) for name, curve in curves]
        found.append(Diagram(f"Error {against}", against, f"largest error ({unit})", lines))
        working = [
            Line(name, [Mark((x,) * 3, (max(y, 1.0),) * 3) for x, y in zip(c["x"], c["work"], strict=True)])
            for name, c in curves
            if any(c["work"])
        ]  # fmt: skip
        if working:
            found.append(Diagram(f"Work {against}", against, "largest search (pieces)", working))
    return found


def _marks(curve: Mapping[str, Any]) -> list[Mark]:
    marks = []
    for x, error, expected in zip(curve["x"], curve["error"], curve["expected"], strict=True):
        y = min(max(error, NOTHING), ANYTHING) if math.isfinite(error) else ANYTHING
        limit = expected if NOTHING < expected < ANYTHING else y
        marks.append(Mark((x, x, x), (y, min(y, limit), max(y, limit))))
    return marks


def save_panels(rows: Sequence[Mapping[str, Any]], directory: Path) -> None:
    """Write every plot as a PNG file."""
    make_folder(directory)
    for diagram in diagrams(rows):
        name = re.sub("[^a-z0-9]+", "_", diagram.title.lower()).strip("_")
        save([diagram], directory / f"{name}.png")


def error_words(error: float | None) -> str:
    """Return an error in units of what is expected; a dash where nothing is measured."""
    return "-" if error is None else f"{error:.2g}"
