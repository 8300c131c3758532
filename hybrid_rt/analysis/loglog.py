"""Log-log diagrams as SVG: curves with bars, reference slopes, and a level below them."""

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
    if not marks:
        raise ValueError(f"diagram {title!r} has no marks: pass one or more")
    for value in values:
        if not (value > 0.0 and math.isfinite(value)):
            raise ValueError(
                f"diagram {title!r} has the value {value}: pass positive finite numbers"
            )
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
    """Logarithms mapped to pixels; ``low`` and ``high`` are logarithms to base 10."""

    def __init__(self, values: Sequence[float], begin: float, end: float) -> None:
        logs = [math.log10(value) for value in values]
        # Some air, so that no mark lies on the frame, and at least a factor of four in all.
        air = max(0.06 * (max(logs) - min(logs)), 0.3 - 0.5 * (max(logs) - min(logs)), 0.05)
        self.low, self.high = min(logs) - air, max(logs) + air
        self._begin, self._end = begin, end

    def place(self, value: float) -> float:
        share = (math.log10(value) - self.low) / (self.high - self.low)
        return self._begin + share * (self._end - self._begin)

    @property
    def ticks(self) -> list[float]:
        """Powers of ten, not more than nine, or 1, 2 and 5 times them over short ranges."""
        decades = range(math.floor(self.low), math.ceil(self.high) + 1)
        step = math.ceil((self.high - self.low) / 8.0)
        factors = (1.0, 2.0, 5.0) if self.high - self.low < 2.0 else (1.0,)
        values = [f * 10.0**decade for decade in decades if decade % step == 0 for f in factors]
        return [v for v in values if self.low <= math.log10(v) <= self.high]


def _grid(x_axis: _Axis, y_axis: _Axis, x_label: str, y_label: str) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    frame = (
        f'<rect x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{bottom - TOP}" '
        'fill="none" stroke="#888"/>'
    )
    parts = [frame]
    for value in x_axis.ticks:
        x = x_axis.place(value)
        parts.append(_segment(x, TOP, x, bottom, "#ddd"))
        parts.append(_text(x, bottom + 16, f"{value:.3g}", "middle"))
    for value in y_axis.ticks:
        y = y_axis.place(value)
        parts.append(_segment(LEFT, y, right, y, "#ddd"))
        parts.append(_text(LEFT - 6, y + 4, f"{value:.3g}", "end"))
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
    x_end = x_axis.high
    if slope < 0.0:
        x_end = min(x_end, x_axis.low + (y_begin - y_axis.low) / -slope)
    y_end = y_begin + slope * (x_end - x_axis.low)
    x0, y0 = x_axis.place(10.0**x_axis.low), y_axis.place(10.0**y_begin)
    x1, y1 = x_axis.place(10.0**x_end), y_axis.place(10.0**y_end)
    label = _text(
        x0 + 0.8 * (x1 - x0) + 6, y0 + 0.8 * (y1 - y0) - 6, f"slope {slope:g}", "start", "#888"
    )
    return f'<g class="slope">{_segment(x0, y0, x1, y1, "#aaa", dash="6 4")}{label}</g>'


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
