"""Judge certified first hits on hard rays: python tools/verify_hits.py --rays 1e5.

A screen in ball arithmetic confirms what is certainly right, and exact arithmetic judges the rest. Prints
per scene how many decisions were wrong, how far t was off in units of the allowed band and of the
reported bound on the rays that exact arithmetic judged, how hard the rays were, and how much work the
hardest of them was.
"""

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases.campaign import COSINES, SCENES, STEP, Tally, steps


def main() -> int:
    """Run the tool; the exit code is 1 if a decision was wrong or a bound broken, or if nothing was judged."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rays", type=float, default=1e5, help="in all, shared by the scenes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scene", action="append", choices=list(SCENES), help="may be repeated")
    parser.add_argument("--coarse", choices=("embree", "none"), help="default: embree")
    parser.add_argument("--threads", type=one_or_more)
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    checks.whole(args.seed, "--seed", at_least=0)
    names = args.scene or list(SCENES)
    each = _share(args.rays, len(names))
    results: dict[str, Tally] = {}
    with kept(args.out, lambda: {name: _plain(t) for name, t in results.items()}):
        for name in names:
            try:
                coarse = args.coarse or "embree"
                for tally in steps(SCENES[name](), each, args.seed, coarse, args.threads):
                    results[name] = tally
                    done = tally.verdict.rays
                    if sys.stderr.isatty() or done % (10 * STEP) == 0:
                        wrong = tally.verdict.n_wrong
                        print(f"{name}: {done} of {each} rays, {wrong} wrong", file=sys.stderr)
            finally:  # also of a scene that Ctrl-C ends
                if name in results:
                    _print(name, results[name])
    n_rays = sum(t.verdict.rays for t in results.values())
    n_wrong = sum(t.verdict.n_wrong for t in results.values())
    faults = {
        "t_bound is broken": [name for name, t in results.items() if t.verdict.bounds_broken],
        "points lie beside their rays": [
            name for name, t in results.items() if t.verdict.off_ray or t.verdict.off_ray_tangent
        ],
    }
    print(f"\n{n_rays} rays judged, {n_wrong} wrong")
    for words, scenes in faults.items():
        if scenes:
            print(f"{words}: {', '.join(scenes)}")
    return 1 if n_wrong or any(faults.values()) or not n_rays else 0


def _print(name: str, tally: Tally) -> None:
    v, rays = tally.verdict, sum(tally.generators.values())
    print(f"\n{name}: {rays} rays, {v.hits / rays:.1%} hit")
    print("  generators      " + ", ".join(f"{k} {n}" for k, n in tally.generators.items()))
    total = max(tally.cosines.sum(), 1)
    print(
        "  |cos| below     "
        + ", ".join(
            f"{bound:.0e}: {share:.1%}"
            for bound, share in zip(COSINES[1:], tally.cosines.cumsum() / total, strict=True)
        )
    )
    print("  wrong           " + ", ".join(f"{k} {n}" for k, n in v.wrong.items()))
    print(
        f"  exact           {v.asked} rays that the screen does not confirm; {v.left_open} left open"
    )
    print(f"  TANGENT         {v.tangent} rows; {v.unmarked} in the band without the mark")
    print(
        f"  worst errors    t {v.worst_error / 64.0:.3f} bands, {v.worst_bound:.3f} t_bound; "
        f"point beside the ray {v.worst_gap:.3f} bands"
    )
    c = tally.counters
    print(
        f"  work per ray    {c['nodes'] / rays:.2f} nodes, {c['newton_solves'] / rays:.2f} Newton, "
        f"{c['slow_pieces'] / rays:.2f} pieces; longest search {c['most_pieces']} pieces, "
        f"{c['given_up']} given up"
    )
    print(f"  seconds         {tally.seconds:.1f} certified, {tally.judge_seconds:.1f} judges")
    for seed, ray, kind in tally.wrong[:5]:
        print(f"  {kind}: ray {ray} of hard_rays(..., seed={seed})")


def _share(rays: float, n_scenes: int) -> int:
    """Return the rays of each scene; a check of none would pass without a word."""
    if not n_scenes <= rays < math.inf:
        raise ValueError(f"--rays is {rays:g}: pass at least one for each of {n_scenes} scenes")
    return int(rays) // n_scenes


def _plain(tally: Tally) -> dict[str, object]:
    plain = asdict(tally)
    plain["cosines"] = tally.cosines.tolist()
    return plain


if __name__ == "__main__":
    sys.exit(run_tool(main))
