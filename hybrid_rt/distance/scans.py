"""Files of measured points: PLY, NPY, and text with a point a line; read in pieces."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing.checks import as_path, check_is_file

PIECE = 200_000
TEXTS = (".csv", ".txt", ".xyz", ".asc", ".pts")
PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2",
    "ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip


class Scan:
    """The points of a file, read when they are asked for.

    Parameters
    ----------
    path : str or path
        ``.ply``: the vertices. ``.npy``: (n, 3) or more columns. ``.csv``, ``.txt``, ``.xyz``, ``.asc``, ``.pts``:
        x, y and z begin each line, apart by commas, semicolons or blanks; or a first line names the columns, x, y and
        z among them. Other columns, as normals, are not read.

    Attributes
    ----------
    path : Path
    n : int
        Number of points.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = as_path(path, "scan")
        name, suffix = f"scan {str(self.path)!r}", self.path.suffix.lower()
        check_is_file(self.path, name)
        self._rows: NDArray[Any] | None = None
        self._skipped, self._columns = 0, [0, 1, 2]
        self._separator: str | None = None
        if suffix == ".npy":
            self._rows = _array_of(self.path, name)
            self.n = len(self._rows)
        elif suffix == ".ply":
            self._read_ply(name)
        elif suffix in TEXTS:
            self._read_lines(name)
        else:
            raise ValueError(f"{name} ends in {suffix!r}: pass .ply, .npy or {', '.join(TEXTS)}")
        if self.n == 0:
            raise ValueError(f"{name} holds no points: pass at least one")

    def _read_ply(self, name: str) -> None:
        with self.path.open("rb") as file:
            lines = list[list[str]]()
            for row in file:
                lines.append(row.decode("ascii", "replace").split())
                if lines[-1] == ["end_header"]:
                    break
            begin = file.tell()
        if not lines or lines[0] != ["ply"] or lines[-1] != ["end_header"]:
            raise ValueError(f"{name} has no header of a PLY file: pass a complete one")
        form = next((line[1] for line in lines if line[:1] == ["format"]), "")
        elements = [line for line in lines if line[:1] in (["element"], ["property"])]
        if elements[:1] == [] or elements[0][:2] != ["element", "vertex"]:
            raise ValueError(f"{name} does not begin with its vertices: write these first")
        self.n = int(elements[0][2])
        fields = list[tuple[str, str]]()
        for line in elements[1:]:
            if line[0] == "element":
                break
            if line[1] not in PLY_TYPES:
                raise ValueError(f"{name} has vertices with {' '.join(line[1:])!r}: leave it out")
            fields.append((line[2], PLY_TYPES[line[1]]))
        names = [field for field, _ in fields]
        if not {"x", "y", "z"} <= set(names):
            raise ValueError(f"{name} has vertices of {names}: pass x, y and z")
        if form == "ascii":
            self._skipped = len(lines)
            self._columns = [names.index(c) for c in ("x", "y", "z")]
            return
        order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(form)
        if order is None:
            raise ValueError(f"{name} is of the format {form!r}: pass ascii or binary")
        kind = np.dtype([(field, order + code) for field, code in fields])
        if self.path.stat().st_size < begin + self.n * kind.itemsize:
            raise ValueError(f"{name} ends before its {self.n} vertices do: pass a complete file")
        self._rows = (
            np.memmap(self.path, kind, "r", begin, (self.n,)) if self.n else np.empty(0, kind)
        )

    def _read_lines(self, name: str) -> None:
        with self.path.open(encoding="utf-8", errors="replace") as file:
            first = next(file, "")
            self._separator = next((s for s in (",", ";") if s in first), None)
            words = [word.strip(" \t\r\n\"'#").lower() for word in first.split(self._separator)]
            words = [word for word in words if word]
            if not any(map(_is_number, words)):
                self._skipped = 1
                if {"x", "y", "z"} <= set(words):
                    self._columns = [words.index(c) for c in ("x", "y", "z")]
                elif len(words) > 1 and words != ["x", "y", "z"]:
                    raise ValueError(
                        f"{name} begins with {first.strip()[:60]!r}: name the columns x, y and z, or leave that line out"
                    )
            elif len(words) < 3 or not all(map(_is_number, words[:3])):
                raise ValueError(
                    f"{name} begins with {first.strip()[:60]!r}: pass x, y and z in each line, with decimal points"
                )
            self.n = sum(1 for line in file if line.strip()) + (1 - self._skipped) * bool(
                first.strip()
            )

    def pieces(self, size: int = PIECE) -> Iterator[FloatArray]:
        """Yield the points in order, (k, 3) float64 with k up to ``size``; refuse those that are not finite."""
        begin = 0
        for piece in self._pieces(size):
            for k in np.flatnonzero(~np.isfinite(piece).all(axis=1))[:1].tolist():
                raise ValueError(
                    f"scan {str(self.path)!r}, point {begin + k} (from 0) is {piece[k].tolist()}: leave such points out"
                )
            begin += len(piece)
            yield piece

    def _pieces(self, size: int) -> Iterator[FloatArray]:
        if self._rows is not None:
            for begin in range(0, self.n, size):
                rows = self._rows[begin : begin + size]
                if rows.dtype.names:
                    yield np.stack([rows[c].astype(np.float64) for c in "xyz"], axis=1)
                else:
                    yield np.array(rows[:, :3], np.float64)
            return
        with self.path.open(encoding="utf-8", errors="replace") as file:
            lines = (line for line in islice(file, self._skipped, None) if line.strip())
            for begin in range(0, self.n, size):
                try:
                    yield np.loadtxt(
                        list(islice(lines, min(size, self.n - begin))),
                        delimiter=self._separator, usecols=self._columns, ndmin=2, comments=None,
                    )  # fmt: skip
                except ValueError as error:
                    raise ValueError(
                        f"scan {str(self.path)!r}, lines from {begin + self._skipped + 1} on: {error}"
                    ) from None

    def sample(self, n: int) -> FloatArray:
        """Return about n points, evenly from the whole file."""
        step, found, first = max(self.n // n, 1), [], 0
        for piece in self.pieces():
            found.append(piece[(-first) % step :: step])
            first += len(piece)
        return np.concatenate(found)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _array_of(path: Path, name: str) -> NDArray[Any]:
    try:
        rows = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise ValueError(f"{name} is no .npy file ({error}): pass np.save's") from None
    if rows.ndim != 2 or rows.shape[1] < 3 or rows.dtype.kind not in "fiu":
        raise ValueError(
            f"{name} holds {rows.dtype} {rows.shape}: pass numbers (n, 3), or more columns"
        )
    found: NDArray[Any] = rows
    return found
