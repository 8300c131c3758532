"""Filters agree with exact arithmetic, and confirm nothing that is wrong."""

import dataclasses

import numpy as np
import pytest

from hybrid_rt import Intersector
from hybrid_rt.core.records import Status
from hybrid_rt.primitives import Box, Rectangle, Sphere
from meshing import SurfaceOfRevolution, TrimmedSurface
from proof.cases.campaign import ORDINARY_SCENES, ordinary_rays, placed_surfaces, trace_cell
from proof.cases.singular_sets import PLACEMENTS, SETS
from proof.exact.judge import ExactJudge
from proof.exact.truth import ExactScene
from proof.filters.kernels import first
from proof.filters.screen import Screen

# Of aspheres the filter knows the ball only, of rational profiles and parts of a turn nothing: the
# exact judge is asked about all other rays.
SCREENED = [
    name for name in SETS if not name.startswith(("asphere", "rational", "part", "uneven weights"))
]


def cell_of(name, place, distance, n=10, seed=5):
    tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
    cell = trace_cell(tracer, name, distance, place, n, seed)
    return tracer.surfaces, cell, cell.leaves


@pytest.mark.parametrize("name", SCREENED)
def test_what_is_confirmed_is_right(name):
    """By exact arithmetic, and what is not confirmed is little but near the set."""
    confirmed = rays = 0
    cells = [(place, 10.0 ** -(2 + 3 * k)) for k, place in enumerate(PLACEMENTS)]
    # Three of the five cells each, others from set to set.
    for place, distance in (cells[(SCREENED.index(name) + k) % 5] for k in (0, 1, 3)):
        n = 3 if name == "wavy patch, tangents" else 10  # exact arithmetic takes 0.2 s a ray there
        surfaces, cell, leaves = cell_of(name, place, distance, n)
        sure = Screen(surfaces).confirmed(cell.hits, cell.origins, cell.directions, leaves)
        rows = np.flatnonzero(sure)
        verdict = ExactJudge(surfaces).judge(
            cell.hits[rows], cell.origins[rows], cell.directions[rows],
            leaves=None if leaves is None else leaves[rows], marks=False,
        )  # fmt: skip
        assert verdict.n_wrong == verdict.wrong_tangent == verdict.bounds_broken == 0
        assert verdict.off_ray == verdict.left_open == 0
        # Near a cusp crossings merge, so that fewer are certain.
        # Of trimmed surfaces it only knows what misses the whole surface.
        is_trimmed = any(isinstance(surface, TrimmedSurface) for surface in surfaces)
        is_clear = distance > (1e-4 if name == "cuspidal edge" else 1e-6) and not is_trimmed
        if is_clear and place != "far":
            confirmed, rays = confirmed + int(sure.sum()), rays + len(sure)
    # Beside a flat circle two crossings of rays across the axis are hardly apart in v.
    assert confirmed >= (0.4 if name == "torus, flat circle" else 0.8) * rays


# Of rays that leave a surface the judge chooses which crossing at the start is held against them.
@pytest.mark.parametrize("name", [name for name in SCREENED if not SETS[name].leaving])
def test_first_crossings_are_those_of_exact_arithmetic(name):
    """t within the radius that is said, for rays that arrive at all distances."""
    for distance in (1e-1, 1e-9):
        surfaces, cell, _ = cell_of(name, "turned", distance, 6)
        screen = Screen(surfaces)
        scene = ExactScene(surfaces)
        exact = [
            [one.t for one in scene.crossings(o, d) if one.t > 0.0 and one.object_id == 0]
            for o, d in zip(cell.origins, cell.directions, strict=True)
        ]
        # Of crossings at the start the one that is held against them is chosen.
        wanted = np.array([ahead[0] if ahead else np.nan for ahead in exact])
        nowhere = np.zeros(len(wanted), np.bool_)
        out = screen.filters[0].first(
            np.ascontiguousarray(cell.origins), np.ascontiguousarray(cell.directions), nowhere,
            wanted,
        )  # fmt: skip
        for row, t in zip(out, wanted, strict=True):
            if row[first.UNSURE_FROM] < np.inf:
                continue
            assert (row[first.FOUND] == 1.0) == np.isfinite(t)
            if np.isfinite(t):
                assert abs(row[first.T] - t) <= row[first.T_ERROR] + np.spacing(t)
                assert abs(row[first.APART]) <= row[first.APART_ERROR] + np.spacing(t)


@pytest.fixture(scope="module")
def traced():
    surfaces = [
        SurfaceOfRevolution([(0, 0.5), (1, 1.5), (2, 0.7)], (0.1, 0, 0), (1, 2, 2)),
        Sphere((3.0, 0.5, 0.2), 0.8),
        Box((-3, -3, -1), (-2, 1, 1)),
    ]
    rays = ordinary_rays(surfaces, 1200, 3)
    hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
    return Screen(surfaces), ExactJudge(surfaces), hits, rays.origins, rays.directions


class TestWeakenedHits:
    def changed(self, hits, **columns):
        rows = hits.hit
        out = {}
        for name, value in columns.items():
            out[name] = getattr(hits, name).copy()
            out[name][rows] = value
        return dataclasses.replace(hits, **out)

    def test_right_hits_are_confirmed(self, traced):
        screen, _, hits, origins, directions = traced
        assert screen.confirmed(hits, origins, directions).mean() > 0.99
        assert hits.hit.sum() > 200

    def test_t_beside_its_bound_is_not(self, traced):
        """And exact arithmetic, asked, finds the bound broken."""
        screen, judge, hits, origins, directions = traced
        rows = hits.hit
        for side in (-3.0, 3.0):
            shifted = self.changed(hits, t=hits.t[rows] + side * hits.t_bound[rows])
            assert not screen.confirmed(shifted, origins, directions)[rows].any()
            few = np.flatnonzero(rows)[:10]
            verdict = judge.judge(shifted[few], origins[few], directions[few])
            assert verdict.bounds_broken == 10

    def test_a_lost_hit_is_not(self, traced):
        screen, judge, hits, origins, directions = traced
        rows = hits.hit
        lost = self.changed(hits, t=np.inf, object_id=-1, status=Status.MISS)
        assert not screen.confirmed(lost, origins, directions)[rows].any()
        few = np.flatnonzero(rows)[:10]
        assert judge.judge(lost[few], origins[few], directions[few]).wrong["missed"] == 10

    def test_the_farther_crossing_is_not(self, traced):
        """Rays that go on from just behind the first hit find the second one."""
        screen, judge, hits, origins, directions = traced
        rows = np.flatnonzero(hits.hit)
        begin = origins[rows] + (hits.t[rows] + 1e-3)[:, None] * directions[rows]
        surfaces = judge.scene.surfaces
        second = Intersector(surfaces).intersect(begin, directions[rows])
        again = np.flatnonzero(second.hit)
        rows, second = rows[again], second[again]
        farther = dataclasses.replace(second, t=second.t + hits.t[rows] + 1e-3)
        assert len(rows) > 100
        assert not screen.confirmed(farther, origins[rows], directions[rows]).any()
        few = rows[:10]
        verdict = judge.judge(farther[:10], origins[few], directions[few])
        assert verdict.wrong["farther"] == 10

    def test_a_point_beside_the_ray_is_not(self, traced):
        screen, _, hits, origins, directions = traced
        rows = hits.object_id == 0
        aside = dataclasses.replace(hits, v=np.where(rows, hits.v + 1e-9, hits.v))
        assert not screen.confirmed(aside, origins, directions)[rows].any()

    def test_a_wrong_object_is_not(self, traced):
        screen, _, hits, origins, directions = traced
        other = self.changed(hits, object_id=(hits.object_id[hits.hit] + 1) % 3, patch_id=0)
        assert not screen.confirmed(other, origins, directions)[hits.hit].any()


def test_departures_met_again_are_not_confirmed():
    sphere = Sphere((0, 1, 0), 1)
    tracer = Intersector([sphere])
    start = tracer.intersect((0.3, 1.2, -4.0), (0, 0, 1))
    leaving = np.array([[0.1, 0.2, 1.0]])
    hits = tracer.intersect(start.position, leaving, source=start)
    screen = Screen([sphere])
    assert screen.confirmed(hits, start.position, leaving, start.object_id).all()
    again = dataclasses.replace(hits, t=np.array([1e-16]))
    assert not screen.confirmed(again, start.position, leaving, start.object_id).any()


def test_the_nearer_of_two_objects_is_confirmed():
    """In either order; where both have the same t neither is."""
    near = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    far = Rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0))
    o, d = np.array([[0.1, 0.2, -2.0]]), np.array([[0.0, 0.0, 1.0]])
    for surfaces, expected in (([near, far], 0), ([far, near], 1)):
        hits = Intersector(surfaces).intersect(o, d)
        assert hits.object_id[0] == expected
        assert Screen(surfaces).confirmed(hits, o, d).all()
    twice = [near, near]
    assert not Screen(twice).confirmed(Intersector(twice).intersect(o, d), o, d).any()


@pytest.mark.parametrize("name", list(ORDINARY_SCENES))
def test_ordinary_rays_are_confirmed(name):
    """All but few: the exact judge is asked about what is left."""
    surfaces = ORDINARY_SCENES[name][1]()
    rays = ordinary_rays(surfaces, 900, 2)
    hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
    assert Screen(surfaces).confirmed(hits, rays.origins, rays.directions).mean() > 0.99


@pytest.mark.parametrize(
    ("t", "radius", "is_sure"), [(1e-17, 1e-17, True), (1e-17, 1e-13, False), (1e-13, 9e-14, False)]
)
def test_a_departure_that_a_wide_ball_leaves_open_makes_the_ray_unsure(t, radius, is_sure):
    # A ray leaves a surface of size 1 at a cosine of 1/2; its next crossing is at t = 1.
    crossings = np.zeros((first.MOST_CROSSINGS, first.CROSSING))
    crossings[0, :4] = t, 0.0, radius, 0.5
    crossings[1, :4] = 1.0, 0.0, 1e-20, 0.5
    out, zero = np.zeros(first.N_COLUMNS), np.zeros(3)
    first.finish(crossings, 2, 0.0, zero, 1.0, zero, 1.0, True, np.nan, np.inf, out)
    assert (out[first.UNSURE_FROM] == np.inf) == is_sure
    assert out[first.FOUND] == is_sure
    if is_sure:
        assert out[first.T] == 1.0
