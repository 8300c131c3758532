"""The certified first hit: identities that must hold to the last bit, and hard rays."""

import sys
from importlib import resources

import numpy as np
import pytest

from hybrid_rt import Intersector, Plane, Sphere, Status
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from meshing import BezierPatches

EPS = 2.0**-52
N = 10_000


@pytest.fixture(scope="module")
def teapot():
    with resources.as_file(resources.files("hybrid_rt") / "data" / "teapot.bpt") as file:
        return BezierPatches.read(file)


@pytest.fixture(scope="module")
def tracer(teapot):
    return Intersector([teapot])


@pytest.fixture(scope="module")
def bare(teapot):
    return Intersector([teapot], coarse="none")


@pytest.fixture(scope="module")
def rays(teapot):
    return chords(teapot, N, seed=1)


@pytest.fixture(scope="module")
def hits(tracer, rays):
    return tracer.intersect(*rays)


def size_of(surface):
    return np.linalg.norm(np.ptp(surface.bounds, axis=0))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def chords(surface, n, seed):
    """Two random points of the bounding sphere each."""
    rng = np.random.default_rng(seed)
    radius, middle = 0.5 * size_of(surface), surface.bounds.mean(axis=0)
    a, b = unit(rng.normal(size=(n, 3))), unit(rng.normal(size=(n, 3)))
    return middle + radius * a, radius * (b - a)


def edge_points(surface, n, seed):
    """Patch, u, v of random points on the borders and corners of patches."""
    rng = np.random.default_rng(seed)
    k, side, s = rng.integers(len(surface), size=n), rng.integers(4, size=n), rng.random(n)
    s = np.where(rng.random(n) < 0.2, np.round(s), s)
    u = np.select([side == 0, side == 1], [0.0, 1.0], s)
    v = np.select([side == 2, side == 3], [0.0, 1.0], s)
    return k, u, v


def assert_same(a, b, scale=1.0):
    for name in ("object_id", "patch_id", "u", "v", "status", "flags", "normal"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    np.testing.assert_array_equal(a.t * scale, b.t)
    np.testing.assert_array_equal(a.t_bound * scale, b.t_bound)


def test_hits_are_on_the_ray_and_on_the_surface(teapot, rays, hits):
    found = hits[hits.hit]
    origin, direction = rays[0][hits.hit], rays[1][hits.hit]
    surface = teapot.point(found.u, found.v, found.patch_id)
    gap = np.linalg.norm(surface - (origin + found.t[:, None] * direction), axis=1)
    # A dozen roundings of numbers up to the size of the scene (8), of which one is allowed here.
    assert gap.max() <= 16 * EPS * size_of(teapot)
    assert found.residual.max() <= 16 * EPS * size_of(teapot)
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, rtol=4 * EPS)


@pytest.mark.parametrize(
    ("accuracy", "asks"), [("certified", False), ("refined", True), ("mesh", True)]
)
def test_certified_shadow_rays_do_without_embree(teapot, bare, rays, accuracy, asks, monkeypatch):
    tracer = Intersector([teapot], accuracy=accuracy)
    scene, asked = tracer._coarse.scene, []
    first = scene.first
    monkeypatch.setattr(scene, "first", lambda *some: asked.append(len(some[0])) or first(*some))
    blocked = tracer.occluded(*rays)
    assert bool(asked) is asks
    assert (tracer.coarse_seconds > 0.0) is asks
    if not asks:
        np.testing.assert_array_equal(blocked, bare.occluded(*rays))


@pytest.mark.parametrize("kind", ["random", "none"])
def test_wrong_coarse_hits_change_nothing(teapot, rays, hits, kind, monkeypatch):
    liar = Intersector([teapot])
    rng = np.random.default_rng(5)
    n_faces = liar._coarse.n_triangles

    def lie(origin, *_):
        n = len(origin)
        face = np.full(n, -1, np.int32)
        if kind == "random":
            face = rng.integers(-1, n_faces, n).astype(np.int32)
        return CoarseHits(face, np.zeros(n), 0.5 * rng.random(n), 0.5 * rng.random(n))

    monkeypatch.setattr(liar._coarse.scene, "first", lie)
    assert_same(hits, liar.intersect(*rays))


def test_no_ray_slips_through_an_edge(teapot, tracer):
    rng = np.random.default_rng(7)
    n = 2_000
    k, u, v = edge_points(teapot, n, seed=8)
    point, normal = teapot.point(u, v, k), teapot.normal(u, v, k)
    direction = unit(rng.normal(size=(n, 3)))
    back = size_of(teapot)
    hits = tracer.intersect(point - back * direction, direction)
    # Some rays end earlier on another part of the teapot; none may go on beyond its target,
    # unless it only grazes it.
    cosine = np.abs(np.einsum("ij,ij->i", direction, normal))
    assert not (hits.t[cosine > 1e-3] > back * (1 + 1e-9)).any()


@pytest.fixture(scope="module")
def on_edges(teapot, tracer):
    """Hits exactly on borders of patches."""
    k, u, v = edge_points(teapot, 2_000, seed=10)
    normal = teapot.normal(u, v, k)
    hits = tracer.intersect(teapot.point(u, v, k) + normal, -normal, t_min=0.5, t_max=1.5)
    return hits[hits.hit & (np.abs(hits.t - 1.0) < 1e-9)]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_departure_from_edges_is_not_a_hit(teapot, tracer, on_edges, side):
    """Some 2800 starts in all, at all slopes down to 1e-6, half to either side.

    `tools/verify.py` departs a million times.
    """
    rng, start = np.random.default_rng(9), on_edges
    assert len(start) > 1_360
    cosine = 10.0 ** rng.uniform(-6, -0.3, len(start))
    along = rng.normal(size=(len(start), 3))
    along = unit(along - np.einsum("ij,ij->i", along, start.normal)[:, None] * start.normal)
    away = side * start.normal * cosine[:, None] + along * np.sqrt(1 - cosine**2)[:, None]
    hits = tracer.intersect(start.position, away, source=start)
    # A root that is the point of departure again has a depth t cos of rounding size; true second
    # roots so near are within the band of tangency, or it is a crease that the ray cannot leave.
    slope = np.abs(np.einsum("ij,ij->i", away, hits.normal))
    near = hits.hit & (hits.status != Status.TANGENT)
    near[near] = (hits.t * slope)[near] <= 64 * EPS * size_of(teapot)
    bad = np.flatnonzero(near)
    assert not len(bad), [
        (start.patch_id[i], start.u[i], start.v[i], hits.patch_id[i], hits.u[i], hits.v[i],
         hits.t[i], hits.t_bound[i], cosine[i], float(away[i] @ hits.normal[i]))
        for i in bad[:8]
    ]  # fmt: skip


def test_shadow_ray_ends_on_its_target(tracer, hits):
    target = hits[hits.hit]
    light = np.array([0.0, 0.0, 50.0])
    seen = tracer.intersect(light, target.position - light)
    first = np.abs(seen.t - 1.0) < 1e-9
    blocked = tracer.occluded(light, target.position - light, t_max=1.0, target=target)
    np.testing.assert_array_equal(blocked, ~first)


def test_inputs_of_any_form(tracer):
    single = tracer.intersect([0, -10, 1], [0, 1, 0])
    image = tracer.intersect(
        np.asfortranarray(np.broadcast_to(np.float32([0, -10, 1]), (2, 3, 3))), (0, 1, 0)
    )
    assert len(single) == 1
    assert len(image) == 6
    np.testing.assert_array_equal(image.t, np.repeat(single.t, 6))
    assert len(tracer.intersect(np.empty((0, 3)), np.empty((0, 3)))) == 0


@pytest.mark.parametrize(
    "form",
    [np.asfortranarray, lambda a: np.repeat(a, 2, axis=0)[::2], lambda a: a[::-1].copy()[::-1]],
    ids=["Fortran-ordered", "strided", "reversed"],
)
def test_layouts_change_no_bit_and_arguments_are_left_as_they_are(tracer, rays, hits, form):
    o, d = (form(a) for a in rays)
    o.flags.writeable = d.flags.writeable = False
    t_max = np.full(N, 1e9)
    assert_same(hits, tracer.intersect(o, d, t_max=t_max))
    assert (t_max == 1e9).all()


@pytest.mark.parametrize(
    ("origin", "direction", "message"),
    [
        ([0, 0, 0], [0, 0, 0], r"directions\[0\].*zero"),
        ([0, 0, 0], [0, 1e-310, 0], r"directions\[0\].* is shorter than 2.3e-308"),
        ([0, np.nan, 0], [0, 0, 1], r"origins\[0\].*finite"),
        ([0, 0, 0], [0, np.inf, 1], r"directions\[0\].*finite"),
        ([[0, 0]], [[0, 0]], r"shape \(1, 2\)"),
        (np.zeros((3, 3)), np.ones((2, 3)), "3 origins but 2 directions"),
    ],
)
def test_bad_rays_are_refused(tracer, origin, direction, message):
    with pytest.raises(ValueError, match=message):
        tracer.intersect(origin, direction)


def test_what_lies_beyond_the_largest_number_is_a_miss():
    """Between two such rays there is one whose t is a number still."""
    tracer = Intersector([Plane((0, 0, -10), (0, 0, 1)), Sphere((0, 0, 5), 1.0)])
    length = 2.0**-1020  # exact: t is 10 or 4 times 2**1020, below 2**1024
    rays = [(0, 0, -length), (0, 0, length), (0, 0.9 * length, -0.5 * length)]
    hits = tracer.intersect(np.zeros((3, 3)), rays)
    assert hits.t.tolist() == [10 * 2.0**1020, 4 * 2.0**1020, np.inf]
    assert hits.object_id.tolist() == [0, 1, -1]
    assert hits.status.tolist() == [Status.HIT, Status.HIT, Status.MISS]
    assert tracer.occluded(np.zeros((3, 3)), rays).tolist() == [True, True, False]


def test_spheres_so_far_away_that_they_are_lost_have_finite_points():
    rng = np.random.default_rng(31)
    origin = rng.normal(size=(2000, 3)) * 10.0 ** rng.uniform(15, 59, (2000, 1))
    hits = Intersector([Sphere((0, 0, 0), 1.0)]).intersect(origin, -origin)
    assert (hits.status[hits.hit] == Status.TANGENT).all()
    assert np.isfinite(hits.position[hits.hit]).all()
    np.testing.assert_allclose(np.linalg.norm(hits.normal[hits.hit], axis=1), 1.0)


def test_no_curved_surface_no_embree(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex", None)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    hit = Intersector([Sphere((0, 0, 0), 1.0)]).intersect([0, 0, 5], [0, 0, -1])
    assert hit.t[0] == 4.0


@pytest.mark.parametrize("coarse", ["embree", "none"])
def test_rays_do_not_see_the_object_that_they_name(teapot, coarse):
    tracer = Intersector([teapot, Sphere((0, 0, 1.5), 1.0)], coarse=coarse)
    rng = np.random.default_rng(4)
    origins, directions = rng.normal(size=(3000, 3)) * 4, rng.normal(size=(3000, 3))
    directions -= origins
    unseen = rng.integers(-1, 2, 3000).astype(np.int32)
    found = tracer.intersect(origins, directions, unseen=unseen)
    alone = [
        tracer.intersect(origins, directions),
        Intersector([Sphere((0, 0, 1.5), 1.0)]).intersect(origins, directions),
        Intersector([teapot], coarse=coarse).intersect(origins, directions),
    ]
    for name, expected in zip((-1, 0, 1), alone, strict=True):
        rows = unseen == name
        assert rows.any()
        np.testing.assert_array_equal(found.t[rows], expected.t[rows])
