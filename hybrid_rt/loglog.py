"""Log-log diagrams as SVG: curves with bars, reference slopes, a level below which nothing counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

WIDTH, HEIGHT = 760, 460
LEFT, RIGHT, TOP, BOTTOM = 70, 230, 30, 50
# Tableau's ten, told apart also by most colour-blind readers when markers differ.
COLORS = (
    "#4e79a7", "#f28e2b", "#e15759", "#59a14f", "#b07aa1", "#9c755f", "#76b7b2", "#edc948",
    "#ff9da7", "#7f7f7f",
)  # fmt: skip


@dataclass(frozen=True)
class Mark:
    """A point with its bars: x and y as (value, least, most); ``is_limit``: y is an upper limit."""

    x: tuple[float, float, float]
    y: tuple[float, float, float]
    label: str = ""
    is_limit: bool = False


@dataclass(frozen=True)
class Line:
    """A named sequence of marks."""

    name: str
    marks: Sequence[Mark]


def log_log(
    title: str,
    x_label: str,
    y_label: str,
    lines: Sequence[Line],
    slopes: Sequence[float] = (),
    floor: tuple[str, float] | None = None,
) -> str:
    """Draw a diagram.

    Parameters
    ----------
    title, x_label, y_label : str
    lines : sequence of Line
        All values above 0 and finite.
    slopes : sequence of float
        Drawn as thin lines from the middle of the diagram's left side.
    floor : (name, y), optional
        A level drawn across.

    Returns
    -------
    str
        An ``<svg>`` element.

    Raises
    ------
    ValueError
        If nothing can be drawn, or a value is not positive.
    """
    marks = [mark for line in lines for mark in line.marks]
    values = [v for mark in marks for v in (*mark.x, *mark.y)]
    if not marks or not all(v > 0.0 and math.isfinite(v) for v in values):
        raise ValueError(f"diagram {title!r}: needs marks, all of them positive and finite")
    levels = [floor[1]] if floor is not None else []
    x_axis = _Axis([v for m in marks for v in m.x], LEFT, WIDTH - RIGHT)
    y_axis = _Axis([v for m in marks for v in m.y] + levels, HEIGHT - BOTTOM, TOP)
    opening = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" font-size="11">'
    )
    parts = [
        opening,
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        _text(LEFT, 18, title, "start", size=14),
        *_grid(x_axis, y_axis, x_label, y_label),
        *(_slope(slope, x_axis, y_axis) for slope in slopes),
    ]
    if floor is not None:
        y = y_axis.place(floor[1])
        parts.append(_segment(LEFT, y, WIDTH - RIGHT, y, "#888", dash="2 3"))
        parts.append(_text(WIDTH - RIGHT - 4, y - 4, floor[0], "end", "#888"))
    for k, line in enumerate(lines):
        parts += _curve(line, COLORS[k % len(COLORS)], k, x_axis, y_axis)
    return "\n".join([*parts, "</svg>"])


class _Axis:
    """Whole decades mapped to pixels."""

    def __init__(self, values: Sequence[float], begin: float, end: float) -> None:
        # A little air, so that no mark lies on the frame.
        self.low = math.floor(math.log10(min(values)) - 0.05)
        self.high = max(math.ceil(math.log10(max(values)) + 0.05), self.low + 1)
        self._begin, self._end = begin, end

    def place(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self._begin + share * (self._end - self._begin)

    @property
    def decades(self) -> list[int]:
        step = max((self.high - self.low) // 8, 1)
        return list(range(self.low, self.high + 1, step))


def _grid(x_axis: _Axis, y_axis: _Axis, x_label: str, y_label: str) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for decade in x_axis.decades:
        x = x_axis.place(10.0**decade)
        parts.append(_segment(x, TOP, x, bottom, "#ddd"))
        parts.append(_text(x, bottom + 16, _power(decade), "middle"))
    for decade in y_axis.decades:
        y = y_axis.place(10.0**decade)
        parts.append(_segment(LEFT, y, right, y, "#ddd"))
        parts.append(_text(LEFT - 6, y + 4, _power(decade), "end"))
    parts.append(_text(0.5 * (LEFT + right), HEIGHT - 12, x_label, "middle"))
    middle = 0.5 * (TOP + bottom)
    parts.append(
        f'<text x="16" y="{middle:.1f}" text-anchor="middle" '
        f'transform="rotate(-90 16 {middle:.1f})">{escape(y_label)}</text>'
    )
    return parts


def _slope(slope: float, x_axis: _Axis, y_axis: _Axis) -> str:
    """Draw y ~ x^slope from the left side, as far as it stays inside."""
    y_begin = 0.5 * (y_axis.low + y_axis.high) + 0.25 * (y_axis.high - y_axis.low)
    x_end = float(x_axis.high)
    if slope < 0.0:
        x_end = min(x_end, x_axis.low + (y_begin - y_axis.low) / -slope)
    y_end = y_begin + slope * (x_end - x_axis.low)
    x0, y0 = x_axis.place(10.0**x_axis.low), y_axis.place(10.0**y_begin)
    x1, y1 = x_axis.place(10.0**x_end), y_axis.place(10.0**y_end)
    return (
        f'<g class="slope">{_segment(x0, y0, x1, y1, "#aaa", dash="6 4")}'
        f"{_text(x0 + 6, y0 - 6, f'slope {slope:g}', 'start', '#888')}</g>"
    )


def _curve(line: Line, color: str, number: int, x_axis: _Axis, y_axis: _Axis) -> list[str]:
    places = [(x_axis.place(m.x[0]), y_axis.place(m.y[0])) for m in line.marks]
    way = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    dash = ' stroke-dasharray="7 3"' if number >= len(COLORS) else ""
    parts = [f'<polyline points="{way}" fill="none" stroke="{color}" stroke-width="1.6"{dash}/>']
    for mark, (x, y) in zip(line.marks, places, strict=True):
        parts.append(_segment(x_axis.place(mark.x[1]), y, x_axis.place(mark.x[2]), y, color))
        parts.append(_segment(x, y_axis.place(mark.y[1]), x, y_axis.place(mark.y[2]), color))
        fill = "white" if mark.is_limit else color
        parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.4" fill="{fill}" stroke="{color}">'
            f"<title>{escape(f'{line.name} {mark.label}')}</title></circle>"
        )
    y = TOP + 14 + 17 * number
    parts.append(_segment(WIDTH - RIGHT + 12, y - 4, WIDTH - RIGHT + 34, y - 4, color, width=2))
    parts.append(_text(WIDTH - RIGHT + 40, y, line.name, "start"))
    return parts


def _power(decade: int) -> str:
    return f"{10.0**decade:g}" if -3 <= decade <= 3 else f"1e{decade}"


def _segment(
    x0: float, y0: float, x1: float, y1: float, color: str, dash: str = "", width: float = 1.0
) -> str:
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{color}" '
        f'stroke-width="{width:g}"{dashes}/>'
    )


def _text(x: float, y: float, text: str, anchor: str, color: str = "black", size: int = 11) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}" '
        f'font-size="{size}">{escape(text)}</text>'
    )
