"""The caustic of a turned glass body, exact and as ever more triangles.

python tools/caustic_of_meshes.py --out docs --threads 2
python tools/caustic_of_meshes.py --quick --out caustic
python tools/caustic_of_meshes.py --out docs --redraw docs/caustic_of_meshes.json

Prints seconds and errors; writes caustic_of_meshes.json, .png (pictures) and
caustic_error_against_time.png to the folder given with --out. --redraw draws the latter alone.
"""

import argparse
import importlib.util
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.mesh_caustics import Curve, curves, truth
from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, save
from hybrid_rt.analysis.picture_sheet import sheet
from hybrid_rt.analysis.units import percent
from hybrid_rt.cli.command import earlier_rows, kept, one_or_more, run_tool, say_if_no_plots
from hybrid_rt.sensor.color import screen_pixels
from meshing.outputs import make_folder, replacing

TRIANGLES = (1_000, 10_000, 100_000, 1_000_000)
# Stops: the floor in the shadow is to be seen, the focus may be white.
EXPOSURE = 3.0
ERRORS = "caustic_error_against_time.png"


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("caustic"), help="folder")
    parser.add_argument("--quick", action="store_true", help="small pictures, few triangles")
    parser.add_argument("--threads", type=one_or_more)
    parser.add_argument("--redraw", type=Path, metavar="FILE.json", help="measure nothing")
    args = parser.parse_args()
    make_folder(args.out)
    say_if_no_plots("caustic_error_against_time.png")
    if args.redraw:
        rows = earlier_rows(args.redraw, "relmse", "curves", "caustic_of_meshes.json")
        draw_errors(rows, args.out / ERRORS)
        return 0
    size, photons = (64, 20_000) if args.quick else (200, 100_000)
    triangles = TRIANGLES[:2] if args.quick else TRIANGLES
    passes = (1, 4) if args.quick else (1, 4, 16)
    print(f"truth: {size} x {size} pixels, {photons:,} photons a pass", flush=True)
    print(f"{'body':30s} {'build s':>7s} | seconds and error after {passes} passes")
    reference = truth(size, 4 * max(passes), photons, args.threads)
    found: list[Curve] = []
    with kept(args.out / "caustic_of_meshes.json", lambda: figures(found, passes)):
        for curve in curves(reference, triangles, passes, photons, args.threads):
            found.append(curve)
            steps = "  ".join(
                f"{t:6.2f} s {percent(math.sqrt(e)):>6s}"
                for t, e in zip(curve.seconds, curve.errors, strict=True)
            )
            print(f"{curve.name:30s} {curve.build_seconds:7.2f} | {steps}", flush=True)
    print(
        "error: relative RMSE against the truth on the floor beside the body, where the caustic is"
    )
    draw_pictures(reference, found, 4 * max(passes), args.out / "caustic_of_meshes.png")
    draw_errors(figures(found, passes), args.out / ERRORS)
    return 0


def figures(found: list[Curve], passes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return the data of curves."""
    return [
        {
            "name": curve.name, "triangles": curve.n_triangles, "smooth": curve.smooth,
            "passes": list(passes), "seconds": curve.seconds, "relmse": curve.errors,
            "build_seconds": curve.build_seconds,
        }
        for curve in found
    ]  # fmt: skip


def draw_pictures(reference: np.ndarray, found: list[Curve], passes: int, file: Path) -> None:
    """Write all pictures in two rows: triangles and the exact body; smoothed, and the truth."""
    import imageio.v3 as imageio

    flat = [curve for curve in found if curve.n_triangles and not curve.smooth] + [found[0]]
    smooth = [curve for curve in found if curve.smooth]
    panels = [(_caption(curve), screen_pixels(curve.image, EXPOSURE)) for curve in flat + smooth]
    truth_caption = f"exact surface, {passes} passes: the truth"
    panels.append((truth_caption, screen_pixels(reference, EXPOSURE)))
    title = "Light through a body of glass: a caustic shows every triangle"
    pixels = sheet(panels, len(flat), title=title, least_width=len(reference))
    with replacing(file) as opened:
        imageio.imwrite(opened, pixels, extension=".png")


def _caption(curve: Curve) -> str:
    if not curve.n_triangles:
        return "exact surface"
    return f"{curve.n_triangles:,} triangles" + (", normals smoothed" if curve.smooth else "")


def draw_errors(rows: list[dict[str, Any]], file: Path) -> None:
    """Write the errors against seconds, if there is matplotlib."""
    if importlib.util.find_spec("matplotlib") is None:  # which was said before the work
        return
    lines = [
        Line(
            "exact surface"
            if not row["triangles"]
            else f"{row['triangles']:,} triangles" + (", smoothed" if row["smooth"] else ""),
            [
                Mark((s, s, s), (100.0 * math.sqrt(e),) * 3, str(n))
                for n, s, e in zip(row["passes"], row["seconds"], row["relmse"], strict=True)
            ],
        )
        for row in rows
    ]
    diagram = Diagram(
        "A caustic through glass: triangles leave an error that passes do not remove",
        "seconds to render, building included",
        "error of the floor beside the body, % (relative RMSE)",
        lines,
        note="Lower and further left is better. Numbers: passes. The floor beside the body shows its "
        "shadow and its caustic alone. smoothed: normals interpolated between vertices.",
    )
    save([diagram], file)


if __name__ == "__main__":
    sys.exit(run_tool(main))
