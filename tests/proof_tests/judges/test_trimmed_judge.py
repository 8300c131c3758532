"""Exact answers on trimmed surfaces, against closed forms, and hits in holes."""

import numpy as np
import pytest
from trimmed_surfaces import plate, windowed_cylinder

from hybrid_rt import Intersector, Rectangle
from hybrid_rt.core.records import Status
from meshing import SurfaceOfRevolution, TrimmedSurface, circle, polygon
from proof.cases.rays import hard_rays
from proof.exact.answers import DOUBTFUL, answers_to
from proof.exact.judge import ExactJudge
from proof.exact.trims import TrimEdges
from proof.exact.truth import ExactScene

OUTLINE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
SQUARE = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))


def down(points):
    """Rays straight down onto points (n, 2), from a height of 2."""
    origins = np.column_stack([points, np.full(len(points), 2.0)])
    return origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)


@pytest.mark.parametrize("ratio", [1.0, 1e3])
def test_curves_pass_as_near_as_circles_do(ratio):
    # A circle of radius 1/4 in the square: a point at distance r from its centre is |r - 1/4| away.
    sides = TrimEdges(TrimmedSurface(SQUARE, [circle((0.5, 0.5), 0.25)]))
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
        for i in np.flatnonzero(true > 1e-13):
            assert sides.passes(u[i], v[i], steps[i], share * reach[i]) is expected


def test_lines_that_cancel_at_a_seam_are_no_edges():
    tube = SurfaceOfRevolution([(0, 1), (2, 1)], (0, 0, 0), (0, 0, 1))
    window = polygon([(0.4, 0.2), (0.6, 0.2), (0.6, 0.4), (0.4, 0.4)])
    whole = TrimEdges(TrimmedSurface(tube, [OUTLINE, window]))
    half = TrimEdges(TrimmedSurface(tube, [polygon([(0, 0), (0.5, 0), (0.5, 1), (0, 1)])]))
    for u in (1e-5, 1 - 1e-5):
        assert whole.passes(u, 0.5, np.eye(2), 1e-3) is False
        assert half.passes(u, 0.5, np.eye(2), 1e-3) is True


def answers(surfaces, points):
    """Return the answers to rays straight down onto points."""
    scene = ExactScene(surfaces)
    return [answers_to(scene, o, d) for o, d in zip(*down(points), strict=True)]


def is_open(found):
    return found.undecided or any(root.kind == DOUBTFUL for root in found.roots)


def first_of(found):
    return -1 if found.first is None else found.first.object_id


def test_first_roots_are_those_inside_by_the_closed_form():
    # A plate with a round hole above another without: z = 0 and z = -1.
    lower = TrimmedSurface(Rectangle((-1, -1, -1), (2, 0, 0), (0, 2, 0)), [OUTLINE])
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (200, 2))
    r, is_on = np.hypot(*points.T), np.abs(points).max(axis=1) < 1
    found = answers([plate(), lower], points)
    assert not any(map(is_open, found))
    expected = np.where(is_on, np.where(r > 0.5, 0, 1), -1)
    assert [first_of(one) for one in found] == expected.tolist()


def test_roots_within_the_band_of_a_curve_are_doubtful():
    # 64 eps x 3 is 4.3e-14 in space; moved rays are 1.3 of that away.
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 5)
    for beside in (0.0, 3e-14, -3e-14, 1e-13, -1e-13, 1e-6, -1e-6):
        at = (0.5 + beside) * np.column_stack([np.cos(angle), np.sin(angle)])
        for found in answers([plate()], at):
            assert is_open(found) == (abs(beside) < 5e-14)
            assert (first_of(found) == 0) == (beside > 5e-14)


def test_roots_within_the_gap_are_hits():
    ring = np.column_stack([np.cos(np.arange(5.0)), np.sin(np.arange(5.0))])
    for beside, number, may_be_open in (
        (-1.1e-3, -1, False), (-1e-3, -1, True), (-0.9e-3, 0, False), (1e-3, 0, False),
    ):  # fmt: skip
        for found in answers([plate(gap=1e-3)], (0.5 + beside) * ring):
            assert not found.undecided
            assert is_open(found) == may_be_open
            assert first_of(found) == (-1 if may_be_open else number)


def test_hits_in_holes_are_phantoms():
    surface = windowed_cylinder()
    rays = hard_rays([surface], 400, 4)
    judge = ExactJudge([surface])
    hits = Intersector(surface, coarse="none").intersect(rays.origins, rays.directions)
    assert judge.judge(hits, rays.origins, rays.directions, marks=False).n_wrong == 0
    whole = Intersector(surface.surface, coarse="none").intersect(rays.origins, rays.directions)
    inside, in_band = surface.contains(np.clip(whole.u, 0, 1), np.clip(whole.v, 0, 1))
    for rows, share in (
        # All but those within the band in space of an edge.
        (whole.hit & ~inside & ~in_band & (whole.status == Status.HIT), (0.9, 1.0)),
        (whole.hit & inside, (0.0, 0.0)),
    ):
        verdict = judge.judge(whole[rows], rays.origins[rows], rays.directions[rows], marks=False)
        assert rows.sum() > 15
        assert share[0] * rows.sum() <= verdict.n_wrong <= share[1] * rows.sum()
