"""All judges on records of hits that no ray has: behind it, beyond its limits, outside the surface."""

import dataclasses

import numpy as np
import pytest

from hybrid_rt import Intersector, Rectangle, Sphere, TriangleMesh
from hybrid_rt.core.records import Status
from hybrid_rt.demo import teapot
from hybrid_rt.primitives.asphere import Asphere
from meshing import BezierPatches, Cylinder
from meshing.sheet import PatchSheet
from proof.cases.filtered_campaign import SINGULAR, Checker, Group
from proof.cases.singular_sets import SETS
from proof.cases.singular_surfaces import lid
from proof.exact.judge import ExactJudge
from proof.exact.truth import ExactScene, exact_hits
from proof.judges.judge import compare
from proof.judges.oracle import first_hits

DOWN = np.array([(0.0, 0.0, -1.0)])
SQUARE = [[(0, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0)]]


def traced(surface, origin, direction=DOWN, **limits):
    tracer = Intersector([surface], coarse="none", threads=1)
    return tracer.intersect(np.array([origin], float), np.array(direction, float), **limits)


def changed(hits, **columns):
    """Give the only row of a record other values."""
    return dataclasses.replace(
        hits,
        **{k: np.array([x], getattr(hits, k).dtype) for k, x in columns.items()},
    )


def faults_of(surface, hits, origin, direction=DOWN):
    """Return wrong rows by the fast oracle and by exact arithmetic, and faults of a campaign."""
    rays = np.array([origin], float), np.array(direction, float)
    group = Group("x", "closed", SINGULAR, 1)
    Checker([surface]).check(group, "batch", hits, *rays, None)
    return (
        compare(hits, first_hits([surface], *rays, threads=1)).n_wrong,
        ExactJudge([surface]).judge(hits, *rays).n_wrong,
        group.count.faults,
    )


def triangle():
    import trimesh

    return TriangleMesh(
        trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)], process=False)
    )


def sheet():
    """Two bilinear patches side by side, each with half of u."""
    nets = [np.array(SQUARE, float) * (0.5, 1, 1) + (x, 0, 0) for x in (0.0, 0.5)]
    return PatchSheet(BezierPatches(nets), [(0, 0.5, 0, 1), (0.5, 1, 0, 1)])


BALL = Sphere((0, 0, 0), 1)


@pytest.mark.parametrize("origin", [(0, 0, 0), (0, 0, 3)])
@pytest.mark.parametrize("status", [Status.HIT, Status.TANGENT])
def test_hits_behind_the_ray_are_wrong(origin, status):
    # From the centre the ray has a hit ahead; from above, upwards, none.
    there = traced(BALL, origin)
    back = changed(there, t=-there.t[0], status=status)
    fast, exact, faults = faults_of(BALL, back, origin, -DOWN)
    assert fast == 1
    assert exact == faults == (status == Status.HIT)
    assert faults_of(BALL, there, origin) == (0, 0, 0)


@pytest.mark.parametrize(
    ("surface", "inside", "outside", "u", "v"),
    [
        (Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), (0.5, 0.5, 2), (1.5, 0.5, 2), 1.5, 0.5),
        (BezierPatches([SQUARE]), (0.5, 0.5, 2), (0.5, -0.25, 2), 0.5, -0.25),
        (triangle(), (0.25, 0.25, 2), (0.75, 0.75, 2), 0.75, 0.75),
        (triangle(), (0.25, 0.25, 2), (0.5, -0.25, 2), 0.5, -0.25),
        (sheet(), (0.25, 0.5, 2), (-0.25, 0.5, 2), -0.25, 0.5),
        (Asphere(4.0, -0.7, [], 2.0, (0, 0, 0), (0, 0, 1)), (0.5, 0, 2), (1.5, 0, 2), 0.0, 1.5),
    ],
)  # fmt: skip
def test_hits_beyond_the_border_are_wrong(surface, inside, outside, u, v):
    hits = traced(surface, inside)
    assert faults_of(surface, hits, inside) == (0, 0, 0)
    t = hits.t[0]
    if isinstance(surface, Asphere):
        t = 2.0 - float(surface.sag.at(np.array([2.25]))[0][0])
    claimed = changed(hits, t=t, u=u, v=v, status=Status.HIT)
    fast, exact, faults = faults_of(surface, claimed, outside)
    assert fast == exact == 1
    assert faults >= 1


def test_hits_beyond_the_part_of_a_turn_are_wrong():
    half = Cylinder((0, 0, -1), (0, 0, 1), 1.0, 2.0, reference=(1, 0, 0), u_range=(0, 0.5))
    origin, to = (0, -3, 0.25), np.array([(0.0, 1.0, 0.0)])
    hits = traced(half, origin, to)
    assert (hits.t[0], hits.u[0]) == (4.0, 0.5)
    claimed = changed(hits, t=2.0, u=1.5)
    assert faults_of(half, hits, origin, to) == (0, 0, 0)
    fast, exact, faults = faults_of(half, claimed, origin, to)
    assert fast == exact == 1
    assert faults >= 1


@pytest.mark.parametrize("limits", [{"t_max": 1.0}, {"t_min": 3.5}])
def test_hits_beyond_the_limits_of_t_are_wrong(limits):
    hits = traced(BALL, (0, 0, 3))
    rays = np.array([(0.0, 0.0, 3.0)]), DOWN
    for truth in (
        first_hits([BALL], *rays, **limits, threads=1),
        exact_hits(ExactScene([BALL]), *rays, **limits),
    ):
        assert compare(hits, truth).n_wrong == 1
        assert compare(traced(BALL, (0, 0, 3), **limits), truth).n_wrong == 0


@pytest.mark.parametrize("t", [0.0, 1e-17, 1e-15])
def test_a_departure_met_again_is_wrong(t):
    source = traced(BALL, (0, 0, 3))
    rays = source.position, np.array([(0.6, 0.0, 0.8)])
    again = dataclasses.replace(source, t=np.array([t]))
    truth = first_hits([BALL], *rays, departing=True, threads=1)
    assert compare(again, truth).wrong["phantom"] == 1
    truth = exact_hits(ExactScene([BALL]), *rays, leaves=source.object_id)
    assert compare(again, truth).wrong["phantom"] == 1
    verdict = ExactJudge([BALL]).judge(again, *rays, leaves=source.object_id)
    assert verdict.wrong["departure"] == 1


def test_a_departure_with_tangent_is_counted_as_both():
    source = traced(BALL, (0, 0, 3))
    again = changed(source, t=1e-17, status=Status.TANGENT)
    verdict = ExactJudge([BALL]).judge(
        again, source.position, np.array([(0.6, 0.0, 0.8)]), leaves=source.object_id
    )
    assert (verdict.tangent, verdict.wrong_tangent) == (1, 1)


class TestLostNormals:
    """Rays through the apex of a lid, where four patches have a collapsed edge."""

    origin = (0, 0, 10)

    def test_what_lies_behind_an_apex_is_wrong(self):
        # Seen from within the bottom is at z = 0; the apex is at 3.15.
        pot = teapot()
        bottom = traced(pot, (0, 0, 3))
        assert faults_of(pot, changed(bottom, t=10.0), self.origin) == (1, 1, 1)

    @pytest.mark.parametrize("make", [teapot, lid])
    def test_the_right_row_is_right_without_a_mark(self, make):
        hits = traced(make(), self.origin)
        assert hits.t[0] == pytest.approx(6.85)
        assert hits.status[0] == Status.HIT
        verdict = ExactJudge([make()]).judge(hits, np.array([self.origin], float), DOWN)
        assert verdict.faults == verdict.left_open == 0

    def test_a_miss_through_an_apex_is_wrong(self):
        miss = traced(lid(), self.origin, -DOWN)
        assert not miss.hit[0]
        assert faults_of(lid(), miss, self.origin) == (1, 1, 1)

    def test_an_apex_ahead_is_no_departure(self):
        # A ray that leaves the bottom and passes the apex has one point of departure.
        pot = teapot()
        source = traced(pot, (0, 0, 3))
        rays = source.position, -DOWN
        truth = exact_hits(ExactScene([pot]), *rays, leaves=source.object_id)
        assert (truth.left[0], truth.ambiguous[0]) == (0, False)
        assert truth.t[0] == pytest.approx(3.15)


def test_tangent_rows_are_held_to_bound_and_point():
    pot, origin, to = teapot(), (5.0, 0.3, 1.2), np.array([(-1.0, 0.05, 0.02)])
    hits = traced(pot, origin, to)
    rays = np.array([origin]), to
    judge = ExactJudge([pot])
    for columns, faults in (
        ({}, (0, 0)),
        ({"u": hits.u[0] + 0.01}, (0, 1)),
        ({"t_bound": 1e-6 * hits.t_bound[0]}, (1, 0)),
        # No crossing is there: nothing is said of one elsewhere.
        ({"t": hits.t[0] + 1e-6, "t_bound": 1e-12}, (0, 1)),
    ):
        claimed = changed(hits, status=Status.TANGENT, **columns)
        verdict = judge.judge(claimed, *rays, marks=False)
        assert (verdict.bounds_broken, verdict.off_ray_tangent) == faults
        assert verdict.faults == sum(faults)


def test_bounds_of_tangent_rows_are_not_held_against_what_lies_behind():
    # The ray begins 5e-13 before a collapsed edge, which it passes within the band; it met the patch
    # 3e-11 behind its origin, so flatly that the band moves that crossing farther.
    origin = (-0.08691331992427177, -0.06683213965914979, -0.06805533542815306)
    to = np.array([(-0.9672879560735849, 0.19104464510946406, -0.1669010293856381)])
    (surface,) = SETS["patch corners"].surfaces()
    hits = traced(surface, origin, to)
    behind = ExactScene([surface]).crossings(np.array(origin), to[0])[-1]
    assert hits.status[0] == Status.TANGENT
    assert hits.hit[0]
    assert hits.t_bound[0] < hits.t[0] - behind.t < behind.band / behind.cosine
    assert ExactJudge([surface]).judge(hits, np.array([origin]), to).faults == 0


def test_missing_marks_are_faults_of_campaigns():
    # The ray touches the ball from outside, half a band away: hit or miss, it must say TANGENT.
    origin, to = (-3, 0, 1 + 3e-15), np.array([(1.0, 0.0, 0.0)])
    hits = traced(BALL, origin, to)
    assert hits.status[0] == Status.TANGENT
    group = Group("x", "closed", SINGULAR, 1)
    rays = np.array([origin], float), to
    point = traced(BALL, (-3, 0, 1 - 1e-9), to)
    bare = changed(point, t=3.0, status=Status.HIT)
    Checker([BALL]).check(group, "batch", bare, *rays, None)
    assert (group.count.wrong, group.count.unmarked, group.count.faults) == (0, 1, 1)
    assert group.examples[0][0] == "unmarked"
