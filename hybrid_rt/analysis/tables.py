"""Tables of the studies, for terminals, pages and CSV: units in the heads, words defined below."""

import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hybrid_rt.analysis.curves import Curve, Point, Slope, Spread
from hybrid_rt.analysis.hit_study import HitStudy
from hybrid_rt.analysis.method_forecast import MethodForecast, at_equal_time
from hybrid_rt.analysis.units import asked, number, of_pixels, percent, signed_percent
from hybrid_rt.analysis.work_precision import PictureStudy

# Of text in a terminal.
WIDTH = 100
# An error below this is none.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Table:
    """A table; the words below it define its terms."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: Sequence[str] = ()


RANGE = ", all runs"


def _spread_if_any(table: Table, spreads: Sequence[Spread]) -> Table:
    """Return a table without its columns of least and most values if these are all alike."""
    if any(of.least < of.most for of in spreads):
        return table
    kept = [k for k, word in enumerate(table.head) if not word.endswith(RANGE)]
    rows = [[row[k] for k in kept] for row in table.rows]
    words = [re.sub(r"; all runs: [^.]*", "", text) for text in table.words]
    return Table(table.title, [table.head[k] for k in kept], rows, words)


def in_text(table: Table) -> str:
    """Return a table for a terminal."""
    cells = [tuple(table.head), *(tuple(row) for row in table.rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(table.head))]
    lines = [table.title]
    for row in cells:
        first, *others = (
            cell.ljust(w) if k == 0 else cell.rjust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  " + "  ".join([first, *others]).rstrip())
    for words in table.words:
        lines += textwrap.wrap(words, WIDTH, initial_indent="  ", subsequent_indent="    ")
    return "\n".join(lines)


def in_latex(table: Table) -> str:
    """Return a table as a ``tabular`` that needs no package; title and words are comments."""
    lines = [f"% {text}" for text in (table.title, *table.words)]
    lines += [f"\\begin{{tabular}}{{l{'r' * (len(table.head) - 1)}}}", "\\hline"]
    for k, row in enumerate((table.head, *table.rows)):
        cells = (re.sub(r"[%&_#$]", r"\\\g<0>", cell).replace("+-", r"$\pm$") for cell in row)
        cells = (re.sub(r"(?<![\w.])-(?=\d)", "$-$", cell) for cell in cells)
        lines.append(" & ".join(cells) + " \\\\" + (" \\hline" if k == 0 else ""))
    return "\n".join([*lines, "\\hline", "\\end{tabular}"]) + "\n"


def _range(of: Spread, digits: int = 3, scale: float = 1.0) -> str:
    return f"{number(scale * of.least, digits)} to {number(scale * of.most, digits)}"


def picture_table(curves: Sequence[Curve], trimmed: bool = False) -> Table:
    """Return the points of picture curves; ``trimmed``: their errors leave out the worst pixels."""
    other, name, stated = (
        ("all pixels %", "error_of_all", "stated_error_of_most")
        if trimmed
        else ("most pixels %", "error_of_most", "stated_error")
    )
    head = (
        "method", "passes", "s", "s, all runs", "error %", "error %, all runs", "stated %", other,
        "mean off by", "+- noise", "+- all", "build s", "million rays",
    )  # fmt: skip
    rows = [
        (
            curve.name, f"{p.setting:g}", number(p.seconds.median), _range(p.seconds),
            number(100.0 * p.error.median), _range(p.error, scale=100.0),
            number(100.0 * p.more.get(stated, math.nan)), number(100.0 * p.more.get(name, math.nan)),
            signed_percent(p.more["mean_error"]),
            percent(p.more.get("mean_error_by_noise", math.nan)),
            percent(p.more.get("mean_error_noise", math.nan)),
            number(p.more["build_seconds"], 2), number(1e-6 * p.more["rays"]),
        )
        for curve in curves
        for p in curve.points
    ]  # fmt: skip
    table = Table("Pictures", head, rows, (
        ("s: seconds of wall time, the median of the runs; all runs: the least and the most of them."),
        ("error: relative RMSE against the reference, the root of the mean of (x - r)^2 / (r^2 + 0.01) over "
        f"pixels and channels{of_pixels(trimmed)}; the reference's own error is in it. stated: what the render itself states of it. "
        + ("all pixels: the same of all pixels." if trimmed else
        "most pixels: the same without the worst 0.1 % of the pixels.")),
        ("mean off by: mean brightness against the reference's, + brighter, - darker; noise averages out "
        "here, light that is not found does not. +- noise: half its 95 % interval by the noise of both. +- all: with "
        "blur, and with what lamps may add that no camera ray has met yet, in mirrors, metal or glass; their limit is "
        "often far more than they add."),
        "build s: seconds of these spent on building surfaces.",
    ))  # fmt: skip
    return _spread_if_any(table, [p.seconds for curve in curves for p in curve.points])


def forecast_table(
    forecasts: Sequence[MethodForecast], target: float, trimmed: bool = False
) -> Table:
    """Return what all methods need for a target."""
    rows = [
        (
            f.method,
            "out of reach" if f.passes is None else f"{f.passes:,}",
            "" if f.passes is None else number(f.seconds.median),
            "" if f.passes is None else _range(f.seconds),
            f.obstacle if f.passes is None else "interpolated" if f.is_measured else "extrapolated",
            percent(f.bias) if f.bias > ROUNDING else "none seen",
        )
        for f in forecasts
    ]
    table = Table(
        f"To an error of {asked(target)}{of_pixels(trimmed)}",
        ("method", "passes", "s", "s, all runs", "how known, or why not", "stays"),
        rows,
        (
            (
                "interpolated: between numbers of passes that were measured; extrapolated: beyond them, the "
                "squared error falling as 1 over the passes (by photons more slowly). The reference's own error is "
                "taken off."
            ),
            (
                "s: with the median error of the runs; all runs: with the least error in the fastest run, to the "
                "largest error in the slowest."
            ),
            "stays: error that more passes do not remove, as far as it is seen above the noise.",
        ),
    )
    return _spread_if_any(table, [f.seconds for f in forecasts])


def equal_time_table(
    curves: Sequence[Curve], reference_error: float, trimmed: bool = False
) -> Table:
    """Return the errors of methods after as many seconds; ``reference_error`` is nan if not known."""
    own = 0.0 if math.isnan(reference_error) else reference_error
    seconds, errors = at_equal_time(curves)
    # What the reference adds is taken away, if it is less than half of the square.
    squares = [e * e - own * own if e * e > 2.0 * own * own else math.nan for e in errors]
    best = min((s for s in squares if s > 0.0), default=math.nan)
    order = sorted(range(len(curves)), key=lambda k: (math.isnan(errors[k]), errors[k]))
    rows = []
    for k in order:
        if math.isnan(errors[k]):
            rows.append((curves[k].name, "takes longer", ""))
        elif math.isnan(squares[k]):
            rows.append((curves[k].name, number(100.0 * errors[k]), "not known"))
        else:
            rows.append((curves[k].name, number(100.0 * errors[k]), number(squares[k] / best)))
    words = [
        (
            f"error: relative RMSE{of_pixels(trimmed)}, interpolated between the points of the table of pictures. "
            "squared error: without "
            "that of the reference. Where it falls as 1 over the seconds, it is also how many times the seconds a "
            "method needs for the best one's error."
        )
    ]
    if any(row[2] == "not known" for row in rows):
        words.append(
            f"not known: the reference is itself off by {percent(own)}, so errors of about that size cannot be "
            "compared: pass more --reference-passes."
        )
    late = [
        c.points[0].seconds.median for c, e in zip(curves, errors, strict=True) if math.isnan(e)
    ]
    if late:
        words.append(
            f"takes longer: its first pass takes up to {number(max(late), 2)} s. With --seconds "
            f"{math.ceil(2.0 * max(late))} each method makes passes until a render takes about so long, and all can "
            "be compared; or pass fewer --photons."
        )
    return Table(
        f"At equal time, {number(seconds)} s",
        ("method", "error %", "squared error, best = 1"),
        rows,
        words,
    )


def slope_table(slopes: Sequence[Slope], trimmed: bool = False) -> Table:
    """Return how fast the error of each method falls."""
    rows = [
        (of.method, *map(_exponent, (of.by_passes, of.by_seconds)), f"{of.of_noise:.3f}")
        for of in slopes
    ]
    return Table(
        f"Slopes{of_pixels(trimmed)}",
        ("method", "by passes", "by seconds", "noise alone"),
        rows,
        (
            (
                "by passes, by seconds: b of error ~ passes^b and ~ seconds^b, by least squares of the logarithms "
                "over all runs, +- its standard error. The reference's own error is taken off; runs of which it is "
                "more than half of the squared error are left out. unknown: less than three numbers of passes."
            ),
            "noise alone: the exponent by passes, without bias.",
        ),
    )


def _exponent(fitted: tuple[float, float]) -> str:
    return "unknown" if math.isnan(fitted[0]) else f"{fitted[0]:.3f} +- {fitted[1]:.3f}"


def mesh_table(study: PictureStudy) -> Table:
    """Return the picture errors from uncertified hits."""
    known = {curve.name: curve.bias for curve in study.curves}
    rows = [
        (
            row["method"], "default" if row["tolerance"] is None else number(row["tolerance"]),
            f"{row['triangles']:,.0f}", number(row["build_seconds"], 2),
            *_changes(row, known.get(row["method"], 0.0)),
        )
        for row in study.meshes
    ]  # fmt: skip
    return Table(
        f"What triangles change{of_pixels(study.trimmed)}",
        ("method", "tolerance", "triangles", "build s", "changes the picture by", "at most"),
        rows,
        (
            (
                "tolerance: largest distance between triangles and surface, scene units. changes the picture "
                "by: relative RMSE that no number of passes removes, from certified hits with the same "
                "random numbers; not seen: below the noise. at most: its upper 95 % limit."
            ),
        ),
    )


def _changes(row: dict[str, Any], known: float) -> tuple[str, str]:
    """Return what triangles change, which is at least what is known by means, and its limit."""
    if row["error_at_most"] < ROUNDING:
        return "nothing", "0 %"
    seen = percent(row["error"]) if row["error"] else "not seen"
    if known > row["error"]:
        seen = f"{percent(known)} or more, by means"
    return seen, percent(row["error_at_most"])


_WRONG = ("us a ray", "us, all runs", "wrong %", "missed", "phantom", "farther")
_FAR = ("mean off by", "worst off by", "gap", "normal off by")
_ABOUT_HITS = (
    (
        "us a ray: microseconds of wall time, the median of the runs; all runs: the least and the most. "
        "wrong: share of the judged rays whose first hit is wrong, by certified hits found without triangles."
    ),
    (
        "missed: rays that meet a surface and find none. phantom: rays that meet nothing and find "
        "something. farther: rays that find a farther sheet than the first."
    ),
    (
        "mean, worst off by: distance along the ray between right hits and exact ones, scene units. gap: "
        "largest distance between the point on the surface and the point on the ray, scene units. normal "
        "off by: mean angle to the true normal, degrees."
    ),
)


def hit_table(curves: Sequence[Curve]) -> Table:
    """Return the points of hit curves."""
    rows = [
        (
            curve.name, "-" if p.setting == float("inf") else number(p.setting),
            f"{p.more['triangles']:,.0f}", number(p.more["build_seconds"], 2), *_wrong_hits(p),
        )
        for curve in curves
        for p in curve.points
    ]  # fmt: skip
    return Table(
        "First hits",
        ("method", "tolerance", "triangles", "build s", *_WRONG, *_FAR),
        rows,
        (
            (
                "mesh: Embree's hits on the triangles. refined: Newton's iteration from these onto the true "
                "surface. certified: proven to be the first hit. no Embree: the proof's own search alone."
            ),
            "tolerance: largest distance between triangles and surface, scene units.",
            *_ABOUT_HITS,
        ),
    )


def newton_table(study: HitStudy) -> Table:
    """Return the points of the Newton curves."""
    rows = [
        (curve.name, f"{p.setting:g}", *_wrong_hits(p))
        for curve in study.newton
        for p in curve.points
    ]
    return Table("Newton's steps", ("method", "steps", *_WRONG, *_FAR), rows, _ABOUT_HITS)


def _wrong_hits(p: Point) -> tuple[str, ...]:
    return (
        number(1e6 * p.seconds.median, 2), _range(p.seconds, 2, 1e6),
        number(100.0 * p.error.median, 2), *(f"{p.more[kind]:,.0f}" for kind in _WRONG[3:]),
        f"{p.more['mean_dt']:.1e}", f"{p.more['worst_dt']:.1e}", f"{p.more['worst_residual']:.1e}",
        f"{p.more['mean_angle']:.1e}",
    )  # fmt: skip
