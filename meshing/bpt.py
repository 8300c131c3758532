"""Newell's .bpt files: Bezier patches as text.

A file holds the number of patches; then, for each patch, its two degrees and its (degree_u + 1)
(degree_v + 1) control points, one a line, v fastest. Blank lines are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from meshing.checks import FloatArray
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.outputs import replacing


class _Lines:
    """The lines of a file that are not blank, each split into words; says where it stands."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lines: Iterator[tuple[int, str]] = enumerate(
            # Some editors begin a file with a byte-order mark.
            path.read_text(encoding="utf-8-sig").splitlines(),
            start=1,
        )
        self.number = 0

    def __iter__(self) -> _Lines:
        return self

    def __next__(self) -> list[str]:
        for number, line in self._lines:
            self.number = number
            words = line.split()
            if words:
                return words
        raise StopIteration

    def take(self, expected: str) -> list[str]:
        words = next(self, None)
        if words is None:
            raise ValueError(
                f"{self.path} ends after line {self.number}, where {expected} was expected"
            )
        return words

    def error(self, words: list[str], expected: str) -> ValueError:
        found = " ".join(words)
        found = found if len(found) <= 60 else found[:57] + "..."
        return ValueError(f"{self.path}, line {self.number}: {expected} expected, found {found!r}")


def read_patches(path: str | Path) -> list[FloatArray]:
    """Return the control nets of a .bpt file, (m + 1, n + 1, 3); errors name the line and what was expected."""
    try:
        lines = _Lines(Path(path))
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file: a .bpt file was expected") from None
    words = lines.take("the number of patches")
    n_patches = _whole_numbers(words, 1)
    if n_patches is None or n_patches[0] < 1:
        raise lines.error(words, "the number of patches (1 or more)")
    patches = [_read_patch(lines, p, n_patches[0]) for p in range(n_patches[0])]
    rest = next(lines, None)
    if rest is not None:
        raise lines.error(rest, f"end of file after {n_patches[0]} patches")
    return patches


def _read_patch(lines: _Lines, p: int, n_patches: int) -> FloatArray:
    expected = f"two degrees (1 to {MAX_DEGREE}) of patch {p} of {n_patches}"
    words = lines.take(expected)
    degrees = _whole_numbers(words, 2)
    if degrees is None or not all(1 <= degree <= MAX_DEGREE for degree in degrees):
        raise lines.error(words, expected)
    shape = (degrees[0] + 1, degrees[1] + 1)
    points = np.empty((shape[0] * shape[1], 3))
    for k in range(len(points)):
        expected = f"three finite coordinates of point {k} of {len(points)} of patch {p}"
        words = lines.take(expected)
        try:
            points[k] = [float(word) for word in words]
        except ValueError:
            raise lines.error(words, expected) from None
        if len(words) != 3 or not np.isfinite(points[k]).all():
            raise lines.error(words, expected)
    return points.reshape(*shape, 3)


def _whole_numbers(words: list[str], count: int) -> list[int] | None:
    # More digits than that are no count, and may be more than Python reads.
    if len(words) != count or not all(word.isdecimal() and len(word) < 19 for word in words):
        return None
    return [int(word) for word in words]


def write_patches(path: str | Path, patches: Sequence[FloatArray]) -> None:
    """Write control nets to a .bpt file; reading it back gives the same float64 numbers."""
    lines = [str(len(patches))]
    for net in patches:
        lines.append(f"{net.shape[0] - 1} {net.shape[1] - 1}")
        lines.extend(" ".join(map(repr, row)) for row in net.reshape(-1, 3).tolist())
    with replacing(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())
