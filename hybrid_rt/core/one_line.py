"""One-line descriptions for ``__repr__``: the call that makes an object, with the values that matter."""

from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray

# What fits on a line of a terminal or a notebook.
WIDEST = 120
# Digits of numbers, and whether objects within others are shown in full: as much as fits.
_WAYS = ((6, True), (4, True), (3, True), (3, False))


def call(of: object, /, *values: Any, **named: Any) -> str:
    """Return an object as the call that makes it, on one line of at most `WIDEST` characters.

    Where that is too long, numbers get fewer digits, then objects within are shown by their class alone, and
    then the line is cut.
    """
    line = ""
    for digits, in_full in _WAYS:
        parts = [_shown(value, digits, in_full) for value in values]
        parts += [f"{name}={_shown(value, digits, in_full)}" for name, value in named.items()]
        line = f"{type(of).__name__}({', '.join(parts)})"
        if len(line) <= WIDEST:
            return line
    return cut(line, "...)")


def cut(line: str, end: str = "...") -> str:
    """Return a line of at most `WIDEST` characters; a longer one ends with ``end``."""
    line = " ".join(line.split())
    return line if len(line) <= WIDEST else line[: WIDEST - len(end)] + end


def one_or_three(color: FloatArray) -> float | FloatArray:
    """Return a grey (3,) as one number, other colours as they are."""
    return float(color[0]) if (color == color[0]).all() else color


def _shown(value: Any, digits: int, in_full: bool) -> str:
    if isinstance(value, float | np.floating):
        return f"{float(value):.{digits}g}"
    if isinstance(value, np.ndarray | tuple | list):
        return f"({', '.join(_shown(item, digits, in_full) for item in value)})"
    if value is None or isinstance(value, bool | int | str | np.generic):
        return repr(value)
    return " ".join(repr(value).split()) if in_full else f"{type(value).__name__}(...)"
