"""A self-contained HTML page of a study: diagrams, pictures, error maps, tables."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Mapping, Sequence
from html import escape

from hybrid_rt.analysis.curves import Curve, Point
from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, as_svg
from hybrid_rt.analysis.forecast import Forecast
from hybrid_rt.analysis.hit_study import RULE_OF_THREE, HitStudy
from hybrid_rt.analysis.picture_comparison import Pixels, error_map
from hybrid_rt.analysis.work_precision import Image, PictureStudy
from hybrid_rt.sensor.color import screen_pixels
from hybrid_rt.sensor.image_metrics import picture_errors

Table = tuple[Sequence[str], Sequence[Sequence[str]]]

MICROSECONDS = "microseconds per ray"

_STYLE = """
body { font: 14px/1.45 sans-serif; max-width: 1080px; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { padding: 2px 10px; text-align: right; border-bottom: 1px solid #ddd; }
td:first-child, th:first-child { text-align: left; }
figure { display: inline-block; margin: 0 8px 12px 0; vertical-align: top; }
figcaption { font-size: 12px; max-width: 330px; }
figure img { width: 330px; image-rendering: pixelated; }
img.diagram { width: 760px; max-width: 100%; }
"""


def picture_diagram(title: str, curves: Sequence[Curve], own_error: float) -> Diagram:
    """Plot relative RMSE against seconds, with slopes -1/2 (noise) and -1."""
    lines = []
    for curve in curves:
        marks = [
            Mark(
                (p.seconds.median, p.seconds.least, p.seconds.most),
                (p.error.median, p.error.least, p.error.most),
                f"{p.setting:g}",
            )
            for p in curve.points
            if p.error.least > 0.0
        ]
        if marks:
            lines.append(Line(curve.name, marks))
    if not lines:
        raise ValueError(f"{title}: all are equal to the reference, there is no error to show")
    floor = None if math.isnan(own_error) else ("the reference's own error", own_error)
    return Diagram(
        f"{title}: error of the picture (numbers: passes)", "seconds", "relative RMSE", lines,
        (-0.5, -1.0), floor,
    )  # fmt: skip


def hit_diagram(title: str, curves: Sequence[Curve], judged: int) -> Diagram:
    """Plot the fraction of wrong first hits against the time per ray.

    A fraction of zero is drawn hollow at its 95 % upper limit.
    """
    none = RULE_OF_THREE / max(judged, 1)

    def mark(p: Point) -> Mark:
        share = p.error.median or none
        return Mark(_microseconds(p), (share,) * 3, _tolerance(p), p.error.median == 0.0)

    return Diagram(
        f"{title}: wrong first hits (numbers: tolerances)", MICROSECONDS,
        "share of rays (hollow: none seen, at most this)",
        [Line(curve.name, [mark(p) for p in curve.points]) for curve in curves],
    )  # fmt: skip


def distance_diagram(title: str, curves: Sequence[Curve], size: float) -> Diagram:
    """Plot the mean |t - exact t| of correct hits, relative to size, against the time per ray."""
    lines = [_size_line(curve, "mean_dt", size, _tolerance) for curve in curves]
    return Diagram(
        f"{title}: distance of right hits (numbers: tolerances)", MICROSECONDS,
        "mean |t - exact t| / size", lines,
    )  # fmt: skip


def newton_diagrams(title: str, curves: Sequence[Curve], size: float) -> list[Diagram]:
    """Plot |t - exact t| and the residual, relative to size, against the number of Newton steps."""
    return [
        Diagram(
            f"{title}: {what} (numbers: steps of Newton's iteration)", MICROSECONDS, label,
            [_size_line(curve, figure, size, lambda p: f"{p.setting:g}") for curve in curves],
        )
        for figure, what, label in (
            ("mean_dt", "distance of right hits", "mean |t - exact t| / size"),
            ("worst_residual", "gap between ray and surface", "largest residual / size"),
        )
    ]  # fmt: skip


def _size_line(curve: Curve, figure: str, size: float, label: Callable[[Point], str]) -> Line:
    """Return the marks of one figure in sizes; what is smaller than any rounding stands at 1e-18."""
    marks = [
        Mark(_microseconds(p), (max(p.more[figure] / size, 1e-18),) * 3, label(p))
        for p in curve.points
    ]
    return Line(curve.name, marks)


def _microseconds(p: Point) -> tuple[float, float, float]:
    return 1e6 * p.seconds.median, 1e6 * p.seconds.least, 1e6 * p.seconds.most


def _tolerance(p: Point) -> str:
    return f"{p.setting:.0e}" if math.isfinite(p.setting) else ""


def page(
    title: str,
    sentences: Sequence[str],
    diagrams: Sequence[Diagram],
    tables: Mapping[str, Table],
    images: Mapping[str, Image],
) -> str:
    """Return the HTML page.

    Parameters
    ----------
    title : str
    sentences : sequence of str
        The conclusions, at the top.
    diagrams : sequence of Diagram
    tables : mapping
        By title, (head, rows).
    images : mapping
        By name; each except "reference" is shown with its error map against the reference.
    """
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>",
        "<ul>",
        *(f"<li>{escape(sentence)}</li>" for sentence in sentences),
        "</ul>",
        *map(_diagram, diagrams),
    ]
    for name, (head, rows) in tables.items():
        parts.append(f"<h2>{escape(name)}</h2>{_table(head, rows)}")
    if images:
        parts.append("<h2>Pictures, and maps of their relative errors (black 0.001, yellow 1)</h2>")
        parts += _pictures(images)
    parts.append("</body></html>")
    return "\n".join(parts)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    first = "".join(f"<th>{escape(word)}</th>" for word in head)
    others = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><tr>{first}</tr>{others}</table>"


def _pictures(images: Mapping[str, Image]) -> list[str]:
    reference = images["reference"]
    parts = [_figure(_png(screen_pixels(reference)), "reference")]
    for name, image in images.items():
        if name == "reference":
            continue
        errors = picture_errors(image, reference)
        caption = (
            f"{name}: relative RMSE {errors.relative_rmse:.3g}, "
            f"{errors.relative_rmse_of_most:.3g} without the worst 0.1 % of the pixels, mean error "
            f"{100.0 * errors.relative_mean_error:+.2g} %"
        )
        parts.append("<div>")
        parts.append(_figure(_png(screen_pixels(image)), name))
        parts.append(_figure(_png(error_map(image, reference)), caption))
        parts.append("</div>")
    return parts


def _figure(uri: str, caption: str) -> str:
    text = escape(caption)
    return f'<figure><img src="{uri}" alt="{text}"><figcaption>{text}</figcaption></figure>'


def _diagram(diagram: Diagram) -> str:
    data = base64.b64encode(as_svg(diagram).encode()).decode("ascii")
    title = escape(diagram.title)
    return f'<img class="diagram" alt="{title}" src="data:image/svg+xml;base64,{data}">'


def _png(pixels: Pixels) -> str:
    import imageio.v3 as imageio

    buffer = io.BytesIO()
    imageio.imwrite(buffer, pixels, extension=".png")
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def picture_table(curves: Sequence[Curve]) -> Table:
    """Return the points of picture curves as a table."""
    head = (
        "method", "passes", "seconds", "least", "most", "relative RMSE", "least", "most",
        "without 0.1 %", "mean error", "stated", "build s", "rays",
    )  # fmt: skip
    rows = [
        (
            curve.name, f"{p.setting:g}", f"{p.seconds.median:.3g}", f"{p.seconds.least:.3g}",
            f"{p.seconds.most:.3g}", f"{p.error.median:.3g}", f"{p.error.least:.3g}",
            f"{p.error.most:.3g}", f"{p.more['error_of_most']:.3g}",
            f"{100.0 * p.more['mean_error']:+.2g} %", f"{p.more['stated_error']:.3g}",
            f"{p.more['build_seconds']:.2g}", f"{p.more['rays']:.3g}",
        )
        for curve in curves
        for p in curve.points
    ]  # fmt: skip
    return head, rows


WRONG_HITS = (
    "us/ray", "least", "most", "wrong", "missed", "phantom", "farther", "mean |dt|", "worst |dt|",
    "residual", "normal, degrees",
)  # fmt: skip


def hit_table(curves: Sequence[Curve]) -> Table:
    """Return the points of hit curves as a table."""
    rows = [
        (
            curve.name, f"{p.setting:.2g}", f"{p.more['triangles']:.0f}",
            f"{p.more['build_seconds']:.2g}", *_wrong_hits(p),
        )
        for curve in curves
        for p in curve.points
    ]  # fmt: skip
    return ("method", "tolerance", "triangles", "build s", *WRONG_HITS), rows


def newton_table(curves: Sequence[Curve]) -> Table:
    """Return the points of the Newton curves as a table."""
    rows = [
        (curve.name, f"{p.setting:g}", *_wrong_hits(p)) for curve in curves for p in curve.points
    ]
    return ("method", "steps", *WRONG_HITS), rows


def _wrong_hits(p: Point) -> tuple[str, ...]:
    return (
        f"{1e6 * p.seconds.median:.3f}", f"{1e6 * p.seconds.least:.3f}",
        f"{1e6 * p.seconds.most:.3f}", f"{p.error.median:.2e}", f"{p.more['missed']:.0f}",
        f"{p.more['phantom']:.0f}", f"{p.more['farther']:.0f}", f"{p.more['mean_dt']:.1e}",
        f"{p.more['worst_dt']:.1e}", f"{p.more['worst_residual']:.1e}",
        f"{p.more['mean_angle']:.1e}",
    )  # fmt: skip


def mesh_table(study: PictureStudy) -> Table:
    """Return the picture errors from uncertified hits as a table."""
    head = ("method", "tolerance", "triangles", "build s", "changes the picture by", "at most")
    rows = [
        (
            row["method"], "default" if row["tolerance"] is None else f"{row['tolerance']:.2g}",
            f"{row['triangles']:.0f}", f"{row['build_seconds']:.2g}", f"{row['error']:.2g}",
            f"{row['error_at_most']:.2g}",
        )
        for row in study.meshes
    ]  # fmt: skip
    return head, rows


def forecast_table(forecasts: Sequence[Forecast]) -> Table:
    """Return the forecasts of all methods as a table."""
    head = ("method", "passes", "seconds", "least", "most", "how known", "bias")
    rows = [
        (
            f.method,
            "not reached" if f.passes is None else str(f.passes),
            *(
                "" if f.passes is None else f"{value:.3g}"
                for value in (f.seconds.median, f.seconds.least, f.seconds.most)
            ),
            "" if f.passes is None else "measured" if f.is_measured else "extrapolated",
            f"{f.bias:.2g}" if f.bias else "none seen",
        )
        for f in forecasts
    ]
    return head, rows


def picture_answers(
    study: PictureStudy, forecasts: Sequence[Forecast], target: float, scene: str, triangles: float
) -> list[str]:
    """Summarise a picture study in sentences."""
    reference, best = study.reference, forecasts[0]
    percent = f"{100.0 * target:g} %"
    lines = []
    smallest = min(p.error.median for curve in study.curves for p in curve.points)
    if reference.own_error > smallest:
        lines.append(
            f"The reference's own error, {reference.own_error:.2g}, is above what was measured against "
            f"it, {smallest:.2g}: forecasts say nothing. Give it more passes, or a picture of your own."
        )
    elif best.passes is None:
        lines.append(f"No method reaches {percent} of relative RMSE.")
    else:
        lines.append(f"Cheapest for {percent}: {_recipe(best, scene)}")
        certified = [f for f in forecasts if f.passes is not None and "--accuracy" not in f.flags]
        if certified and certified[0] is not best:
            lines.append(f"With certified hits: {_recipe(certified[0], scene)}")
    if study.meshes and not math.isnan(triangles):
        rows = [row for row in study.meshes if row["accuracy"] == "mesh"]
        coarse, fine = rows[0], rows[-1]
        least = f"{fine['error']:.2g}" if fine["error"] else f"below {fine['error_at_most']:.2g}"
        lines.append(
            f"Meshes in place of the surfaces change the picture by {coarse['error']:.2g} "
            f"({coarse['triangles']:.0f} triangles) to {least} "
            f"({fine['triangles']:.0f}); for {percent} about {triangles:.2g} are needed."
        )
    own = "unknown" if math.isnan(reference.own_error) else f"{reference.own_error:.2g}"
    lines.append(f"Reference: {reference.made_by}; its own relative error is {own}.")
    if reference.check is not None:
        check = reference.check
        blur = check["by_blur"]
        blurred = f" and the blur of photons {blur:.2g}" if blur else ""
        lines.append(
            f"A different method ({check['made_by']}) has a mean that differs by "
            f"{check['gap']:+.2g} +- {3.182 * check['gap_error']:.1g} (95 %); the pictures differ by "
            f"{check['difference']:.2g}, of which their noise explains {check['by_noise']:.2g}{blurred}."
        )
    lines.append(f"Kernels took {study.compile_seconds:.1f} s to compile, not counted here.")
    return lines


def _recipe(found: Forecast, scene: str) -> str:
    how = "measured" if found.is_measured else "extrapolated"
    return (
        f"{found.method}, {found.passes} passes, {found.seconds.median:.3g} s (by the runs "
        f"{found.seconds.least:.3g} to {found.seconds.most:.3g}, {how}): "
        f"hybrid-rt render {scene} {found.flags} --passes {found.passes}"
    )


def hit_answers(study: HitStudy) -> list[str]:
    """Summarise a hit study in sentences."""
    finest = {curve.name: min(curve.points, key=lambda p: p.setting) for curve in study.curves}
    mesh, certified = finest["mesh"], finest["certified"]
    cheapest = min(
        (p for c in study.curves if c.name.startswith("certified") for p in c.points),
        key=lambda p: p.seconds.median,
    )
    limit = RULE_OF_THREE / study.judged
    meshes = [p for c in study.curves if c.name == "mesh" for p in c.points]
    times = sorted(p.seconds.median for p in meshes)
    cost = (
        f"Exact first hits cost {1e6 * cheapest.seconds.median:.3f} us per ray at best, meshes "
        f"{1e6 * times[0]:.3f} to {1e6 * times[-1]:.3f}: exactness costs "
        f"{cheapest.seconds.median / times[-1]:.2f} to {cheapest.seconds.median / times[0]:.2f} "
        f"times a mesh."
    )
    share = (
        f"Of {study.judged} judged rays {mesh.error.median:.2g} meet the wrong thing first on a "
        f"mesh of {mesh.more['triangles']:.0f} triangles, {finest['refined'].error.median:.2g} "
        f"after Newton, {certified.error.median:.2g} when certified (none: below {limit:.1g} at "
        f"95 %), by an oracle that shares no code."
    )
    lines = [cost, share]
    curve = next(c for c in study.curves if c.name == "mesh")
    a, b = sorted(curve.points, key=lambda p: p.more["triangles"])[-2:]
    if 0.0 < b.more["mean_dt"] < a.more["mean_dt"]:
        order = math.log(a.more["mean_dt"] / b.more["mean_dt"]) / math.log(
            b.more["triangles"] / a.more["triangles"]
        )
        exact = max(certified.more["mean_dt"], 1e-17 * study.size)
        needed = b.more["triangles"] * (b.more["mean_dt"] / exact) ** (1.0 / order)
        lines.append(
            f"Its right hits are off by {b.more['mean_dt'] / study.size:.1e} of the size on average, "
            f"falling as triangles^-{order:.2f}; to be as near as certified hits "
            f"({exact / study.size:.0e}) it would need about {needed:.0e} triangles."
        )
    if study.newton:
        lines.append(_newton_answer(study))
    return lines


def _newton_answer(study: HitStudy) -> str:
    # The middle one of the meshes, finer than which few renderers start from.
    curve = study.newton[len(study.newton) // 2]
    first, last = curve.points[0], curve.points[-1]
    steps = ", ".join(
        f"{p.more['mean_dt'] / study.size:.0e} after {p.setting:g}" for p in curve.points[1:]
    )
    return (
        f"{curve.name}: right hits are off by {first.more['mean_dt'] / study.size:.0e} of the size "
        f"on average before the first step, {steps}. The wrong ones no step mends: "
        f"{first.error.median:.2g} before, {last.error.median:.2g} after. All {last.setting:g} steps "
        f"take a ray from {1e6 * first.seconds.least:.3f} to {1e6 * last.seconds.least:.3f} us."
    )
