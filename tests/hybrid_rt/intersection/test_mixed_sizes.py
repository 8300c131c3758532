"""What is small beside something of its own class costs a ray no more than alone: counted in nodes."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from hybrid_rt import Box, Intersector, Sphere, Status, TriangleMesh, demo
from hybrid_rt.intersection.members import MOST_FRAMES, in_frames
from meshing import BezierPatches

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


def test_patches_that_rounding_has_moved_are_told_from_other_primitives():
    net = np.stack([*np.meshgrid([0.0, 1.0], [0.0, 1.0], indexing="ij"), np.zeros((2, 2))], axis=-1)
    moved = BezierPatches.of_pairs([(net, 0.0 * net)], moved=1e-12)
    ball = TriangleMesh(trimesh.creation.icosphere(2, 0.4).apply_translation((0.5, 0.5, 1)))
    o = np.array([(0.5, 0.5, 3.0), (0.05, 0.05, 3.0)])
    hits = Intersector([moved, ball], coarse="none").intersect(o, (0, 0, -1))
    np.testing.assert_array_equal(hits.object_id, [1, 0])
    assert hits.t_bound[0] < 1e-12 < hits.t_bound[1] < 2e-12
