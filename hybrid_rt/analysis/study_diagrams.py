"""The diagrams of picture studies and hit studies."""

import math
from collections.abc import Sequence

from hybrid_rt.analysis.curves import Curve, Point
from hybrid_rt.analysis.diagrams import Diagram, Line, Mark
from hybrid_rt.analysis.hit_study import RULE_OF_THREE
from hybrid_rt.analysis.units import number, of_pixels

A_RAY = "microseconds a ray"
BARS = "Bars: least and most of the runs."
# What is smaller than any rounding.
NOTHING = 1e-18


def picture_diagram(curves: Sequence[Curve], own_error: float, trimmed: bool = False) -> Diagram:
    """Plot relative RMSE against seconds, with the slopes of noise."""
    lines = []
    for curve in curves:
        marks = [
            Mark(
                (p.seconds.median, p.seconds.least, p.seconds.most),
                (100.0 * p.error.median, 100.0 * p.error.least, 100.0 * p.error.most),
                f"{p.setting:g}",
            )
            for p in curve.points
            if p.error.least > 0.0
        ]
        if marks:
            lines.append(Line(curve.name, marks))
    if not lines:
        raise ValueError("pictures: all are equal to the reference, there is no error to show")
    floor = None if math.isnan(own_error) else ("the reference's own error", 100.0 * own_error)
    return Diagram(
        "How far pictures are off after how many seconds",
        "seconds to render the picture",
        f"error of {'most pixels' if trimmed else 'the picture'}, % (relative RMSE)",
        lines,
        ((-0.5, "noise: half the error\nin 4 times the time"),),
        floor,
        "Lower and further left is better. Numbers: passes (samples per pixel). A curve that turns flat "
        f"has an error that passes do not remove. {BARS} Below the grey level the reference judges "
        f"nothing.{f' Errors are{of_pixels(True)} of each picture.' if trimmed else ''}",
    )


def hit_diagram(curves: Sequence[Curve], judged: int) -> Diagram:
    """Plot the wrong first hits against the time per ray; none is drawn hollow at its 95 % limit."""
    none = RULE_OF_THREE / max(judged, 1)

    def mark(p: Point) -> Mark:
        share = 100.0 * (p.error.median or none)
        return Mark(_microseconds(p), (share,) * 3, _tolerance(p), p.error.median == 0.0)

    return Diagram(
        "How many rays meet the wrong thing first",
        A_RAY,
        "wrong first hits, % of the rays",
        [Line(curve.name, [mark(p) for p in curve.points]) for curve in curves],
        note=f"Lower and further left is better. Hollow: none of {judged:,} rays was wrong, so at most "
        "this (95 %). Numbers: tolerance of the triangles, scene units. mesh: hits on triangles; refined: "
        "moved onto the true surface by Newton's iteration; certified: proven to be first. " + BARS,
    )


def distance_diagram(curves: Sequence[Curve], size: float) -> Diagram:
    """Plot the mean |t - exact t| of correct hits, relative to size, against the time per ray."""
    lines = [
        Line(
            c.name,
            [
                Mark(_microseconds(p), _in_sizes(p, "mean_dt", size), _tolerance(p))
                for p in c.points
            ],
        )
        for c in curves
    ]
    return Diagram(
        "How far right hits are from the exact point",
        A_RAY,
        "mean distance / size of the objects",
        lines,
        note="Lower and further left is better. Only hits on the right sheet count here. 1e-16 is the "
        f"rounding of double precision. Numbers: tolerance of the triangles, scene units. {BARS}",
    )


def newton_diagrams(curves: Sequence[Curve], size: float) -> list[Diagram]:
    """Plot |t - exact t| and the residual, relative to size, against the number of Newton steps."""
    return [
        Diagram(
            title,
            "steps of Newton's iteration from the hit on the triangle",
            label,
            [
                Line(c.name, [Mark((p.setting,) * 3, _in_sizes(p, figure, size)) for p in c.points])
                for c in curves
            ],
            note=f"Lower is better. 0 steps: the triangle itself. {about} Of hits on the right sheet only: "
            "what the triangles decided wrongly no step mends. What steps cost stands in the table.",
            counts_x=True,
        )
        for figure, title, label, about in (
            (
                "mean_dt",
                "What a step of Newton's iteration is worth",
                "mean distance / size of the objects",
                "Distance: from the exact point, along the ray.",
            ),
            (
                "worst_residual",
                "What gap Newton's iteration leaves between ray and surface",
                "largest gap / size of the objects",
                "Gap: between the point on the ray and the point on the surface.",
            ),
        )
    ]


def _in_sizes(p: Point, figure: str, size: float) -> tuple[float, float, float]:
    """Return a figure in sizes; what is smaller than any rounding stands at 1e-18."""
    return (max(p.more[figure] / size, NOTHING),) * 3


def _microseconds(p: Point) -> tuple[float, float, float]:
    return 1e6 * p.seconds.median, 1e6 * p.seconds.least, 1e6 * p.seconds.most


def _tolerance(p: Point) -> str:
    return number(p.setting, 1) if math.isfinite(p.setting) else ""
