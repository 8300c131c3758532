"""Compares traced hits with exact arithmetic or closed forms; yields an `Outcome`.

Errors of t are in units of 64 eps x scale / cos. Closed forms replace cosines below `LEAST_COSINE`
by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, Status
from hybrid_rt.intersection import Intersector
from proof.cases.catalogue import MOST_PIECES
from proof.cases.singular_rays import size_of
from proof.exact.judge import BatchVerdict
from proof.judge import Judge
from proof.stability.row import Outcome

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
# Of the rays of a row, this share may be left open by exact arithmetic, or be wrong and say TANGENT.
MOST_OPEN = 0.1


def differences(a: HitRecord, b: HitRecord, columns: Sequence[str] = COLUMNS) -> tuple[str, ...]:
    """Name the columns in which two records differ in any bit."""
    return tuple(
        name
        for name in columns
        if not np.array_equal(
            getattr(a, name), getattr(b, name), equal_nan=getattr(a, name).dtype.kind == "f"
        )
    )


def apart(
    surface: Any, a: HitRecord, b: HitRecord, origins: FloatArray, directions: FloatArray
) -> BoolArray:
    """Tell which rows, TANGENT in neither record, have not the same first hit on one surface.

    Two right answers differ by the sum of their allowed errors at most, 64 eps x scale / cos each.
    """
    sure = (a.status != Status.TANGENT) & (b.status != Status.TANGENT)
    length = np.linalg.norm(directions, axis=1)
    scale = np.maximum(np.linalg.norm(origins - surface.middle, axis=1), size_of(surface))
    cosines = [np.abs(np.einsum("ij,ij->i", h.normal, directions)) / length for h in (a, b)]
    allowed = sum(BAND * scale / np.maximum(cosine, LEAST_COSINE) for cosine in cosines)
    both = a.hit & b.hit
    with np.errstate(invalid="ignore"):
        far = np.abs(a.t - b.t) * length > allowed
    found: BoolArray = sure & ((a.hit != b.hit) | (both & far))
    return found


WAYS = ("none", "embree")


def both_tracers(surfaces: Sequence[Any]) -> list[Intersector]:
    """Return a tracer without a coarse stage and one with Embree, for several calls of `traced`."""
    return [Intersector(surfaces, coarse=coarse) for coarse in WAYS]


def traced(
    surfaces: Sequence[Any],
    origins: FloatArray,
    directions: FloatArray,
    *,
    most_pieces: int = MOST_PIECES,
    may_give_up: bool = False,
    ways: Sequence[str] = WAYS,
    tracers: Sequence[Intersector] | None = None,
) -> tuple[HitRecord, Outcome]:
    """Trace rays with both coarse stages, and check invariants of the hits.

    Both stages must give the same bits, no search may be given up (without ``may_give_up``), work
    is bounded, and normals are unit vectors.

    ``tracers``: one for each of ``ways``, made for these surfaces before; their counts of pieces begin
    anew.
    """
    records, outcome = [], Outcome()
    for k, coarse in enumerate(ways):
        tracer = Intersector(surfaces, coarse=coarse) if tracers is None else tracers[k]
        tracer.forget_counters()
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


def by_judges(
    surfaces: Sequence[Any], origins: FloatArray, directions: FloatArray, **options: Any
) -> Outcome:
    """Trace rays and judge them; options are those of `traced`."""
    hits, outcome = traced(surfaces, origins, directions, **options)
    return outcome + judged(surfaces, hits, origins, directions)


def judged(
    surfaces: Sequence[Any], hits: HitRecord, origins: FloatArray, directions: FloatArray
) -> Outcome:
    """Return the outcome of hits by screen and exact arithmetic; the rays are not counted again.

    No decision of rows that say TANGENT is guaranteed; but most of them must be right.
    """
    verdict = Judge(surfaces).judge(hits, origins, directions)
    outcome = replace(verdict_outcome(verdict), rays=0, undecided=0)
    if verdict.examples:
        outcome = replace(outcome, notes=(*outcome.notes, f"rays {verdict.examples}"))
    outcome = outcome.checked(
        verdict.wrong_tangent <= MOST_OPEN * verdict.tangent,
        f"{verdict.wrong_tangent} of {verdict.tangent} rows TANGENT are wrong",
    )
    return outcome.checked(
        verdict.left_open <= verdict.tangent + MOST_OPEN * len(hits),
        f"{verdict.left_open} of {len(hits)} rays are left open",
    )


def verdict_outcome(verdict: BatchVerdict, marks: bool = True) -> Outcome:
    """Return the outcome of a verdict by exact crossings.

    ``marks``: whether TANGENT counts as needless if no moved ray has another first hit. Features thinner
    than the spacing of the moved rays escape that test.
    """
    outcome = Outcome(
        rays=verdict.rays, wrong=verdict.n_wrong, error=verdict.worst_error / 64.0,
        broken=verdict.bounds_broken, undecided=verdict.tangent,
        needless=verdict.tangent_needlessly * marks,
    )  # fmt: skip
    for number, words in (
        (verdict.off_ray, "points beside the ray by more than the band"),
        (verdict.off_ray_tangent, "points of rows TANGENT farther from the ray than is guaranteed"),
        (verdict.unmarked, "decisions within rounding without the mark TANGENT"),
    ):
        outcome = outcome.checked(number == 0, f"{number} {words}")
    for number, words in (
        (verdict.tangent_needlessly, "marks TANGENT without need, as far as rays around tell"),
        (verdict.wrong_tangent, "rows TANGENT with another first hit than any right one"),
        (verdict.left_open, "rays left open by exact arithmetic"),
    ):
        if number:
            outcome = replace(outcome, notes=(*outcome.notes, f"{number} {words}"))
    return outcome


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

    ``most_error``: as in a `Case` of the catalogue.
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
