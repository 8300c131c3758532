"""What holds hits against truths notices hits that are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere
from hybrid_rt.core.records import Status
from proof.cases.catalogue import cone, saddle, square
from proof.cases.rays import chords
from proof.exact.judge import BatchVerdict, ExactJudge
from proof.filters.screen import Screen
from proof.stability.measure import (
    apart,
    by_times,
    differences,
    judged,
    traced,
    verdict_outcome,
)
from proof.stability.measure_exact import (
    by_set,
    exact_errors,
    exact_verdict,
)
from proof.stability.row import Effort, Outcome, Plot

UP = np.array([[0.25, 0.5, -3.0], [0.5, 0.25, -2.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))


@pytest.fixture(scope="module", params=["saddle", "sphere"])
def hits(request):
    surfaces = [saddle()] if request.param == "saddle" else [Sphere((0.1, 0, 0), 0.9)]
    rays = chords(surfaces, 16, seed=3)
    found, outcome = traced(surfaces, rays.origins, rays.directions)
    assert outcome.holds
    assert found.hit.any()
    assert (found.status != Status.TANGENT).all()
    return surfaces, rays.origins, rays.directions, found


def spoiled(hits):
    """Hits lost, moved within the band but beyond their bound, and moved far away."""
    some = hits.hit
    ids = np.where(some, -1, hits.object_id).astype(np.int32)
    lost = replace(
        hits, t=np.full(len(hits), np.inf), object_id=ids, status=np.zeros_like(hits.status)
    )
    beside = replace(hits, t_bound=np.full(len(hits), 1e-30), t=hits.t * (1.0 + 4e-15))
    far = replace(hits, t=hits.t * 1.001)
    return {"lost": lost, "beside": beside, "far": far}


@pytest.mark.parametrize("kind", ["lost", "beside", "far"])
def test_the_judges_notice(hits, kind):
    surfaces, o, d, found = hits
    assert judged(surfaces, found, o, d).holds
    outcome = judged(surfaces, spoiled(found)[kind], o, d)
    assert not outcome.holds
    assert (outcome.broken if kind == "beside" else outcome.wrong) > 0
    assert "rays {" in outcome.notes[-1]


def test_rows_that_nobody_decides_fail(hits, monkeypatch):
    surfaces, o, d, found = hits
    monkeypatch.setattr(Screen, "confirmed", lambda *_: np.zeros(len(o), np.bool_))
    monkeypatch.setattr(ExactJudge, "judge", lambda *_, **__: BatchVerdict(left_open=len(o)))
    assert judged(surfaces, found, o, d).faults == (f"{len(o)} of {len(o)} rays are left open",)


def test_second_hits_are_not_first_ones():
    """Two answers of one surface are told apart by t, not only by whether they are hits."""
    ball = Sphere((0, 0, 0), 1)
    o, d = np.array([[0.3, 0.2, -5.0], [2.0, 0, -5.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    tracer = Intersector([ball], coarse="none")
    first, second = tracer.intersect(o, d), tracer.intersect(o, d, t_min=5.0)
    assert second.hit.tolist() == [True, False]
    assert apart(ball, first, second, o, d).tolist() == [True, False]
    assert not apart(ball, first, tracer.intersect(o, 3.0 * d), o, d)[1]
    assert not apart(ball, first, first, o, d).any()
    assert apart(ball, first, tracer.intersect(o, -d), o, d).tolist() == [True, False]


@pytest.mark.parametrize(
    ("errors", "holds"),
    [((None, None), True), ((0.5, None), True), ((0.5, 1.5), False), ((0.5, np.nan), False)],
)
def test_an_error_that_is_no_number_is_too_large(errors, holds):
    assert sum((Outcome(error=error) for error in errors), Outcome()).holds == holds


@pytest.mark.parametrize("error", [[0.0, 5.0], [np.nan, 0.5]])
def test_errors_where_none_is_expected_are_too_large(error):
    assert not Plot("angle", "cone").add(1.0, np.array(error), np.array([0.0, 1.0])).holds
    assert Plot("angle", "cone").add(1.0, np.array([0.0, 0.5]), np.array([0.0, 1.0])).holds


def test_given_times_are_held_against_hits():
    assert by_times([square()], *UP, np.array([3.0, 2.0])).holds
    assert by_times([square()], *UP, np.array([3.0, np.inf])).wrong == 1
    assert by_times([square()], *UP, np.array([3.0, 2.0 + 1e-12])).error > 1.0
    found = by_times([square()], *UP, np.array([3.0, 2.0 + 1e-12]))
    assert found.broken == 1


def test_needless_marks_and_missing_ones_are_noticed():
    surfaces = [Sphere((0, 0, 0), 1)]
    o, d = np.array([[0.5, 0, -5.0], [1.0, 0, -5.0]]), np.tile([0.0, 0.0, 1.0], (2, 1))
    hits, judge = Intersector(surfaces).intersect(o, d), ExactJudge(surfaces)
    assert hits.status.tolist() == [Status.HIT, Status.TANGENT]
    assert verdict_outcome(exact_verdict(judge, hits, o, d)).holds
    turned = replace(hits, status=hits.status[::-1].copy())
    verdict = exact_verdict(judge, turned, o, d)
    assert (verdict.tangent_needlessly, verdict.unmarked) == (1, 1)
    outcome = verdict_outcome(verdict)
    assert outcome.needless == 1
    assert "without the mark" in outcome.faults[0]
    assert verdict_outcome(verdict, marks=False).needless == 0
    assert Outcome(rays=1000, needless=2).holds
    assert not Outcome(rays=900, needless=2).holds


def test_far_away_the_last_place_of_t_is_no_other_hit():
    """At 1e3 sizes an ulp of t is more than the shift by which marks are judged."""
    surfaces = [Sphere((0, 0, 0), 1)]
    rng = np.random.default_rng(5)
    o = 1e3 * np.array([[0.6, 0.0, -0.8]]) + 0.1 * rng.normal(size=(20, 3))
    d = np.tile([-0.6, 0.0, 0.8], (20, 1)) + 1e-4 * rng.normal(size=(20, 3))
    hits = Intersector(surfaces).intersect(o, d)
    assert hits.hit.sum() > 10
    assert ExactJudge(surfaces).judge(hits, o, d).unmarked == 0


def test_errors_stand_beside_what_is_expected():
    surface = cone()
    rays = chords([surface], 30, seed=2)
    hits = Intersector([surface]).intersect(rays.origins, rays.directions)
    judge = ExactJudge([surface])
    error, expected = exact_errors(judge.scene, hits, rays.origins, rays.directions)
    assert len(error) == len(expected) == (hits.status == Status.HIT).sum()
    assert (error < expected).all()
    plot = Plot("angle", "cone")
    assert plot.add(0.5, error, expected, 7).error == (error / expected).max()
    assert (plot.x, plot.error, plot.work) == ([0.5], [error.max()], [7.0])
    assert plot.expected == [expected[error.argmax()]]
    assert not Plot("angle", "nothing").add(1.0, error[:0], expected[:0]).rays
    found = by_set("spindle", Effort(1.0), 3, against="distance", distances=(1e-2, 1e-6))
    assert found.holds
    assert found.rays == 6
    assert len(found.curves) == 1


def test_columns_that_differ_are_named():
    hits = Intersector([square()]).intersect(*UP)
    assert differences(hits, hits) == ()
    assert differences(hits, replace(hits, t=hits.t + 1e-15)) == ("t",)
    assert Outcome().holds
