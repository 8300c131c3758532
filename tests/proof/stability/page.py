"""HTML page of a run of the catalogue of hard cases: verdicts, and plots of error and work.

There is one plot for each difficulty parameter. Measured points are marks; the theoretical limit is a
dashed line of the same colour.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from hybrid_rt.analysis.diagrams import MARKERS
from meshing.outputs import make_folder, replacing

# An error of 0 has no logarithm: it stands here, below any rounding.
NOTHING = 1e-19
PANEL = (7.0, 4.2)
"""Inches; the legend stands below."""

_STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 1180px; margin: 1.5em auto; padding: 0 1em; color: #222; }
.summary { font-size: clamp(20px, 4vw, 34px); font-weight: bold; line-height: 1.25; margin: 0.4em 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; }
td, th { padding: 2px 8px; text-align: right; border-bottom: 1px solid #ddd; vertical-align: top; }
td.words, th.words { text-align: left; }
tr.fails td { background: #fde3e0; }
tr.none td { color: #777; }
tr.more td { text-align: left; font-size: 12px; border-bottom: none; color: #555; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 480px), 1fr)); gap: 1em; }
figure { margin: 0; }
figure svg { width: 100%; height: auto; }
"""

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
|In the plots a mark is the largest error measured at its abscissa; the dashed line of the same colour is
what theory allows for that very ray. Errors of 0 stand at the lower edge, at 1e-19.
""".strip().split("|")


@dataclass(frozen=True)
class Panel:
    """One plot: curves against one parameter.

    Attributes
    ----------
    name : str
        For a file.
    against : str
    figure : str
        "error" or "work".
    unit : str
        Of errors.
    curves : sequence of mappings
        As `Result.figures` has them.
    """

    name: str
    against: str
    figure: str
    unit: str
    curves: Sequence[Mapping[str, Any]]


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
    """Return a self-contained HTML page of a run, without plots if matplotlib is not installed.

    Parameters
    ----------
    rows : sequence of mappings
        `Result.figures` of each row.
    sentence : str
        The summary.
    """
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Hard cases</title><style>{_STYLE}</style></head><body>",
        "<h1>Hard cases, one row each</h1>",
        f'<p class="summary">{escape(sentence)}</p>',
        "<h2>How to read this</h2><ul>",
        *(f"<li>{escape(line)}</li>" for line in READ),
        '</ul><h2>Rows</h2><div class="scroll"><table>',
        _line(HEAD, "th", ""),
        *(_row(row) for row in rows),
        "</table></div>",
    ]
    found = panels(rows) if find_spec("matplotlib") else []
    if found:
        parts.append('<h2>Curves</h2><div class="plots">')
        parts += [f"<figure>{as_svg(panel)}</figure>" for panel in found]
        parts.append("</div>")
    parts.append("</body></html>")
    return "\n".join(parts)


def panels(rows: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Group the curves of all rows by their x axis and unit."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        for curve in row["curves"]:
            named = {**curve, "label": f"{row['id']} {curve['label']}"}
            groups.setdefault((curve["against"], curve["unit"]), []).append(named)
    found = []
    for (against, unit), curves in groups.items():
        name = "".join(c if c.isalnum() else "_" for c in against.lower()).strip("_")
        name = "_".join(part for part in name.split("_") if part)
        found.append(Panel(f"error_{name}", against, "error", unit, curves))
        working = [curve for curve in curves if curve["work"]]
        if working:
            found.append(Panel(f"work_{name}", against, "work", "", working))
    return found


def as_svg(panel: Panel) -> str:
    """Return a panel as an SVG element: equal panels, equal text."""
    buffer = io.StringIO()
    for figure in _drawn(panel, {"svg.fonttype": "none", "svg.hashsalt": panel.name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def save_panels(rows: Sequence[Mapping[str, Any]], directory: Path) -> list[Path]:
    """Write every panel as a PNG and an SVG file; return their names."""
    make_folder(directory)
    files = []
    for panel in panels(rows):
        for ending in ("png", "svg"):
            file = directory / f"{panel.name}.{ending}"
            more: dict[str, Any] = {"metadata": {"Date": None}} if ending == "svg" else {"dpi": 110}
            for figure in _drawn(panel, {"svg.hashsalt": panel.name}):
                with replacing(file) as opened:
                    figure.savefig(opened, format=ending, bbox_inches="tight", **more)
            files.append(file)
    return files


def _drawn(panel: Panel, settings: Mapping[str, Any]) -> Iterator[Any]:
    """Yield a figure without a window, whatever the user's own settings of matplotlib are."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(["default", dict(settings)]):
        figure = Figure(figsize=PANEL)
        axes = figure.add_subplot()
        _draw(axes, panel)
        yield figure


def _draw(axes: Any, panel: Panel) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for number, curve in enumerate(panel.curves):
        marker, color = MARKERS[number % len(MARKERS)], f"C{number % 10}"
        y = [max(value, NOTHING) for value in curve[panel.figure]]
        if panel.figure == "work":
            y = [max(value, 1.0) for value in y]
        axes.plot(
            curve["x"], y, marker=marker, color=color, markersize=4.5, linewidth=1.2,
            label=curve["label"],
        )  # fmt: skip
        if panel.figure == "error":
            # Without its marks a theory of one point would not be seen.
            allowed = [
                value if math.isfinite(value) and value < 1e6 else math.nan
                for value in curve["expected"]
            ]
            axes.plot(curve["x"], allowed, "--", color=color, linewidth=1.0)
    if panel.figure == "error":
        axes.plot([], [], "--", color="0.4", linewidth=1.0, label="what theory allows")
        axes.set_ylabel(f"largest error ({panel.unit})")
    else:
        axes.set_ylabel("largest search (pieces)")
    axes.set_xlabel(panel.against)
    axes.grid(True, which="major", color="0.9")
    axes.set_axisbelow(True)
    axes.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2, borderaxespad=0.0,
        frameon=False,
    )  # fmt: skip


def _row(row: Mapping[str, Any]) -> str:
    verdict = row["verdict"]
    style = "" if verdict == "holds" else "none" if verdict.startswith("not built") else "fails"
    cells = (
        row["id"], verdict, f"{row['rays']:,}", str(row["wrong"]), error_words(row["error"]),
        str(row["broken"]), str(row["undecided"]), str(row["work"]), f"{row['seconds']:.1f}",
        row["title"], row["truth"],
    )  # fmt: skip
    lines = [_line(cells, "td", style)]
    for words in (*row["faults"], *row["notes"]):
        lines.append(
            f'<tr class="more"><td></td><td colspan="{len(HEAD) - 1}">{escape(words)}</td></tr>'
        )
    return "".join(lines)


def _line(cells: Sequence[str], tag: str, style: str) -> str:
    words = {0, 1, len(HEAD) - 2, len(HEAD) - 1}
    inner = "".join(
        f'<{tag} class="words">{escape(cell)}</{tag}>'
        if number in words
        else f"<{tag}>{escape(cell)}</{tag}>"
        for number, cell in enumerate(cells)
    )
    return f'<tr class="{style}">{inner}</tr>' if style else f"<tr>{inner}</tr>"


def error_words(error: float | None) -> str:
    """Return an error in units of what is expected; a dash where nothing is measured."""
    return "-" if error is None else f"{error:.2g}"
