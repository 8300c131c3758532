"""HTML page of a run of the catalogue of hard cases: verdicts, and plots of error and work.

There is one plot for each difficulty parameter. Measured points are marks; the theoretical limit is a
dashed line of the same colour.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from hybrid_rt.analysis.diagrams import MARKERS
from meshing.outputs import make_folder, replacing

# An error of 0 has no logarithm: it stands here, below any rounding.
NOTHING = 1e-19

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


class Panel(NamedTuple):
    """One plot: curves, as `Result.figures` has them, against one parameter."""

    against: str
    figure: str  # "error" or "work"
    unit: str
    curves: Sequence[Mapping[str, Any]]

    @property
    def name(self) -> str:
        """Name of a file."""
        return re.sub("[^a-z0-9]+", "_", f"{self.figure} {self.against}".lower()).strip("_")


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
    if find_spec("matplotlib") and (found := panels(rows)):
        parts.append('<h2>Curves</h2><div class="plots">')
        for panel in found:
            text = drawn(panel, "svg").decode()
            parts.append(f"<figure>{text[text.index('<svg') :]}</figure>")
        parts.append("</div>")
    return "\n".join([*parts, "</body></html>"])


def panels(rows: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Group the curves of all rows by their x axis and unit."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        for curve in row["curves"]:
            named = {**curve, "label": f"{row['id']} {curve['label']}"}
            groups.setdefault((curve["against"], curve["unit"]), []).append(named)
    found = []
    for (against, unit), curves in groups.items():
        found.append(Panel(against, "error", unit, curves))
        if working := [curve for curve in curves if any(curve["work"])]:
            found.append(Panel(against, "work", "", working))
    return found


def save_panels(rows: Sequence[Mapping[str, Any]], directory: Path) -> None:
    """Write every panel as a PNG file."""
    make_folder(directory)
    for panel in panels(rows):
        with replacing(directory / f"{panel.name}.png") as opened:
            opened.write(drawn(panel, "png"))


def drawn(panel: Panel, ending: str) -> bytes:
    """Return a picture, whatever the user's own settings of matplotlib are: equal panels, equal bytes."""
    from matplotlib import style
    from matplotlib.figure import Figure

    settings = {"svg.fonttype": "none", "svg.hashsalt": panel.name}
    more: dict[str, Any] = {"metadata": {"Date": None}} if ending == "svg" else {"dpi": 110}
    with style.context(["default", settings]):
        figure, buffer = Figure(figsize=(7.0, 4.2)), io.BytesIO()
        _draw(figure.add_subplot(), panel)
        figure.savefig(buffer, format=ending, bbox_inches="tight", **more)
    return buffer.getvalue()


def _draw(axes: Any, panel: Panel) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    is_error = panel.figure == "error"
    for number, curve in enumerate(panel.curves):
        marker, color = MARKERS[number % len(MARKERS)], f"C{number % 10}"
        y = [max(value, NOTHING if is_error else 1.0) for value in curve[panel.figure]]
        axes.plot(curve["x"], y, marker=marker, color=color, markersize=4.5, linewidth=1.2,
                  label=curve["label"])  # fmt: skip
        if is_error:
            # Without its marks a theory of one point would not be seen.
            allowed = [value if value < 1e6 else math.nan for value in curve["expected"]]
            axes.plot(curve["x"], allowed, "--", color=color, linewidth=1.0)
    if is_error:
        axes.plot([], [], "--", color="0.4", linewidth=1.0, label="what theory allows")
    axes.set_ylabel(f"largest error ({panel.unit})" if is_error else "largest search (pieces)")
    axes.set_xlabel(panel.against)
    axes.grid(True, which="major", color="0.9")
    axes.set_axisbelow(True)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2,
                borderaxespad=0.0, frameon=False)  # fmt: skip


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
