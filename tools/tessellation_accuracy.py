"""Tell how fine a mesh must be, and what exactness costs.

python tools/tessellation_accuracy.py hybrid_rt/data/teapot.bpt --out teapot
python tools/tessellation_accuracy.py scenes/vase.py --out vase

Prints a table of tolerances; writes table.json, table.csv, error_against_time.png and
mesh_error.png to the folder given with --out.
"""

import argparse
import csv
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.analysis.mesh_error import RAYS, Rung, climb, error_image
from hybrid_rt.cli.command import kept, one_or_more, run_tool, say_if_no_plots
from hybrid_rt.cli.scene_file import load_scene
from meshing import BezierPatches, SurfaceOfRevolution

LADDER = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
QUICK = (3e-2, 3e-3, 3e-4)


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, help="a .bpt file, or a scene script (which is run)")
    parser.add_argument("--out", type=Path, help="folder for tables and pictures")
    parser.add_argument(
        "--quick", action="store_true", help="three tolerances, a tenth of the rays"
    )
    parser.add_argument("--rays", type=one_or_more, help="of each kind (default 200000)")
    parser.add_argument("--threads", type=one_or_more)
    args = parser.parse_args()
    if args.out:
        say_if_no_plots("error_against_time.png and mesh_error.png")
    surfaces = load(args.file)
    low = np.min([s.bounds[0] for s in surfaces], axis=0)
    high = np.max([s.bounds[1] for s in surfaces], axis=0)
    size = float(np.linalg.norm(high - low))
    tolerances = [step * size for step in (QUICK if args.quick else LADDER)]
    n_rays = args.rays or (20_000 if args.quick else 200_000)
    print(f"{args.file}: size {size:.4g}; {n_rays} rays of each kind")
    print(HEADER)
    rungs: list[Rung] = []

    def hear(rung: Rung) -> None:
        rungs.append(rung)
        print(row(rung), flush=True)

    if args.out:
        args.out.mkdir(parents=True, exist_ok=True)
    table = args.out and args.out / "table.json"
    with kept(table, lambda: [asdict(rung) for rung in rungs]):
        rungs[:] = climb(surfaces, tolerances, n_rays, threads=args.threads, on_rung=hear)
    print(speeds(rungs))
    if args.out:
        write(args.out, surfaces, rungs, size)
    return 0


def load(file: Path) -> list[Any]:
    """Return the curved surfaces of a file."""
    if file.suffix == ".bpt":
        return [BezierPatches.read(file)]
    curved = [
        item.surface
        for item in load_scene(file).objects
        if isinstance(item.surface, BezierPatches | SurfaceOfRevolution)
    ]
    if not curved:
        raise ValueError(
            f"{file} has neither Bezier patches nor a surface of revolution: name a file with one"
        )
    return curved


HEADER = (
    f"{'tolerance':>10} {'triangles':>10} {'build s':>8} {'MiB':>6} {'proven':>9} {'measured':>9} "
    f"{'normal':>7} | wrong first hits of the mesh, after Newton (random camera silhouette)"
    f" | mean error of t"
)


def row(rung: Rung) -> str:
    """Put one rung into a line."""
    shares = "  ".join(
        f"{name} " + " ".join(f"{rung.errors[name][kind].wrong:8.1e}" for kind in RAYS)
        for name in ("mesh", "refined")
    )
    return (
        f"{rung.tolerance:10.2e} {rung.triangles:10d} {rung.build_seconds:8.2f} "
        f"{rung.memory / 2**20:6.1f} {rung.bound:9.2e} {rung.worst:9.2e} {rung.mean_angle:6.2f}° | "
        f"{shares} | {rung.errors['mesh']['camera'].mean:.1e}"
    )


def speeds(rungs: Sequence[Rung]) -> str:
    """Put the times per ray into lines."""
    lines = ["\nmicroseconds per ray (random camera silhouette), finest mesh:"]
    for name, kinds in rungs[-1].microseconds.items():
        lines.append(f"  {name:28s} " + " ".join(f"{kinds[kind]:8.3f}" for kind in RAYS))
    exact = rungs[-1].microseconds["certified"]["random"]
    mesh = rungs[-1].microseconds["mesh"]["random"]
    lines.append(f"exactness costs {exact / mesh:.2f} times the finest mesh, per random ray")
    return "\n".join(lines)


def write(folder: Path, surfaces: Sequence[Any], rungs: Sequence[Rung], size: float) -> None:
    """Write tables and pictures."""
    with (folder / "table.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        flat = [_flat(asdict(rung)) for rung in rungs]
        writer.writerow(flat[0])
        writer.writerows(line.values() for line in flat)
    try:
        import matplotlib as mpl
    except ImportError:  # which was said before the work
        return
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    for kind, style in zip(RAYS, ("-", "--", ":"), strict=True):
        for name, color in (("mesh", "tab:red"), ("refined", "tab:orange")):
            axes.loglog(
                [rung.microseconds[name][kind] for rung in rungs],
                [max(rung.errors[name][kind].wrong, 1e-7) for rung in rungs],
                style, color=color, marker="o", markersize=3, label=f"{name}, {kind}",
            )  # fmt: skip
        for name, color in (("certified", "tab:blue"), ('certified, coarse="none"', "tab:green")):
            time = float(np.median([rung.microseconds[name][kind] for rung in rungs]))
            axes.axvline(time, linestyle=style, color=color, label=f"{name}, {kind}: none wrong")
    axes.set_xlabel("microseconds per ray")
    axes.set_ylabel("share of wrong first hits (1e-7: none)")
    axes.legend(fontsize=6)
    figure.savefig(folder / "error_against_time.png", dpi=120)
    plt.close(figure)

    tolerance = 1e-3 * size
    error, shade = error_image(surfaces, tolerance, 640, 480)
    level = np.clip(np.log10(np.maximum(error, 1e-300) / tolerance) / 4.0 + 0.75, 0.0, 1.0)
    picture = plt.get_cmap("viridis")(np.nan_to_num(level))[..., :3]
    picture *= (0.35 + 0.65 * np.nan_to_num(shade))[..., None]
    picture[np.isnan(error)] = 1.0
    picture[np.isinf(error)] = (0.85, 0.0, 0.0)
    figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
    image = axes.imshow(picture)
    image.set_clim(tolerance * 1e-3, tolerance * 10.0)
    axes.set_axis_off()
    axes.set_title(f"|t - exact t| of a mesh of tolerance {tolerance:.2g}; red: lost or phantom")
    scale = mpl.cm.ScalarMappable(mpl.colors.LogNorm(tolerance * 1e-3, tolerance * 10), "viridis")
    figure.colorbar(scale, ax=axes, shrink=0.8, label="scene units")
    figure.savefig(folder / "mesh_error.png", dpi=120)
    plt.close(figure)
    print(f"\nwrote {', '.join(sorted(str(path) for path in folder.iterdir()))}")


def _flat(values: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, dict):
            out.update(_flat(value, f"{prefix}{key} "))
        else:
            out[f"{prefix}{key}"] = value
    return out


if __name__ == "__main__":
    sys.exit(run_tool(main))
