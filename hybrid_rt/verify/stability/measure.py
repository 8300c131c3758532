"""Compares traced hits with the oracle, exact crossings or closed forms; yields an `Outcome`.

Errors of t are in units of 64 eps x scale / cos. Closed forms replace cosines below `LEAST_COSINE`
by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.verify.cases.catalogue import CATALOGUE, MOST_PIECES
from hybrid_rt.verify.cases.singular_campaign import placed_surfaces, trace_cell
from hybrid_rt.verify.cases.singular_rays import size_of
from hybrid_rt.verify.exact.crossings import POINT, bits, norm, rational
from hybrid_rt.verify.exact.judge import BatchVerdict, ExactJudge
from hybrid_rt.verify.exact.truth import ExactScene, same_place
from hybrid_rt.verify.judges.judge import compare
from hybrid_rt.verify.judges.oracle import Truth, first_hits
from hybrid_rt.verify.stability.row import Curve, Effort, Outcome
from meshing import BezierPatches

EPS = 2.0**-52
BAND = 64 * EPS
# Flatter than the root of the band a crossing is a touch: rounding moves it by sqrt(band x size).
LEAST_COSINE = float(np.sqrt(2.0 * BAND))
# The columns of a hit record that two ways to the same answer must share bit by bit.
COLUMNS = (
    "t", "object_id", "patch_id", "u", "v", "position", "normal", "front_face", "status", "flags",
    "t_bound",
)  # fmt: skip
DISTANCES = tuple(10.0**-k for k in range(1, 15))
# A full run traces so many times the rays of a case of the catalogue.
MORE = 10.0
# A mark is looked at again with rays moved by so many bands, to so many sides.
MOVES, SIDES = (0.5, 1.0, 2.0, 4.0), 16


def differences(a: HitRecord, b: HitRecord, columns: Sequence[str] = COLUMNS) -> tuple[str, ...]:
    """Name the columns in which two records differ in any bit."""
    return tuple(
        name
        for name in columns
        if not np.array_equal(
            getattr(a, name), getattr(b, name), equal_nan=getattr(a, name).dtype.kind == "f"
        )
    )


def traced(
    surfaces: Sequence[Any],
    origins: FloatArray,
    directions: FloatArray,
    *,
    most_pieces: int = MOST_PIECES,
    may_give_up: bool = False,
    ways: Sequence[str] = ("none", "embree"),
) -> tuple[HitRecord, Outcome]:
    """Trace rays with both coarse stages, and check invariants of the hits.

    Both stages must give the same bits, no search may be given up (without ``may_give_up``), work
    is bounded, and normals are unit vectors.
    """
    records, outcome = [], Outcome()
    for coarse in ways:
        tracer = Intersector(surfaces, coarse=coarse)
        records.append(tracer.intersect(origins, directions))
        work, given_up = tracer.counters["most_pieces"], tracer.counters["given_up"]
        outcome = replace(outcome, work=max(outcome.work, work))
        outcome = outcome.checked(work <= most_pieces, f"{work} pieces for one search ({coarse})")
        words = f"{given_up} searches given up ({coarse})"
        if may_give_up:
            notes = (words,) if given_up else ()
            outcome = replace(outcome, notes=(*outcome.notes, *notes))
        else:
            outcome = outcome.checked(given_up == 0, words)
    hits = records[0]
    for other in records[1:]:
        names = differences(hits, other)
        outcome = outcome.checked(not names, f"coarse stages differ in {', '.join(names)}")
    normals = hits.normal[hits.hit]
    is_unit = (
        np.isfinite(normals).all()
        and (np.abs(np.linalg.norm(normals, axis=1) - 1.0) <= 1e-14).all()
    )
    outcome = outcome.checked(bool(is_unit), "a normal is no unit vector")
    undecided = int((hits.status == Status.TANGENT).sum())
    return hits, replace(outcome, rays=len(hits), undecided=undecided)


def by_oracle(
    surfaces: Sequence[Any], origins: FloatArray, directions: FloatArray, **options: Any
) -> Outcome:
    """Trace rays and judge them by the oracle; options are those of `traced`."""
    hits, outcome = traced(surfaces, origins, directions, **options)
    return outcome + judged(hits, first_hits(surfaces, origins, directions))


def judged(hits: HitRecord, truth: Truth) -> Outcome:
    """Return the outcome of hits by the oracle's truth; the rays are not counted again.

    A row that the oracle calls wrong is checked by exact crossings. TANGENT rows count as wrong if
    their answer is none of those that rounding leaves open.
    """
    verdict = compare(hits, truth)
    # The oracle is fast, not infallible beside joints: exact crossings confirm what it calls wrong.
    suspects = {kind: _confirmed(hits, truth, rows) for kind, rows in verdict.rows.items()}
    kinds = ", ".join(f"{kind}: rays {rows[:3]}" for kind, rows in suspects.items() if rows)
    outcome = Outcome(
        wrong=sum(map(len, suspects.values())), error=verdict.worst_band, broken=_broken(hits, truth),
        notes=(kinds,) if kinds else (),
    )  # fmt: skip
    return outcome.checked(
        verdict.worst_gap <= 1.0, f"a point lies {verdict.worst_gap:.3g} bands beside its ray"
    )


def _confirmed(hits: HitRecord, truth: Truth, rows: NDArray[np.int64]) -> list[int]:
    """Return those rows that are wrong by exact crossings as well."""
    found: list[int] = []
    judge = ExactJudge(truth.surfaces) if len(rows) else None
    for i in rows.tolist():
        assert judge is not None
        at = slice(i, i + 1)
        verdict = judge.judge(hits[at], truth.origins[at], truth.directions[at])
        if verdict.n_wrong or verdict.wrong_tangent:
            found.append(i)
    return found


def _broken(hits: HitRecord, truth: Truth) -> int:
    """Count |t - exact| above t_bound, by half an ulp of t more, where the root is the same."""
    same = truth.exact & ~truth.ambiguous & ~truth.undecided
    same &= (hits.object_id == truth.object_id) & (hits.patch_id == truth.patch_id) & hits.hit
    with np.errstate(invalid="ignore"):
        error = np.abs(hits.t - truth.t)
        slack = truth.band / (np.maximum(truth.cosine, LEAST_COSINE) * truth.length)
        close = same & (error <= slack)
    over: BoolArray = error[close] - 0.5 * np.spacing(hits.t[close]) > hits.t_bound[close]
    return int(over.sum())


def by_times(
    surfaces: Sequence[Any],
    origins: FloatArray,
    directions: FloatArray,
    t: FloatArray,
    *,
    most_error: float | None = None,
    **options: Any,
) -> Outcome:
    """Trace rays and compare with first hits in closed form, inf for a miss.

    Parameters
    ----------
    most_error : float, optional
        As in a `Case` of the catalogue.
    """
    hits, outcome = traced(surfaces, origins, directions, **options)
    largest = np.abs(directions).max(axis=1)  # squares of 1e300 overflow
    length = largest * np.linalg.norm(directions / largest[:, None], axis=1)
    sizes = np.array([size_of(surface) for surface in surfaces])
    middles = np.array([surface.middle for surface in surfaces])
    sure = hits.status != Status.TANGENT
    wrong = sure & (np.isfinite(t) != hits.hit)
    both = np.flatnonzero(sure & hits.hit & np.isfinite(t))
    number = hits.object_id[both]
    away = np.linalg.norm(origins[both] - middles[number], axis=1)
    scale = np.maximum(away, sizes[number])
    unit = directions[both] / length[both, None]
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal[both], unit))
    error = np.abs(hits.t[both] - t[both]) * length[both]
    allowed = BAND * scale / np.maximum(cosine, LEAST_COSINE)
    if most_error is not None:
        way = np.maximum(t[both] * length[both], 1.0)
        allowed = np.minimum(allowed, most_error * way / np.maximum(cosine, LEAST_COSINE))
    # t in closed form is rounded: half an ulp is not the tracer's.
    over = np.abs(hits.t[both] - t[both]) - np.spacing(np.abs(t[both])) > hits.t_bound[both]
    return outcome + Outcome(
        wrong=int(wrong.sum()), error=float((error / allowed).max(initial=0.0)),
        broken=int(over.sum()),
    )  # fmt: skip


def catalogue(case_id: str, effort: Effort) -> Outcome:
    """Run the cases of the catalogue with an id: by given distances, or by the oracle."""
    total = Outcome()
    cases = [case for case in CATALOGUE if case.id == case_id]
    if not cases:
        raise ValueError(f"{case_id}: no case of the catalogue")
    for case in cases:
        surfaces = case.surfaces()
        origins, directions = case.rays(surfaces, MORE * effort.factor, effort.seed)
        if case.t is None:
            found = by_oracle(surfaces, origins, directions, most_pieces=case.most_pieces)
        else:
            found = by_times(
                surfaces, origins, directions, case.t(origins, directions),
                most_error=case.most_error, most_pieces=case.most_pieces,
            )  # fmt: skip
            undecided = found.undecided
            found = found.checked(
                undecided < 0.2 * found.rays, f"{case.name}: {undecided} rays are undecided"
            )
        total = total + found
    return total


def verdict_outcome(verdict: BatchVerdict, marks: bool = True) -> Outcome:
    """Return the outcome of a verdict by exact crossings.

    Parameters
    ----------
    marks : bool
        Whether TANGENT is a fault if no moved ray has another first hit. Features thinner than the
        spacing of the moved rays escape that test.
    """
    outcome = Outcome(
        rays=verdict.rays, wrong=verdict.n_wrong, error=verdict.worst_error / 64.0,
        broken=verdict.bounds_broken, undecided=verdict.tangent,
    )  # fmt: skip
    needless = verdict.tangent_needlessly
    for number, words in (
        (verdict.off_ray, "points beside the ray by more than the band"),
        (verdict.unmarked, "decisions within rounding without the mark TANGENT"),
        (needless * marks, "marks TANGENT without need"),
    ):
        outcome = outcome.checked(number == 0, f"{number} {words}")
    for number, words in (
        (needless * (not marks), "marks TANGENT of which no ray around says why"),
        (verdict.wrong_tangent, "rows TANGENT with another first hit than any right one"),
        (verdict.left_open, "rays left open by the oracle"),
    ):
        if number:
            outcome = replace(outcome, notes=(*outcome.notes, f"{number} {words}"))
    return outcome


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
            away = (
                np.concatenate(
                    [
                        net[:: len(net) - 1, :: len(net[0]) - 1].reshape(-1, 3)
                        for net in surface.patches
                    ]
                )
                - o
            )
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


@dataclass
class Plot:
    """A curve under construction.

    Attributes
    ----------
    against, label, unit : str
        As in `Curve`.
    """

    against: str
    label: str
    unit: str = "size"
    x: list[float] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    expected: list[float] = field(default_factory=list)
    work: list[float] = field(default_factory=list)

    def add(self, x: float, error: FloatArray, expected: FloatArray, work: float = 0.0) -> Outcome:
        """Add a point: the largest of some errors, and what is expected of that one."""
        if len(error):
            k = int(np.argmax(error))
            self.x.append(float(x))
            self.error.append(float(error[k]))
            self.expected.append(float(expected[k]))
            self.work.append(float(work))
        return Outcome(error=float((error / expected).max(initial=0.0)))

    @property
    def curve(self) -> Curve:
        """The curve as it is now."""
        work = self.work if any(self.work) else []
        return Curve(
            self.against, self.label, list(self.x), list(self.error), list(self.expected),
            list(work), self.unit,
        )  # fmt: skip


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
    least: int = 2,
    marks: bool = True,
    from_afar: bool = False,
) -> Outcome:
    """Judge rays of a singular set by exact crossings at several distances; adds a curve.

    Parameters
    ----------
    name : str, one of `SETS`
    rays : int
        At each distance, in a full run.
    against : str
        What the distance is.
    marks : bool
        As in `verdict_outcome`.
    from_afar : bool
        Whether all rays begin at least a third of the size away.
    """
    surfaces = placed_surfaces(name, placement)
    size = size_of(surfaces[0])
    tracer, judge = Intersector(surfaces, coarse="none", threads=1), ExactJudge(surfaces)
    plot, total = Plot(against, name), Outcome()
    for distance in distances:
        tracer.counters["most_pieces"] = tracer.counters["given_up"] = 0
        n = effort.count(rays, least)
        cell = trace_cell(tracer, name, distance, placement, n, effort.seed)
        if from_afar:
            back = size * effort.rng().uniform(0.3, 3.0, (n, 1))
            origins = cell.origins - back * cell.directions
            cell = replace(cell, origins=origins, hits=tracer.intersect(origins, cell.directions))
        leaves = None if cell.source is None else cell.source.object_id
        verdict = exact_verdict(
            judge, cell.hits, cell.origins, cell.directions, cell.distance, leaves
        )
        work = tracer.counters["most_pieces"]
        found = replace(verdict_outcome(verdict, marks), work=work)
        if tracer.counters["given_up"]:
            words = f"{tracer.counters['given_up']} searches given up at {distance:.0e}"
            found = replace(found, notes=(*found.notes, words))
        if not found.holds:
            seen = {fault: rows[:2] for fault, rows in verdict.examples.items()}
            where = f"{name}, {distance:.0e}, {placement}, {n} rays, seed {effort.seed}: {seen}"
            found = replace(found, notes=(*found.notes, where))
        total = total + found
        if cell.source is None:
            error, expected = exact_errors(judge.scene, cell.hits, cell.origins, cell.directions)
            total = total + plot.add(distance, error / size, expected / size, work)
    return replace(total, curves=(plot.curve,)) if plot.x else total
