"""The oracle against rational arithmetic, and the judge against answers made wrong on purpose."""

import dataclasses

import mpmath
import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Sphere, TriangleMesh
from hybrid_rt.analysis.ray_sets import silhouettes
from meshing import BezierPatches, SurfaceOfRevolution
from proof.cases.campaign import SCENES
from proof.cases.rational_surfaces import octants
from proof.cases.rays import hard_rays
from proof.judges import exact
from proof.judges.judge import compare
from proof.judges.kernels.events import DOUBTFUL, UNDECIDED
from proof.judges.oracle import first_hits, truth_of
from proof.judges.surface_judge import judge_of


@pytest.mark.parametrize("check", [exact.check_patches, exact.check_lathes])
def test_all_roots_are_found_and_right_to_the_last_bits(check):
    result = check(1000, seed=11)
    assert not result.lost
    assert not result.invented
    # Newton ends in double-double; t itself is a float64, and one sum with it rounds.
    assert result.worst <= 4.0
    # Rays half of which meet something: the comparison was about something.
    assert result.roots > 500


def test_sphere_roots_agree_with_sixty_digits():
    rng = np.random.default_rng(5)
    center, radius = np.array([0.3, -0.2, 0.1]), 0.7
    origins = rng.normal(size=(300, 3)) * 10.0 ** rng.uniform(0, 6, (300, 1))
    directions = center + 0.71 * rng.normal(size=(300, 3)) / np.sqrt(3) - origins
    truth = first_hits([Sphere(center, radius)], origins, directions)
    with mpmath.workdps(60):
        for i in range(300):
            o = [
                mpmath.mpf(float(x)) - mpmath.mpf(float(c))
                for x, c in zip(origins[i], center, strict=True)
            ]
            d = [mpmath.mpf(float(x)) for x in directions[i]]
            a = mpmath.fsum(x * x for x in d)
            b = mpmath.fsum(x * y for x, y in zip(o, d, strict=True))
            c = mpmath.fsum(x * x for x in o) - mpmath.mpf(radius) ** 2
            rest = b * b - a * c
            if truth.ambiguous[i]:
                continue
            if rest < 0:
                assert truth.object_id[i] < 0
                continue
            t = (-b - mpmath.sqrt(rest)) / a
            assert abs(float(t - mpmath.mpf(float(truth.t[i])))) <= np.spacing(truth.t[i])


def weighted_ball(u_range=(0.0, 1.0)):
    """The unit sphere about z as two rational quarter circles that turn."""
    w = np.sqrt(0.5)
    arcs = [[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (1, 1), (1, 0)]]
    return SurfaceOfRevolution(
        arcs, (0, 0, 0), (0, 0, 1), (1, 0, 0), [(1, w, 1), (1, w, 1)], u_range
    )


@pytest.mark.parametrize("make", [octants, weighted_ball])
def test_rational_surfaces_are_the_sphere_that_they_stand_for(make):
    rays = hard_rays([make()], 3000, seed=6)
    truth, closed = (
        first_hits(surfaces, rays.origins, rays.directions)
        for surfaces in ([make()], [Sphere((0, 0, 0), 1)])
    )
    clear = ~truth.ambiguous & ~closed.ambiguous & ~truth.undecided
    assert clear.mean() > 0.7
    np.testing.assert_array_equal(truth.object_id[clear], closed.object_id[clear])
    both = np.flatnonzero(clear & (truth.object_id >= 0))
    # Rounded weights of sqrt(1/2) move the surface by 2e-16; near poles t is known to the band only.
    moved = np.where(truth.exact, 4e-16, truth.band) / (closed.cosine * truth.length)
    apart = np.abs(truth.t[both] - closed.t[both])
    assert (apart <= moved[both] + np.spacing(truth.t[both])).all()


@pytest.mark.parametrize("ratio", [0.5, 1e-4])
def test_roots_on_rational_patches_are_right_to_the_last_bits(ratio):
    rng = np.random.default_rng(9)
    x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 3), indexing="ij")
    net = np.stack([x, y, rng.uniform(-0.5, 0.5, (4, 3))], axis=-1)
    surface = BezierPatches([net], [ratio ** rng.random((4, 3))])
    rays = hard_rays([surface], 1000, seed=7)
    truth = first_hits([surface], rays.origins, rays.directions)
    rows = np.flatnonzero(truth.exact & ~truth.ambiguous)[:100]
    assert rows.size == 100
    with mpmath.workdps(60):
        solve = judge_of(surface).solver()
        for i in rows:
            o, d = ([mpmath.mpf(float(x)) for x in a[i]] for a in (rays.origins, rays.directions))
            t = solve(0, float(truth.u[i]), float(truth.v[i]), float(truth.t[i]), o, d)
            assert abs(float(t - mpmath.mpf(float(truth.t[i])))) <= np.spacing(truth.t[i])


@pytest.mark.parametrize("part", [(0.0, 0.5), (0.9, 1.3), (-0.25, 0.05)])
def test_parts_of_a_turn_are_what_the_closed_form_leaves(part):
    """A cylinder of radius 1 about z: both roots by the quadratic equation, then their angles."""
    rng = np.random.default_rng(8)
    tube = SurfaceOfRevolution([(-1, 1), (1, 1)], (0, 0, 0), (0, 0, 1), (1, 0, 0), u_range=part)
    origins = rng.normal(size=(4000, 3)) * 2
    directions = rng.normal(size=(4000, 3)) - 0.5 * origins
    truth = first_hits([tube], origins, directions)
    (ox, oy, oz), (dx, dy, dz) = origins.T, directions.T
    a, b, c = dx**2 + dy**2, ox * dx + oy * dy, ox**2 + oy**2 - 1
    with np.errstate(invalid="ignore"):
        both = (-b + np.sqrt(b * b - a * c) * np.array([[-1.0], [1.0]])) / a
        turn = np.arctan2(oy + both * dy, ox + both * dx) / (2 * np.pi)
        within = (both > 0) & (np.abs(oz + both * dz) < 1)
        within &= (turn - part[0]) % 1.0 < part[1] - part[0]
    t = np.where(within, both, np.inf).min(axis=0)
    assert not truth.ambiguous.any()
    np.testing.assert_allclose(truth.t, t, rtol=1e-9)
    hit = np.flatnonzero(truth.object_id >= 0)
    assert 300 < hit.size < 3000
    np.testing.assert_allclose(
        tube.point(truth.u[hit], truth.v[hit], truth.patch_id[hit]),
        origins[hit] + truth.t[hit, None] * directions[hit],
        atol=1e-12,
    )


def test_hits_on_what_a_part_turn_lacks_are_found():
    half = weighted_ball((0.0, 0.5))
    rays = hard_rays([half], 2000, seed=2)
    truth = first_hits([half], rays.origins, rays.directions)
    hits = Intersector([weighted_ball()]).intersect(rays.origins, rays.directions)
    own = Intersector([half]).intersect(rays.origins, rays.directions)
    assert compare(own, truth).n_wrong == 0
    lacking = hits.hit & (hits.position[:, 1] < -1e-9)
    assert lacking.sum() > 100
    found = compare(hits, truth).rows
    rows = np.concatenate([found["phantom"], found["nearer"]])
    assert set(np.flatnonzero(lacking & ~truth.ambiguous)) <= set(rows)


@pytest.fixture(scope="module")
def judged():
    surfaces = SCENES["vase"]()
    rays = hard_rays(surfaces, 2000, seed=4)
    hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
    return hits, first_hits(surfaces, rays.origins, rays.directions)


def test_the_judge_finds_what_was_made_wrong(judged):
    hits, truth = judged
    assert compare(hits, truth).n_wrong == 0
    sure = np.flatnonzero(~truth.ambiguous & truth.exact & (truth.cosine > 0.1))[:30]
    t, ids = hits.t.copy(), hits.object_id.copy()
    status = hits.status.copy()
    t[sure[:10]] = np.inf  # lost
    ids[sure[:10]], status[sure[:10]] = -1, 0
    t[sure[10:20]] += 1e-6  # behind the surface
    t[sure[20:30]] -= 1e-6  # in front of it
    wrong = dataclasses.replace(hits, t=t, object_id=ids, status=status)
    verdict = compare(wrong, truth)
    assert set(verdict.rows["missed"]) == set(sure[:10])
    assert set(verdict.rows["farther"]) == set(sure[10:20])
    assert set(verdict.rows["nearer"]) == set(sure[20:30])


def test_the_judge_finds_phantoms(judged):
    hits, truth = judged
    empty = np.flatnonzero(~hits.hit & (truth.object_id < 0) & ~truth.ambiguous)[:10]
    some = np.flatnonzero(hits.hit)[0]
    columns = {}
    for item in dataclasses.fields(hits):
        column = getattr(hits, item.name).copy()
        column[empty] = column[some]
        columns[item.name] = column
    verdict = compare(dataclasses.replace(hits, **columns), truth)
    assert set(verdict.rows["phantom"]) == set(empty)


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

    rays = np.array([(0.0, 0.05, 0.0)]), np.array([(1.0, 0.0, 0.0)])

    @pytest.mark.parametrize("triangle", [FLAT, ASIDE, BEHIND])
    def test_the_nearest_wall_is_the_first(self, triangle):
        mesh = walls((3.0, 1.0), triangle)
        truth = first_hits([mesh], *self.rays, threads=1)
        assert (truth.t[0], truth.undecided[0]) == (1.0, False)
        hits = Intersector([mesh], coarse="none", threads=1).intersect(*self.rays)
        assert compare(hits, truth).n_wrong == 0
        for t in (2.3, 3.0):
            farther = dataclasses.replace(hits, t=np.array([t]))
            assert compare(farther, truth).n_wrong == 1

    def test_both_ends_of_what_it_has_of_the_triangle_are_doubtful(self):
        truth = first_hits([walls((), FLAT)], *self.rays, threads=1)
        # The sides have a slope of 3, and the ray is 0.35 above the base.
        ends = 1.8 + 0.35 / 3, 2.2 - 0.35 / 3
        np.testing.assert_allclose(truth.roots.t, ends, rtol=1e-12)
        assert (truth.roots.kind == DOUBTFUL).all()
        assert len(first_hits([walls((), ASIDE)], *self.rays, threads=1).roots.t) == 0


def test_edges_are_not_joined_by_what_lies_between():
    # Events at edges with t = 1, 1.6 and 2.2, each within reach of the next: the third is not of the
    # first. Of those of one edge the nearest stays.
    n = 4
    columns = {
        "ray": np.zeros(n, np.int64),
        "t": np.array([2.2, 1.6, 1.0, 1.0 + 1e-9]),
        "object_id": np.zeros(n, np.int32),
        "patch_id": np.array([0, 1, 3, 2], np.int32),
        "u": np.zeros(n),
        "v": np.zeros(n),
        "cosine": np.full(n, 1.0),
        "band": np.full(n, 0.4),
        "kind": np.zeros(n, np.uint8),
        "at_edge": np.ones(n, np.uint8),
    }
    o, d, inf = np.zeros((1, 3)), np.array([(1.0, 0.0, 0.0)]), np.full(1, np.inf)
    truth = truth_of(columns, [], o, d, -inf, inf)
    assert truth.roots.t.tolist() == [1.0, 2.2]
    assert truth.patch_id[0] == 3


@pytest.mark.parametrize("name", ["bulge", "wavy"])
def test_turned_events_name_the_azimuth_at_their_t(name):
    profile = {
        "bulge": [(-1, 0.3), (-0.5, 1.6), (0.5, 1.6), (1, 0.3)],
        "wavy": [(-1, 0.8), (-0.5, 2.5), (0.6, 0.1), (1, 1.2)],
    }[name]
    whole = SurfaceOfRevolution(profile, (0, 0, 0), (0.3, -0.2, 1.0))
    rays = silhouettes([whole], 800, 5, offsets=[1e-13, -1e-13, 1e-14, -1e-14, 1e-15, 0.0])
    roots = first_hits([whole], rays.origins, rays.directions, threads=1).roots
    rows = np.flatnonzero(roots.kind != UNDECIDED)
    assert (roots.kind == DOUBTFUL).sum() > 400
    at = rays.origins[roots.ray[rows]] + roots.t[rows, None] * rays.directions[roots.ray[rows]]
    x, y = (at - whole.origin) @ whole.radial, (at - whole.origin) @ whole.binormal
    apart = (roots.u[rows] - np.arctan2(y, x) / (2 * np.pi) + 0.5) % 1.0 - 0.5
    assert (np.abs(2 * np.pi * apart) * np.hypot(x, y)).max() < 1e-13
