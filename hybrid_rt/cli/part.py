"""``hybrid-rt part``: a report on a CAD part, each answer with how sure it is."""

from __future__ import annotations

import argparse
from pathlib import Path

from hybrid_rt.cli.cad import add_reading, read
from hybrid_rt.cli.command import one_or_more, say
from hybrid_rt.cli.options import add_progress_options
from hybrid_rt.cli.render import shown_progress
from meshing.outputs import check_outputs, replacing

DESCRIPTION = """\
Report on the closed parts of a CAD file: volume, box, least wall thickness (along normals, and of balls inside),
clearance, draft, holes and fillets. Thickness and clearance are proven: none is less than the bound beside them.
"""
EXAMPLES = """\
examples:
  hybrid-rt part part.step
  hybrid-rt part part.step --out part.html --out part.json --out faces.csv
  hybrid-rt part part.step --pull 0 0 1              draft angles and undercuts
  hybrid-rt part part.step --map thickness.ply       triangles in the colours of their thickness
  hybrid-rt part part.step --meshes                  how fine an STL must be for the same answers
"""
ENDINGS = (".html", ".json", ".csv")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt part`` takes."""
    parser.add_argument("file", type=Path, metavar="FILE", help=".step, .stp, .iges, .igs or .brep")
    parser.add_argument(
        "--out", type=Path, action="append", default=[], metavar="REPORT", help=".html, .json or .csv; several times"
    )  # fmt: skip
    add_reading(parser)
    parser.add_argument(
        "--pull", type=float, nargs=3, metavar=("X", "Y", "Z"), help="pull direction of the mould"
    )
    parser.add_argument(
        "--angle", type=float, default=20.0, metavar="DEGREES", help="walls within this of antiparallel are opposite (20)"
    )  # fmt: skip
    parser.add_argument("--seconds", type=float, default=60.0, help="for each search (60)")
    parser.add_argument(
        "--no-clearance", action="store_true", help="leave out the clearance of parts"
    )
    parser.add_argument("--meshes", action="store_true", help="take the answers from meshes, too")
    parser.add_argument(
        "--map", type=Path, metavar="PLY", help="the thickness on triangles, as colours"
    )
    parser.add_argument("--threads", type=one_or_more)
    add_progress_options(parser)


def run(options: argparse.Namespace) -> None:
    """Report, and write what is asked for."""
    from hybrid_rt.analysis.tables import in_text
    from hybrid_rt.part.page import answers, page_of, warnings_of
    from hybrid_rt.part.pictures import write_map
    from hybrid_rt.part.report import part_report

    for out in options.out:
        if out.suffix.lower() not in ENDINGS:
            raise ValueError(
                f"output {str(out)!r} ends in {out.suffix!r}: pass .html, .json or .csv"
            )
    maps = [options.map] if options.map else []
    if maps and options.map.suffix.lower() != ".ply":
        raise ValueError(f"--map {str(options.map)!r} ends in {options.map.suffix!r}: pass .ply")
    check_outputs([*options.out, *maps], [options.file])
    model = read(options, options.file)
    with shown_progress(options.progress) as progress:
        report = part_report(
            model, pull=options.pull, angle=options.angle, seconds=options.seconds,
            clearances=not options.no_clearance, meshes=options.meshes, threads=options.threads,
            progress=progress,
        )  # fmt: skip
    for part in report.parts:
        say(in_text(answers(part, report.unit)))
        for line in warnings_of(part):
            say(line)
    for clearance in report.clearances:
        a, b = clearance.parts
        say(
            f"parts {a} and {b}: {clearance.found.value:.8g} apart, at least {clearance.found.bound:.8g}"
        )
    for line in report.skipped:
        say(f"left out: {line}")
    for out in options.out:
        text = {
            ".html": lambda: page_of(report, options.file.name, report.walls), ".json": report.to_json,
            ".csv": report.to_csv,
        }[out.suffix.lower()]()  # fmt: skip
        with replacing(out) as file:
            file.write(text.encode())
        say(str(out))
    if options.map:
        for k, walls in enumerate(report.walls):
            file = options.map if k == 0 else options.map.with_stem(f"{options.map.stem}_{k}")
            n, low, high = write_map(walls, file)
            say(f"{file}  ({n:,} triangles, from {low:.4g} red to {high:.4g} blue)")
