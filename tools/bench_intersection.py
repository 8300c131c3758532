"""Rays per second, and their ratios to other methods, all in one run.

python tools/bench_intersection.py [--quick] [--threads 4] [--out bench.json]
"""

import argparse
import resource
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.embree_newton import Rival, buffers, evaluate_with_numpy
from benchmarks.kernels.embree_newton import evaluate_many
from benchmarks.uniform_grids import best_uniform_grid
from hybrid_rt import Intersector, Rectangle, Sphere, TriangleMesh
from hybrid_rt.analysis.mesh_error import deviations
from hybrid_rt.analysis.ray_sets import RaySet, at_box, camera, silhouettes
from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core.threads import Pool
from hybrid_rt.core.timing import in_turn
from hybrid_rt.demo import teapot, vase
from hybrid_rt.intersection.hit_errors import certified_hits, compare
from meshing import BezierPatches, SurfaceOfRevolution, tessellate
from proof.cases.scenes import SCENES

# Figures by name: each is put where it is kept as soon as it is measured.
Rows = dict[str, Any]
ROUNDS = 5
TRIANGLES = "triangles / those of the best grid"
KINDS: dict[str, Callable[..., RaySet]] = {
    "incoherent": at_box, "camera": camera, "silhouette": silhouettes,
}  # fmt: skip


def main() -> int:
    """Run all benchmarks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a tenth of the rays")
    parser.add_argument("--threads", type=one_or_more, help="default: all cores")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    found: dict[str, Any] = {}
    with kept(args.out, lambda: {name: rows for name, rows in found.items() if rows}):
        measure(200_000 if args.quick else 2_000_000, args.quick, Pool(args.threads).threads, found)
    return 0


def measure(n: int, quick: bool, most: int, found: dict[str, Any]) -> None:
    """Run one benchmark after the other; ``found`` receives their figures by name."""
    against_rival(n, most, found.setdefault("teapot against the rival", {}))
    for threads in dict.fromkeys((most, 1)):
        for name, surfaces in (
            ("teapot", [teapot()]),
            ("vase", [vase(0, 0, 5)]),
            ("mixed", SCENES["mixed"]()),
        ):
            title = f"{name}, {in_words(threads)}"
            accuracies(title, surfaces, n // 4, threads, found.setdefault(title, {}))
    found["trimesh"] = against_trimesh(n // 20)
    few(n // 4, most, found.setdefault("few", {}))
    many(n // 10, quick, most, found.setdefault("many", {}))
    tessellation(quick, found.setdefault("tessellation", {}))
    found["numba"] = against_numpy(n // 10)
    found["costs"] = costs()


def show(title: str, n: int, seconds: dict[str, Any], base: str) -> dict[str, Any]:
    """Print one table, and return its figures."""
    print(f"\n{title} ({n} rays)")
    rows = {}
    for name, timing in seconds.items():
        ratio, least, most = timing.ratios(seconds[base])
        rays = n / timing.median / 1e6
        spread = f"{n / timing.most / 1e6:.2f} .. {n / timing.least / 1e6:.2f}"
        line = f"  {name:34s} {rays:7.2f} Mrays/s ({spread})"
        if name != base:
            line += f"  {ratio:5.2f} x {base} ({least:.2f} .. {most:.2f})"
        print(line)
        rows[name] = {
            "mrays_per_s": rays, "ratio": ratio, "least ratio": least, "greatest ratio": most,
            "seconds": vars(timing),
        }  # fmt: skip
    return rows


def in_words(threads: int) -> str:
    """Return how many threads there are."""
    return "1 thread" if threads == 1 else f"{threads} threads"


def against_rival(n: int, threads: int, result: Rows) -> None:
    """Compare certified hits with the best uncertified method."""
    surface = teapot()
    tracers = {
        'certified, coarse="embree"': Intersector([surface], threads=threads),
        'certified, coarse="none"': Intersector([surface], coarse="none", threads=threads),
    }
    rival = Rival(surface, threads)
    for kind, make in KINDS.items():
        rays = make([surface], n, 1)
        out = buffers(n)
        runs: dict[str, Callable[[], object]] = {
            "embreex + Newton, uncertified": _rival(rival, rays, out)
        }
        for name, tracer in tracers.items():
            runs[name] = _trace(tracer, rays)
        title = f"teapot, {kind}, {in_words(threads)}"
        result[kind] = show(title, n, in_turn(runs, ROUNDS), "embreex + Newton, uncertified")
        bare = tracers['certified, coarse="none"']
        exact = certified_hits(bare, rays.origins, rays.directions)
        met = np.where(np.isfinite(out[0]), np.int32(0), np.int32(-1))
        wrong = compare(exact, out[0], met).wrong_hits.counts
        print(f"  the uncertified method: {wrong} of {int(exact.hits.hit.sum())} hits")
        result[kind]["uncertified wrong"] = wrong


def accuracies(title: str, surfaces: list[Any], n: int, threads: int, result: Rows) -> None:
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
    for kind, make in KINDS.items():
        rays = make(surfaces, n, 2)
        runs = {name: _trace(tracer, rays) for name, tracer in tracers.items()}
        result[kind] = show(f"{title}, {kind}", n, in_turn(runs, 3), "certified")
    rays = at_box(surfaces, n, 3)
    runs = {name: _shadow(tracer, rays) for name, tracer in tracers.items()}
    result["shadow"] = show(f"{title}, shadow", n, in_turn(runs, 3), "certified")


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


def few(n: int, threads: int, result: Rows) -> None:
    """Measure scenes of one surface, which need no tree: one test of at most eight boxes."""
    x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    scenes = {
        "one sphere": Sphere((0, 0, 0), 1),
        "one rectangle": Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)),
        "one flat patch": BezierPatches(np.stack([x, y, 0 * x], axis=-1)[None]),
        "one cone": SurfaceOfRevolution([(0, 1), (2, 0)], (0, 0, -1), (0, 0, 1)),
    }
    for name, surface in scenes.items():
        rays = at_box([Sphere((0, 0, 0), 1)], n, 8)
        tracer = Intersector([surface], coarse="none", threads=threads)
        result.update(show(name, n, in_turn({name: _trace(tracer, rays)}, 3), name))


def many(n: int, quick: bool, threads: int, result: Rows) -> None:
    """Measure scenes of many surfaces: speed, seconds to build, memory."""
    import trimesh

    count = 10_000 if quick else 100_000
    scenes: dict[str, Callable[[], list[Any]]] = {
        f"{count} spheres": lambda: balls(count),
        f"{count} patches": lambda: [tiles(count)],
        "a mesh": lambda: [TriangleMesh(trimesh.creation.icosphere(6 if quick else 8))],
    }
    for name, make in scenes.items():
        surfaces = make()
        began = time.perf_counter()
        tracer = Intersector(surfaces, coarse="none", threads=threads)
        build = time.perf_counter() - began
        memory = memory_of(lambda surfaces=surfaces: Intersector(surfaces, coarse="none"))
        pieces = len(surfaces[0]) if len(surfaces) == 1 else count
        rays = at_box(surfaces[:200], n, 6)
        title = f"{name} ({pieces})"
        result[name] = show(title, n, in_turn({"certified": _trace(tracer, rays)}, 3), "certified")
        result[name] |= {"build seconds": build, "MiB": memory}
        print(f"  built in {build:.2f} s, {memory:.0f} MiB")


def balls(count: int) -> list[Any]:
    """Return small spheres in the unit cube."""
    return [Sphere(c, 0.003) for c in np.random.default_rng(5).random((count, 3))]


def tiles(count: int) -> BezierPatches:
    """Return a rolling landscape of bicubic patches."""
    side = round(count**0.5)
    i, j = np.meshgrid(np.arange(3 * side + 1), np.arange(3 * side + 1), indexing="ij")
    height = 3.0 * np.sin(0.05 * i) * np.cos(0.07 * j) + np.sin(0.9 * i + 0.5 * j)
    points = np.stack([i, j, height], axis=-1) / 3.0
    corners = 3 * np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), -1)
    rows, columns = corners.reshape(-1, 2).T
    k = np.arange(4)
    return BezierPatches(points[rows[:, None, None] + k[:, None], columns[:, None, None] + k])


def tessellation(quick: bool, result: Rows) -> None:
    """Compare proven with measured deviation, and adaptive triangles with the best grid."""
    print("\ntessellation: bound over deviation, triangles over those of the best uniform grid")
    steps = (1e-2, 3e-3) if quick else (1e-2, 3e-3, 1e-3, 3e-4)
    for name, surface in (("teapot", teapot()), ("vase", vase(0, 0, 5))):
        size = float(np.linalg.norm(surface.bounds[1] - surface.bounds[0]))
        rows = []
        for step in steps:
            mesh = tessellate(surface, step * size)
            deviation = float(deviations([surface], [mesh], 1)[0].max())
            grid = best_uniform_grid(surface, deviation)
            rows.append(
                {
                    "tolerance": step * size, "triangles": len(mesh), "deviation": deviation,
                    "bound / deviation": mesh.deviation_bound / deviation,
                    TRIANGLES: len(mesh) / grid.triangles,
                    "grid": f"{grid.columns} x {grid.rows}",
                }
            )  # fmt: skip
            print(
                f"  {name:8s} {step:.0e} of the size: {len(mesh):7d} triangles, "
                f"{rows[-1]['bound / deviation']:.2f}, {rows[-1][TRIANGLES]:.2f}"
                f" ({rows[-1]['grid']} cells a piece)"
            )
        median = float(np.median([row["bound / deviation"] for row in rows]))
        share = float(np.median([row[TRIANGLES] for row in rows]))
        print(f"  {name:8s} medians {median:.2f}, {share:.2f}")
        result[name] = {"rows": rows, "bound / deviation": median, TRIANGLES: share}


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
    surface, began = teapot(), time.perf_counter()
    Intersector([surface])
    seconds = time.perf_counter() - began
    memory = memory_of(lambda: Intersector([surface]))
    figures = {
        "import seconds": float(run.stdout),
        "build of the teapot, seconds": seconds,
        "memory of the teapot, MiB": memory,
        "peak memory of this run, MiB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }
    print("\ncosts")
    for name, value in figures.items():
        print(f"  {name:34s} {value:.3f}")
    return figures


def memory_of(build: Callable[[], object]) -> float:
    """Return the memory that what is built holds, MiB: arrays and Python's objects, not Embree's."""
    tracemalloc.start()
    kept = build()
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del kept
    return held / 2**20


def _trace(tracer: Intersector, rays: RaySet) -> Callable[[], object]:
    return lambda: tracer.intersect(rays.origins, rays.directions)


def _shadow(tracer: Intersector, rays: RaySet) -> Callable[[], object]:
    return lambda: tracer.occluded(rays.origins, rays.directions)


def _rival(rival: Rival, rays: RaySet, out: Any) -> Callable[[], object]:
    return lambda: rival.intersect(rays.origins, rays.directions, out)


if __name__ == "__main__":
    sys.exit(run_tool(main))
