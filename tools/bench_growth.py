"""How cost grows with the number of things in a scene: time, nodes and memory against N.

python tools/bench_growth.py [--most 100000] [--rays 100000] [--out growth.json]

Each table is of a kind of scene. Its things stand on a cubic grid, 1.2 sizes apart, and rays run through
random points of the grid: so at each N as many things lie along a ray as at any other, up to the cube root of
N. Or a thing stands beside others of its kind that are N times as large or far away, and rays run through the
thing. Seconds are those of the processor, the least of three rounds in which N take turns.
"""

import argparse
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from hybrid_rt import Box, Instances, Intersector, Sphere, SurfaceOfRevolution, Torus, TriangleMesh
from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import teapot
from meshing import BezierPatches

ROUNDS = 3
PITCH = 1.2
# A profile near a circle of radius 0.4, (axial, radius); and a net about as large.
BALL = np.array([[(-0.4, 0.0), (-0.4, 0.53), (0.4, 0.53), (0.4, 0.0)]])
BUMP = np.stack(
    [*np.meshgrid(*2 * [np.linspace(-0.4, 0.4, 4)], indexing="ij"), np.zeros((4, 4))], -1
)
BUMP[1:3, 1:3, 2] = 0.5


def places(n: int, size: float) -> FloatArray:
    """Return points (n, 3) of a cubic grid about 0."""
    side = int(np.ceil(n ** (1 / 3) - 1e-9))
    grid = np.stack(np.meshgrid(*3 * [np.arange(side)], indexing="ij"), axis=-1).reshape(-1, 3)
    points: FloatArray = PITCH * size * (grid[:n] - 0.5 * (side - 1))
    return points


def spheres(n: int) -> list[Any]:
    """Return balls that fill as much as a teapot in its place does."""
    return [Sphere(at, 0.4) for at in places(n, 1.0)]


def five_kinds(n: int) -> list[Any]:
    """Return things of five kinds in turn, each about as large as a ball of `spheres`."""
    made: list[Callable[[FloatArray], Any]] = [
        lambda at: Sphere(at, 0.4),
        lambda at: Box(at - 0.33, at + 0.33),
        lambda at: Torus(at, (0, 0, 1), 0.3, 0.15),
        lambda at: SurfaceOfRevolution(BALL, at, (0, 0, 1)),
        lambda at: BezierPatches([BUMP + at]),
    ]
    return [made[k % 5](at) for k, at in enumerate(places(n, 1.0))]


def pot_on_patch(n: int) -> list[Any]:
    """Return a teapot, and a floor of the same kind that is n times as large."""
    pot = teapot()
    return [pot, BezierPatches([n * pot.size * BUMP[:, :, [0, 1, 1]] * (1, 1, 0) - (0, 0, 0.01)])]


def faces_on_faces(n: int) -> list[Any]:
    """Return one mesh: a ball, and two triangles n times as large below it."""
    ball = trimesh.creation.icosphere(5, 1.0)
    floor = n * np.array([(-1.0, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) - (0, 0, 1.5)
    faces = np.concatenate([ball.faces, np.array([(0, 1, 2), (0, 2, 3)]) + len(ball.vertices)])
    both = trimesh.Trimesh(np.concatenate([ball.vertices, floor]), faces, process=False)
    return [TriangleMesh(both)]


def patches_on_patch(n: int) -> list[Any]:
    """Return the same as one object."""
    pot, floor = pot_on_patch(n)
    return [BezierPatches([*pot.patches, *floor.patches])]


def groups(n: int) -> list[Any]:
    """Return n groups of 27 boxes, 1e6 times their size apart."""
    spots = places(n, 3e6)
    at = ((spots - spots[0])[:, None] + places(27, 1.0)).reshape(-1, 3)
    return [Box(p - 0.33, p + 0.33) for p in at]


def three_sizes(n: int) -> list[Any]:
    """Return boxes in a cube, as many n times as large around them, and these n times as large again."""
    return [Box(s * (p - 0.33), s * (p + 0.33)) for s in (1.0, n, n * n) for p in places(216, 1.0)]


def teapots(n: int) -> list[Any]:
    """Return one teapot in many places, turned at random."""
    rng, surface = np.random.default_rng(1), teapot()
    turn = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    at = places(n, surface.size)
    return [Instances(surface, np.concatenate([turn, at[:, :, None]], axis=2))]


ROWS: dict[str, Callable[[int], list[Any]]] = {
    "spheres": spheres,
    "instances": teapots,
    "five kinds": five_kinds,
    "teapot on a floor N times as large": pot_on_patch,
    "patches in one object with a floor N times as large": patches_on_patch,
    "ball in one mesh with a floor N times as large": faces_on_faces,
    "boxes of three sizes, each N times the last": three_sizes,
    "N groups of boxes": groups,
}
# What rays run through, where that is not all of a scene: its corners.
AIMED = {
    "teapot on a floor N times as large": teapot().bounds,
    "patches in one object with a floor N times as large": teapot().bounds,
    "boxes of three sizes, each N times the last": np.array([(-4.0, -4, -4), (4, 4, 4)]),
    "N groups of boxes": np.array([(-2.0, -2, -2), (2, 2, 2)]),
    "ball in one mesh with a floor N times as large": np.array([(-1.0, -1, -1), (1, 1, 1)]),
}


def rays_through(bounds: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Return rays from around boxes (k, 2, 3) through points of the box of all of them."""
    rng = np.random.default_rng(2)
    low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
    away = rng.normal(size=(n, 3))
    away /= np.linalg.norm(away, axis=1)[:, None]
    o = 0.5 * (low + high) + 0.6 * np.linalg.norm(high - low) * away
    return o, rng.uniform(low, high, (n, 3)) - o


def built(make: Callable[[int], list[Any]], n: int) -> tuple[Intersector, float, float]:
    """Return a tracer, the seconds that it and its surfaces took, and the bytes that they hold."""
    began = time.process_time()
    tracer = Intersector(make(n), coarse="none", threads=1)
    seconds = time.process_time() - began
    tracemalloc.start()
    again = Intersector(make(n), coarse="none", threads=1)
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del again
    return tracer, seconds, float(held)


def measure(name: str, counts: list[int], n_rays: int) -> list[dict[str, float]]:
    """Return a row of figures for each N."""
    rows, tracers = [], []
    for n in counts:
        tracer, seconds, held = built(ROWS[name], n)
        bounds = np.array([surface.bounds for surface in tracer.surfaces])
        rays = rays_through(AIMED.get(name, bounds).reshape(-1, 2, 3), n_rays)
        tracer.intersect(*rays)
        tracer.forget_counters()
        hits = tracer.intersect(*rays)
        rows.append(
            {
                "N": n,
                "us a ray": np.inf,
                "nodes a ray": tracer.counters["nodes"] / n_rays,
                "hit": float(hits.hit.mean()),
                "seconds to build": seconds,
                "bytes": held,
            }
        )
        tracers.append((tracer, rays))
    for _ in range(ROUNDS):
        for row, (tracer, rays) in zip(rows, tracers, strict=True):
            began = time.process_time()
            tracer.intersect(*rays)
            row["us a ray"] = min(row["us a ray"], (time.process_time() - began) / n_rays * 1e6)
    return rows


def slope(rows: list[dict[str, float]], name: str) -> float:
    """Return the exponent of N with which a figure grows, over the upper half of the rows."""
    kept_rows = rows[len(rows) // 2 :]
    x, y = (np.log([max(row[key], 1e-300) for row in kept_rows]) for key in ("N", name))
    return float(np.polyfit(x, y, 1)[0])


def main() -> int:
    """Print a table for each kind of scene."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--most", type=one_or_more, default=100_000, help="the largest N")
    parser.add_argument("--rays", type=one_or_more, default=100_000, help="at each N")
    parser.add_argument("--only", choices=sorted(ROWS), help="default: all", metavar="ROW")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    counts = [10**k for k in range(10) if 10**k <= args.most]
    found: dict[str, list[dict[str, float]]] = {}
    with kept(args.out, lambda: found):
        for name in [args.only] if args.only else ROWS:
            found[name] = rows = measure(name, counts, args.rays)
            print(f"\n{name}")
            print(
                f"{'N':>9} {'us a ray':>9} {'nodes a ray':>12} {'hit':>5} {'s to build':>11} {'bytes each':>11}"
            )
            for row in rows:
                print(
                    f"{row['N']:9.0f} {row['us a ray']:9.2f} {row['nodes a ray']:12.1f} {row['hit']:5.2f} "
                    f"{row['seconds to build']:11.2f} {(row['bytes'] - rows[0]['bytes']) / row['N']:11.0f}"
                )
            names = ("us a ray", "nodes a ray", "seconds to build", "bytes")
            print("exponents of N: " + ", ".join(f"{k} {slope(rows, k):.2f}" for k in names))
    if "spheres" in found:
        b = [row["us a ray"] for row in found["spheres"]]
        for other in ("instances", "five kinds"):
            a = [row["us a ray"] for row in found.get(other, [])]
            grown = " ".join(f"{x / y:.2f}" for x, y in zip(a, b, strict=False))
            print(f"\n{other} over spheres: {grown}")
    return 0


if __name__ == "__main__":
    sys.exit(run_tool(main))
