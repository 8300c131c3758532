"""How fast scenes are rendered: rays per second, seconds per stage, seconds to an error, memory.

For example:
  python tools/bench_render.py scenes/cornell_box.py --targets 0.035
  python tools/bench_render.py scenes/*.py --width 200 --reference-passes 256 --json bench.json
  python tools/bench_render.py scenes/teapot_room.py --integrator ppm --photons 500000 --width 512
  python tools/bench_render.py scenes/wine_glass.py --coarse embree none     # by either way
  python tools/bench_render.py --caustics            # floors under glass, against a light tracer
  git worktree add ../older e10b952                  # this checkout and an older one, in turn:
  python tools/bench_render.py scenes/wine_glass.py --against ../older --integrator ppm --width 200

Seconds are wall time of a whole render after its kernels are compiled, scene set-up included. The
reference is a longer render of the same method with other random numbers; its own error is stated.
"""

from __future__ import annotations

import argparse
import math
import resource
import signal
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from benchmarks.caustic_speed import measure_rows
from benchmarks.two_checkouts import Job, checkout_at, compare
from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.cli.scene_file import check_script, load_scene
from hybrid_rt.core import checks
from hybrid_rt.integrators import Options, PhotonMapOptions, PPMOptions
from hybrid_rt.intersection.intersector import COARSE_STAGES
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import noise_of_reference, relative_mse, seconds_to

REFERENCE_SEED = 20_000
# The size of picture for which memory is stated.
FULL_SIZE = (1280, 720)
# Options that one of the ways to run makes no use of.
IGNORED_BY_CAUSTICS = (
    "scenes", "against", "passes", "rounds", "integrator", "coarse", "width", "targets",
    "reference_passes", "most_passes",
)  # fmt: skip
IGNORED_BY_AGAINST = ("reference_photons", "targets", "most_passes")
IGNORED_OTHERWISE = ("passes", "rounds", "reference_photons")
PHOTON_KINDS = {"ppm": PPMOptions, "photon_map": PhotonMapOptions}


def main() -> int:
    """Run the tool; return the exit code."""
    parser = _parser()
    options = parser.parse_args()
    _refuse_ignored(parser, options)
    if options.caustics:
        return _caustics(options)
    if not options.scenes:
        parser.error("name scene scripts, or use --caustics")
    for target in options.targets:
        checks.number(target, "--targets", above=0.0)
    if options.against is not None:
        return _against(options)
    rows: list[dict[str, Any]] = []
    with kept(options.json, lambda: rows):
        for path in options.scenes:
            for coarse in options.coarse:
                row = _apart(_measure, Path(path), coarse, options)
                rows.append(row)
                _show(row, options.targets)
                memory = _apart(_memory, Path(path), coarse, options)
                row["full_size_memory_mib"] = memory
                print(
                    f"  peak memory at {FULL_SIZE[0]} x {FULL_SIZE[1]}: {memory:.0f} MiB",
                    flush=True,
                )
    return 0


def _refuse_ignored(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse options that would have no effect."""
    if options.caustics:
        ignored: tuple[str, ...] = IGNORED_BY_CAUSTICS
    else:
        ignored = IGNORED_OTHERWISE if options.against is None else IGNORED_BY_AGAINST
        if options.integrator not in PHOTON_KINDS:
            ignored = (*ignored, "photons")
    for name in ignored:
        value = getattr(options, name)
        if value and value != parser.get_default(name):
            option = "scenes" if name == "scenes" else f"--{name.replace('_', '-')}"
            parser.error(f"{option}: nothing of this kind of run depends on it, leave it out")


def _apart(function: Callable[[Path, str, argparse.Namespace], Any], *arguments: Any) -> Any:
    """Call a function in a process of its own: peak memory is that of a whole process."""
    # Ctrl-C reaches the child as well: there it ends without a word.
    quietly = (signal.SIGINT, signal.SIG_DFL)
    context = get_context("spawn")
    with ProcessPoolExecutor(
        1, mp_context=context, initializer=signal.signal, initargs=quietly
    ) as child:
        return child.submit(function, *arguments).result()


def _memory(path: Path, coarse: str, options: argparse.Namespace) -> float:
    """Return the peak memory, MiB, of two passes of a full-size picture."""
    scene = load_scene(path)
    shown = scene.with_camera(scene.camera.resized(*FULL_SIZE))
    render(
        shown,
        options.integrator,
        2,
        threads=options.threads,
        coarse=coarse,
        options=_settings(options),
    )
    return _peak()


def _settings(options: argparse.Namespace) -> Options | None:
    """Return the integrator's options: photons have as many in a pass as --photons says."""
    kind = PHOTON_KINDS.get(options.integrator)
    return None if kind is None else kind(options.photons)


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenes", nargs="*", metavar="SCENE.py")
    parser.add_argument("--caustics", action="store_true", help="the rows of caustics on a floor")
    parser.add_argument(
        "--against", type=Path, metavar="DIR", help="an older checkout: renders by both, in turn"
    )
    parser.add_argument(
        "--passes", type=one_or_more, default=16, metavar="N", help="of a render (--against)"
    )
    parser.add_argument(
        "--rounds", type=one_or_more, default=3, metavar="N", help="renders by each (--against)"
    )
    parser.add_argument("--photons", type=one_or_more, default=200_000, help="of a pass")
    parser.add_argument(
        "--reference-photons", type=float, default=1e9, help="counted by the light tracer"
    )
    parser.add_argument("--integrator", default="path")
    parser.add_argument(
        "--coarse", nargs="+", default=["embree"], choices=COARSE_STAGES, help="a row for each"
    )
    parser.add_argument("--width", type=one_or_more, help="pixels; proportions are kept")
    parser.add_argument("--threads", type=one_or_more)
    parser.add_argument("--targets", type=float, nargs="+", default=[1e-2, 1e-3], metavar="E")
    parser.add_argument("--reference-passes", type=one_or_more, default=512, metavar="N")
    parser.add_argument("--most-passes", type=one_or_more, default=128, metavar="N")
    parser.add_argument("--json", type=Path, metavar="FILE")
    return parser


def _measure(path: Path, coarse: str, options: argparse.Namespace) -> dict[str, Any]:
    scene = load_scene(path)
    camera = scene.camera
    if options.width is not None:
        scene = scene.with_camera(camera.resized(options.width))

    def run(passes: int, seed: int, small: bool = False, **settings: Any) -> RenderResult:
        shown: Scene = scene.with_camera(camera.resized(16, 12)) if small else scene
        return render(
            shown,
            options.integrator,
            passes,
            seed=seed,
            threads=options.threads,
            coarse=coarse,
            options=_settings(options),
            **settings,
        )

    run(1, 0, small=True)  # compiles
    print(f"{path.stem}: reference of {options.reference_passes} passes ...", file=sys.stderr)
    reference = run(options.reference_passes, REFERENCE_SEED, outputs=["standard_error"])
    own = noise_of_reference(reference.image, reference.channels["standard_error"])
    curve: list[dict[str, Any]] = []
    passes = 1
    while passes <= options.most_passes:
        result = run(passes, 1)
        error = relative_mse(result.image, reference.image)
        trimmed = relative_mse(result.image, reference.image, leave_out=1e-3)
        seconds = result.report.seconds
        curve.append({"passes": passes, "seconds": seconds, "relmse": error, "trimmed": trimmed})
        if error <= min(options.targets):
            break
        passes *= 2
    rays = sum(result.report.rays.values())
    totals = [point["seconds"]["total"] for point in curve]
    errors = [point["relmse"] for point in curve]
    return {
        "scene": path.stem,
        "integrator": options.integrator,
        "coarse": result.report["coarse"],
        "size": [scene.camera.width, scene.camera.height],
        "rays_per_second": rays / totals[-1],
        "rays_per_camera_ray": rays / result.report.rays["camera"],
        "curve": curve,
        "relmse_of_reference": own,
        "seconds_to": {str(e): seconds_to(e, totals, errors) for e in options.targets},
        "photons": result.report.get("photons"),
        "peak_memory_mib": _peak(),
    }


def _against(options: argparse.Namespace) -> int:
    """Compare this checkout with an older one."""
    checkout = checkout_at(options.against)
    scenes = [check_script(path) for path in options.scenes]
    rows: list[dict[str, Any]] = []
    with kept(options.json, lambda: rows):
        for scene in scenes:
            for coarse in options.coarse:
                has_photons = options.integrator in PHOTON_KINDS
                job = Job(
                    scene,
                    options.integrator,
                    options.passes,
                    options.rounds,
                    options.reference_passes,
                    options.width,
                    options.photons if has_photons else None,
                    options.threads,
                    coarse,
                )
                print(f"{scene.stem}: reference and {job.rounds} rounds ...", file=sys.stderr)
                rows.append(compare(checkout, job))
                _show_ratios(rows[-1])
    return 0


def _show_ratios(row: dict[str, Any]) -> None:
    width, height = row["size"]
    print(
        f"\n{row['scene']}  {width} x {height}, {row['integrator']}, {row['passes']} passes, "
        f"{row['rounds']} rounds, threads {row['threads'] or 'all'}, coarse {row['coarse']}"
    )
    heads = {
        "relmse": "relMSE",
        "wall": "seconds",
        "processor": "processor s",
        "work": "relMSE x processor s",
        "trimmed_work": "without the worst 0.1 %",
    }
    print(" " * 20 + "".join(f"{head:>25}" for head in heads.values()))
    for side in ("old", "new"):
        means = [sum(row[side][name]) / row["rounds"] for name in heads]
        shown = "".join(f"{mean:>25.3g}" for mean in means)
        print(f"  {side} {row[f'{side}_checkout']:<14}{shown}")
    ratios = [row["ratios"][name] for name in heads]
    shown = "".join(
        f"{'{mean:.2f} ({least:.2f} to {most:.2f})'.format(**ratio):>25}" for ratio in ratios
    )
    print(f"  {'old / new':<18}{shown}")
    own = row["relmse_of_reference"]
    share = own * row["rounds"] / sum(row["new"]["relmse"])
    print(f"  the reference's own relMSE is about {own:.2g}, {share:.0%} of the new one's")


def _caustics(options: argparse.Namespace) -> int:
    """Print the rows of caustics."""
    n = int(options.reference_photons)
    print(f"floors under glass, 256 x 256, against {n:.1e} photons of a light tracer")
    rows: list[dict[str, Any]] = []
    with kept(options.json, lambda: rows):
        for row in measure_rows(n, options.photons, options.threads):
            rows.append(row)
            print(
                f"  {row['row']}: {row['error']:.2g} after {row['seconds']:.1f} s (to reach "
                f"{row['target']:g}; the reference's own {row['of_reference']:.1g}), {row['passes']} "
                f"passes, {row['photons_per_second'] / 1e3:.0f} thousand photons/s, gathering "
                f"{row['gather_seconds']:.1f} s",
                flush=True,
            )
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"  peak memory {memory:.0f} MiB")
    return 0


def _show(row: dict[str, Any], targets: list[float]) -> None:
    width, height = row["size"]
    coarse = row["coarse"]
    print(
        f"\n{row['scene']}  {width} x {height}, {row['integrator']}, coarse {coarse['stage']} "
        f"({coarse['share_of_seconds']:.0%} of the time)"
    )
    print(
        f"  {row['rays_per_second'] / 1e6:.2f} Mrays/s, {row['rays_per_camera_ray']:.1f} rays for "
        f"each camera ray, peak memory {row['peak_memory_mib']:.0f} MiB"
    )
    if row["photons"] is not None:
        seconds = row["curve"][-1]["seconds"]
        print(
            f"  {row['photons']['emitted'] / seconds['photons'] / 1e3:.0f} thousand photons/s while "
            f"shooting, gathering {seconds['gather'] / row['curve'][-1]['passes']:.2f} s a pass of "
            f"{row['photons']['gathered_per_point']:.1f} photons a point"
        )
    print("  passes   seconds    relMSE   without the worst 0.1 %")
    for point in row["curve"]:
        print(
            f"  {point['passes']:6d} {point['seconds']['total']:9.2f} {point['relmse']:9.2g} "
            f"{point['trimmed']:9.2g}"
        )
    last = row["curve"][-1]
    stages = ", ".join(
        f"{name} {seconds / last['seconds']['total']:.0%}"
        for name, seconds in last["seconds"].items()
        if name != "total"
    )
    print(f"  stages of the last: {stages}")
    print(f"  the reference's own relMSE is about {row['relmse_of_reference']:.2g}")
    for target in targets:
        seconds = row["seconds_to"][str(target)]
        reached = f"{seconds:.2f} s"
        if math.isnan(seconds):
            # The error falls as one over the passes.
            expected = last["seconds"]["total"] * last["relmse"] / target
            reached = f"not reached; about {expected:.0f} s if it goes on as it should"
        print(f"  to relMSE {target:g}: {reached}")


if __name__ == "__main__":
    sys.exit(run_tool(main))
