"""Weaken each proof of the tracer in turn, and see which hard rays notice.

A mutant changes one line in a temporary copy of the packages; the copy traces rays at singular sets
and ordinary hard rays, and rows that differ from today's go before the exact judge, until one tells.
Printed per mutant: that ray, and what is wrong with its row. Mutants that nobody notices are listed
at the end; with those the exit code is 1.

Each mutant compiles the kernels that it concerns: a minute or two. Needs python-flint: pip install
'hybrid-rt[dev]'.
"""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases.mutant_campaign import MutantResult, run_mutants
from proof.cases.mutants import MUTANTS


def main() -> int:
    """Run the tool."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", action="append", metavar="WORD", help="mutants with it in a name")
    parser.add_argument("--list", action="store_true", help="list the mutants and what they weaken")
    parser.add_argument("--rays", type=one_or_more, default=20, help="of each set, place, distance")
    parser.add_argument("--judged", type=one_or_more, default=100, help="rows of each set at most")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    args = parser.parse_args()
    checks.whole(args.seed, "--seed", at_least=0)
    words = args.only or [""]
    chosen = [m for m in MUTANTS if any(word in m.name for word in words)]
    if not chosen:
        raise ValueError(f"--only is {', '.join(words)}: no mutant has that in its name")
    if args.list:
        for mutant in chosen:
            print(f"{mutant.name}: {mutant.weakens}; in {mutant.where}")
        return 0
    results: list[MutantResult] = []
    with kept(args.out, lambda: [asdict(result) for result in results]):
        for result in run_mutants(chosen, args.rays, args.seed, args.judged):
            results.append(result)
            _print(result)
    missed = [result.mutant for result in results if not result.is_noticed]
    print(f"\n{len(results) - len(missed)} of {len(results)} mutants noticed")
    for mutant in missed:
        print(f"  nobody notices: {mutant.name} ({mutant.weakens})")
    return 1 if missed else 0


def _print(result: MutantResult) -> None:
    mutant, notice = result.mutant, result.notice
    if result.is_broken:
        found = result.failed
    elif result.failed:
        found = f"noticed: the tracer fails: {result.failed}"
    elif notice is None:
        found = "nobody notices"
    else:
        found = f"noticed: {', '.join(notice.faults)} (ray {notice.row} of {notice.set_name})"
    print(
        f"\n{mutant.name} ({mutant.weakens}): {result.differing} rows differ, {result.judged} judged, "
        f"{result.seconds:.0f} s\n  {found}",
        flush=True,
    )


if __name__ == "__main__":
    sys.exit(run_tool(main))
