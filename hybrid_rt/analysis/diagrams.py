"""Log-log diagrams by matplotlib: curves with error bars, reference slopes, a noise floor.

A diagram is written as SVG for a page, or as a panel of an image file.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Told apart also by readers who do not see colours, and in print.
MARKERS = "os^Dv<>Pp*X"
PANEL = (8.0, 4.6)
"""Inches, the legend included."""
GREY = "0.55"


@dataclass(frozen=True)
class Mark:
    """A point with error bars: x and y as (value, least, most).

    ``label`` is printed next to it; ``is_limit``: y is an upper limit, drawn hollow.
    """

    x: tuple[float, float, float]
    y: tuple[float, float, float]
    label: str = ""
    is_limit: bool = False


@dataclass(frozen=True)
class Line:
    """A named sequence of marks."""

    name: str
    marks: Sequence[Mark]


@dataclass(frozen=True)
class Diagram:
    """The contents of a diagram.

    Attributes
    ----------
    title, x_label, y_label : str
    lines : sequence of Line
        All values above 0 and finite.
    slopes : sequence of float
        Drawn as thin lines y ~ x^slope through the first point.
    floor : (name, y), optional
        A horizontal line.

    Raises
    ------
    ValueError
        If there are no points, or a value is not positive and finite.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line]
    slopes: Sequence[float] = ()
    floor: tuple[str, float] | None = None

    def __post_init__(self) -> None:
        """Refuse what has no logarithm."""
        marks = [mark for line in self.lines for mark in line.marks]
        if not marks:
            raise ValueError(f"diagram {self.title!r} has no marks: pass one or more")
        for value in (v for mark in marks for v in (*mark.x, *mark.y)):
            if not (value > 0.0 and math.isfinite(value)):
                raise ValueError(
                    f"diagram {self.title!r} has the value {value}: pass positive finite numbers"
                )


def as_svg(diagram: Diagram) -> str:
    """Return a diagram as SVG text; equal diagrams give equal text."""
    buffer = io.StringIO()
    with _figure([diagram], {"svg.fonttype": "none", "svg.hashsalt": "hybrid_rt"}) as figure:
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def save(diagrams: Sequence[Diagram], file: Path) -> None:
    """Write diagrams as one image, two panels a row."""
    with _figure(diagrams, {}) as figure:
        figure.savefig(file, dpi=110)


@contextmanager
def _figure(diagrams: Sequence[Diagram], settings: dict[str, Any]) -> Iterator[Any]:
    """Yield a figure without a window, whatever the user's own settings of matplotlib are."""
    from matplotlib import style
    from matplotlib.figure import Figure

    columns = min(len(diagrams), 2)
    rows = -(-len(diagrams) // columns)
    with style.context(["default", settings]):
        size = (PANEL[0] * columns, PANEL[1] * rows)
        figure = Figure(figsize=size, layout="constrained")
        for number, diagram in enumerate(diagrams):
            _draw(figure.add_subplot(rows, columns, number + 1), diagram)
        yield figure


def _draw(axes: Any, diagram: Diagram) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for number, line in enumerate(diagram.lines):
        x, y = (_columns(line.marks, name) for name in ("x", "y"))
        marker = MARKERS[number % len(MARKERS)]
        drawn = axes.errorbar(
            x[0], y[0], yerr=_bars(y), xerr=_bars(x), label=line.name, marker=marker,
            markersize=5, linewidth=1.4, elinewidth=1.0,
        )  # fmt: skip
        color = drawn[0].get_color()
        for mark in line.marks:
            if mark.is_limit:
                axes.plot(
                    mark.x[0], mark.y[0], marker=marker, markersize=5, color=color,
                    markerfacecolor="white", zorder=3,
                )  # fmt: skip
            if mark.label:
                axes.annotate(
                    mark.label, (mark.x[0], mark.y[0]), (4, 4), textcoords="offset points",
                    fontsize=7, color=color,
                )  # fmt: skip
    _slopes(axes, diagram)
    if diagram.floor is not None:
        name, level = diagram.floor
        axes.axhline(level, color=GREY, linestyle="-.", linewidth=1.0, label=name)
    axes.grid(True, which="major", color="0.9")
    axes.set_axisbelow(True)
    axes.set_xlabel(diagram.x_label)
    axes.set_ylabel(diagram.y_label)
    axes.set_title(diagram.title, fontsize=11, loc="left")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)


def _slopes(axes: Any, diagram: Diagram) -> None:
    """Draw y ~ x^slope from the highest point on, as far as the frame goes."""
    marks = [mark for line in diagram.lines for mark in line.marks]
    low, high = min(m.x[0] for m in marks), max(m.x[0] for m in marks)
    top = max(m.y[0] for m in marks)
    frame = axes.get_ylim()
    for slope, style in zip(diagram.slopes, ("--", ":", "-."), strict=False):
        axes.plot(
            [low, high], [top, top * (high / low) ** slope], style, color=GREY, linewidth=1.0,
            label=f"slope {slope:g}", gid=f"slope {slope:g}",
        )  # fmt: skip
    axes.set_ylim(frame)


def _columns(marks: Sequence[Mark], name: str) -> list[list[float]]:
    """Return values, least and most of one coordinate of marks."""
    return [list(column) for column in zip(*(getattr(m, name) for m in marks), strict=True)]


def _bars(columns: list[list[float]]) -> list[list[float]]:
    value, least, most = columns
    below = [max(v - low, 0.0) for v, low in zip(value, least, strict=True)]
    above = [max(high - v, 0.0) for v, high in zip(value, most, strict=True)]
    return [below, above]
