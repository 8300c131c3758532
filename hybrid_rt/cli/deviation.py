"""``hybrid-rt deviation``: how far measured points are from a model, in pieces of bounded memory."""

from __future__ import annotations

import argparse
import csv
import io
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from hybrid_rt.cli.cad import add_reading
from hybrid_rt.cli.command import one_or_more, say
from hybrid_rt.cli.options import add_progress_options
from hybrid_rt.cli.rays import surfaces_of
from hybrid_rt.cli.render import shown_progress
from meshing.checks import FloatArray
from meshing.outputs import check_outputs, replacing

if TYPE_CHECKING:
    from hybrid_rt.cad.model import CadModel
    from hybrid_rt.distance.deviation import Deviation

DESCRIPTION = """\
Tell how far measured points are from a CAD file, a mesh or Bezier patches: the signed distance to the nearest
point of the model, positive outside, with a proven bound.

SCAN is a .ply, a .npy of (n, 3), or text with x, y and z in each line, in the unit of the model; a first line
may name the columns. It is read, measured and written in pieces.
"""
EXAMPLES = """\
examples:
  hybrid-rt deviation part.step scan.ply
  hybrid-rt deviation part.step scan.ply --out colored.ply --out faces.csv --limit 0.1
  hybrid-rt deviation part.step scan.csv --fit --out report.json
"""
PIECE, SAMPLE, SHOWN = 200_000, 20_000, 10
# Without --limit the colours are full at this percentile of a sample of deviations.
FULL_COLOR = 98
ENDINGS = {".ply": "coloured points", ".csv": "a table of faces", ".json": "all figures"}
VERTEX = np.dtype([
    *((c, "<f8") for c in "xyz"), ("deviation", "<f8"), *((c, "u1") for c in ("red", "green", "blue")),
    ("face", "<i4"),
])  # fmt: skip
PLY_NAMES = {"f8": "double", "u1": "uchar", "i4": "int"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt deviation`` takes."""
    parser.add_argument("file", type=Path, metavar="MODEL", help="CAD file, mesh, or .bpt")
    parser.add_argument(
        "scan", type=Path, metavar="SCAN", help=".ply, .npy, .csv, .xyz, .txt, .asc or .pts"
    )
    words = ", ".join(f"{ending}: {what}" for ending, what in ENDINGS.items())
    parser.add_argument("--out", type=Path, action="append", default=[], metavar="FILE", help=words)
    parser.add_argument(
        "--fit", action="store_true", help="move the points first, as one, to where they fit best"
    )
    parser.add_argument(
        "--limit", type=float, metavar="D", help="deviation of full colour (default: by the scan)"
    )
    add_reading(parser)
    parser.add_argument("--threads", type=one_or_more)
    add_progress_options(parser)


def run(options: argparse.Namespace) -> None:
    """Measure the points, write what is asked for, and print a summary."""
    from hybrid_rt.distance import ClosestPoint
    from hybrid_rt.distance.deviation import best_fit, deviation, measure
    from hybrid_rt.distance.scans import Scan
    from meshing.checks import number

    for out in options.out:
        if out.suffix.lower() not in ENDINGS:
            raise ValueError(
                f"output {str(out)!r} ends in {out.suffix!r}: pass .ply, .csv or .json"
            )
    check_outputs(options.out, [options.file, options.scan])
    limit = options.limit
    if limit is not None:
        number(limit, "--limit", above=0.0, hint="in the unit of the model")
    scan = Scan(options.scan)
    surfaces, model = surfaces_of(options, options.file)
    closed = None if model is None else model.closed
    search = ClosestPoint(surfaces, closed=closed, threads=options.threads)
    sample = scan.sample(SAMPLE)
    fit = best_fit(search, sample) if options.fit else None
    if limit is None:
        found = measure(search, sample if fit is None else fit.moved(sample)).deviation
        limit = max(float(np.percentile(np.abs(found), FULL_COLOR)), 1e-300)
    done = 0
    with ExitStack() as opened:
        files = {out: opened.enter_context(replacing(out)) for out in options.out}
        colored = [file for out, file in files.items() if out.suffix.lower() == ".ply"]
        progress = opened.enter_context(shown_progress(options.progress))
        for file in colored:
            file.write(_head(scan.n, limit))

        def each(points: FloatArray, measured: Any, face: Any) -> None:
            nonlocal done
            done += len(points)
            rows = _vertices(points, measured.deviation, face, limit).tobytes() if colored else b""
            for file in colored:
                file.write(rows)
            if progress is not None:
                progress("points", done, scan.n)

        result = deviation(
            search, scan.pieces(PIECE), face_of=None if model is None else model.face_at, fit=fit, each=each
        )  # fmt: skip
        for out, file in files.items():
            if out.suffix.lower() != ".ply":
                (_write_table if out.suffix.lower() == ".csv" else _write_report)(
                    file, result, model, limit
                )
    say(in_words(result, model))
    for out in options.out:
        say(f"{out}  ({ENDINGS[out.suffix.lower()]})")


def _head(n: int, limit: float) -> bytes:
    fields = [(name, VERTEX[name].str[1:]) for name in VERTEX.names or ()]
    properties = "".join(f"property {PLY_NAMES[code]} {name}\n" for name, code in fields)
    words = f"comment colours: blue at -{limit:.6g}, white at 0, red at {limit:.6g}\n"
    head = (
        f"ply\nformat binary_little_endian 1.0\n{words}element vertex {n}\n{properties}end_header\n"
    )
    return head.encode()


def _vertices(points: FloatArray, deviation: FloatArray, face: Any, limit: float) -> Any:
    from hybrid_rt.distance.deviation import colors_of

    rows = np.empty(len(points), VERTEX)
    for name, column in zip("xyz", points.T, strict=True):
        rows[name] = column
    rows["deviation"], rows["face"] = deviation, face
    for name, column in zip(("red", "green", "blue"), colors_of(deviation, limit).T, strict=True):
        rows[name] = column
    return rows


def _write_table(file: BinaryIO, result: Deviation, model: CadModel | None, limit: float) -> None:
    del limit
    text = io.StringIO(newline="")
    rows = csv.writer(text, lineterminator="\n")
    names = list(result.faces.dtype.names or ())
    rows.writerow([names[0], "kind", *names[1:]])
    rows.writerows([face, _kind(model, face), *rest] for face, *rest in result.faces.tolist())
    file.write(text.getvalue().encode())


def _write_report(file: BinaryIO, result: Deviation, model: CadModel | None, limit: float) -> None:
    from hybrid_rt.core.plain_records import as_json

    names = list(result.faces.dtype.names or ())
    faces = [dict(zip(names, row, strict=True)) for row in result.faces.tolist()]
    report: dict[str, Any] = {
        name: getattr(result, name)
        for name in ("n", "mean", "rms", "least", "most", "bound", "by_normal", "undecided")
    }
    report |= {
        "percentiles": {str(k): x for k, x in result.percentiles.items()},
        "color_limit": limit,
    }
    report["faces"] = [{**face, "kind": _kind(model, face["face"])} for face in faces]
    report["unit"] = None if model is None else model.report["unit"]
    if result.fit is not None:
        report["fit"] = result.fit
    file.write(as_json(report).encode())


def _kind(model: CadModel | None, face: int) -> str:
    return "" if model is None else str(model.faces["kind"][face])


def in_words(result: Deviation, model: CadModel | None) -> str:
    """Return a summary of deviations."""
    unit = "" if model is None else f" {model.report['unit']}"
    lines = []
    if (fit := result.fit) is not None:
        lines.append(
            f"best fit of {fit.n:,} points: rms {fit.rms_before:.6g} before, {fit.rms:.6g} after{unit}"
            + (f"; {fit.free} direction(s) are not determined by them" if fit.free else "")
        )
    share = ", ".join(f"{k} %: {x:.6g}" for k, x in result.percentiles.items())
    lines += [
        f"{result.n:,} points: mean {result.mean:.6g}, rms {result.rms:.6g}, bound {result.bound:.2g}{unit}",
        f"from {result.least:.6g} to {result.most:.6g}; {share}",
    ]
    if result.by_normal:
        lines.append(
            f"{result.by_normal:,} are signed by normals only: what is nearest to them bounds no closed body"
        )
    if result.undecided:
        lines.append(
            f"{result.undecided:,} are undecided: their searches ended early, within the bound"
        )
    worst = np.maximum(np.abs(result.faces["least"]), np.abs(result.faces["most"]))
    lines.append(
        f"{'face':>8} {'kind':10} {'points':>10} {'mean':>12} {'rms':>12} {'least':>12} {'most':>12}"
    )
    for k in np.argsort(-worst, kind="stable")[:SHOWN].tolist():
        face, n, *rest = result.faces[k].tolist()
        figures = " ".join(f"{x:12.6g}" for x in rest)
        lines.append(f"{face:8} {_kind(model, face):10} {n:10,} {figures}")
    if len(result.faces) > SHOWN:
        lines.append(f"  and {len(result.faces) - SHOWN} more faces, nearer: --out faces.csv")
    return "\n".join(lines)
