"""What is small beside something of its own class costs a ray no more than alone: counted in nodes."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from hybrid_rt import Box, Intersector, Sphere, Status, Torus, TriangleMesh, demo
from hybrid_rt.intersection.members import MOST_FRAMES, by_size, in_frames
from meshing import BezierPatches, Cylinder

X, Z = np.array([1, 0, 0]), np.array([0, 0, 1])


def boxes(centres, sizes):
    half = 0.5 * np.broadcast_to(sizes, len(centres))[:, None]
    return np.stack([centres - half, centres + half], axis=1)


def spread(n, extent=1.0, seed=0):
    return np.random.default_rng(seed).uniform(-extent, extent, (n, 3))


def test_things_of_like_size_share_a_frame():
    (group,) = in_frames(boxes(spread(500), np.geomspace(1e-2, 1.0, 500)))
    np.testing.assert_array_equal(group, np.arange(500))


def test_small_things_have_a_frame_for_each_cluster():
    """Sizes from 1e-9 to 1e9, and two clusters that lie far from each other."""
    clusters = [spread(20, 1e-9), spread(30) + X * 1e3, spread(40) - X * 1e6, [[0, 0, 0]]]
    sizes = np.repeat([1e-10, 0.1, 0.2, 1e9], [len(c) for c in clusters])
    groups = in_frames(boxes(np.concatenate(clusters), sizes))
    first = np.cumsum([0, *(len(c) for c in clusters)])
    wanted = {tuple(range(a, b)) for a, b in pairwise(first)}
    assert {tuple(group) for group in groups} == wanted


def test_frames_are_few():
    """Specks all over a room lie in one frame: each its own would cost rays more."""
    assert len(in_frames(boxes(spread(2000), 1e-6))) == 1
    assert len(in_frames(boxes(spread(MOST_FRAMES + 1) * 1e6, 1e-3))) == 1
    assert len(in_frames(boxes(spread(MOST_FRAMES) * 1e6, 1e-3))) == MOST_FRAMES


def test_few_small_things_are_no_group():
    """A tree that tells them apart is not worth its call."""
    clusters = np.concatenate([spread(20), spread(7) + 1e6 * X])
    rest, group = in_frames(boxes(clusters, 0.1), few=8)
    np.testing.assert_array_equal(group, np.arange(20))
    np.testing.assert_array_equal(rest, 20 + np.arange(7))


def test_each_size_of_which_there_are_many_has_trees():
    sizes = np.repeat([1.0, 1e3, 1e6, 1e9], [100, 40, 50, 9])
    groups = by_size(sizes, 10)
    assert [len(group) for group in groups] == [9, 50, 40, 100]
    np.testing.assert_array_equal(np.sort(np.concatenate(groups)), np.arange(199))


def flat_patch(size, height):
    along = np.linspace(-size, size, 4)
    net = np.stack([*np.meshgrid(along, along, indexing="ij"), np.full((4, 4), height)], axis=-1)
    return BezierPatches([net])


def mesh_of(vertices, faces):
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def plate(size, height):
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]) * size
    return mesh_of(corners + height * Z, [(0, 1, 2), (0, 2, 3)])


def ball_of_triangles():
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 61), np.linspace(0, np.pi, 31))
    points = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1).reshape(-1, 3)
    k = np.add.outer(61 * np.arange(30), np.arange(60)).ravel()
    return mesh_of(points, np.concatenate([np.c_[k, k + 61, k + 1], np.c_[k + 1, k + 61, k + 62]]))


SCENES = {
    "patches": ([demo.teapot()], lambda s: flat_patch(4.0 * s, -0.01)),
    "meshes": ([ball_of_triangles()], lambda s: plate(4.0 * s, -1.5)),
    "spheres": (
        [Sphere(place, 0.02) for place in spread(300)],
        lambda s: Sphere((0, 0, 3.0 + 4.0 * s), 0.02),
    ),
    "boxes": (
        [Box(place - 0.02, place + 0.02) for place in spread(300)],
        lambda s: Box((4 * s, 0, 0), (4 * s + 1, 1, 1)),
    ),
}


@pytest.mark.parametrize("size", [1e6, 1e9])
@pytest.mark.parametrize("name", SCENES)
def test_a_large_or_far_thing_of_the_same_class_adds_few_nodes(name, size):
    things, other = SCENES[name]
    rng = np.random.default_rng(2)
    low = np.min([thing.bounds[0] for thing in things], axis=0)
    high = np.max([thing.bounds[1] for thing in things], axis=0)
    targets = rng.uniform(low, high, (4000, 3))
    origins = targets + 5.0 * rng.normal(size=(4000, 3))

    def nodes(surfaces):
        tracer = Intersector(surfaces, coarse="none")
        hits = tracer.intersect(origins, targets - origins)
        return hits, tracer.counters["nodes"]

    alone, of_things = nodes(things)
    hits, of_all = nodes([*things, other(size)])
    # One node of the other's frame for each ray.
    assert of_all <= 1.3 * (of_things + 4000)
    same = hits.object_id == alone.object_id
    np.testing.assert_array_equal(hits.t[same], alone.t[same])
    # Whatever differs is hidden by the other, or hides nothing.
    assert (hits.object_id[~same] == len(things)).all()


@pytest.mark.parametrize("size", [1e6, 1e9])
def test_large_faces_in_a_mesh_add_few_nodes(size):
    ball, floor = ball_of_triangles(), plate(4.0 * size, -1.5)
    faces = np.concatenate([ball.faces, floor.faces + len(ball.vertices)])
    both = mesh_of(np.concatenate([ball.vertices, floor.vertices]), faces)
    rng = np.random.default_rng(2)
    targets = rng.uniform(-1.0, 1.0, (4000, 3))
    origins = targets + 5.0 * rng.normal(size=(4000, 3))
    one, two = (Intersector(s, coarse="none") for s in ([both], [ball, floor]))
    hits = one.intersect(origins, targets - origins)
    apart = two.intersect(origins, targets - origins)
    # The band counts by the size of the whole mesh, and boxes are widened by it.
    assert one.counters["nodes"] <= 2.5 * two.counters["nodes"]
    assert (np.unique(hits.status[hits.status != apart.status]) == [Status.TANGENT]).all()
    np.testing.assert_array_equal(hits.t, apart.t)
    shift = np.where(apart.object_id == 1, len(ball.faces), 0)
    np.testing.assert_array_equal(hits.patch_id, apart.patch_id + shift)


def rays_at(bounds, n=4000):
    rng = np.random.default_rng(2)
    targets = rng.uniform(*bounds, (n, 3))
    origins = targets + 5.0 * rng.normal(size=(n, 3))
    return origins, targets - origins


def assert_same_but_for_objects(one, two, columns):
    for column in columns:
        np.testing.assert_array_equal(getattr(one, column), getattr(two, column), err_msg=column)


ALL_BUT_OBJECTS = ("t", "u", "v", "position", "normal", "status", "flags", "t_bound", "residual")


@pytest.mark.parametrize("size", [1e5, 1e9])
@pytest.mark.parametrize("coarse", ["none", "embree"])
def test_patches_of_one_object_have_frames_by_size(size, coarse):
    """The same hits, to the bit, and the same work as of two objects."""
    pot, floor = demo.teapot(), flat_patch(4.0 * size, -0.01)
    both = BezierPatches([*pot.patches, *floor.patches])
    one, two = (Intersector(s, coarse=coarse, threads=1) for s in ([both], [pot, floor]))
    rays = rays_at(pot.bounds)
    hits, apart = one.intersect(*rays), two.intersect(*rays)
    if coarse == "none":  # else the triangles of one object are as coarse as it is large
        assert one.counters["nodes"] == two.counters["nodes"]
        assert one.counters["slow_pieces"] == two.counters["slow_pieces"]
    assert_same_but_for_objects(hits, apart, ALL_BUT_OBJECTS)
    shift_of_floor = np.where(apart.object_id == 1, len(pot), 0)
    np.testing.assert_array_equal(hits.patch_id, apart.patch_id + shift_of_floor)
    np.testing.assert_array_equal(one.occluded(*rays, 0.9), two.occluded(*rays, 0.9))


def test_refined_patches_of_one_object_have_frames_by_size():
    pot, floor = demo.teapot(), flat_patch(4e5, -0.01)
    both = BezierPatches([*pot.patches, *floor.patches])
    one, two = (
        Intersector(s, "refined", tolerance=0.02, threads=1) for s in ([both], [pot, floor])
    )
    hits, apart = (tracer.intersect(*rays_at(pot.bounds)) for tracer in (one, two))
    assert_same_but_for_objects(hits, apart, ALL_BUT_OBJECTS)


def groups_of(make, n=30):
    """Return things in n groups, 1e6 apart."""
    return [make(at) for k in range(n) for at in spread(10, 1.0, seed=k) + 1e6 * k * X]


MANY_GROUPS = {
    "spheres": lambda: groups_of(lambda at: Sphere(at, 0.1)),
    "boxes": lambda: groups_of(lambda at: Box(at - 0.1, at + 0.1)),
    "tori": lambda: groups_of(lambda at: Torus(at, Z, 0.1, 0.05)),
    "cylinders": lambda: groups_of(lambda at: Cylinder(at, Z, 0.1, 0.2)),
    "patches": lambda: [
        flat_patch(0.2, 0.0).transformed(shift(at))
        for at in np.concatenate([spread(10, seed=k) + 1e6 * k * X for k in range(30)])
    ],
    "two kinds": lambda: (
        groups_of(lambda at: Sphere(at, 0.1), 12) + groups_of(lambda at: Box(at, at + 0.1), 12)
    ),
}


def shift(at):
    matrix = np.eye(4)
    matrix[:3, 3] = at
    return matrix


@pytest.mark.parametrize("coarse", ["none", "embree"])
@pytest.mark.parametrize("name", MANY_GROUPS)
def test_one_walk_through_many_trees_finds_what_each_finds(name, coarse, monkeypatch):
    """To the bit; it looks into a tenth of the nodes, as all others are far away."""
    things = MANY_GROUPS[name]()
    walk = Intersector(things, coarse=coarse, threads=1)
    monkeypatch.setattr("hybrid_rt.intersection.walks.MANY_TREES", 10**9)
    monkeypatch.setattr("hybrid_rt.intersection.intersector.MANY_TREES", 10**9)
    apart = Intersector(things, coarse=coarse, threads=1)
    rays = rays_at(np.array([(-1.0, -1, -1), (1, 1, 1)]) + 5e6 * X, 2000)
    hits, others = walk.intersect(*rays), apart.intersect(*rays)
    assert walk.counters["nodes"] <= 0.3 * apart.counters["nodes"]
    every = (*ALL_BUT_OBJECTS, "object_id", "patch_id")
    assert_same_but_for_objects(hits, others, every)
    assert 100 < np.count_nonzero(hits.hit) < 2000
    on = hits[hits.hit]
    away = np.random.default_rng(3).normal(size=on.position.shape)
    assert_same_but_for_objects(
        walk.intersect(on.position, away, source=on),
        apart.intersect(on.position, away, source=on),
        every,
    )
    np.testing.assert_array_equal(walk.occluded(*rays, 0.9), apart.occluded(*rays, 0.9))
    again = pickle.loads(pickle.dumps(walk)).intersect(*rays)
    assert_same_but_for_objects(again, hits, every)


def test_patches_that_rounding_has_moved_are_told_from_other_primitives():
    net = np.stack([*np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij"), np.zeros((2, 2))], axis=-1)
    moved = BezierPatches.of_pairs([(net, 0.0 * net)], moved=1e-12)
    ball = TriangleMesh(trimesh.creation.icosphere(2, 0.4).apply_translation((0.5, 0.5, 1)))
    o = np.array([(0.5, 0.5, 3.0), (0.05, 0.05, 3.0)])
    hits = Intersector([moved, ball], coarse="none").intersect(o, (0, 0, -1))
    np.testing.assert_array_equal(hits.object_id, [1, 0])
    assert hits.t_bound[0] < 1e-12 < hits.t_bound[1] < 2e-12
