"""Judge certified first hits by the oracle, on hard rays: python tools/verify_hits.py --rays 1e6.

Prints per scene how many decisions were wrong, how far t was off in units of the allowed band and
of the reported bound, how hard the rays were, and how much work the hardest of them was.

With --second the hits on patches are compared with those of a second certificate, which is some
hundred times as fast as the oracle; only where the two differ is the oracle asked.
"""

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases.campaign import COSINES, SCENES, STEP, Tally, steps
from proof.judges.second_certificate import Duel, duel

OF_PATCHES = ("teapot", "patches")


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
    parser.add_argument("--second", action="store_true", help="compare two certificates")
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    checks.whole(args.seed, "--seed", at_least=0)
    if args.second:
        if args.coarse is not None:
            raise ValueError(
                f"--second compares without a coarse stage: leave out --coarse {args.coarse}"
            )
        return _compare_two(args)
    names = args.scene or list(SCENES)
    each = _share(args.rays, len(names))
    results: dict[str, Tally] = {}
    with kept(args.out, lambda: {name: _plain(t) for name, t in results.items()}):
        for name in names:
            try:
                coarse = args.coarse or "embree"
                for tally in steps(SCENES[name](), each, args.seed, coarse, args.threads):
                    results[name] = tally
                    done = min(tally.verdict.rays + tally.verdict.undecided, each)
                    if sys.stderr.isatty() or done % (10 * STEP) == 0:
                        wrong = tally.verdict.n_wrong
                        print(f"{name}: {done} of {each} rays, {wrong} wrong", file=sys.stderr)
            finally:  # also of a scene that Ctrl-C ends
                if name in results:
                    _print(name, results[name])
    n_rays = sum(t.verdict.rays for t in results.values())
    n_wrong = sum(t.verdict.n_wrong for t in results.values())
    broken = [name for name, t in results.items() if t.verdict.worst_bound > 1.0]
    beside = [name for name, t in results.items() if t.verdict.worst_gap > 1.0]
    print(f"\n{n_rays} rays judged, {n_wrong} wrong")
    for words, names in (("t_bound is broken", broken), ("points lie beside their rays", beside)):
        if names:
            print(f"{words}: {', '.join(names)}")
    return 1 if n_wrong or broken or beside or not n_rays else 0


def _compare_two(args: argparse.Namespace) -> int:
    names = args.scene or list(OF_PATCHES)
    if not set(names) <= set(OF_PATCHES):
        print(f"--second knows the scenes {', '.join(OF_PATCHES)}", file=sys.stderr)
        return 2
    each = _share(args.rays, len(names))
    results: dict[str, Duel] = {}
    with kept(args.out, lambda: {name: asdict(d) for name, d in results.items()}):
        for name in names:
            try:
                for found in duel(SCENES[name](), each, args.seed, args.threads):
                    results[name] = found
                    if sys.stderr.isatty() or found.rays % 1_000_000 == 0:
                        done = f"{found.rays} of {each} rays, {found.wrong} wrong"
                        print(f"{name}: {done}", file=sys.stderr)
            finally:  # also of a scene that Ctrl-C ends
                if name in results:
                    _print_two(name, results[name])
    n_wrong = sum(d.wrong + d.wrong_second for d in results.values())
    print(f"\n{sum(d.rays for d in results.values())} rays compared, {n_wrong} wrong, by either")
    return 1 if n_wrong else 0


def _print_two(name: str, d: Duel) -> None:
    print(f"\n{name}: {d.rays} rays, {d.hits / d.rays:.1%} hit, {d.tangent} TANGENT")
    print(
        f"  apart           {d.apart} rays; by the oracle the first is wrong on {d.wrong}, "
        f"the second on {d.wrong_second}; {d.undecided} left open"
    )
    print(f"  worst t         {d.worst:.3f} of the sum of both bounds; {d.given_up} given up")
    print(f"  seconds         {d.seconds:.1f} first, {d.second_seconds:.1f} second")
    for seed, ray in (d.examples or [])[:5]:
        print(f"  wrong: ray {ray} of hard_rays(..., seed={seed})")


def _print(name: str, tally: Tally) -> None:
    v, rays = tally.verdict, sum(tally.generators.values())
    print(f"\n{name}: {rays} rays, {tally.hits / rays:.1%} hit")
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
        f"  decisions       {v.ambiguous} within the band (either is right), "
        f"{v.undecided} left undecided by the oracle"
    )
    print(
        f"  TANGENT         {v.tangent} rows, {v.tangent_needlessly} of them clear of the band; "
        f"{v.unmarked} in the band without the mark"
    )
    print(
        f"  worst errors    t {v.worst_band:.3f} bands, {v.worst_bound:.3f} t_bound; "
        f"point beside the ray {v.worst_gap:.3f} bands"
    )
    c = tally.counters
    print(
        f"  work per ray    {c['nodes'] / rays:.2f} nodes, {c['newton_solves'] / rays:.2f} Newton, "
        f"{c['slow_pieces'] / rays:.2f} pieces; longest search {c['most_pieces']} pieces, "
        f"{c['given_up']} given up"
    )
    print(f"  seconds         {tally.seconds:.1f} certified, {tally.oracle_seconds:.1f} oracle")
    for seed, ray, kind in tally.wrong[:5]:
        print(f"  {kind}: ray {ray} of hard_rays(..., seed={seed})")


def _share(rays: float, n_scenes: int) -> int:
    """Return the rays of each scene; a check of none would pass without a word."""
    if not n_scenes <= rays < math.inf:
        raise ValueError(f"--rays is {rays:g}: pass at least one for each of {n_scenes} scenes")
    return int(rays) // n_scenes


def _plain(tally: Tally) -> dict[str, object]:
    plain = asdict(tally)
    plain["verdict"].pop("rows")
    plain["cosines"] = tally.cosines.tolist()
    return plain


if __name__ == "__main__":
    sys.exit(run_tool(main))
