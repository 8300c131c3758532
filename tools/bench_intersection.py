"""Rays per second, and their ratios to other methods, all in one run.

python tools/bench_intersection.py [--quick] [--out bench.json]
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt import Intersector, Sphere, TriangleMesh
from hybrid_rt.demo import teapot, vase
from hybrid_rt.verify.campaign import SCENES
from hybrid_rt.verify.judge import decisions
from hybrid_rt.verify.kernels.rival import evaluate_many
from hybrid_rt.verify.rays import RaySet, at_box, camera, silhouettes
from hybrid_rt.verify.rival import Rival, buffers, evaluate_with_numpy
from hybrid_rt.verify.speed import in_turn

ROUNDS = 5
KINDS: dict[str, Callable[..., RaySet]] = {
    "incoherent": at_box, "camera": camera, "silhouette": silhouettes,
}  # fmt: skip


def main() -> None:
    """Run all benchmarks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a tenth of the rays")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    n = 200_000 if args.quick else 2_000_000
    found: dict[str, Any] = {}
    found["teapot against the rival"] = against_rival(n)
    for threads in (None, 1):
        for name, surfaces in (
            ("teapot", [teapot()]),
            ("vase", [vase(0, 0, 5)]),
            ("mixed", SCENES["mixed"]()),
        ):
            title = f"{name}, {'all threads' if threads is None else '1 thread'}"
            found[title] = accuracies(title, surfaces, n // 4, threads)
    found["trimesh"] = against_trimesh(n // 20)
    found["many"] = many(n // 10, args.quick)
    found["numba"] = against_numpy(n // 10)
    found["costs"] = costs()
    if args.out:
        args.out.write_text(json.dumps(found, indent=2), "utf-8")


def show(title: str, n: int, seconds: dict[str, Any], base: str) -> dict[str, Any]:
    """Print one table, and return its figures."""
    print(f"\n{title} ({n} rays)")
    rows = {}
    for name, timing in seconds.items():
        ratio = seconds[base].median / timing.median
        rays = n / timing.median / 1e6
        spread = f"{n / timing.most / 1e6:.2f} .. {n / timing.least / 1e6:.2f}"
        print(f"  {name:34s} {rays:7.2f} Mrays/s ({spread})  {ratio:5.2f} x {base}")
        rows[name] = {"mrays_per_s": rays, "ratio": ratio, "seconds": vars(timing)}
    return rows


def against_rival(n: int) -> dict[str, Any]:
    """Compare certified hits with the best uncertified method."""
    surface = teapot()
    result = {}
    tracers = {
        'certified, coarse="embree"': Intersector([surface]),
        'certified, coarse="none"': Intersector([surface], coarse="none"),
    }
    rival = Rival(surface)
    for kind, make in KINDS.items():
        rays = make([surface], n, 1)
        out = buffers(n)
        runs: dict[str, Callable[[], object]] = {
            "embreex + Newton, uncertified": _rival(rival, rays, out)
        }
        for name, tracer in tracers.items():
            runs[name] = _trace(tracer, rays)
        title = f"teapot, {kind}, all threads"
        result[kind] = show(title, n, in_turn(runs, ROUNDS), "embreex + Newton, uncertified")
        certified = tracers['certified, coarse="none"'].intersect(rays.origins, rays.directions)
        wrong = decisions(certified, out[0])
        print(f"  the uncertified method: {wrong} of {int(certified.hit.sum())} hits")
        result[kind]["uncertified wrong"] = wrong
    return result


def accuracies(title: str, surfaces: list[Any], n: int, threads: int | None) -> dict[str, Any]:
    """Compare the three accuracies."""
    tracers = {
        name: Intersector(surfaces, threads=threads, **options)
        for name, options in (
            ("certified", {}),
            ('certified, coarse="none"', {"coarse": "none"}),
            ("refined", {"accuracy": "refined"}),
            ("mesh", {"accuracy": "mesh"}),
        )
    }
    result = {}
    for kind, make in KINDS.items():
        rays = make(surfaces, n, 2)
        runs = {name: _trace(tracer, rays) for name, tracer in tracers.items()}
        result[kind] = show(f"{title}, {kind}", n, in_turn(runs, 3), "certified")
    rays = at_box(surfaces, n, 3)
    runs = {name: _shadow(tracer, rays) for name, tracer in tracers.items()}
    result["shadow"] = show(f"{title}, shadow", n, in_turn(runs, 3), "certified")
    return result


def against_trimesh(n: int) -> dict[str, Any]:
    """Compare with trimesh's own ray queries, one thread."""
    import trimesh
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    mesh = trimesh.creation.icosphere(5)
    rays = at_box([TriangleMesh(mesh)], n, 4)
    theirs, ours = RayMeshIntersector(mesh), Intersector([TriangleMesh(mesh)], threads=1)
    runs: dict[str, Callable[[], object]] = {
        "trimesh": lambda: theirs.intersects_location(rays.origins, rays.directions, False),
        "certified, 1 thread": _trace(ours, rays),
    }
    title = f"mesh of {len(mesh.faces)} faces, incoherent"
    return show(title, n, in_turn(runs, ROUNDS), "trimesh")


def many(n: int, quick: bool) -> dict[str, Any]:
    """Measure scenes of many surfaces."""
    import trimesh

    rng = np.random.default_rng(5)
    count = 10_000 if quick else 100_000
    balls = [Sphere(c, 0.003) for c in rng.random((count, 3))]
    mesh = TriangleMesh(trimesh.creation.icosphere(6 if quick else 8))
    result = {}
    for name, surfaces in ((f"{count} spheres", balls), (f"mesh of {len(mesh)} faces", [mesh])):
        began = time.perf_counter()
        tracer = Intersector(surfaces)
        build = time.perf_counter() - began
        rays = at_box([mesh] if surfaces[0] is mesh else balls[:200], n, 6)
        result[name] = show(name, n, in_turn({"certified": _trace(tracer, rays)}, 3), "certified")
        result[name]["build seconds"] = build
        print(f"  built in {build:.2f} s")
    return result


def against_numpy(n: int) -> dict[str, Any]:
    """Evaluate a patch and its tangents by a kernel and by plain NumPy, one thread."""
    surface, rng = teapot(), np.random.default_rng(7)
    nets = np.stack(surface.patches)
    control = np.zeros((16 * len(nets), 4))
    control[:, :3] = nets.reshape(-1, 3)
    patch, (u, v), out = rng.integers(len(nets), size=n), rng.random((2, n)), np.empty((n, 9))
    runs: dict[str, Callable[[], object]] = {
        "plain NumPy": lambda: evaluate_with_numpy(nets[patch], u, v),
        "numba": lambda: evaluate_many(control, patch, u, v, out),
    }
    return show("bicubic points and tangents, 1 thread", n, in_turn(runs, 5), "plain NumPy")


def costs() -> dict[str, float]:
    """Measure what comes before the first ray."""
    script = (
        "import time; t = time.perf_counter(); import hybrid_rt; print(time.perf_counter() - t)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    began = time.perf_counter()
    Intersector([teapot()])
    figures = {
        "import seconds": float(run.stdout),
        "build of the teapot, seconds": time.perf_counter() - began,
        "peak memory of this run, MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    print("\ncosts")
    for name, value in figures.items():
        print(f"  {name:34s} {value:.3f}")
    return figures


def _trace(tracer: Intersector, rays: RaySet) -> Callable[[], object]:
    return lambda: tracer.intersect(rays.origins, rays.directions)


def _shadow(tracer: Intersector, rays: RaySet) -> Callable[[], object]:
    return lambda: tracer.occluded(rays.origins, rays.directions)


def _rival(rival: Rival, rays: RaySet, out: Any) -> Callable[[], object]:
    return lambda: rival.intersect(rays.origins, rays.directions, out)


if __name__ == "__main__":
    main()
