"""The caustic of a turned glass body, exact and as ever more triangles.

python tools/caustic_of_meshes.py --out docs --threads 2
python tools/caustic_of_meshes.py --quick --out caustic

Prints seconds and errors; writes caustic_of_meshes.json, .png (pictures) and
caustic_error_against_time.png to the folder given with --out.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.benchmarks.mesh_caustics import Curve, curves, truth
from hybrid_rt.cli.command import kept, one_or_more, run_tool, say_if_no_plots
from hybrid_rt.sensor.color import screen_pixels

TRIANGLES = (1_000, 10_000, 100_000, 1_000_000)
EXPOSURE = 1.5


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("caustic"), help="folder")
    parser.add_argument("--quick", action="store_true", help="small pictures, few triangles")
    parser.add_argument("--threads", type=one_or_more)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    say_if_no_plots("caustic_error_against_time.png")
    size, photons = (64, 20_000) if args.quick else (200, 100_000)
    triangles = TRIANGLES[:2] if args.quick else TRIANGLES
    passes = (1, 4) if args.quick else (1, 4, 16)
    print(f"truth: {size} x {size}, {photons} photons a pass", flush=True)
    reference = truth(size, 4 * max(passes), photons, args.threads)
    found: list[Curve] = []
    with kept(args.out / "caustic_of_meshes.json", lambda: figures(found, passes)):
        for curve in curves(reference, triangles, passes, photons, args.threads):
            found.append(curve)
            steps = "  ".join(
                f"{t:7.2f} s {e:.2e}" for t, e in zip(curve.seconds, curve.errors, strict=True)
            )
            print(f"{curve.name:30s} build {curve.build_seconds:6.2f} s | {steps}", flush=True)
    draw(args.out, reference, found)
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


def draw(folder: Path, reference: np.ndarray, found: list[Curve]) -> None:
    """Write pictures."""
    import imageio.v3 as imageio

    flat = [curve.image for curve in found if curve.n_triangles and not curve.smooth]
    smooth = [curve.image for curve in found if curve.smooth]
    sheet = np.vstack([np.hstack([*flat, found[0].image]), np.hstack([*smooth, reference])])
    imageio.imwrite(folder / "caustic_of_meshes.png", screen_pixels(sheet, EXPOSURE))
    try:
        import matplotlib as mpl
    except ImportError:  # which was said before the work
        return
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for curve in found:
        style = "--" if curve.smooth else "-"
        color = "black" if curve.n_triangles == 0 else f"C{int(np.log10(curve.n_triangles)) - 3}"
        axes.loglog(curve.seconds, curve.errors, style, color=color, marker="o", label=curve.name)
    axes.set_xlabel("seconds")
    axes.set_ylabel("relative MSE of the floor beside the body")
    axes.legend(fontsize=7)
    figure.savefig(folder / "caustic_error_against_time.png", dpi=120)


if __name__ == "__main__":
    sys.exit(run_tool(main))
