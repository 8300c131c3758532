"""Trace published lenses: focal lengths beside the printed ones, and spot diagrams.

python tools/lens_spots.py --out spots.png

Light of three field angles goes through each lens surface by surface, certified hits and Snell's law,
to the plane of least spread on the axis.
"""

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from hybrid_rt.analysis.lens import Lens
from hybrid_rt.analysis.lens_examples import (
    COOKE_HALF_FIELD,
    COOKE_PRINTED,
    COOKE_TRIPLET,
    DOUBLE_GAUSS,
    DOUBLE_GAUSS_PRINTED,
    stigmatic_singlet,
)
from hybrid_rt.cli.command import one_or_more, run_tool
from meshing.outputs import check_writable, replacing

# Lens, printed focus, largest field in degrees, diameter of the light in front.
LENSES = {
    "Cooke triplet, f/3.5": (COOKE_TRIPLET, COOKE_PRINTED, COOKE_HALF_FIELD, 29.2),
    "double Gauss, f/1.25": (DOUBLE_GAUSS, DOUBLE_GAUSS_PRINTED, 12.4, 80.0),
    "hyperboloid, f/0.9": (stigmatic_singlet(), None, 1.0, 58.0),
}
SHARES = (0.0, 0.7, 1.0)


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rays", type=one_or_more, default=400, help="across the light in front")
    parser.add_argument("--out", type=Path, metavar="FILE.png", help="draws the spots")
    args = parser.parse_args()
    if args.out is not None:
        if find_spec("matplotlib") is None:
            raise ModuleNotFoundError(
                f"--out {args.out}: the spots need matplotlib: pip install 'hybrid-rt[plot]', or leave out --out"
            )
        check_writable(args.out)
    spots = {name: show(name, args.rays) for name in LENSES}
    if args.out is not None:
        draw(spots, args.out)
    return 0


def show(name: str, n: int) -> list[tuple[str, np.ndarray, float]]:
    """Print the figures of one lens; return title, points and spread of each field."""
    prescription, printed, half_field, pupil = LENSES[name]
    lens = Lens(prescription)
    traced, paraxial = lens.focus(), lens.paraxial_focus()
    print(f"{name}: focal length, back focal distance")
    for what, focus in (("traced", traced), ("paraxial", paraxial), ("printed", printed)):
        if focus is not None:
            print(f"  {what:9}{focus.focal_length:12.6f}{focus.back_focal_distance:12.6f}")
    plane = lens.vertices[-1] + paraxial.back_focal_distance
    plane = lens.plane_of_least_spread(plane, pupil=pupil)
    print(
        f"  plane of least spread on the axis: {plane - lens.vertices[-1]:.4f} behind the last vertex"
    )
    found = []
    for share in SHARES:
        points, chief, rms = lens.spot(share * half_field, plane, pupil, n)
        print(
            f"  {share * half_field:6.2f} degrees: {len(points):7,} rays pass, spot {rms:.3g} (rms radius), "
            f"image {chief[1]:.4f} high"
        )
        found.append((f"{share * half_field:.1f} deg, rms {rms:.2g} mm", points - chief, rms))
    return found


def draw(spots: dict[str, list[tuple[str, np.ndarray, float]]], out: Path) -> None:
    """Draw all spots, each lens in a row of one scale."""
    import matplotlib.pyplot as plt

    figure, rows = plt.subplots(len(spots), len(SHARES), figsize=(8, 8.4), layout="constrained")
    for row, (name, found) in zip(rows, spots.items(), strict=True):
        half = max(np.abs(points).max() for _, points, _ in found)
        for axes, (title, points, _) in zip(row, found, strict=True):
            axes.plot(*points.T, ",", color="#24527a", alpha=0.5)
            axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", title=title)
            axes.tick_params(labelsize=7)
            axes.title.set_fontsize(9)
        row[0].set_ylabel(f"{name}\nmm", fontsize=9)
    with replacing(out) as file:
        figure.savefig(file, dpi=110, format=out.suffix[1:] or "png")


if __name__ == "__main__":
    sys.exit(run_tool(main))
