"""Judge certified first hits on any number of rays: python tools/verify.py --hard 1e5 --out a.json.

A screen in double-double balls, with other formulas than the tracer's, confirms what is certain: the
first crossing, t within t_bound, the point on its ray. Exact arithmetic judges all other rows: whether
they are wrong (without TANGENT, and with it), break a bound, lie off their ray, or lack the mark although
their decision, within the band, is not that of the exact ray. With --marks it judges every row, and says
which need the mark or have it without need: 0.3 to 2 thousand rays a second.

--hard N: rays at silhouettes, edges and from far away, at scenes. --ordinary N: chords of scenes, rays at
their boxes, cameras. --singular N: rays at tips, poles, joints, rims, seams, collapsed edges, creases,
borders, flat parts and departures, at 1e-1 to 1e-16 of the size. The latter two in five placements: at
home, turned, far from 0, tiny and huge.

--add-up A.json B.json: the totals of several runs, which must have different seeds.

Needs python-flint: pip install 'hybrid-rt[dev]'.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases import campaign
from proof.cases.campaign import HARD, MOST_OPEN, SINGULAR, SORTS, Group, added, names_of
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS
from proof.exact.judge import BatchVerdict

COLUMNS = {
    "rays": 11, "hits": 11, "tangent": 9, "asked": 9, "n_wrong": 7, "wrong_tangent": 9,
    "bounds_broken": 7, "off_ray": 5, "off_ray_tangent": 9, "unmarked": 8, "tangent_needlessly": 9,
    "left_open": 6, "passed_over": 8,
}  # fmt: skip
NAMES = (
    "rays", "hits", "TANGENT", "asked", "wrong", "+TANGENT", "bounds", "off", "+TANGENT", "no mark",
    "needless", "open", "passed",
)  # fmt: skip
HEAD = " " * 30 + "".join(
    f"{name:>{width}}" for name, width in zip(NAMES, COLUMNS.values(), strict=True)
)
HEAD += f"{'t':>8}{'t_bound':>8}{'point':>8}{'seconds':>9}{'krays/s':>9}"


def main() -> int:
    """Run the tool; the exit code is 1 if a guarantee was broken, or if too many rays are left open."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for sort in SORTS:
        parser.add_argument(f"--{sort}", type=float, default=0.0, help=f"{sort} rays, in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", action="append", choices=KINDS, help="may be repeated")
    parser.add_argument("--only", action="append", metavar="NAME", help="a scene or a singular set")
    parser.add_argument("--marks", action="store_true", help="ask which rows need the mark TANGENT")
    parser.add_argument(
        "--tangent-every", type=one_or_more, default=1, metavar="N",
        help="judge every Nth row that says TANGENT and is not confirmed; default: all",
    )  # fmt: skip
    parser.add_argument("--coarse", choices=("embree", "none"), default="none")
    parser.add_argument("--threads", type=one_or_more, default=1)
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    parser.add_argument("--add-up", type=Path, nargs="+", metavar="FILE", help="runs to add up")
    args = parser.parse_args()
    if args.add_up:
        return _total([group for path in args.add_up for group in _read(path)])
    checks.whole(args.seed, "--seed", at_least=0)
    tasks = []
    for sort in SORTS:
        n = int(checks.number(getattr(args, sort), f"--{sort}", at_least=0.0))
        names = [x for x in names_of(sort, args.kind or KINDS) if x in (args.only or [x])]
        places = 1 if sort == HARD else len(PLACEMENTS)
        least = len(names) * places * (len(DISTANCES) if sort == SINGULAR else 1)
        if 0 < n < least:
            raise ValueError(f"--{sort} is {n}: pass at least {least}, one for each cell")
        tasks += [(sort, name, n // len(names)) for name in names if n]
    if not tasks:
        raise ValueError("no rays: pass --hard N, --ordinary N, --singular N or --add-up FILE ...")
    options = {
        name: getattr(args, name) for name in ("tangent_every", "marks", "coarse", "threads")
    }
    groups: list[Group] = []
    with kept(args.out, lambda: [asdict(group) for group in groups]):
        print(HEAD)
        for task in tasks:
            place = len(groups)
            try:
                for group in campaign.run(*task, args.seed, **options):
                    groups[place:] = [group]
            finally:  # also of a group that Ctrl-C ends
                if len(groups) > place:
                    _print(groups[-1])
    return _total(groups)


def _print(group: Group) -> None:
    print(_line(group.name, group.count))
    for fault, ray in group.examples:
        if fault not in ("wrong, TANGENT", "left open"):
            print(f"  {fault}: {ray}")
    sys.stdout.flush()


def _total(groups: Sequence[Group]) -> int:
    table = added(groups)
    print(f"\n{HEAD}")
    for sort in SORTS:
        counts = {kind: count for (whose, kind), count in table.items() if whose == sort}
        for kind, count in counts.items():
            print(_line(f"{sort}, {kind}", count))
        if len(counts) > 1:
            print(_line(f"{sort}, all", sum(counts.values(), BatchVerdict())))
    total = sum(table.values(), BatchVerdict())
    print(f"{total.rays} rays, {total.faults} faults, {total.left_open} left open")
    is_right = total.rays and not total.faults and total.left_open <= MOST_OPEN * total.rays
    return 0 if is_right else 1


def _read(path: Path) -> list[Group]:
    plain = json.loads(path.read_text("utf-8"))
    return [Group(**{**entry, "count": BatchVerdict(**entry["count"])}) for entry in plain]


def _line(name: str, c: BatchVerdict) -> str:
    counts = "".join(f"{getattr(c, column):{width}}" for column, width in COLUMNS.items())
    worst = "".join(f"{x:8.2g}" for x in (c.worst_error / 64.0, c.worst_bound, c.worst_gap))
    return f"{name:30}{counts}{worst}{c.seconds:9.1f}{1e-3 * c.rays / max(c.seconds, 1e-9):9.1f}"


if __name__ == "__main__":
    sys.exit(run_tool(main))
