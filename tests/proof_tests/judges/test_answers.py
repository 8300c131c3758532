"""The right answers to a ray against closed forms, and the judge on answers made wrong on purpose."""

import dataclasses

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Sphere, TriangleMesh
from meshing import SurfaceOfRevolution
from proof.cases.rational_surfaces import octants
from proof.cases.rays import hard_rays
from proof.exact.answers import CERTAIN, DOUBTFUL, Root, _merged, answers_to
from proof.exact.truth import ExactScene
from proof.judge import Judge


def weighted_ball(u_range=(0.0, 1.0)):
    """The unit sphere about z as two rational quarter circles that turn."""
    w = np.sqrt(0.5)
    arcs = [[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (1, 1), (1, 0)]]
    return SurfaceOfRevolution(
        arcs, (0, 0, 0), (0, 0, 1), (1, 0, 0), [(1, w, 1), (1, w, 1)], u_range
    )


def is_clear(answers):
    return all(root.kind == CERTAIN for root in answers.roots)


@pytest.mark.parametrize("make", [octants, weighted_ball])
def test_rational_surfaces_are_the_sphere_that_they_stand_for(make):
    rays = hard_rays([make()], 100, seed=6)
    scenes = ExactScene([make()]), ExactScene([Sphere((0, 0, 0), 1)])
    n_clear = 0
    for o, d in zip(rays.origins, rays.directions, strict=True):
        one, ball = (answers_to(scene, o, d) for scene in scenes)
        if not (is_clear(one) and is_clear(ball)):
            continue
        n_clear += 1
        assert (one.first is None) == (ball.first is None)
        if ball.first is not None:
            # Rounded weights of sqrt(1/2) move the surface by 2e-16; near poles t is known to the band.
            apart = abs(one.first.t - ball.first.t)
            moved = (4e-16 + one.first.band) / (ball.first.cosine * ball.length)
            assert apart <= moved + np.spacing(ball.first.t)
    assert n_clear > 50


@pytest.mark.parametrize("part", [(0.0, 0.5), (0.9, 1.3), (-0.25, 0.05)])
def test_parts_of_a_turn_are_what_the_closed_form_leaves(part):
    """A cylinder of radius 1 about z: both roots by the quadratic equation, then their angles."""
    rng = np.random.default_rng(8)
    tube = SurfaceOfRevolution([(-1, 1), (1, 1)], (0, 0, 0), (0, 0, 1), (1, 0, 0), u_range=part)
    origins = rng.normal(size=(150, 3)) * 2
    directions = rng.normal(size=(150, 3)) - 0.5 * origins
    (ox, oy, oz), (dx, dy, dz) = origins.T, directions.T
    a, b, c = dx**2 + dy**2, ox * dx + oy * dy, ox**2 + oy**2 - 1
    with np.errstate(invalid="ignore"):
        both = (-b + np.sqrt(b * b - a * c) * np.array([[-1.0], [1.0]])) / a
        turn = np.arctan2(oy + both * dy, ox + both * dx) / (2 * np.pi)
        within = (both > 0) & (np.abs(oz + both * dz) < 1)
        within &= (turn - part[0]) % 1.0 < part[1] - part[0]
    t = np.where(within, both, np.inf).min(axis=0)
    scene = ExactScene([tube])
    found = [answers_to(scene, o, d) for o, d in zip(origins, directions, strict=True)]
    assert all(map(is_clear, found))
    firsts = [np.inf if one.first is None else one.first.t for one in found]
    np.testing.assert_allclose(firsts, t, rtol=1e-9)
    assert 10 < np.isfinite(t).sum() < 120


def test_hits_on_what_a_part_turn_lacks_are_found():
    half = weighted_ball((0.0, 0.5))
    rays = hard_rays([half], 300, seed=2)
    hits = Intersector([weighted_ball()]).intersect(rays.origins, rays.directions)
    own = Intersector([half]).intersect(rays.origins, rays.directions)
    judge = Judge([half])
    assert judge.judge(own, rays.origins, rays.directions).n_wrong == 0
    lacking = hits.hit & (hits.position[:, 1] < -1e-6)
    assert lacking.sum() > 10
    verdict = judge.judge(hits[lacking], rays.origins[lacking], rays.directions[lacking])
    assert verdict.n_wrong + verdict.wrong_tangent == lacking.sum()
    assert verdict.wrong["phantom"] + verdict.wrong["nearer"] == verdict.n_wrong


def walls(heights, *triangles):
    """Walls across x, each of two triangles that share the edge z = 0, and triangles after them."""
    corners, faces = [], []
    for x in heights:
        b = len(corners)
        corners += [(x, -1, 0), (x, 1, 0), (x, 0, 1), (x, 0, -1)]
        faces += [(b, b + 1, b + 2), (b + 1, b, b + 3)]
    for triangle in triangles:
        faces.append(tuple(range(len(corners), len(corners) + 3)))
        corners += triangle
    return TriangleMesh(trimesh.Trimesh(np.array(corners, float), faces, process=False))


FLAT = [(1.8, -0.3, 0), (2.2, -0.3, 0), (2.0, 0.3, 0)]
ASIDE = [(2.0, 0.1, 0), (2.4, 0.4, 0), (1.6, 0.4, 0)]
BEHIND = [(3.8, -0.3, 0), (4.2, -0.3, 0), (4.0, 0.3, 0)]


class TestRaysInThePlaneOfATriangle:
    """The ray along x passes walls through an edge of theirs, and triangles within their plane."""

    ray = np.array([0.0, 0.05, 0.0]), np.array([1.0, 0.0, 0.0])

    @pytest.mark.parametrize("triangle", [FLAT, ASIDE, BEHIND])
    def test_the_nearest_wall_is_the_first(self, triangle):
        mesh = walls((3.0, 1.0), triangle)
        answers = answers_to(ExactScene([mesh]), *self.ray)
        assert (answers.first.t, answers.undecided) == (1.0, False)
        rays = self.ray[0][None], self.ray[1][None]
        hits = Intersector([mesh], coarse="none", threads=1).intersect(*rays)
        judge = Judge([mesh])
        assert judge.judge(hits, *rays).n_wrong == 0
        for t in (2.3, 3.0):
            farther = dataclasses.replace(hits, t=np.array([t]))
            assert judge.judge(farther, *rays).n_wrong == 1

    def test_what_it_has_of_the_triangle_is_doubtful(self):
        roots = answers_to(ExactScene([walls((), FLAT)]), *self.ray).roots
        assert {root.kind for root in roots} == {DOUBTFUL}
        # The sides have a slope of 3, and the ray is 0.35 above the base.
        assert min(root.t for root in roots) == pytest.approx(1.8 + 0.35 / 3)
        assert answers_to(ExactScene([walls((), ASIDE)]), *self.ray).roots == []


def test_edges_are_not_joined_by_what_lies_between():
    # Roots at edges with t = 1, 1.6 and 2.2, each within reach of the next: the third is not of the
    # first. Of those of one edge the nearest stays.
    roots = [
        Root(t, 0, patch, 1.0, 0.4, CERTAIN, True)
        for t, patch in ((2.2, 0), (1.6, 1), (1.0, 3), (1.0 + 1e-9, 2))
    ]
    assert [(root.t, root.patch_id) for root in _merged(roots, 1.0)] == [(1.0, 3), (2.2, 0)]
