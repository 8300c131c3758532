"""Are the stated errors true? For example: python tools/calibrate.py --seeds 400 --hits 1e6.

First pictures of which every pixel is known: how often the truth falls into the stated 95 %
intervals, over many seeds, per pixel and for the mean of the picture. Then certified hits of hard
rays against their roots in double-double: whether t_bound was ever exceeded, and how loose it is.
The exit code is 1 if an interval holds the truth less than 92 % or more than 98 % of the time, or
if a bound is broken or loose.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.command import kept, run_tool
from hybrid_rt.verify.calibration import PICTURES, Bounds, bounds, coverage
from hybrid_rt.verify.campaign import SCENES

HONEST = (0.92, 0.98)
LOOSE = 64.0


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=400)
    parser.add_argument("--passes", type=int, nargs="+", default=[16, 64, 256])
    parser.add_argument("--integrator", action="append", help="default: path; may be repeated")
    parser.add_argument("--hits", type=float, default=1e6, help="shared by the scenes; 0: none")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with kept(args.out, lambda: rows):
        for integrator in args.integrator or ["path"]:
            for name, make in PICTURES.items():
                if integrator != "whitted" or not make().has_bounces:
                    rows.extend(_cover(name, integrator, n, args.seeds) for n in args.passes)
        n_hits = int(args.hits) // len(SCENES)
        rows.extend(_bind(name, n_hits, args.threads) for name in SCENES if args.hits)
    return 0 if all(row["honest"] for row in rows) else 1


def _cover(name: str, integrator: str, passes: int, n_seeds: int) -> dict[str, Any]:
    found = coverage(PICTURES[name](), integrator, passes, range(n_seeds))
    low, high = HONEST
    honest = low <= found.of_pixels <= high and low <= found.of_mean <= high
    print(
        f"{name:20} {integrator:8} {passes:4d} passes, {n_seeds} seeds: inside the 95 % interval "
        f"{found.of_pixels:.1%} of pixels, {found.of_mean:.1%} of means; stated error over true "
        f"{found.error_ratio:.2f}{'' if honest else '   NOT within 92 to 98 %'}",
        flush=True,
    )
    return {
        "picture": name, "integrator": integrator, "passes": passes, "seeds": n_seeds,
        "of_pixels": found.of_pixels, "of_mean": found.of_mean, "error_ratio": found.error_ratio,
        "honest": honest,
    }  # fmt: skip


def _bind(name: str, n_hits: int, threads: int | None) -> dict[str, Any]:
    parts: list[Bounds] = []
    # Not every ray hits: go on until there are enough.
    for part in bounds(SCENES[name](), 100 * n_hits, 1, threads):
        parts.append(part)
        if sum(p.hits for p in parts) >= n_hits:
            break
    looseness = np.concatenate([part.looseness for part in parts])
    hits, exceeded = len(looseness), sum(part.exceeded for part in parts)
    wrong = sum(part.wrong for part in parts)
    worst, median = max(part.worst for part in parts), float(np.median(looseness))
    honest = exceeded == 0 and wrong == 0 and median < LOOSE
    print(
        f"{name:20} {hits:7d} hits, {wrong} wrong; t_bound exceeded {exceeded} times (largest error "
        f"{worst:.2f} of it); t_bound / (eps scale / |cos|): median {median:.1f}, 99 % below "
        f"{np.quantile(looseness, 0.99):.1f}{'' if honest else '   BROKEN OR LOOSE'}",
        flush=True,
    )
    return {
        "scene": name, "hits": hits, "wrong": wrong, "exceeded": exceeded, "worst": worst,
        "looseness_median": median, "looseness_99": float(np.quantile(looseness, 0.99)),
        "honest": honest,
    }  # fmt: skip


if __name__ == "__main__":
    sys.exit(run_tool(main))
