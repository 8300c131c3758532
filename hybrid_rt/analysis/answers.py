"""Studies in sentences: what meshes change, what exact hits cost, under what conditions it was measured."""

import math
import os
import platform
from collections.abc import Sequence
from pathlib import Path

from hybrid_rt.analysis.advice import without_examples
from hybrid_rt.analysis.curves import Curve
from hybrid_rt.analysis.hit_study import HitStudy
from hybrid_rt.analysis.method_forecast import seconds_fall
from hybrid_rt.analysis.reference import Reference, off_itself
from hybrid_rt.analysis.units import asked, number, percent, seconds, signed_percent
from hybrid_rt.analysis.work_precision import PictureStudy
from hybrid_rt.rendering.report import SHARE_OF_FEW
from hybrid_rt.rendering.versions import versions

Conditions = list[tuple[str, str]]
"""Names and values, as they stand in a page's first table."""
# Distances that fall more slowly with the number of triangles are those of too few hits.
LEAST_ORDER = 0.25


def machine() -> str:
    """Return the processor and how many of its cores there are."""
    name = platform.processor() or platform.machine()
    told = Path("/proc/cpuinfo")
    if told.is_file():
        lines = told.read_text("utf-8", errors="replace").splitlines()
        models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        name = models[0] if models else name
    return f"{name}, {os.cpu_count()} cores, {platform.system()}"


def picture_conditions(study: PictureStudy, full_size: tuple[int, int] | None) -> Conditions:
    """Return how pictures were measured, and against what."""
    width, height = study.size
    own = (
        ""
        if full_size in (None, study.size)
        else "; the scene's own camera has {} x {}".format(*(full_size or ()))
    )
    reference = study.reference
    took = "" if math.isnan(reference.seconds) else f", {seconds(reference.seconds)}"
    runs = (
        "one run of each, seed 1"
        if study.runs == 1
        else f"{study.runs} runs of each, seeds from 1 on"
    )
    return [
        ("pictures", f"{width} x {height} pixels{own}"),
        ("threads", str(study.threads)),
        ("passes", f"{_passes_in_words(study.curves)}; {runs}, all methods in turn"),
        ("reference", f"{reference.made_by}{took}; {off_itself(reference)}"),
        ("its check", _check_in_words(reference)),
        (
            "seconds",
            f"wall time; compiling kernels, {seconds(study.compile_seconds)}, is not counted",
        ),
    ]


def _passes_in_words(curves: Sequence[Curve]) -> str:
    settings = [[p.setting for p in curve.points] for curve in curves]
    if all(of == settings[0] for of in settings):
        return ", ".join(f"{n:g}" for n in settings[0])
    most = [of[-1] for of in settings]
    return (
        f"1, 4, 16 ... until a render took as long as asked: {min(most):g} of the slowest method, "
        f"{max(most):g} of the fastest"
    )


def _check_in_words(reference: Reference) -> str:
    check = reference.check
    if check is None:
        alone = "no other method here finds all light of the scene"
        return f"none: {'the reference was given' if reference.is_given else alone}"
    blur = check["by_blur"]
    blurred = f" and blur of photons {percent(blur)}" if blur else ""
    gap, half = check["gap"], check["gap_half_interval"]
    beyond = ", MORE than noise and blur explain" if abs(gap) > half else ""
    return (
        f"{check['made_by']}: mean differs by {number(gap, 2)} +- {number(half, 1)} (95 %){beyond}, "
        f"pictures by {percent(check['difference'])}, of which noise explains {percent(check['by_noise'])}{blurred}"
    )


def conditions(of_study: Conditions, scene: str) -> Conditions:
    """Return all conditions of a page."""
    numbers = versions()
    return [
        ("scene", scene),
        ("machine", machine()),
        *of_study,
        ("versions", ", ".join(f"{name} {number}" for name, number in numbers.items())),
    ]


def mesh_answer(study: PictureStudy, target: float, triangles: float) -> list[str]:
    """Say how fine a mesh must be for a target, if that is known."""
    if not study.meshes and any("--accuracy" in curve.flags for curve in study.curves):
        return [
            (
                "What triangles change was not measured, as the study was stopped before. So errors that stay are "
                "told from the bend of curves alone."
            )
        ]
    rows = [row for row in study.meshes if row["accuracy"] == "mesh"]
    if not rows or math.isnan(triangles):
        return []
    coarse, fine = rows[0], rows[-1]
    least = percent(fine["error"]) if fine["error"] else f"below {percent(fine['error_at_most'])}"
    return [
        (
            f"Triangles in place of the surfaces change the picture by {percent(coarse['error'])} "
            f"({coarse['triangles']:,.0f} triangles) to {least} ({fine['triangles']:,.0f}); for "
            f"{asked(target)} about {number(triangles, 2)} are needed."
        )
    ]


def bias_answers(study: PictureStudy) -> list[str]:
    """Say which methods miss light, by what they declare and by their mean brightness."""
    found = []
    for curve in study.curves:
        last = curve.points[-1].more
        if not curve.left_out or "--accuracy" in curve.flags:
            continue
        by_photons = (
            f"; of what it leaves out, photons find {percent(curve.unfound)} of the mean on surfaces seen directly"
            if curve.unfound
            else ""
        )
        off, noise = last["mean_error"], last.get("mean_error_noise", math.nan)
        mean = f"{signed_percent(off)} +- {percent(noise)} (95 %) off"
        if abs(off) <= noise:
            mean += ", which is within the noise"
        found.append(
            f"{curve.name} leaves out {without_examples(curve.left_out)}: after {curve.points[-1].setting:g} "
            f"passes its mean is {mean}{by_photons}."
        )
    return found


def dots_answers(study: PictureStudy, target: float) -> list[str]:
    """Say whose errors the worst pixels decide, unless these are left out."""
    if study.trimmed:
        return []
    shares = {}
    for curve in study.curves:
        last = curve.points[-1]
        share = (
            1.0 - (last.more["error_of_most"] / last.error.median) ** 2
            if last.error.median
            else 0.0
        )
        if "--accuracy" not in curve.flags and share > SHARE_OF_FEW:
            shares[curve.name] = percent(share)
    if not shares:
        return []
    listed = ", ".join(f"{share} of {name}" for name, share in shares.items())
    return [
        (
            "A few bright dots decide errors: the worst 0.1 % of the pixels hold this part of the squared error: "
            f"{listed}. So runs differ by a few dots, and curves rise where one comes. --target-trimmed "
            f"{target:g} leaves these pixels out of all errors."
        )
    ]


def time_answers(study: PictureStudy) -> list[str]:
    """Say of which methods more passes took less time, so that their times are not to be relied on."""
    busy = [curve.name for curve in study.curves if seconds_fall(curve)]
    if not busy:
        return []
    names = " and of ".join(busy)
    return [
        (
            f"More passes of {names} took less time: something else kept the machine busy. Seconds are "
            "evened out, and forecasts of them are rough: repeat it when nothing else runs, or with more --runs."
        )
    ]


def hit_answers(study: HitStudy) -> list[str]:
    """Summarise a hit study in sentences."""
    finest = {curve.name: min(curve.points, key=lambda p: p.setting) for curve in study.curves}
    cheapest = min(
        (p for c in study.curves if c.name.startswith("certified") for p in c.points),
        key=lambda p: p.seconds.median,
    )
    cost = f"Exact first hits cost {number(1e6 * cheapest.seconds.median, 2)} us a ray at best"
    if "mesh" not in finest:
        return [
            f"{cost}, at any accuracy: no surface here is free-form, so there is nothing to tessellate.",
            f"Right hits are off by {study.truth_bound / study.size:.0e} of the size at most, on average.",
        ]
    mesh = finest["mesh"]
    meshes = [p for c in study.curves if c.name == "mesh" for p in c.points]
    times = sorted(p.seconds.median for p in meshes)
    cost += (
        f", meshes {number(1e6 * times[0], 2)} to {number(1e6 * times[-1], 2)} us: exactness costs "
        f"{number(cheapest.seconds.median / times[-1], 2)} to "
        f"{number(cheapest.seconds.median / times[0], 2)} times a mesh."
    )
    share = (
        f"Of {study.judged:,} judged rays {percent(mesh.error.median)} meet the wrong thing first on a "
        f"mesh of {mesh.more['triangles']:,.0f} triangles, {percent(finest['refined'].error.median)} "
        f"after Newton's iteration, {percent(finest['certified'].error.median)} when certified. The truth "
        "are certified hits, found without triangles and without Embree."
    )
    lines = [cost, share]
    curve = next(c for c in study.curves if c.name == "mesh")
    a, b = sorted(curve.points, key=lambda p: p.more["triangles"])[-2:]
    if 0.0 < b.more["mean_dt"] < a.more["mean_dt"]:
        order = math.log(a.more["mean_dt"] / b.more["mean_dt"]) / math.log(
            b.more["triangles"] / a.more["triangles"]
        )
        if order >= LEAST_ORDER:
            exact = max(study.truth_bound, 1e-17 * study.size)
            needed = b.more["triangles"] * (b.more["mean_dt"] / exact) ** (1.0 / order)
            lines.append(
                f"Right hits on that mesh are off by {b.more['mean_dt'] / study.size:.1e} of the size on average, "
                f"falling as triangles^-{order:.2f}; to be as near as certified hits are "
                f"proven to be ({exact / study.size:.0e}) it would need about {needed:.0e} triangles."
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
        f"{percent(first.error.median)} of the rays before, {percent(last.error.median)} after. All "
        f"{last.setting:g} steps take a ray from {number(1e6 * first.seconds.least, 2)} to "
        f"{number(1e6 * last.seconds.least, 2)} us."
    )
