"""Judge certified first hits on very many rays: python tools/verify_many.py --singular 1e6 --out a.json.

Filters in double-double balls, with other formulas than the tracer's, confirm what is certain: the
first crossing, t within t_bound, the point on its ray. Exact arithmetic judges all other rows: whether
they are wrong (without TANGENT, and with it), break a bound, lie off their ray, or lack the mark although
their decision, within the band, is not that of the exact ray.

--singular N: rays at tips, poles, joints, rims, seams, collapsed edges, creases, borders, flat
parts and departures, at 1e-1 to 1e-16 of the size. --ordinary N: chords of scenes, rays at their
boxes, cameras. Both in five placements: at home, turned, far from 0, tiny and huge.

--add-up A.json B.json: the totals of several runs, which must have different seeds.

Needs python-flint: pip install 'hybrid-rt[dev]'.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from hybrid_rt.cli.command import kept, one_or_more, run_tool
from hybrid_rt.core import checks
from proof.cases.filtered_campaign import (
    ORDINARY,
    ORDINARY_SCENES,
    SINGULAR,
    Count,
    Group,
    added,
    run_ordinary,
    run_singular,
)
from proof.cases.singular_campaign import MOST_OPEN
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS, SETS

HEAD = (
    f"{'':30}{'rays':>11}{'hits':>11}{'TANGENT':>9}{'asked':>9}{'wrong':>7}{'+TANGENT':>9}"
    f"{'bounds':>7}{'off':>5}{'+TANGENT':>9}{'no mark':>8}{'open':>6}{'passed':>8}{'seconds':>9}{'krays/s':>9}"
)


def main() -> int:
    """Run the tool; the exit code is 1 if a guarantee was broken, or if too many rays are left open."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--singular", type=float, default=0.0, help="rays at singular sets, in all")
    parser.add_argument("--ordinary", type=float, default=0.0, help="ordinary rays, in all")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", action="append", choices=KINDS, help="may be repeated")
    parser.add_argument("--set", action="append", choices=list(SETS), help="may be repeated")
    parser.add_argument("--scene", action="append", choices=list(ORDINARY_SCENES))
    parser.add_argument(
        "--tangent-every", type=one_or_more, default=1, metavar="N",
        help="judge every Nth row that says TANGENT and is not confirmed; default: all",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="write the figures as JSON")
    parser.add_argument("--add-up", type=Path, nargs="+", metavar="FILE", help="runs to add up")
    args = parser.parse_args()
    if args.add_up:
        return _total([group for path in args.add_up for group in _read(path)])
    checks.whole(args.seed, "--seed", at_least=0)
    singular = checks.number(args.singular, "--singular", at_least=0.0)
    ordinary = checks.number(args.ordinary, "--ordinary", at_least=0.0)
    kinds = args.kind or KINDS
    names = args.set or [name for name, entry in SETS.items() if entry.kind in kinds]
    scenes = args.scene or [name for name, (kind, _) in ORDINARY_SCENES.items() if kind in kinds]
    if not singular and not ordinary:
        raise ValueError("no rays: pass --singular N, --ordinary N or --add-up FILE ...")
    cells = len(names) * len(PLACEMENTS) * len(DISTANCES)
    if 0.0 < singular < cells:
        raise ValueError(f"--singular is {singular:g}: pass at least {cells}, one for each cell")
    groups: list[Group] = []
    with kept(args.out, lambda: [asdict(group) for group in groups]):
        print(HEAD)
        if singular:
            for name in names:
                each = int(singular) // len(names)
                _follow(groups, run_singular(name, each, args.seed, args.tangent_every))
        if ordinary:
            for name in scenes:
                _follow(groups, run_ordinary(name, int(ordinary) // len(scenes), args.seed))
    return _total(groups)


def _follow(groups: list[Group], steps: Iterator[Group]) -> None:
    """Keep the figures of a group while it runs."""
    place = len(groups)
    for group in steps:
        groups[place:] = [group]
    print(_line(groups[-1].name, groups[-1].count))
    for fault, ray in groups[-1].examples:
        if fault not in ("wrong, TANGENT", "left open"):
            print(f"  {fault}: {ray}")
    sys.stdout.flush()


def _total(groups: Sequence[Group]) -> int:
    table = added(groups)
    print(f"\n{HEAD}")
    for rays in (SINGULAR, ORDINARY):
        for (whose, kind), count in table.items():
            if whose == rays:
                print(_line(f"{rays}, {kind}", count))
        counts = [count for (whose, _), count in table.items() if whose == rays]
        if len(counts) > 1:
            print(_line(f"{rays}, all", sum(counts, Count())))
    total = sum(table.values(), Count())
    print(f"{total.rays} rays, {total.faults} faults, {total.left_open} left open")
    return 1 if total.faults or total.left_open > MOST_OPEN * total.rays else 0


def _read(path: Path) -> list[Group]:
    plain = json.loads(path.read_text("utf-8"))
    return [Group(**{**entry, "count": Count(**entry["count"])}) for entry in plain]


def _line(name: str, c: Count) -> str:
    seconds = c.seconds + c.filter_seconds + c.exact_seconds
    return (
        f"{name:30}{c.rays:11}{c.hits:11}{c.tangent:9}{c.asked:9}{c.wrong:7}{c.wrong_tangent:9}"
        f"{c.bounds_broken:7}{c.off_ray:5}{c.off_ray_tangent:9}{c.unmarked:8}{c.left_open:6}{c.passed_over:8}{seconds:9.1f}"
        f"{1e-3 * c.rays / max(seconds, 1e-9):9.1f}"
    )


if __name__ == "__main__":
    sys.exit(run_tool(main))
