"""The oracle on trimmed surfaces, against loops in integers, closed forms, and hits in holes."""

import numpy as np
import pytest
from trimmed_surfaces import bumpy, plate, windowed_cylinder, windowed_torus

from hybrid_rt import Intersector, Rectangle
from hybrid_rt.core.records import Status
from meshing import SurfaceOfRevolution, TrimmedSurface, circle, polygon
from proof.cases.rays import hard_rays
from proof.exact.loops import ExactLoops
from proof.judges.judge import compare
from proof.judges.oracle import first_hits
from proof.judges.trim_sides import TrimSides

OUTLINE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
SQUARE = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))


def down(points):
    """Rays straight down onto points (n, 2), from a height of 2."""
    origins = np.column_stack([points, np.full(len(points), 2.0)])
    return origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)


@pytest.mark.parametrize("make", [bumpy, windowed_cylinder, windowed_torus])
def test_sides_are_those_of_loops_in_integers(make):
    surface = make()
    u, v = np.random.default_rng(3).random((2, 200))
    exact = ExactLoops(surface.loops, surface.closes)
    found = TrimSides(surface).inside(u, v)
    assert found.tolist() == [
        exact.is_inside(*at) for at in zip(u.tolist(), v.tolist(), strict=True)
    ]


@pytest.mark.parametrize("ratio", [1.0, 1e3])
def test_curves_pass_as_near_as_circles_do(ratio):
    # A circle of radius 1/4 in the square: a point at distance r from its centre is |r - 1/4| away.
    sides = TrimSides(TrimmedSurface(SQUARE, [circle((0.5, 0.5), 0.25)]))
    rng = np.random.default_rng(1)
    turn, away = rng.uniform(0, 2 * np.pi, 100), 10.0 ** rng.uniform(-12, -2, 100)
    r = 0.25 + away * rng.choice([-1, 1], 100)
    u, v = 0.5 + r * np.cos(turn), 0.5 + r * np.sin(turn)
    true = np.abs(np.hypot(u - 0.5, v - 0.5) - 0.25)
    # Seen so that the way out is shorter by some ratio: turned, then squeezed.
    out = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    along = np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    steps = np.stack([out / ratio, along], axis=1)
    reach = true / ratio
    for share, expected in ((0.99, False), (1.01, True)):
        # Rounding of u and v: 1e-16 each.
        sure = true > 1e-13
        passes, is_wide = sides.passes(u, v, steps, share * reach)
        assert not is_wide[sure].any()
        assert (passes[sure] == expected).all()


def test_lines_that_cancel_at_a_seam_are_no_edges():
    tube = SurfaceOfRevolution([(0, 1), (2, 1)], (0, 0, 0), (0, 0, 1))
    window = polygon([(0.4, 0.2), (0.6, 0.2), (0.6, 0.4), (0.4, 0.4)])
    steps, reach = np.tile(np.eye(2), (2, 1, 1)), np.full(2, 1e-3)
    whole = TrimSides(TrimmedSurface(tube, [OUTLINE, window]))
    half = TrimSides(TrimmedSurface(tube, [polygon([(0, 0), (0.5, 0), (0.5, 1), (0, 1)])]))
    at = np.array([1e-5, 1 - 1e-5]), np.array([0.5, 0.5])
    assert whole.passes(*at, steps, reach)[0].tolist() == [False, False]
    assert half.passes(*at, steps, reach)[0].tolist() == [True, True]


def test_first_roots_are_those_inside_by_the_closed_form():
    # A plate with a round hole above another without: z = 0 and z = -1.
    lower = TrimmedSurface(Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0)), [OUTLINE])
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (3000, 2))
    truth = first_hits([plate(), lower], *down(points), threads=1)
    r, is_on = np.hypot(*points.T), np.abs(points).max(axis=1) < 1
    assert not truth.undecided.any()
    assert not truth.ambiguous.any()
    np.testing.assert_array_equal(truth.object_id, np.where(is_on, np.where(r > 0.5, 0, 1), -1))


def test_roots_within_the_band_of_a_curve_are_doubtful():
    # 64 eps x 3 is 4.3e-14 in space; moved rays are 1.3 of that away.
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 20)
    for beside in (0.0, 3e-14, -3e-14, 1e-13, -1e-13, 1e-6, -1e-6):
        at = (0.5 + beside) * np.column_stack([np.cos(angle), np.sin(angle)])
        truth = first_hits([plate()], *down(at), threads=1)
        assert (truth.ambiguous == (abs(beside) < 5e-14)).all()
        assert ((truth.object_id == 0) == (beside > 5e-14)).all()


def test_roots_within_the_gap_are_hits():
    gap = 1e-3
    ring = np.column_stack([np.cos(np.arange(40.0)), np.sin(np.arange(40.0))])
    for beside, object_id, is_open in (
        (-1.1e-3, -1, False), (-1e-3, -1, True), (-0.9e-3, 0, False), (1e-3, 0, False),
    ):  # fmt: skip
        truth = first_hits([plate(gap=gap)], *down((0.5 + beside) * ring), threads=1)
        assert (truth.object_id == object_id).all()
        assert (truth.ambiguous == is_open).all()


@pytest.fixture(scope="module")
def judged():
    surface = windowed_cylinder()
    rays = hard_rays([surface], 1500, 4)
    return surface, rays, first_hits([surface], rays.origins, rays.directions, threads=1)


def test_hits_in_holes_are_phantoms(judged):
    surface, rays, truth = judged
    hits = Intersector(surface, coarse="none").intersect(rays.origins, rays.directions)
    assert compare(hits, truth).n_wrong == 0
    whole = Intersector(surface.surface, coarse="none").intersect(rays.origins, rays.directions)
    inside, in_band = surface.contains(np.clip(whole.u, 0, 1), np.clip(whole.v, 0, 1))
    in_hole = whole.hit & ~inside & ~in_band & (whole.status == Status.HIT) & ~truth.undecided
    verdict = compare(whole, truth)
    found = np.isin(np.arange(len(whole)), np.concatenate(list(verdict.rows.values())))
    # All but those within the band in space of an edge.
    assert (found & in_hole).sum() > 0.9 * in_hole.sum() > 50
    assert not (found & inside).any()
