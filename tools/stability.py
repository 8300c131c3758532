"""Run the catalogue of hard cases, one row each, against independent truths.

Each row is printed as it ends: its id, the verdict, rays compared, wrong decisions, the largest error
in units of what is expected there, broken bounds, rows marked TANGENT, the largest search in pieces,
seconds, and what the case is. Rows run in a child process, each within --limit seconds: one that does
not end, or ends the process, fails, and the rest goes on. Figures and a page go to --out.

The exit code is 0 only if every row that was selected holds, or is declared as not built.

Needs python-flint and mpmath: pip install 'hybrid-rt[dev]'.
"""

import argparse
import importlib.util
import platform
import sys
import time
from pathlib import Path

from hybrid_rt._version import __version__
from hybrid_rt.cli.command import kept, run_tool, say_if_no_plots
from hybrid_rt.core import checks
from hybrid_rt.core.threads import available_threads
from meshing.outputs import make_folder, replacing
from proof.stability import page as pages
from proof.stability import runner
from proof.stability.row import Effort

QUICK = 0.05
LINE = "{:<4} {:<13} {:>9} {:>6} {:>9} {:>7} {:>8} {:>6} {:>8}  {}"


def main() -> int:
    """Run the tool; the exit code is 1 if anything fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default="", help="ids or how they begin, such as A01,B")
    parser.add_argument("--out", type=Path, default=Path("stability"), help="a directory")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK:g} of the rays")
    parser.add_argument("--factor", type=float, help="so many times the rays of a full run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--limit", type=float, default=runner.LIMIT, help="seconds for one row")
    parser.add_argument("--plots", type=Path, help="write the plots as PNG files here")
    parser.add_argument("--fuzz", type=float, help="minutes of random cases besides")
    args = parser.parse_args()
    checks.whole(args.seed, "--seed", at_least=0)
    limit = checks.number(args.limit, "--limit", above=0.0)
    factor = QUICK if args.quick else 1.0
    if args.factor is not None:
        factor = checks.number(args.factor, "--factor", above=0.0)
    if args.fuzz is not None:
        checks.number(args.fuzz, "--fuzz", above=0.0)
    only = args.only.split(",")
    n_rows = len(runner.expand(only))
    make_folder(args.out)
    say_if_no_plots("plots")
    began, rows, failures = time.perf_counter(), [], []

    def sentence() -> str:
        machine = f"{platform.machine()}, {available_threads()} threads"
        return pages.summary(rows, machine, __version__, time.perf_counter() - began)

    def figures() -> dict[str, object]:
        return {} if not rows and not failures else {
            "summary": sentence(), "version": __version__, "factor": factor, "seed": args.seed,
            "seconds": time.perf_counter() - began, "rows": rows, "fuzz": failures,
        }  # fmt: skip

    print(LINE.format("row", "verdict", "rays", "wrong", "error", "broken", "TANGENT", "work",
                      "seconds", "case"))  # fmt: skip
    is_right = True
    with kept(args.out / "stability.json", figures):
        for result in runner.run_rows(only, Effort(factor, args.seed), limit=limit):
            rows.append(result.figures())
            is_right &= result.is_right
            _print(rows[-1])
        if args.fuzz is not None:
            from proof.stability.fuzz import run_fuzz

            for failure in run_fuzz(args.fuzz, args.seed, args.out):
                failures.append({"case": failure.case, "faults": failure.faults})
                print(f"fuzz: {'; '.join(failure.faults)}: {failure.case}")
    print(f"\n{sentence()}")
    if len(rows) < n_rows:
        print(f"{n_rows - len(rows)} rows were not run")
    with replacing(args.out / "stability.html") as file:
        file.write(pages.stability_page(rows, sentence()).encode())
    if args.plots is not None and importlib.util.find_spec("matplotlib"):
        pages.save_panels(rows, args.plots)
    return 0 if is_right and not failures else 1


def _print(row: dict) -> None:
    verdict = row["verdict"].split(":")[0]
    print(
        LINE.format(
            row["id"], verdict, row["rays"], row["wrong"], pages.error_words(row["error"]),
            row["broken"], row["undecided"], row["work"], f"{row['seconds']:.1f}",
            row["title"] or row["verdict"],
        )
    )  # fmt: skip
    for fault in row["faults"]:
        print(f"     {fault}")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(run_tool(main))
