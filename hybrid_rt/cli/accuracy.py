"""``hybrid-rt accuracy``: how fine a mesh must be, and what exactness costs."""

import argparse
import csv
import importlib.util
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hybrid_rt.analysis import mesh_diagrams
from hybrid_rt.analysis.mesh_error import RAYS, Rung, climb
from hybrid_rt.analysis.methods import size_of
from hybrid_rt.analysis.units import number
from hybrid_rt.cli.cad import add_reading, read, takes
from hybrid_rt.cli.command import (
    check_results,
    earlier_rows,
    kept,
    one_or_more,
    say,
    say_if_no_plots,
)
from hybrid_rt.cli.scene_file import load_scene
from meshing import BezierPatches
from meshing.outputs import replacing

LADDER = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
QUICK = (3e-2, 3e-3, 3e-4)
PICTURES = ("error_against_time.png", "mesh_error.png")


DESCRIPTION = """\
Tell how fine a mesh must be, and what exactness costs.

Of a CAD file the mesh is the one that `tessellate` makes of all faces: how fine must an STL of the part be?
Prints a table of tolerances; writes table.json, table.csv, error_against_time.png and
mesh_error.png to the folder given with --out. --redraw draws the pictures of an earlier table.
"""
EXAMPLES = """\
examples:
  hybrid-rt accuracy hybrid_rt/data/teapot.bpt --out teapot
  hybrid-rt accuracy part.step --quick
  hybrid-rt accuracy scenes/vase.py --out vase
  hybrid-rt accuracy scenes/vase.py --out vase --redraw vase/table.json
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt accuracy`` takes."""
    parser.add_argument(
        "file", type=Path, help="a .bpt or CAD file, or a scene script (which is run)"
    )
    add_reading(parser)
    parser.add_argument("--out", type=Path, help="folder for tables and pictures")
    parser.add_argument(
        "--quick", action="store_true", help="three tolerances, a tenth of the rays"
    )
    parser.add_argument("--redraw", type=Path, metavar="table.json", help="measure nothing")
    parser.add_argument("--rays", type=one_or_more, help="of each kind (default 200000)")
    parser.add_argument("--threads", type=one_or_more)


def run(args: argparse.Namespace) -> None:
    """Measure and print what is asked for, or draw an earlier table."""
    if args.out:
        say_if_no_plots("error_against_time.png and mesh_error.png")
    surfaces = load(args.file, args)
    size = size_of(surfaces)
    if args.redraw:
        if not args.out:
            raise ValueError("--redraw has no folder: pass --out as well")
        _check_out(args.out)
        rows = earlier_rows(args.redraw, "microseconds", "table", "table.json")
        draw(args.out, args.file, surfaces, rows)
        return
    tolerances = [step * size for step in (QUICK if args.quick else LADDER)]
    n_rays = args.rays or (20_000 if args.quick else 200_000)
    say(f"{args.file}: size {size:.4g} scene units; {n_rays:,} rays of each kind")
    say(HEADER)
    rungs: list[Rung] = []

    def hear(rung: Rung) -> None:
        rungs.append(rung)
        say(row(rung))

    if args.out:
        _check_out(args.out)
    table = args.out and args.out / "table.json"
    with kept(table, lambda: [rung.figures for rung in rungs]):
        rungs[:] = climb(surfaces, tolerances, n_rays, threads=args.threads, on_rung=hear)
    say(WORDS)
    say(speeds(rungs))
    if args.out:
        write(args.out, args.file, surfaces, rungs)


def _check_out(folder: Path) -> None:
    has_plots = importlib.util.find_spec("matplotlib") is not None
    check_results(
        folder,
        ["table.json", "table.csv", *(PICTURES if has_plots else ())],
        lambda held: bool(held) and all("microseconds" in rung for rung in held),
    )


def load(file: Path, args: argparse.Namespace) -> list[Any]:
    """Return the curved surfaces of a file; of a CAD file all faces that are no meshes."""
    if takes(file, args):
        return read(args, file).faces_in_places()
    if file.suffix == ".bpt":
        return [BezierPatches.read(file)]
    curved = [item.surface for item in load_scene(file).objects if item.surface.is_freeform]
    if not curved:
        raise ValueError(
            f"{file} has neither patches nor a surface of revolution: name a file with one. All others, "
            "aspheres and tori among them, are never made of triangles: hybrid-rt study FILE --only hits times "
            "their exact hits"
        )
    return curved


HEADER = (
    f"{'':10} {'':10} {'':8} {'':6} {'off by, scene units':>19} {'normal':>7} | "
    f"{'wrong first hits, %: mesh':>26} | {'after Newton':>26} | {'right hits':>10}\n"
    f"{'tolerance':>10} {'triangles':>10} {'build s':>8} {'MiB':>6} {'proven':>9} {'measured':>9} "
    f"{'deg':>7} | "
    + " | ".join([" ".join(f"{kind[:8]:>8}" for kind in RAYS)] * 2)
    + f" | {'off by':>10}"
)
WORDS = """
tolerance: asked for, largest distance between triangles and surface, scene units. proven: the bound
  that the tessellation states; measured: the largest of 20 000 samples and more.
normal: mean angle between the normals of triangle and surface, degrees. MiB: peak memory of the mesh.
wrong first hits: share of the rays that hit anything which miss the surface, find something where
  nothing is, or find a farther sheet; random rays, a camera's, and rays along the silhouette.
after Newton: hits moved from the triangles onto the true surface, accuracy "refined".
right hits off by: mean distance along the ray, camera rays on the mesh, scene units."""


def row(rung: Rung) -> str:
    """Put one rung into a line."""
    shares = " | ".join(
        " ".join(f"{number(100.0 * rung.errors[name][kind].wrong, 2):>8}" for kind in RAYS)
        for name in ("mesh", "refined")
    )
    return (
        f"{number(rung.tolerance, 2):>10} {rung.triangles:10,d} {rung.build_seconds:8.2f} "
        f"{rung.memory / 2**20:6.1f} {number(rung.bound, 2):>9} {number(rung.worst, 2):>9} "
        f"{rung.mean_angle:7.2f} | {shares} | {number(rung.errors['mesh']['camera'].mean, 2):>10}"
    )


def speeds(rungs: Sequence[Rung]) -> str:
    """Put the times per ray into lines."""
    lines = [f"\nus a ray, finest mesh           {' '.join(f'{kind[:10]:>10}' for kind in RAYS)}"]
    for name, kinds in rungs[-1].microseconds.items():
        times = " ".join(f"{number(kinds[kind], 2):>10}" for kind in RAYS)
        lines.append(f"  {name:29s} {times}")
    exact = rungs[-1].microseconds["certified"]["random"]
    mesh = rungs[-1].microseconds["mesh"]["random"]
    lines.append(
        'us a ray: microseconds of wall time. certified: proven to be the first hit; coarse="none": '
        "the same without Embree.\n"
        f"Exactness costs {exact / mesh:.2f} times the finest mesh, for a random ray."
    )
    return "\n".join(lines)


def write(folder: Path, file: Path, surfaces: Sequence[Any], rungs: Sequence[Rung]) -> None:
    """Write the other table and the pictures, and say what there is."""
    text, flat = io.StringIO(newline=""), [_flat(rung.figures) for rung in rungs]
    csv.writer(text).writerows([flat[0], *(line.values() for line in flat)])
    with replacing(folder / "table.csv") as opened:
        opened.write(text.getvalue().encode())
    pictures = draw(folder, file, surfaces, [rung.figures for rung in rungs])
    written = [folder / "table.json", folder / "table.csv", *pictures]
    say(f"\nwrote {', '.join(str(path) for path in written)}")


def draw(
    folder: Path, file: Path, surfaces: Sequence[Any], rungs: Sequence[dict[str, Any]]
) -> list[Path]:
    """Write the pictures of a table, if there is matplotlib; return their files."""
    if importlib.util.find_spec("matplotlib") is None:  # which was said before the work
        return []
    time, error = (folder / name for name in PICTURES)
    mesh_diagrams.draw_time(rungs, file.stem, time)
    mesh_diagrams.draw_error(surfaces, 1e-3 * size_of(surfaces), file.stem, error)
    return [time, error]


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            out.update(_flat(value, f"{prefix}{key} "))
        else:
            out[f"{prefix}{key}"] = value
    return out
