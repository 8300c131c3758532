"""Diagrams by matplotlib: curves with error bars, reference slopes, a noise floor.

A diagram is written as SVG for a page, wide or narrow, as a page of a PDF file, or as a panel of an image file.
"""

import io
import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshing.outputs import replacing

# Told apart also by readers who do not see colours, and in print.
MARKERS = "os^Dv<>Pp*X"
GREY = "0.55"
# Inches, the legend included: beside the curves, and below them for narrow screens.
WIDE, NARROW = (8.4, 4.2), (4.3, 5.6)
# Letters of a title or note that fit into a line.
LINE = {WIDE: 98, NARROW: 46}
# Up to so many decades ticks stand between powers of ten as well, from so many on not at all powers.
FEW_DECADES, MANY_DECADES = 1.7, 7.0


@dataclass(frozen=True)
class Mark:
    """A point with error bars: x and y as (value, least, most); a limit is drawn hollow."""

    x: tuple[float, float, float]
    y: tuple[float, float, float]
    label: str = ""  # printed next to it
    is_limit: bool = False


@dataclass(frozen=True)
class Line:
    """A named sequence of marks."""

    name: str
    marks: Sequence[Mark]


@dataclass(frozen=True)
class Diagram:
    """The contents of a diagram; all values are above 0 and finite, else ValueError."""

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    slopes: Sequence[tuple[float, str]] = ()  # thin lines y ~ x^slope through the first point
    floor: tuple[str, float] | None = None  # a horizontal line
    note: str = ""  # how to read it
    counts_x: bool = False  # from 0 on, on a linear axis

    def __post_init__(self) -> None:
        """Refuse what has no logarithm."""
        marks = [mark for line in self.lines for mark in line.marks]
        if not marks:
            raise ValueError(f"diagram {self.title!r} has no marks: pass one or more")
        for value in (v for m in marks for v in (*(() if self.counts_x else m.x), *m.y)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(
                    f"diagram {self.title!r} has the value {value}: pass positive finite numbers"
                )


def as_svg(diagram: Diagram, size: tuple[float, float] = WIDE) -> str:
    """Return a diagram without its title and note as SVG text; equal diagrams give equal text."""
    buffer = io.StringIO()
    settings = {"svg.fonttype": "none", "svg.hashsalt": "hybrid_rt"}
    with _figure([diagram], settings, size, is_alone=False) as figure:
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def save(diagrams: Sequence[Diagram], file: Path) -> None:
    """Write diagrams as one image, one below the other."""
    with _figure(diagrams, {}, WIDE, is_alone=True) as figure, replacing(file) as opened:
        figure.savefig(opened, dpi=110, format=file.suffix[1:])


def save_pdf(diagrams: Sequence[Diagram], file: Path) -> None:
    """Write each diagram, without its title and note, as a page of vectors; equal diagrams give equal bytes."""
    from matplotlib.backends.backend_pdf import PdfPages

    settings = {"pdf.fonttype": 42}  # publishers refuse fonts of type 3
    with replacing(file) as opened, PdfPages(opened, metadata={"CreationDate": None}) as pages:
        for diagram in diagrams:
            with _figure([diagram], settings, WIDE, is_alone=False) as figure:
                pages.savefig(figure)


@contextmanager
def _figure(
    diagrams: Sequence[Diagram],
    settings: dict[str, Any],
    size: tuple[float, float],
    *,
    is_alone: bool,
) -> Iterator[Any]:
    """Yield a figure without a window, whatever the user's own settings of matplotlib are."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(["default", settings]):
        # An image has no text around it, so there each panel has a title and a note.
        height = (size[1] + (0.5 if is_alone else 0.0)) * len(diagrams)
        figure = Figure(figsize=(size[0], height), layout="constrained")
        panels = figure.subfigures(len(diagrams), 1, squeeze=False)[:, 0]
        for panel, diagram in zip(panels, diagrams, strict=True):
            axes = panel.add_subplot()
            _draw(axes, diagram, is_wide=size == WIDE)
            if is_alone:
                title = "\n".join(textwrap.wrap(diagram.title, LINE[size] - 20))
                panel.suptitle(title, fontsize=12, x=0.01, ha="left", fontweight="bold")
                note = "\n".join(textwrap.wrap(diagram.note, LINE[size] + 30))
                panel.supxlabel(note, fontsize=8, x=0.01, ha="left", color="0.3")
        yield figure


def _draw(axes: Any, diagram: Diagram, *, is_wide: bool) -> None:
    axes.set_xscale("linear" if diagram.counts_x else "log")
    axes.set_yscale("log")
    for number_of_line, line in enumerate(diagram.lines):
        # Values, least and most of each coordinate.
        x, y = (list(zip(*(getattr(m, c) for m in line.marks), strict=True)) for c in "xy")
        marker = MARKERS[number_of_line % len(MARKERS)]
        drawn = axes.errorbar(
            x[0], y[0], yerr=_bars(y), xerr=_bars(x), label=line.name, marker=marker,
            markersize=5, linewidth=1.4, elinewidth=1.0, color=f"C{number_of_line % 10}",
        )  # fmt: skip
        color = drawn[0].get_color()
        for mark in line.marks:
            if mark.is_limit:
                axes.plot(
                    mark.x[0], mark.y[0], marker=marker, markersize=5, color=color,
                    markerfacecolor="white", zorder=3,
                )  # fmt: skip
    for limits, set_limits in ((axes.get_xlim(), axes.set_xlim), (axes.get_ylim(), axes.set_ylim)):
        if limits[1] <= limits[0] * (1.0 + 1e-6):  # marks that rounding alone tells apart
            set_limits(0.5 * limits[0], 2.0 * limits[1])
    _labels(axes, diagram)
    _slopes(axes, diagram)
    if diagram.floor is not None:
        name, level = diagram.floor
        axes.axhline(level, color=GREY, linestyle="-.", linewidth=1.0, label=name)
        axes.set_ylim(bottom=min(axes.get_ylim()[0], 0.8 * level))
    for axis in (axes.yaxis,) if diagram.counts_x else (axes.xaxis, axes.yaxis):
        set_plain_ticks(axis)
    axes.grid(visible=True, which="major", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel(diagram.x_label)
    axes.set_ylabel(diagram.y_label)
    if is_wide:
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    else:
        axes.legend(
            fontsize=8, loc="upper center", bbox_to_anchor=(0.45, -0.17), borderaxespad=0.0,
            ncols=2 if max(len(line.name) for line in diagram.lines) < 24 else 1, frameon=False,
        )  # fmt: skip


def _labels(axes: Any, diagram: Diagram) -> None:
    """Print the marks' labels; a label is left out where another stands already."""
    if diagram.counts_x:
        return
    low_x, high_x = (math.log10(v) for v in axes.get_xlim())
    low_y, high_y = (math.log10(v) for v in axes.get_ylim())
    taken: list[tuple[float, float]] = []
    for number_of_line, line in enumerate(diagram.lines):
        for mark in line.marks:
            place = (
                (math.log10(mark.x[0]) - low_x) / (high_x - low_x),
                (math.log10(mark.y[0]) - low_y) / (high_y - low_y),
            )
            is_free = all(abs(place[0] - x) > 0.06 or abs(place[1] - y) > 0.05 for x, y in taken)
            if not mark.label or not is_free:
                continue
            taken.append(place)
            axes.annotate(
                mark.label, (mark.x[0], mark.y[0]), (4, 4), textcoords="offset points",
                fontsize=7.5, color=f"C{number_of_line % 10}",
            )  # fmt: skip


def set_plain_ticks(axis: Any) -> None:
    """Label a logarithmic axis with plain numbers, so few that they do not collide."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = (math.log10(v) for v in sorted(axis.get_view_interval()))
    if high - low > MANY_DECADES:
        axis.set_major_locator(LogLocator(10.0, numticks=8))
    else:
        digits: Sequence[float] = (1.0, 2.0, 5.0) if high - low < FEW_DECADES else (1.0,)
        if high - low < 0.9:
            digits = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)
        axis.set_major_locator(LogLocator(10.0, subs=digits, numticks=20))
        axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value)))
    axis.set_minor_formatter(NullFormatter())


def plain(value: float) -> str:
    """Return a tick's number as it is said: "0.05", "20", "1,000"."""
    return f"{value:.12f}".rstrip("0") if value < 1.0 else f"{value:,.10g}"


def _slopes(axes: Any, diagram: Diagram) -> None:
    """Draw y ~ x^slope from the highest point on, as far as the frame goes."""
    marks = [mark for line in diagram.lines for mark in line.marks]
    low, high = min(m.x[0] for m in marks), max(m.x[0] for m in marks)
    top = max(m.y[0] for m in marks)
    frame = axes.get_ylim()
    for (slope, name), style in zip(diagram.slopes, ("--", ":", "-."), strict=False):
        axes.plot(
            [low, high], [top, top * (high / low) ** slope], style, color=GREY, linewidth=1.0,
            label=name, gid=name,
        )  # fmt: skip
    axes.set_ylim(frame)


def _bars(columns: Sequence[Sequence[float]]) -> list[list[float]]:
    value, least, most = columns
    below = [max(v - low, 0.0) for v, low in zip(value, least, strict=True)]
    above = [max(high - v, 0.0) for v, high in zip(value, most, strict=True)]
    return [below, above]
