"""Surfaces in many places: every row holds for the exact image, and costs grow as the logarithm."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid_rt import (
    Asphere,
    Box,
    Cylinder,
    Extrusion,
    Instances,
    Intersector,
    NamedPoints,
    Plane,
    Rectangle,
    Sphere,
    Status,
    Torus,
    TriangleMesh,
    TrimmedSurface,
    circle,
    demo,
)
from proof.cases.placed import placed
from proof.cases.rational_surfaces import octants
from proof.cases.rays import hard_rays
from proof.cases.scenes import patches_of_mixed_degrees
from proof.cases.trimmed_surfaces import trimmed_patch
from proof.exact.judge import ExactJudge
from proof.surfaces.instances import one_by_one

VERTICES = np.array([(0, 0, 0), (1, 0.1, 0.2), (0.3, 1.1, -0.3), (0.2, 0.4, 1.3)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
MESH = TriangleMesh(SimpleNamespace(vertices=VERTICES, faces=FACES))
HOLE = [circle((0.4, 0.5), 0.3)]
TURN = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
# Those of which exact arithmetic decides a ray within milliseconds.
QUICK = {
    "sphere": Sphere((0.1, 0.7, -0.3), 0.9),
    "torus": Torus((0.1, 0.7, -0.3), (0, 0, 1), 0.8, 0.3),
    "asphere": Asphere(1.7, -1.0, (0.0, -0.06), 1.6, (0.1, 0.7, -0.3), (0, 0, 1)),
    "rectangle": Rectangle((0.1, 0.7, -0.3), (1.1, 0.2, 0), (0.3, -0.4, 0.9)),
    "box": Box((0.1, 0.7, -0.3), (0.6, 1.9, 0.4)),
    "mesh": MESH,
    "turned": demo.vase(0, 0, 1),
    "trimmed sphere": TrimmedSurface(Sphere((0.1, 0.7, -0.3), 0.9), HOLE),
}
SLOW = {
    "turned box": Box((0.1, 0.7, -0.3), (0.6, 1.9, 0.4)).transformed(
        np.block([[TURN, np.ones((3, 1))], [np.zeros((1, 3)), 1.0]])
    ),
    "patches": patches_of_mixed_degrees(),
    "rational": octants(),
    "extrusion": Extrusion([(0, 0, 0), (1, 0, 0), (1, 1, 0)], (0, 0, 1)),
    "cylinder": Cylinder((0, 0, 0), (0, 0, 1), 0.7, 1.2),
    "trimmed patch": trimmed_patch(),
}
SEVERAL = [QUICK["sphere"], QUICK["box"], MESH, SLOW["rational"], SLOW["trimmed patch"]]


def similarities(rng, n, scale=1.0, spread=2.0, far=0.0):
    """Matrices (n, 3, 4): turned, every second mirrored, about a point ``far`` from 0."""
    turn = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    turn[1::2] *= -1.0
    # As far from similarities as they may be; a copy is moved by that.
    turn *= 1.0 + 1e-13 * rng.uniform(-1, 1, (n, 3, 3))
    shift = far * rng.uniform(-1, 1, 3) + spread * rng.uniform(-1, 1, (n, 3))
    return np.concatenate([scale * turn, shift[:, :, None]], axis=2)


def copies_of(instances):
    return [image for k in range(len(instances.matrices)) for image in instances.surface_in(k)]


def trace(surfaces, *rays, **limits):
    return Intersector(surfaces, coarse="none", threads=1).intersect(*rays, **limits)


def rays_through(rng, bounds, n):
    low, high = bounds
    o = rng.uniform(low - (high - low), high + (high - low), (n, 3))
    return o, rng.uniform(low, high, (n, 3)) - o


@pytest.mark.parametrize(
    ("scale", "far", "aside"),
    [(1e-3, 0, 0), (1, 0, 0), (1e3, 0, 0), (1e-3, 1e6, 0), (1e3, 1e6, 0), (1, 0, 1e5)],
)
@pytest.mark.parametrize("name", QUICK)
def test_rows_hold_for_the_exact_image(name, scale, far, aside):
    """``aside``: the surface is given far from 0, and matrices bring it back."""
    rng = np.random.default_rng(7)
    shift = aside * np.array([1.0, -0.7, 0.4])
    given = placed(QUICK[name], np.block([[np.eye(3), shift[:, None]], [np.zeros(3), 1.0]]))
    given.moved = 0.0
    matrices = similarities(rng, 2, scale, 1.5 * scale, far)
    matrices[:, :, 3] -= matrices[:, :, :3] @ shift
    instances = Instances(given, matrices)
    rays = hard_rays(copies_of(instances), 24, 11)
    hits = trace(instances, rays.origins, rays.directions)
    several, named = one_by_one(instances, hits)
    verdict = ExactJudge(several).judge(named, rays.origins, rays.directions, marks=False)
    # At an edge of a box rounding may name the face beside that which the exact ray meets, within the bound.
    assert verdict.n_wrong == verdict.bounds_broken == verdict.off_ray == 0
    assert hits.hit.sum() > 3


@pytest.mark.parametrize("given", [*QUICK.values(), *SLOW.values(), SEVERAL],
                         ids=[*QUICK, *SLOW, "several"])  # fmt: skip
def test_hits_are_those_of_transformed_copies(given):
    rng = np.random.default_rng(5)
    instances = Instances(given, similarities(rng, 12))
    ball = Sphere((0, 0, 0), 0.4)
    copies = [ball, *copies_of(instances)]
    one, other = (Intersector(x, coarse="none", threads=1) for x in ([ball, instances], copies))
    o, d = rays_through(rng, instances.bounds, 400)
    a, b = one.intersect(o, d), other.intersect(o, d)
    np.testing.assert_array_equal(a.hit, b.hit)
    met = np.flatnonzero(a.hit)
    assert (np.abs(a.t[met] - b.t[met]) <= a.t_bound[met] + b.t_bound[met]).all()
    np.testing.assert_array_equal(a.object_id, np.sign(b.object_id))
    n = len(instances.surfaces)
    np.testing.assert_array_equal(
        a.instance_id, np.where(b.object_id > 0, (b.object_id - 1) // n, -1)
    )
    on = np.flatnonzero(a.instance_id >= 0)
    place, member, own = instances.split(a.patch_id[on])
    np.testing.assert_array_equal(place, a.instance_id[on])
    np.testing.assert_array_equal(member, (b.object_id[on] - 1) % n)
    np.testing.assert_array_equal(own, b.patch_id[on])
    # Points are rounded where they lie, and t that is rounded moves them along flat rays.
    cosine = np.einsum("ij,ij->i", a.normal[met], b.normal[met])
    # A copy of a box has its normals outside even if it is mirrored.
    has_box = any(isinstance(surface, Box) for surface in instances.surfaces)
    np.testing.assert_allclose(np.abs(cosine) if has_box else cosine, 1.0, atol=1e-12)
    np.testing.assert_allclose(a.position[met], b.position[met], atol=1e-9)
    where = a.u[on], a.v[on], a.patch_id[on]
    np.testing.assert_allclose(instances.point(*where), a.position[on], atol=1e-14)
    np.testing.assert_allclose(instances.normal(*where), a.normal[on], atol=1e-12)
    np.testing.assert_array_equal(one.occluded(o, d), other.occluded(o, d))
    np.testing.assert_array_equal(one.intersect_all(o, d).count, other.intersect_all(o, d).count)
    # --- and of rays that leave them
    on = on[: min(on.size, 100)]
    away = rng.normal(size=(on.size, 3))
    a, b = (
        tracer.intersect(x.position[on], away, source=x[on]) for tracer, x in ((one, a), (other, b))
    )
    np.testing.assert_array_equal(a.hit, b.hit)
    np.testing.assert_allclose(a.t[a.hit], b.t[a.hit], rtol=1e-9, atol=1e-9)


def test_bits_depend_on_neither_threads_nor_batches():
    rng = np.random.default_rng(3)
    instances = [Instances(SEVERAL, similarities(rng, 40, spread=8.0)) for _ in range(2)]
    o, d = rays_through(rng, instances[0].bounds, 6000)
    whole = trace(instances, o, d)
    threads = Intersector(instances, coarse="none", threads=3).intersect(o, d)
    parts = Intersector(instances, coarse="embree", threads=1)
    halves = [parts.intersect(o[k::2], d[k::2]) for k in (0, 1)]
    for name in whole.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(whole, name), getattr(threads, name))
        for k in (0, 1):
            np.testing.assert_array_equal(getattr(whole, name)[k::2], getattr(halves[k], name))
    assert whole.hit.mean() > 0.2


def test_ties_go_to_the_lower_object_then_the_lower_place():
    rng = np.random.default_rng(8)
    matrices = np.tile(np.eye(4), (5, 1, 1))
    matrices[[0, 2], 2, 3] = -20.0
    balls = Instances(Sphere((0, 0, 0), 1), matrices)
    o = 4.0 * rng.normal(size=(50, 3))
    hits = trace([balls, Sphere((0, 0, 0), 1)], o, -o)
    assert set(hits.object_id) == {0}
    assert set(hits.instance_id) == {1}
    hits = trace([Sphere((0, 0, 0), 1), balls], o, -o)
    assert set(hits.object_id) == {0}
    assert set(hits.instance_id) == {-1}


def test_a_point_that_is_left_is_left_out_on_touching_places_too():
    # A wall of cubes, side by side.
    matrices = np.tile(np.eye(4), (4, 1, 1))
    matrices[:, 0, 3] = np.arange(4.0)
    wall = Intersector(Instances(Box((0, 0, 0), (1, 1, 1)), matrices), coarse="none", threads=1)
    hits = wall.intersect([(0.5, 0.5, 3.0), (1.0, 0.5, 3.0)], (0, 0, -1))
    np.testing.assert_array_equal(hits.t, 2.0)
    up = wall.intersect(hits.position, (0, 0, 1), source=hits)
    assert not up.hit.any()
    down = wall.intersect(hits.position, (0.1, 0, -1), source=hits)
    np.testing.assert_allclose(down.position[:, 2], 0.0, atol=1e-15)
    np.testing.assert_array_equal(down.instance_id, [0, 1])
    # Of the other places nothing is left out: a cube above, and the gap between them.
    matrices[1, :3, 3] = 0.0, 0.0, 2.0
    two = Intersector(Instances(Box((0, 0, 0), (1, 1, 1)), matrices), coarse="none", threads=1)
    hits = two.intersect((0.5, 0.5, 1.5), (0, 0, -1))
    above = two.intersect(hits.position, (0, 0, 1), source=hits)
    assert (above.t, above.instance_id) == (1.0, 1)
    assert not two.occluded(hits.position, (0, 0, 1), 1.0, source=hits).any()


def test_rays_that_leave_an_edge_between_two_places_are_in_doubt():
    # A step of two cubes: the upper one stands on the lower one, flush with nothing but this edge.
    matrices = np.tile(np.eye(4), (2, 1, 1))
    matrices[1, :3, 3] = 0.5, 0.0, 1.0
    given = Instances(Box((0, 0, 0), (1, 1, 1)), matrices)
    d = np.tile([(-0.3, 0.1, 0.5), (0.3, 0.1, 0.5)], (2, 1))
    o = np.array([(0.5, 0.5, 1.0), (0.5, 0.5, 1.0), (0.4, 0.5, 1.0), (0.4, 0.5, 1.0)])
    for surfaces in (given, copies_of(given)):
        hits = trace(surfaces, o, d, source=NamedPoints(np.zeros(4, np.int32), o))
        assert (hits.status[:2] == Status.TANGENT).all()
        np.testing.assert_array_equal(hits.status[2:], [Status.MISS, Status.HIT])


def test_an_object_that_is_not_seen_is_so_in_all_places():
    balls = Instances(Sphere((0, 0, 0), 1), similarities(np.random.default_rng(1), 9))
    tracer = Intersector([Sphere((0, 0, 0), 0.1), balls], coarse="none", threads=1)
    o = np.tile([0.0, 0.0, 9.0], (2, 1))
    hits = tracer.intersect(o, -o, unseen=np.array([1, -1]))
    np.testing.assert_array_equal(hits.object_id, [0, 1])


def test_limits_are_those_of_the_world():
    ball = Instances(Sphere((0, 0, 0), 1), [np.diag([8.0, 8, 8, 1]), np.diag([0.3, 0.3, 0.3, 1])])
    o, d = (0.0, 0, 20.0), (0.0, 0, -3.0)
    assert trace(ball, o, d).t == 4.0
    inner = 19.7 / 3.0
    for limits, t, status in (
        ({"t_min": 4.0}, inner, Status.HIT),  # the root at t_min is none
        ({"t_max": 4.0 - 1e-9}, np.inf, Status.MISS),
        ({"t_max": 4.0 + 1e-16}, np.inf, Status.TANGENT),
        ({"t_min": 4.1, "t_max": inner + 1e-9}, inner, Status.HIT),
    ):
        hits = trace(ball, o, d, **limits)
        assert hits.t == pytest.approx(t, rel=1e-14)
        assert hits.status == status or limits == {"t_min": 4.0}


def test_work_grows_as_the_logarithm():
    """Nodes of a ray among 100 and 10 000 balls, as many a length of the ray: twice the levels."""
    nodes = {}
    for side in (5, 22):
        matrices = np.tile(np.eye(4), (side**3, 1, 1))
        grid = np.stack(np.meshgrid(*3 * [np.arange(side)], indexing="ij"), axis=-1)
        matrices[:, :3, 3] = grid.reshape(-1, 3) - 0.5 * (side - 1)
        balls = Intersector(Instances(Sphere((0, 0, 0), 0.4), matrices), coarse="none", threads=1)
        rng = np.random.default_rng(6)
        o = side * rng.normal(size=(2000, 3))
        assert balls.intersect(o, rng.uniform(-0.3, 0.3, o.shape) * side - o).hit.mean() > 0.7
        nodes[side] = balls.counters["nodes"] / 2000
    assert nodes[22] < 3.0 * nodes[5] < 30.0


def test_memory_of_a_place():
    """96 bytes are its matrix, and 8 its scale; nodes of 256 bytes hold 2.5 places or more."""
    surface = demo.vase(0, 0, 1)
    matrices = similarities(np.random.default_rng(9), 5000, 0.01)
    trace(Instances(surface, matrices[:20]), (0, 0, 5), (0, 0, -1))
    tracemalloc.start()
    one = Intersector(Instances(surface, matrices[:1]), coarse="none", threads=1)
    alone = tracemalloc.get_traced_memory()[0]
    many = Intersector(Instances(surface, matrices), coarse="none", threads=1)
    held = tracemalloc.get_traced_memory()[0] - alone
    tracemalloc.stop()
    assert held < 1.2 * alone + 220 * 5000
    assert (
        one.intersect((0, 0, 5), (0, 0, -1)).hit.size
        == many.intersect((0, 0, 5), (0, 0, -1)).hit.size
    )


def with_row(value):
    matrices = np.tile(np.eye(4), (7, 1, 1))
    matrices[4] = value
    return matrices


@pytest.mark.parametrize(
    ("surfaces", "matrices", "words"),
    [
        (MESH, with_row(np.diag([1.0, 2, 1, 1])), r"matrices\[4\] = .*2\.0.* is no similarity \(1 such"),
        (MESH, with_row(np.nan), r"matrices\[4\] = .*nan.* is not finite"),
        (MESH, with_row(np.diag([0.0, 0, 0, 1])), r"matrices\[4\] = .* has scale 0"),
        (MESH, with_row(np.diag([1.0, 1, 1, 2])), r"matrices\[4\] = .* last row \(0, 0, 0, 1\)"),
        (MESH, with_row(np.diag([1e-90, 1e-90, 1e-90, 1])), r"matrices\[4\] makes them .*scale the scene"),
        (MESH, np.eye(4), r"shape \(4, 4\): pass \(n, 4, 4\)"),
        (MESH, np.zeros((0, 3, 4)), "at least one"),
        ([], with_row(np.eye(4)), "at least one surface"),
        (Plane((0, 0, 0), (0, 0, 1)), with_row(np.eye(4)), "unbounded: pass it by itself"),
        (Instances(MESH, [np.eye(4)]), with_row(np.eye(4)), "the products of both matrices"),
        ([MESH, 5], with_row(np.eye(4)), r"surfaces\[1\] is 5: pass surfaces"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(surfaces, matrices, words):
    with pytest.raises((TypeError, ValueError), match=words):
        Instances(surfaces, matrices)


def test_images_of_instances_are_instances():
    rng = np.random.default_rng(10)
    instances = Instances(SEVERAL[:3], similarities(rng, 6))
    by = np.vstack([similarities(rng, 1, 2.5, far=3.0)[0], [0, 0, 0, 1]])
    image = instances.transformed(by)
    o, d = rays_through(rng, instances.bounds, 300)
    a, b = trace(instances, o, d), trace(image, o @ by[:3, :3].T + by[:3, 3], d @ by[:3, :3].T)
    np.testing.assert_array_equal(a.instance_id, b.instance_id)
    np.testing.assert_allclose(a.t[a.hit], b.t[b.hit], rtol=1e-12)
    np.testing.assert_array_equal(
        trace(instances.flipped(), o, d).front_face, a.hit & ~a.front_face
    )


def test_patches_and_places_that_there_are_not_are_named():
    few, many = (Instances(Sphere((0, 0, 0), 0.2), np.eye(4) + k) for k in (steps(2), steps(5)))
    with pytest.raises(IndexError, match="patch_id holds 2: pass 0 to 1"):
        few.split([0, 2])
    with pytest.raises(IndexError, match="holds -1: pass 0 to 1, not those of misses"):
        few.split(-1)
    rays = np.array([(4.0, 0.0, 5.0)]), np.array([(0.0, 0.0, -1.0)])
    hits = Intersector(many).intersect(*rays)
    with pytest.raises(ValueError, match="source names place 4 of surface 0, which has 2"):
        Intersector(few).intersect(*rays, source=hits)


def steps(n):
    """Translations along x by 0, 1, 2 ..., less the identity."""
    moved = np.zeros((n, 4, 4))
    moved[:, 0, 3] = np.arange(n)
    return moved
