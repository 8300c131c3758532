"""Judge certified first hits at singular sets by exact arithmetic.

Rays are aimed at tips, poles, spindles, joints, rims, seams, flat parts, rulings, collapsed edges,
corners, creases, cusps, shared edges, and away from hits, at 1e-1 to 1e-16 of the size, in several
places; see `tests/proof/cases/singular_sets.py`. All crossings come from exact arithmetic. For each
set and distance: wrong hits (+ those that say TANGENT), broken bounds of t, points beside the ray (+ those),
missing marks, rows TANGENT and those of them without need, rays left open; then the largest error
of t in eps x scale / cos, in t_bound, and of the point in 64 eps x scale.

Needs python-flint: pip install 'hybrid-rt[dev]'.
"""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases.singular_campaign import MOST_OPEN, SetResult, run_sets
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS, SETS
from proof.exact.judge import BatchVerdict

HEAD = (
    f"{'':>10}{'rays':>7}{'hits':>7}{'wrong':>9}{'bounds':>8}{'off':>6}{'no mark':>8}"
    f"{'TANGENT':>8}{'needless':>9}{'open':>5}{'t':>9}{'t_bound':>9}{'point':>9}"
)


def main() -> int:
    """Run the tool; the exit code is 1 if there was a fault or a refusal, or if too many rays are open."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rays", type=float, default=1e4, help="in all, shared by all cells")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--set", action="append", choices=list(SETS), help="may be repeated")
    parser.add_argument("--kind", action="append", choices=KINDS, help="may be repeated")
    parser.add_argument("--place", action="append", choices=list(PLACEMENTS))
    parser.add_argument("--distance", type=float, action="append", help="may be repeated")
    parser.add_argument("--coarse", choices=("embree", "none"), default="none")
    parser.add_argument("--jobs", type=one_or_more, default=1, help="processes")
    parser.add_argument("--examples", action="store_true", help="name a row of each fault")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    checks.whole(args.seed, "--seed", at_least=0)
    kinds = args.kind or KINDS
    names = args.set or [name for name, entry in SETS.items() if entry.kind in kinds]
    distances, places = args.distance or DISTANCES, args.place or list(PLACEMENTS)
    n_cells = len(names) * len(distances)
    each = int(checks.number(args.rays, "--rays", above=0.0)) // n_cells
    if each < len(places):
        raise ValueError(
            f"--rays is {args.rays:g}: pass at least {n_cells * len(places)}, one for each cell"
        )
    results: list[SetResult] = []
    options = {"distances": distances, "placements": places, "coarse": args.coarse}
    with kept(args.out, lambda: {result.name: _plain(result) for result in results}):
        for result in run_sets(names, each, args.seed, args.jobs, **options):
            results.append(result)
            _print(result, distances, args.examples)
    total = sum((result.total for result in results), BatchVerdict())
    refused = [result.name for result in results if result.refused]
    print(f"\nall sets\n{HEAD}")
    for place in places:
        print(_line(place, sum((result.in_place(place) for result in results), BatchVerdict())))
    print(_line("all", total))
    print(f"{total.rays} rays, {total.faults} faults, {len(refused)} sets refused")
    print(f"wrong, but says TANGENT (no fault): {total.wrong_tangent}")
    return 1 if total.faults or refused or total.left_open > MOST_OPEN * total.rays else 0


def _print(result: SetResult, distances: list[float], examples: bool) -> None:
    print(f"\n{result.name}\n{HEAD}")
    if result.refused:
        print(f"  refused: {result.refused}")
        return
    for distance in distances:
        print(_line(f"{distance:.0e}", result.at(distance)))
    if examples:
        for fault, distance, place, row in result.examples:
            print(f"  {fault}: row {row}, {distance:.0e}, {place}")
    sys.stdout.flush()


def _line(name: str, v: BatchVerdict) -> str:
    wrong = f"{v.n_wrong}+{v.wrong_tangent}" if v.wrong_tangent else str(v.n_wrong)
    off = f"{v.off_ray}+{v.off_ray_tangent}" if v.off_ray_tangent else str(v.off_ray)
    return (
        f"{name:>10}{v.rays:7}{v.hits:7}{wrong:>9}{v.bounds_broken:8}{off:>6}{v.unmarked:8}"
        f"{v.tangent:8}{v.tangent_needlessly:9}{v.left_open:5}"
        f"{v.worst_error:9.2g}{v.worst_bound:9.2g}{v.worst_gap:9.2g}"
    )


def _plain(result: SetResult) -> dict[str, object]:
    return {
        "kind": result.kind,
        "refused": result.refused,
        "examples": result.examples,
        "cells": [
            {"distance": distance, "place": place, **_figures(verdict)}
            for (distance, place), verdict in result.cells.items()
        ],
    }


def _figures(verdict: BatchVerdict) -> dict[str, object]:
    figures = asdict(verdict)
    figures.pop("examples")
    return figures


if __name__ == "__main__":
    sys.exit(run_tool(main))
