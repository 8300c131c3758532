"""``hybrid-rt cad``: what a CAD file holds, and what of it is exact."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid_rt.cad.records import MM
from hybrid_rt.cli.command import say, tell

if TYPE_CHECKING:
    from hybrid_rt.cad.model import CadModel

DESCRIPTION = """\
Tell what a CAD file (STEP, IGES, BREP) holds: parts, faces by kind and whether they are exact, the largest
gaps between faces along their edges, free edges, and what was refused and why.
"""
EXAMPLES = """\
examples:
  hybrid-rt cad part.step
  hybrid-rt cad part.igs --sew 0.01 --unit mm
  hybrid-rt cad part.step --json > part.json
  hybrid-rt render part.step --passes 64
  hybrid-rt rays part.step rays.npy --out hits.npz
"""
SHOWN = 10


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt cad`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help=".step, .stp, .iges, .igs or .brep")
    add_reading(parser)
    parser.add_argument(
        "--json", action="store_true", help="print the report, parts and faces as JSON"
    )


def add_reading(parser: argparse._ActionsContainer) -> None:
    """Add how CAD files are read."""
    parser.add_argument("--unit", choices=("file", *MM), default="file", help="of all lengths")
    parser.add_argument("--sew", type=float, metavar="TOL", help="join edges so near to each other")
    parser.add_argument(
        "--approximate",
        type=float,
        metavar="TOL",
        help="replace offset surfaces, within this distance",
    )


def takes(file: Path, options: argparse.Namespace) -> bool:
    """Tell whether a file is a CAD file; refuse options of these for others."""
    from hybrid_rt.cad.process import SUFFIXES

    if file.suffix.lower() in SUFFIXES:
        return True
    if (options.unit, options.sew, options.approximate) != ("file", None, None):
        raise ValueError(f"{file} is no CAD file: leave out --unit, --sew and --approximate")
    return False


def read(options: argparse.Namespace, file: Path, *, is_traced: bool = True) -> CadModel:
    """Return the model of a file; what is refused is left out, and said. To be traced it needs faces."""
    from hybrid_rt.cad.model import read_cad

    model = read_cad(
        file, options.unit, sew=options.sew, approximate=options.approximate, refuse="skip"
    )
    if refused := model.report["refused"]:
        first = refused[0]
        tell(
            f"{file}: {len(refused)} of {len(model.faces)} faces are left out; face {first['face']} "
            f"({first['kind']}): {first['reason']}"
        )
    if is_traced and not model.surfaces:
        raise ValueError(f"CAD file {str(file)!r}: no face is left to meet: hybrid-rt cad says why")
    return model


def run(options: argparse.Namespace) -> None:
    """Print what a file holds."""
    model = read(options, options.file, is_traced=False)
    if options.json:
        from hybrid_rt.core.plain_records import as_json

        say(as_json(in_records(model)))
    else:
        say(in_words(model))


def in_records(model: CadModel) -> dict[str, Any]:
    """Return report, parts and faces as plain values."""
    parts = [
        {
            "name": part.name, "instance": part.instance, "color": part.color, "shape": part.shape,
            "is_closed": part.is_closed, "faces": [part.faces.start, part.faces.stop],
            "transform": part.transform.tolist(),
        }
        for part in model.parts
    ]  # fmt: skip
    names = [name for name in model.faces.dtype.names or () if name != "color"]
    faces = [dict(zip(names, row, strict=True)) for row in model.faces[names].tolist()]
    return {
        **model.report,
        "bounds": model.bounds.tolist(),
        "parts_placed": parts,
        "faces_listed": faces,
    }


def in_words(model: CadModel) -> str:
    """Return what a model holds as a table in words."""
    report, unit = model.report, model.report["unit"]
    low, high = model.bounds
    sides = " x ".join(f"{side:.6g}" for side in (high - low).tolist())
    first = f"{report['parts']} part(s) of {report['shapes']} shape(s), {report['closed_parts']} closed; "
    lines = [first + f"{len(model.faces)} faces; {sides} {unit}"]
    for part in model.parts[:SHOWN]:
        name = part.name or "(no name)"
        closed = "closed" if part.is_closed else "open"
        lines.append(f"  {name}: {part.faces.stop - part.faces.start} faces, {closed}")
    lines += _more(len(model.parts), "parts")
    lines += ["", f"{'faces':12} {'exact':>7} {'approx.':>8} {'mesh':>6} {'refused':>8}"]
    for kind, counts in sorted(report["faces"].items()):
        numbers = [counts.get(name, 0) for name in ("exact", "approximated", "mesh", "refused")]
        lines.append("{:12} {:>7} {:>8} {:>6} {:>8}".format(kind, *numbers))
    lines += ["", f"largest gaps between faces, {unit} (the file's own tolerance)"]
    for gap in report["gaps"][:SHOWN]:
        a, b = gap["faces"]
        kinds = " and ".join(str(model.faces["kind"][k]) for k in (a, b))
        lines.append(f"  {gap['gap']:.3g} ({gap['declared']:.3g}): faces {a} and {b}, {kinds}")
    lines.append(f"free edges: {report['free_edges']}")
    for refused in report["refused"][:SHOWN]:
        lines.append(f"refused: face {refused['face']} ({refused['kind']}): {refused['reason']}")
    lines += _more(len(report["refused"]), "refused faces")
    if report["wires"] or report["points"]:
        lines.append(
            f"ignored: {report['wires']} wires and {report['points']} points outside faces"
        )
    return "\n".join(lines)


def _more(number: int, what: str) -> list[str]:
    return [f"  and {number - SHOWN} more {what}: --json"] if number > SHOWN else []
