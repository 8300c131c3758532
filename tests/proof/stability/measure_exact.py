"""Compares traced hits with exact crossings; yields an `Outcome`, with errors of t in units of the band."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, Status
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.campaign import placed_surfaces, trace_cell
from proof.cases.catalogue import CATALOGUE, MOST_PIECES
from proof.cases.singular_rays import size_of
from proof.exact.crossings import POINT, bits, norm, rational
from proof.exact.judge import BatchVerdict, ExactJudge
from proof.exact.truth import ExactScene, same_place
from proof.stability.measure import DISTANCES, apart, by_judges, by_times, traced, verdict_outcome
from proof.stability.row import Effort, Outcome, Plot

# A full run traces so many times the rays of a case of the catalogue.
MORE = 10.0
# A mark is looked at again with rays moved by so many bands, to so many sides.
MOVES, SIDES = (0.5, 1.0, 2.0, 4.0), 16
DEGREES = (1, 2, 3, 5, 8, 12, 17, 23, 30)


def exact_verdict(
    judge: ExactJudge,
    hits: HitRecord,
    origins: FloatArray,
    directions: FloatArray,
    near: float = 0.0,
    leaves: IntArray | None = None,
) -> BatchVerdict:
    """Judge hits by exact crossings, and check doubtful TANGENT verdicts a second time.

    The judge moves a ray in eight directions by one length. TANGENT is needless only if none of the
    rays of `MOVES` has another first hit either, and no corner of a patch lies within four bands of
    the ray: seen edge-on it is a needle that moved rays miss. TANGENT is missing only if no surface lies within
    the band of the origin: there t > 0 itself is decided by rounding, and no mark is promised.
    """
    total = BatchVerdict()
    for i in range(len(hits)):
        row, o, d = hits[i : i + 1], origins[i : i + 1], directions[i : i + 1]
        left = None if leaves is None else leaves[i : i + 1]
        one = judge.judge(row, o, d, distance=np.array([near]), leaves=left)
        if one.tangent_needlessly and (
            _passes_a_corner(judge.scene, o[0], d[0]) or _is_decided_nearby(judge.scene, o[0], d[0])
        ):
            one.tangent_needlessly, one.examples = 0, {}
        if one.unmarked and _begins_within_the_band(judge.scene, o[0], d[0]):
            one.unmarked, one.examples = 0, {}
        one.examples = {fault: [i] for fault in one.examples}
        total = total + one
    return total


def _passes_a_corner(scene: ExactScene, o: FloatArray, d: FloatArray) -> bool:
    """Tell whether the ray passes a corner of a Bezier patch within four bands."""
    along = d / norm(d)
    for k, surface in enumerate(scene.surfaces):
        if isinstance(surface, BezierPatches):
            ends = [net[:: len(net) - 1, :: len(net[0]) - 1] for net in surface.patches]
            away = np.concatenate([corners.reshape(-1, 3) for corners in ends]) - o
            beside = away - np.outer(away @ along, along)
            if (np.linalg.norm(beside, axis=1) <= 4.0 * scene.band(k, o, d, 0.0)).any():
                return True
    return False


def _is_decided_nearby(scene: ExactScene, o: FloatArray, d: FloatArray) -> bool:
    """Tell whether some ray moved by up to four bands has another first hit."""
    length, band = norm(d), max(scene.band(k, o, d, 0.0) for k in range(len(scene.surfaces)))
    first = next((one for one in scene.crossings(o, d) if one.t > 0.0), None)
    p, q = (np.array(x) / (1.3 * band) for x in scene.shifts(d, 1.3 * band)[:3:2])
    for bands in MOVES:
        for turn in np.arange(SIDES) * (2.0 * np.pi / SIDES):
            shift = bands * band * (np.cos(turn) * p + np.sin(turn) * q)
            other = next((x for x in scene.crossings(o, d, shift.tolist()) if x.t > 0.0), None)
            if (first is None) != (other is None):
                return True
            if first is not None and other is not None:
                same = first.object_id == other.object_id
                if not (same and same_place(first, other, bands * band, length)):
                    return True
    return False


def _begins_within_the_band(scene: ExactScene, o: FloatArray, d: FloatArray) -> bool:
    """Tell whether the ray, or one around it, meets a surface within a band of its origin."""
    length = norm(d)
    found = [one for ring in scene.around(o, d, 1.0) for one in ring]
    return any(abs(one.t) * length * one.cosine <= one.band for one in found)


def by_exact(
    surfaces: Sequence[Any], origins: FloatArray, directions: FloatArray, **options: Any
) -> Outcome:
    """Trace rays and judge them by exact crossings; options are those of `traced`."""
    hits, outcome = traced(surfaces, origins, directions, **options)
    verdict = exact_verdict(ExactJudge(surfaces), hits, origins, directions)
    found = replace(verdict_outcome(verdict), rays=0, undecided=0)
    if not found.holds:
        found = replace(found, notes=(*found.notes, f"rays {verdict.examples}"))
    return outcome + found


def plotted(
    plot: Plot,
    x: float,
    surface: Any,
    origins: FloatArray,
    directions: FloatArray,
    unit: float | None = None,
    **options: Any,
) -> Outcome:
    """Judge rays on one surface by exact crossings, and add a point to a curve.

    ``unit``: of errors; default: the surface's size.
    """
    found = by_exact([surface], origins, directions, **options)
    hits = Intersector([surface], coarse="none").intersect(origins, directions)
    error, expected = exact_errors(ExactScene([surface]), hits, origins, directions)
    unit = unit or size_of(surface)
    return found + plot.add(x, error / unit, expected / unit, found.work)


def by_degrees(
    label: str, own: int, raised: Callable[[int], Any], origins: FloatArray, directions: FloatArray
) -> Outcome:
    """Compare a surface of a degree of its own, raised up to 30, with exact crossings from before.

    ``raised``: makes it with so many degrees more.
    """
    low, plot, total = raised(0), Plot("degree", f"{label}, degree raised"), Outcome()
    scene, size = ExactScene([low]), size_of(low)
    before = Intersector([low], coarse="none").intersect(origins, directions)
    for degree in (k for k in DEGREES if k >= own):
        tracer = Intersector([raised(degree - own)], coarse="none")
        hits = tracer.intersect(origins, directions)
        work = tracer.counters["most_pieces"]
        total += Outcome(
            rays=len(hits), wrong=int(apart(low, before, hits, origins, directions).sum()),
            work=work, undecided=int((hits.status == Status.TANGENT).sum()),
        )  # fmt: skip
        error, expected = exact_errors(scene, hits, origins, directions)
        total += plot.add(degree, error / size, expected / size, work)
    return replace(total, curves=(plot,))


def exact_errors(
    scene: ExactScene, hits: HitRecord, origins: FloatArray, directions: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return |t - exact t| |d| of HIT rows, and 64 eps x scale / cos; both in scene units."""
    errors, expected = [], []
    for i in np.flatnonzero(hits.status == Status.HIT):
        t, length = float(hits.t[i]), norm(directions[i])
        own = [
            one
            for one in scene.crossings(origins[i], directions[i])
            if one.object_id == hits.object_id[i] and one.crossing.kind == POINT
        ]
        if not own:
            continue
        with bits(512):
            gaps = [(float(abs(one.crossing.t - rational(t)).upper()), one) for one in own]
        gap, one = min(gaps, key=lambda pair: pair[0])
        errors.append(gap * length)
        expected.append(one.band / one.cosine)
    return np.array(errors), np.array(expected)


def by_set(
    name: str,
    effort: Effort,
    rays: int,
    *,
    against: str,
    distances: Sequence[float] = DISTANCES,
    placement: str = "home",
    marks: bool = True,
    from_afar: bool = False,
) -> Outcome:
    """Judge rays of a singular set by exact crossings at several distances; adds a curve.

    ``rays``: at each distance, in a full run.
    ``against``: what the distance is.
    ``marks``: as in `verdict_outcome`.
    ``from_afar``: whether all rays begin at least a third of the size away.
    """
    surfaces = placed_surfaces(name, placement)
    size = size_of(surfaces[0])
    tracer, judge = Intersector(surfaces, coarse="none", threads=1), ExactJudge(surfaces)
    plot, total = Plot(against, name), Outcome()
    for distance in distances:
        tracer.counters["most_pieces"] = tracer.counters["given_up"] = 0
        n = effort.count(rays)
        cell = trace_cell(tracer, name, distance, placement, n, effort.seed)
        if from_afar:
            back = size * effort.rng().uniform(0.3, 3.0, (n, 1))
            origins = cell.origins - back * cell.directions
            hits = tracer.intersect(origins, cell.directions)
            cell = cell._replace(origins=origins, hits=hits)
        verdict = exact_verdict(
            judge, cell.hits, cell.origins, cell.directions, cell.near, cell.leaves
        )
        work = tracer.counters["most_pieces"]
        found = replace(verdict_outcome(verdict, marks), work=work)
        found = found.checked(
            work <= MOST_PIECES, f"{work} pieces for one search at {distance:.0e}"
        )
        if tracer.counters["given_up"]:
            words = f"{tracer.counters['given_up']} searches given up at {distance:.0e}"
            found = replace(found, notes=(*found.notes, words))
        if not found.holds or found.needless:
            seen = {fault: rows[:2] for fault, rows in verdict.examples.items()}
            where = f"{name}, {distance:.0e}, {placement}, {n} rays, seed {effort.seed}: {seen}"
            found = replace(found, notes=(*found.notes, where))
        total = total + found
        if cell.source is None:
            error, expected = exact_errors(judge.scene, cell.hits, cell.origins, cell.directions)
            total = total + plot.add(distance, error / size, expected / size, work)
    return replace(total, curves=(plot,)) if plot.x else total


def catalogue(case_id: str, effort: Effort) -> Outcome:
    """Run the cases of the catalogue with an id: by given distances, or by the judges."""
    total = Outcome()
    cases = [case for case in CATALOGUE if case.id == case_id]
    if not cases:
        raise ValueError(f"{case_id}: no case of the catalogue")
    for case in cases:
        surfaces = case.surfaces()
        options: dict[str, Any] = {"most_pieces": case.most_pieces}
        rays = case.rays(surfaces, MORE * effort.factor, effort.seed)
        if case.t is None:
            total += (by_exact if case.has_marks else by_judges)(surfaces, *rays, **options)
            continue
        found = by_times(surfaces, *rays, case.t(*rays), most_error=case.most_error, **options)
        words = f"{case.name}: {found.undecided} rays are undecided"
        total += found.checked(found.undecided < 0.2 * found.rays, words)
    return total
