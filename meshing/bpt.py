"""Newell's .bpt files: Bezier patches as text.

A file holds the number of patches; then, for each patch, its two degrees and its (degree_u + 1)
(degree_v + 1) control points, one a line, v fastest. Blank lines are ignored.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from meshing.checks import FloatArray
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.outputs import replacing

T = TypeVar("T")
_EXPECTED = "pass a .bpt file (CAD files are read by hybrid_rt.read_cad, meshes by hybrid_rt.TriangleMesh.read)"


class _Lines:
    """The lines of a file that are not blank, each split into words; says where it stands."""

    def __init__(self, path: Path) -> None:
        self.path, self.number = path, 0
        # Some editors begin a file with a byte-order mark.
        lines = enumerate(path.read_text(encoding="utf-8-sig").splitlines(), start=1)
        self.left = ((number, line.split()) for number, line in lines if line.strip())

    def take(self, expected: str, meaning: Callable[[list[str]], list[T] | None]) -> list[T]:
        """Return what the next line means; None stands for what is not expected."""
        line = next(self.left, None)
        if line is None:
            raise ValueError(
                f"{self.path} ends after line {self.number}, where {expected} was expected"
            )
        self.number, words = line
        found = meaning(words)
        if found is None:
            raise self.error(words, expected)
        return found

    def error(self, words: list[str], expected: str) -> ValueError:
        found = " ".join(words)
        found = found if len(found) <= 60 else found[:57] + "..."
        return ValueError(f"{self.path}, line {self.number}: {expected} expected, found {found!r}")


def read_patches(path: str | Path) -> list[FloatArray]:
    """Return the control nets of a .bpt file, (m + 1, n + 1, 3); errors name the line and what was expected."""
    try:
        lines = _Lines(Path(path))
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file: {_EXPECTED}") from None
    try:
        (count,) = lines.take("the number of patches (1 or more)", lambda words: _counts(words, 1))
    except ValueError as error:
        raise ValueError(f"{error}: {_EXPECTED}") from None
    patches = [_read_patch(lines, p, count) for p in range(count)]
    for number, words in lines.left:
        lines.number = number
        raise lines.error(words, f"end of file after {count} patches")
    return patches


def _read_patch(lines: _Lines, p: int, n_patches: int) -> FloatArray:
    m, n = lines.take(
        f"two degrees (1 to {MAX_DEGREE}) of patch {p} of {n_patches}",
        lambda words: _counts(words, 2, MAX_DEGREE),
    )
    size = (m + 1) * (n + 1)
    points = [
        lines.take(f"three finite coordinates of point {k} of {size} of patch {p}", _coordinates)
        for k in range(size)
    ]
    return np.array(points).reshape(m + 1, n + 1, 3)


def _coordinates(words: list[str]) -> list[float] | None:
    try:
        found = [float(word) for word in words]
    except ValueError:
        return None
    return found if len(found) == 3 and all(map(math.isfinite, found)) else None


def _counts(words: list[str], n: int, most: float = math.inf) -> list[int] | None:
    # More digits than that are no count, and may be more than Python reads.
    if len(words) != n or not all(word.isdecimal() and len(word) < 19 for word in words):
        return None
    counts = [int(word) for word in words]
    return counts if all(1 <= count <= most for count in counts) else None


def write_patches(path: str | Path, patches: Sequence[FloatArray]) -> None:
    """Write control nets to a .bpt file; reading it back gives the same float64 numbers."""
    lines = [str(len(patches))]
    for net in patches:
        lines.append(f"{net.shape[0] - 1} {net.shape[1] - 1}")
        lines.extend(" ".join(map(repr, row)) for row in net.reshape(-1, 3).tolist())
    with replacing(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())
