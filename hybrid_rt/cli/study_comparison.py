"""``hybrid-rt study --compare``: the curves of two earlier runs in one diagram."""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from hybrid_rt.analysis import study_diagrams, tables
from hybrid_rt.analysis.curves import Curve, fitted_slope, renamed
from hybrid_rt.analysis.diagrams import Diagram
from hybrid_rt.analysis.method_forecast import forecast
from hybrid_rt.analysis.page import Study
from hybrid_rt.analysis.units import asked, seconds
from hybrid_rt.cli.study_files import check_folder, curves_of, publish_study, read_study

# The figures of one part of both runs, their diagram and their tables.
Overlay = tuple[dict[str, Any], Diagram, list[tables.Table]]


def compare(args: argparse.Namespace) -> None:
    """Overlay the curves of two earlier runs."""
    both = [read_study(file) for file in args.compare]
    names = [str(file.parent / file.stem) for file in args.compare]
    if args.out:
        for file in args.compare:
            if args.out.exists() and args.out.samefile(file.parent):
                raise ValueError(
                    f"--out {args.out} is the folder of {file}, which would be replaced: name another"
                )
        check_folder(args.out)
    diagrams: list[Diagram] = []
    found: list[tables.Table] = []
    data: dict[str, Any] = {"compared": names}
    for part, overlay in (("picture", _pictures), ("hits", _hits)):
        if all(part in one for one in both):
            data[part], diagram, of_part = overlay([one[part] for one in both], names)
            diagrams.append(diagram)
            found += of_part
    if not diagrams:
        raise ValueError(
            f"{names[0]} and {names[1]} have no kind of curves in common: name two of one kind"
        )
    first, *others = _ratios(both) or ["Read the diagrams: lower and further left is better."]
    study = Study(
        f"Error against run time: {names[0]} and {names[1]}",
        f"Asked: how do two runs compare? A is {names[0]}, B is {names[1]}.",
        first,
        details=others,
        measured=[(letter, str(file)) for letter, file in zip("AB", args.compare, strict=True)],
        diagrams=diagrams,
        tables=found,
    )
    publish_study(study, data, args.out)


def _pictures(both: Sequence[dict[str, Any]], names: Sequence[str]) -> Overlay:
    trimmed = [bool(one.get("trimmed")) for one in both]
    if trimmed[0] != trimmed[1]:
        raise ValueError(
            f"one of {names[0]} and {names[1]} leaves out the worst 0.1 % of the pixels: measure both "
            "with --target, or both with --target-trimmed"
        )
    curves = _curves(both)
    own = max(one["reference"]["own_error"] or 0.0 for one in both)
    data = {
        "curves": [asdict(curve) for curve in curves],
        "reference": {"own_error": own or float("nan")},
        "trimmed": trimmed[0],
    }
    diagram = study_diagrams.picture_diagram(curves, own or float("nan"), trimmed[0])
    by_time = tables.equal_time_table(curves, own, trimmed[0])
    slopes = tables.slope_table([fitted_slope(curve, own) for curve in curves], trimmed[0])
    return data, diagram, [by_time, slopes, tables.picture_table(curves, trimmed[0])]


def _hits(both: Sequence[dict[str, Any]], _: Sequence[str]) -> Overlay:
    curves = _curves(both)
    judged = max(one["judged"] for one in both)
    data = {"curves": [asdict(curve) for curve in curves], "judged": judged}
    return data, study_diagrams.hit_diagram(curves, judged), [tables.hit_table(curves)]


def _curves(both: Sequence[dict[str, Any]]) -> list[Curve]:
    """Return the curves of both runs, named after A and B."""
    return [
        curve
        for letter, one in zip("AB", both, strict=True)
        for curve in renamed(curves_of(one), letter)
    ]


def _ratios(both: Sequence[dict[str, Any]]) -> list[str]:
    """Say for methods of both runs how the seconds compare to a target that both can judge."""
    if not all("picture" in one for one in both):
        return []
    target = max(one["picture"]["forecast_target"] for one in both)
    found = []
    for one in both:
        own = one["picture"]["reference"]["own_error"] or 0.0
        found.append({c.name: forecast(c, target, own) for c in curves_of(one["picture"])})
    return [
        f"To {asked(target)}, {name}: {seconds(found[0][name].seconds.median)} in A, "
        f"{seconds(found[1][name].seconds.median)} in B."
        for name in found[0]
        if name in found[1] and None not in (found[0][name].passes, found[1][name].passes)
    ]
