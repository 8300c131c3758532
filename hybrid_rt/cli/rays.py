"""``hybrid-rt rays``: first hits of rays of a file, in pieces of bounded memory."""

from __future__ import annotations

import argparse
import csv
import importlib.util
import io
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.cli.cad import add_reading, read, takes
from hybrid_rt.cli.command import one_or_more, say
from hybrid_rt.cli.options import add_progress_options
from hybrid_rt.cli.render import shown_progress
from hybrid_rt.core.records import HitRecord
from meshing.checks import FloatArray, check_is_file
from meshing.outputs import check_writable, replacing

if TYPE_CHECKING:
    from hybrid_rt.cad.model import CadModel

DESCRIPTION = """\
Trace rays of a .npy file at a CAD file, a mesh or Bezier patches, and write their first hits.

RAYS.npy holds (n, 6) numbers: origin and direction of each ray, in the unit of the model. It is read,
traced and written in pieces, so millions of rays need no more memory than one piece (and the results of
.npz wait on disk). Rows are in the order of the rays; t counts lengths of each direction.
"""
EXAMPLES = """\
examples:
  hybrid-rt rays part.step rays.npy --out hits.npz
  hybrid-rt rays part.step rays.npy --out hits.csv --unit mm
  hybrid-rt rays part.stl rays.npy --out hits.parquet
"""
PIECE = 200_000
ENDINGS = (".npz", ".csv", ".parquet")

Columns: TypeAlias = dict[str, NDArray[Any]]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt rays`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help="CAD file, mesh, or .bpt")
    parser.add_argument("rays", type=Path, metavar="RAYS.npy", help="(n, 6): origins, directions")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="HITS", help=".npz, .csv or .parquet"
    )
    add_reading(parser)
    parser.add_argument("--threads", type=one_or_more)
    add_progress_options(parser)
    parser.add_argument("--piece", type=one_or_more, default=PIECE, help=f"rays a piece ({PIECE})")


def run(options: argparse.Namespace) -> None:
    """Trace the rays, and say how many hit what."""
    from hybrid_rt import Intersector

    _check_out(options.out)
    rays = _as_rays(options.rays)
    surfaces, model = surfaces_of(options, options.file)
    tracer = Intersector(surfaces, coarse="none", threads=options.threads)
    n, n_hit, n_edge = len(rays), 0, 0
    with shown_progress(options.progress) as progress, _writer(options.out, n) as write:
        for begin in range(0, max(n, 1), options.piece):  # columns have names without rays, too
            piece = np.array(rays[begin : begin + options.piece], np.float64)
            try:
                hits = tracer.intersect(piece[:, :3], piece[:, 3:])
            except ValueError as error:
                raise ValueError(f"{options.rays}, rays from {begin} on: {error}") from None
            columns = _columns(hits, model)
            write(begin, columns)
            n_hit += int(hits.hit.sum())
            n_edge += int(columns["edge"].sum())
            if progress is not None:
                progress("rays", begin + len(piece), n)
    say(f"{options.out}  ({n:,} rays, {n_hit:,} hit, {n_edge:,} of them within the gap of an edge)")


def surfaces_of(options: argparse.Namespace, file: Path) -> tuple[list[Any], CadModel | None]:
    """Return the surfaces of a file, and of a CAD file the model."""
    if takes(file, options):
        model = read(options, file)
        return model.surfaces, model
    if file.suffix.lower() == ".bpt":
        from meshing import BezierPatches

        return [BezierPatches.read(file)], None
    from hybrid_rt import TriangleMesh

    return [TriangleMesh.read(file)], None


def _as_rays(file: Path) -> FloatArray:
    """Return the rays of a file, which stay there until they are asked for."""
    check_is_file(file, f"rays {str(file)!r}")
    try:
        rays = np.load(file, mmap_mode="r", allow_pickle=False)
    except (ValueError, EOFError) as error:
        raise ValueError(f"rays {str(file)!r} is no .npy file ({error}): pass np.save's") from None
    shape = getattr(rays, "shape", None)
    if shape is not None and len(shape) == 3 and shape[1:] == (2, 3):
        rays = rays.reshape(-1, 6)
    if (
        shape is None
        or len(shape) not in (2, 3)
        or rays.shape[1:] != (6,)
        or rays.dtype.kind not in "fiu"
    ):
        held = "several arrays" if shape is None else f"{shape} of {rays.dtype}"
        raise ValueError(
            f"rays {str(file)!r} holds {held}: pass real numbers (n, 6), origin and direction"
        )
    return rays


def _columns(hits: HitRecord, model: CadModel | None) -> Columns:
    """Return the columns of a table; ``face`` and ``part`` are those of the CAD file, -1 on a miss."""
    columns = hits.columns()
    if model is None:
        return columns
    owners = {"face": model.face_at(hits), "part": model.part_at(hits)}
    return {"t": columns.pop("t"), **owners, **columns}


def _check_out(out: Path) -> None:
    if out.suffix.lower() not in ENDINGS:
        raise ValueError(f"output {str(out)!r} ends in {out.suffix!r}: pass .npz, .csv or .parquet")
    if out.suffix.lower() == ".parquet" and importlib.util.find_spec("pyarrow") is None:
        raise ImportError(
            f"output {str(out)!r} needs pyarrow: pip install 'hybrid-rt[parquet]', or write .npz or .csv"
        )
    check_writable(out)


@contextmanager
def _writer(out: Path, n: int) -> Iterator[Callable[[int, Columns], None]]:
    """Return what writes the columns of a piece that begins at a ray."""
    kind = out.suffix.lower()
    with replacing(out) as file:
        if kind == ".npz":
            yield from _arrays(file, n)
        elif kind == ".csv":
            yield lambda begin, columns: _lines(file, begin, columns)
        else:
            yield from _parquet(file)


def _arrays(file: BinaryIO, n: int) -> Iterator[Callable[[int, Columns], None]]:
    """Keep columns on disk until all are there, then pack them."""
    with tempfile.TemporaryDirectory(prefix="hybrid_rt_rays_") as folder:
        whole: dict[str, Any] = {}

        def write(begin: int, columns: Columns) -> None:
            for name, column in columns.items():
                if name not in whole:
                    path = Path(folder) / f"{name}.npy"
                    dtype = np.dtype("U7") if name == "status" else column.dtype
                    whole[name] = np.lib.format.open_memmap(path, "w+", dtype, (n,))
                whole[name][begin : begin + len(column)] = column

        yield write
        for column in whole.values():
            column.flush()
        with zipfile.ZipFile(file, "w") as packed:
            for name in whole:
                packed.write(Path(folder) / f"{name}.npy", f"{name}.npy")


def _lines(file: BinaryIO, begin: int, columns: Columns) -> None:
    text = io.StringIO(newline="")
    rows = csv.writer(text, lineterminator="\n")
    if begin == 0:
        rows.writerow(columns)
    rows.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
    file.write(text.getvalue().encode())


def _parquet(file: BinaryIO) -> Iterator[Callable[[int, Columns], None]]:
    import pyarrow
    import pyarrow.parquet

    writers: list[Any] = []

    def write(_begin: int, columns: Columns) -> None:
        table = pyarrow.table(columns)
        if not writers:
            writers.append(pyarrow.parquet.ParquetWriter(file, table.schema))
        writers[0].write_table(table)

    try:
        yield write
    finally:
        for writer in writers:
            writer.close()
