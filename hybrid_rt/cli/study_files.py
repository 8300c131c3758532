"""Studies as text and as files: curves.json, curves.csv, tables.tex, curves.png, curves.pdf and page.html."""

import csv
import importlib.util
import io
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from hybrid_rt.analysis import tables
from hybrid_rt.analysis.curves import Curve, Point, Spread
from hybrid_rt.analysis.diagrams import save, save_pdf
from hybrid_rt.analysis.page import Study, page
from hybrid_rt.cli.command import check_results, say
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.sensor.image_files import is_report
from meshing.outputs import replacing

# seconds and error: of a picture, and its relative RMSE; of a ray, and the share of wrong first hits.
CSV_HEAD = ("part", "method", "setting", "run", "seconds", "error")
# What the figures of a curve hold beside its name, flags and points.
OF_CURVE = (
    "bias", "power", "bias_known_by", "left_out", "bias_at_most", "unfound", "error_by_unfound",
    "converges",
)  # fmt: skip


def publish_study(study: Study, data: dict[str, Any], folder: Path | None) -> None:
    """Write a study and print it: files first, as the reader of a pipe may have closed it."""
    written = [] if folder is None else _write(folder, study, data)
    _print(study)
    if written:
        say(f"\nwrote {', '.join(str(file) for file in written)}")


def _print(study: Study) -> None:
    say(study.title)
    for name, value in study.measured:
        say(f"  {name:12s} {value}")
    for table in study.tables:
        say(f"\n{tables.in_text(table)}")
    say("")
    for sentence in study.findings:
        say(f"- {sentence}")
    if study.asked:
        say(f"\n{study.asked}")
    if study.answer:
        say(study.answer)
    for sentence in study.details:
        say(f"- {sentence}")
    if study.command:
        say(f"\n  {study.command}")


def _names() -> list[str]:
    """Return the names of the files that are written for every study or comparison."""
    has_plots = importlib.util.find_spec("matplotlib") is not None
    plots = ["curves.png", "curves.pdf", "page.html"] if has_plots else []
    return ["curves.json", "curves.csv", "tables.tex", *plots]


def check_folder(folder: Path) -> None:
    """Make the folder, and say before the work if a file cannot be written."""
    check_results(
        folder,
        _names(),
        lambda held: isinstance(held, dict) and (is_report(held) or "compared" in held),
    )


def _write(folder: Path, study: Study, data: dict[str, Any]) -> list[Path]:
    """Write the files of a study, each whole or not at all; return them."""
    rows = io.StringIO(newline="")
    csv.writer(rows).writerows([CSV_HEAD, *_runs(data)])
    texts: dict[str, Callable[[], str]] = {
        ".json": lambda: as_json(data), ".csv": rows.getvalue, ".html": lambda: page(study),
        ".tex": lambda: "\n".join(map(tables.in_latex, study.tables)),
    }  # fmt: skip
    pictures = {".png": save, ".pdf": save_pdf}
    files = [folder / name for name in _names()]
    for file in files:
        if file.suffix in pictures:
            pictures[file.suffix](study.diagrams, file)
        else:
            with replacing(file) as opened:
                opened.write(texts[file.suffix]().encode())
    return files


def _runs(data: dict[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Yield a row for each run of each point; one for the median, without a number, where runs are not kept."""
    for part in ("picture", "hits"):
        for curve in curves_of(data.get(part, {"curves": []})):
            for point in curve.points:
                place = (part, curve.name, point.setting)
                if not point.seconds.runs:
                    yield (*place, "", point.seconds.median, point.error.median)
                for k, pair in enumerate(zip(point.seconds.runs, point.error.runs, strict=True)):
                    yield (*place, k + 1, *pair)


def read_study(file: Path) -> dict[str, Any]:
    """Read the curves.json of a study. Raise ValueError if it is none, or one of a comparison."""
    held = "figures"
    with suppress(ValueError):
        data = json.loads(file.read_text("utf-8"))
        if isinstance(data, dict) and "compared" not in data:
            return data
        if isinstance(data, dict):
            held = "figures of its own, but a comparison"
    raise ValueError(f"{file} holds no {held}: pass the curves.json of an earlier run")


def curves_of(part: dict[str, Any]) -> list[Curve]:
    """Return the curves of one part of a study, as they were written and read again."""
    inf = float("inf")
    if any(name not in curve for curve in part["curves"] for name in OF_CURVE):
        raise ValueError("the figures are of an earlier version of this tool: measure again")
    return [
        Curve(
            curve["name"],
            curve["flags"],
            [
                Point(
                    inf if p["setting"] is None else p["setting"],
                    Spread(**p["seconds"]),
                    Spread(**p["error"]),
                    {key: float("nan") if v is None else v for key, v in p["more"].items()},
                )
                for p in curve["points"]
            ],
            **{name: curve[name] for name in OF_CURVE},
        )
        for curve in part["curves"]
    ]
