"""Rays per second at rational, NURBS, turned and trimmed surfaces, on one thread.

python tools/bench_surfaces.py [--quick] [--out bench.json]

Compared, each interleaved in one run, with OpenCASCADE (where its package is installed), with
polynomial patches of the same nets, with the same surfaces untrimmed, and many surfaces in a tree with
asking each of them.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from hybrid_rt import Asphere, Box, Intersector, Rectangle, Sphere
from hybrid_rt.analysis.ray_sets import RaySet, at_box
from hybrid_rt.cli.command import kept, run_tool
from hybrid_rt.core.records import HitRecord
from hybrid_rt.core.timing import in_turn
from hybrid_rt.demo import teapot
from hybrid_rt.intersection.kinds import registry
from hybrid_rt.primitives.torus import Torus
from meshing import (
    BezierPatches,
    Cone,
    Cylinder,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    polygon,
)
from proof.cases import trimmed_surfaces as trimmed
from proof.cases.rational_surfaces import nurbs_sphere, octants, rational_sheet

# Figures by name: each is put where it is kept as soon as it is measured.
Rows = dict[str, Any]
ROUNDS = 5
# OpenCASCADE traces this many rays a round.
FEW = 10_000
NUMBERS = (8, 16, 64, 256)
# One surface of a kind, of about a size, at a place.
MADE: dict[str, Callable[[np.random.Generator, float, Any], Any]] = {
    "spheres": lambda _rng, size, at: Sphere(at, 0.4 * size),
    "rectangles": lambda rng, size, at: Rectangle(at, *(size * rng.normal(size=(2, 3)))),
    "boxes along the axes": lambda _rng, size, at: Box(at - 0.4 * size, at + 0.4 * size),
    "turned boxes": lambda rng, size, at: Box((-0.4,) * 3, (0.4,) * 3).transformed(
        np.block(
            [[size * np.linalg.qr(rng.normal(size=(3, 3)))[0], at[:, None]], [0.0, 0.0, 0.0, 1.0]]
        )
    ),
    "tori": lambda rng, size, at: Torus(at, rng.normal(size=3), 0.6 * size, 0.2 * size),
    "aspheres": lambda rng, size, at: Asphere(size, -0.5, [], 0.8 * size, at, rng.normal(size=3)),
    "turned surfaces": lambda rng, size, at: SurfaceOfRevolution(
        size * np.array([(0, 0.2), (0.3, 0.5), (0.6, 0.1), (1, 0.3)]), at, rng.normal(size=3)
    ),
}


def main() -> int:
    """Run all benchmarks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a tenth of the rays")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    found: dict[str, Rows] = {}
    n = 20_000 if args.quick else 200_000
    with kept(args.out, lambda: {name: rows for name, rows in found.items() if rows}):
        against_opencascade(n, found.setdefault("opencascade", {}))
        against_polynomials(n, found.setdefault("polynomial", {}))
        turned(n, found.setdefault("turned", {}))
        against_untrimmed(n, found.setdefault("untrimmed", {}))
        many(n // 4, found.setdefault("many", {}))
    return 0


def against_opencascade(n: int, rows: Rows) -> None:
    """Compare speeds at NURBS surfaces, and count the rays of which the answers differ."""
    print(
        "over OpenCASCADE: Mrays/s, times its speed (least .. greatest), hits of 10 000 that differ"
    )
    try:
        from benchmarks import opencascade
    except ImportError:
        print("  left out: pip install cadquery-ocp-novtk")
        return
    for name, surface in {
        "NURBS sphere, 2 x 2, 8 patches": nurbs_sphere(),
        "rational sheet, 3 x 3, 30 patches": rational_sheet(),
        "trimmed sheet, 3 x 2, 6 patches": trimmed.trimmed_sheet(),
    }.items():
        for coarse in ("embree", "none"):
            title = f'{name}, coarse="{coarse}"'
            tracer = Intersector([surface], threads=1, coarse=coarse)
            row = rows[title] = beside(tracer, surface, opencascade.first_hits, n)
            print(
                f"  {title:52s} {row['mrays_per_s']:5.2f}  {row['ratio']:5.1f} "
                f"({row['least ratio']:.1f} .. {row['greatest ratio']:.1f})  {row['differ']}"
            )


def beside(tracer: Intersector, surface: Any, other: Callable[..., Any], n: int) -> dict[str, Any]:
    """Compare the hits and the speed of a tracer with those of another on a part of the rays."""
    rays, few = at_box([surface], n, 1), min(FEW, n)
    directions = rays.directions / np.linalg.norm(rays.directions, axis=1)[:, None]
    runs: dict[str, Callable[[], Any]] = {
        "ours": lambda: tracer.intersect(rays.origins, directions),
        "theirs": lambda: other(surface, rays.origins[:few], directions[:few]),
    }
    seconds = in_turn(runs, ROUNDS)
    ratio, least, most = (r * n / few for r in seconds["ours"].ratios(seconds["theirs"]))
    ours, theirs = np.nan_to_num(runs["ours"]().t[:few]), np.nan_to_num(runs["theirs"]())
    return {
        "mrays_per_s": n / seconds["ours"].median / 1e6,
        "ratio": ratio, "least ratio": least, "greatest ratio": most,
        "differ": int((np.abs(ours - theirs) > 1e-10).sum()), "rays": few,
    }  # fmt: skip


def against_polynomials(n: int, rows: Rows) -> None:
    """Compare rational patches with polynomial ones of the same, or nearly the same, shape."""
    rng = np.random.default_rng(3)
    nets = [np.array(net) for net in teapot().patches]
    pairs: dict[str, tuple[Any, Any]] = {
        f"teapot, weights exp({a:g} N(0, 1))": (
            BezierPatches(nets, [np.exp(a * rng.normal(size=net.shape[:2])) for net in nets]),
            BezierPatches(nets),
        )
        for a in (1e-9, 0.05, 0.3)
    }
    ball = octants()
    pairs["sphere of 8 octants, 2 x 2"] = ball, BezierPatches(ball.patches)
    in_pairs("rational over polynomial patches", pairs, n, rows)


def turned(n: int, rows: Rows) -> None:
    """Measure turned surfaces and closed forms."""
    ring = [(0.5, 1.0), (0.5, 1.5), (0, 1.5), (-0.5, 1.5), (-0.5, 1), (-0.5, 0.5), (0, 0.5)]
    half = float(np.sqrt(0.5))
    arcs = [ring[0:3], ring[2:5], ring[4:7], [ring[6], (0.5, 0.5), ring[0]]]
    weights = [(1, half, 1)] * 4
    at, up = (0.1, 0.2, -1.0), (0.2, 0.1, 1.0)
    print("\nturned surfaces: Mrays/s (slowest .. fastest round), without and with Embree")
    for name, surface in {
        "cylinder": Cylinder(at, up, 1.0, 2.0),
        "half of it": Cylinder(at, up, 1.0, 2.0, u_range=(0.0, 0.5)),
        "cone": Cone(at, up, 1.0, 2.0),
        "frustum of a cone": SurfaceOfRevolution([(0, 1), (2, 0.4)], at, up),
        "torus, closed form": Torus(at, up, 1.0, 0.5),
        "torus of rational arcs": SurfaceOfRevolution(arcs, at, up, weights=weights),
    }.items():
        rays = at_box([surface], n, 2)
        runs = {
            coarse: trace(Intersector([surface], threads=1, coarse=coarse), rays)
            for coarse in ("none", "embree")
        }
        seconds = in_turn(runs, ROUNDS)
        rows[name] = {
            coarse: {"mrays_per_s": n / timing.median / 1e6, "seconds": vars(timing)}
            for coarse, timing in seconds.items()
        }
        speeds = ", ".join(
            f"{n / s.median / 1e6:5.2f} ({n / s.most / 1e6:.2f} .. {n / s.least / 1e6:.2f})"
            for s in seconds.values()
        )
        print(f"  {name:30s} {speeds}")


def against_untrimmed(n: int, rows: Rows) -> None:
    """Compare trimmed surfaces with the same ones whole."""
    x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    bumpy = BezierPatches(np.stack([x, y, 0.4 * np.sin(3 * x + y)], axis=-1)[None])
    flat = BezierPatches([[[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]])
    window = [polygon(trimmed.OUTLINE), circle((0.5, 0.5), (0.2, 0.2))]
    surfaces = {
        "flat patch, 1 x 1": TrimmedSurface(flat, window),
        "bicubic patch": TrimmedSurface(bumpy, window),
        "spline, 6 patches": trimmed.trimmed_sheet(),
        "rational sheet, 30 patches": TrimmedSurface(rational_sheet(), window),
        "cylinder, two windows": trimmed.windowed_cylinder(),
        "turned part, five segments": trimmed.drilled_part(),
        "rectangle": TrimmedSurface(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), window),
        "sphere": TrimmedSurface(Sphere((0.1, 0.2, 0), 1.0), window),
        "torus": trimmed.windowed_torus(),
        "asphere": trimmed.cut_lens(),
    }
    pairs = {name: (surface, surface.surface) for name, surface in surfaces.items()}
    in_pairs("trimmed over whole", pairs, n, rows)


def many(n: int, rows: Rows) -> None:
    """Compare many surfaces of a kind in a tree with asking each of them."""
    print(
        "\nmany surfaces at random in a cube: ns a ray in a tree; if each is asked; share of hits"
    )
    rng = np.random.default_rng(4)
    for name, make in MADE.items():
        for number in NUMBERS:
            size, places = 0.5 / number ** (1 / 3), rng.random((number, 3))
            surfaces = [make(rng, size, at) for at in places]
            targets = rng.random((n, 3))
            origins = 0.5 + rng.normal(size=targets.shape)
            rays = RaySet(origins, targets - origins, np.full(n, "random"))
            runs = {}
            for way, least in (("tree", 1), ("each", number + 1)):
                with patch.dict(registry.MANY, dict.fromkeys(registry.MANY, least)):
                    runs[way] = trace(Intersector(surfaces, threads=1, coarse="none"), rays)
            seconds = in_turn(runs, ROUNDS)
            tree, each = (1e9 * seconds[way].median / n for way in runs)
            hits = runs["tree"]().hit.mean()
            rows[f"{number} {name}"] = {"tree ns": tree, "each ns": each, "hits": float(hits)}
            print(f"  {number:5d} {name:24s} {tree:7.0f} {each:7.0f}  {100 * hits:3.0f} %")


def in_pairs(title: str, pairs: dict[str, tuple[Any, Any]], n: int, rows: Rows) -> None:
    """Measure the time of the first surface of each pair over that of the second."""
    print(f"\n{title}: Mrays/s, times the other's time (least .. greatest round)")
    for name, pair in pairs.items():
        rays = at_box([pair[1]], n, 2)
        tracers = [Intersector([surface], threads=1, coarse="none") for surface in pair]
        seconds = in_turn({k: trace(one, rays) for k, one in enumerate(tracers)}, 2 * ROUNDS)
        cost, least, most = seconds[1].ratios(seconds[0])
        speed = n / seconds[0].median / 1e6
        print(f"  {name:36s} {speed:5.2f}  {cost:.2f} ({least:.2f} .. {most:.2f})")
        rows[name] = {"mrays_per_s": speed, "cost": cost, "least": least, "greatest": most}


def trace(tracer: Intersector, rays: RaySet) -> Callable[[], HitRecord]:
    """Return a call that traces the rays."""
    return lambda: tracer.intersect(rays.origins, rays.directions)


if __name__ == "__main__":
    sys.exit(run_tool(main))
