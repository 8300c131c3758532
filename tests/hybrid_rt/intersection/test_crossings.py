"""All crossings: parity on closed bodies, counts from closed forms, trimesh's interface."""

import numpy as np
import pytest
import trimesh
from hard_rays import assert_crossings_are_exact
from trimesh.ray.ray_pyembree import RayMeshIntersector as Embree

from hybrid_rt import Box, Intersector, Sphere, TriangleMesh
from hybrid_rt.demo import teapot, vase
from hybrid_rt.trimesh_adapter import RayMeshIntersector
from proof.cases.rays import chords, edges
from proof.cases.scenes import ellipsoid, torus

CLOSED = {
    "torus": torus,
    "vase": lambda: vase(0, 0, 5),
    "sphere": lambda: Sphere((0.2, 0.1, 0), 1.3),
    "box": lambda: Box((-1, -2, 0), (1, 0.5, 3)),
    "mesh": ellipsoid,
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_bodies_are_left_as_often_as_entered(name):
    surface = CLOSED[name]()
    rays = chords([surface], 20_000, seed=12)
    found = Intersector([surface]).intersect_all(rays.origins, rays.directions)
    touched = np.zeros(20_000, bool)
    touched[found.ray[found.hits.status == 2]] = True
    assert (found.count[~touched] % 2 == 0).all()
    # In and out by turns, with t going up.
    front = found.hits.front_face
    first = found.offsets[:-1][(found.count > 0) & ~touched]
    assert front[first].all()
    same_ray = found.ray[1:] == found.ray[:-1]
    assert (found.hits.t[1:] >= found.hits.t[:-1])[same_ray].all()
    turned = (front[1:] != front[:-1]) | touched[found.ray[1:]]
    assert turned[same_ray].all()


@pytest.mark.parametrize("name", ["torus", "vase", "box", "mesh"])
def test_a_shared_edge_counts_once(name):
    surface = CLOSED[name]()
    rays = edges([surface], 4000, seed=3)
    # From outside: some begin within the body.
    size = np.linalg.norm(surface.bounds[1] - surface.bounds[0])
    origins = rays.origins - 2.0 * size * rays.directions
    found = Intersector([surface]).intersect_all(origins, rays.directions)
    touched = np.zeros(4000, bool)
    touched[found.ray[found.hits.status == 2]] = True
    odd = (found.count[~touched] % 2 == 1).mean()
    # A ray that touches the body at a crease, in and out in one point, has one row there.
    assert odd <= {"vase": 0.03, "mesh": 0.01}.get(name, 0.0)


def test_all_crossings_of_a_turned_torus_are_the_exact_ones():
    surface = torus()
    rays = chords([surface], 300, seed=4)
    assert_crossings_are_exact(surface, rays.origins, rays.directions, {0, 2, 4})


def test_repeated_calls_say_the_same():
    tracer = Intersector([teapot()])
    rays = chords([teapot()], 3000, seed=5)
    found = tracer.intersect_all(rays.origins, rays.directions)
    hits = tracer.intersect(rays.origins, rays.directions)
    assert np.array_equal(found.count > 0, hits.hit)
    first = found.hits[found.offsets[:-1][hits.hit]]
    assert np.array_equal(first.t, hits.t[hits.hit])


def test_trimesh_interface_agrees_with_trimesh():
    mesh = trimesh.creation.icosphere(3)
    rays = chords([TriangleMesh(mesh)], 2000, seed=6)
    o, d = rays.origins, rays.directions
    theirs, ours = Embree(mesh), RayMeshIntersector(mesh)
    assert np.array_equal(theirs.intersects_any(o, d), ours.intersects_any(o, d))
    # At edges either of two faces may be named: almost all are the same.
    assert (theirs.intersects_first(o, d) == ours.intersects_first(o, d)).mean() > 0.999
    for many in (True, False):
        a, b = theirs.intersects_location(o, d, many), ours.intersects_location(o, d, many)
        assert [x.shape for x in a] == [x.shape for x in b]
        assert [x.dtype for x in a] == [x.dtype for x in b]
        order_a = np.lexsort((((a[0] - o[a[1]]) ** 2).sum(axis=1), a[1]))
        order_b = np.lexsort((((b[0] - o[b[1]]) ** 2).sum(axis=1), b[1]))
        # Embree's points are good to float32.
        assert np.abs(a[0][order_a] - b[0][order_b]).max() < 1e-4
        assert np.array_equal(a[1][order_a], b[1][order_b])
    tri, ray, places = ours.intersects_id(o, d, max_hits=1, return_locations=True)
    assert len(tri) == len(ray) == len(places) == ours.intersects_any(o, d).sum()


def test_contains_points_of_a_curved_body():
    ours = RayMeshIntersector(torus())
    rng = np.random.default_rng(8)
    points = rng.uniform(-1.5, 1.5, (2000, 3))
    surface = torus()
    z = (points - surface.origin) @ surface.axis
    rho = np.linalg.norm(points - z[:, None] * surface.axis, axis=1)
    distance = np.hypot(rho - 1.0, z)
    # The arcs are within 3e-4 of circles of radius 0.4.
    clear = np.abs(distance - 0.4) > 1e-3
    assert np.array_equal(ours.contains_points(points)[clear], (distance < 0.4)[clear])


@pytest.mark.parametrize("order", [1, -1])
def test_one_body_is_left_where_another_begins(order):
    boxes = [Box((0, 0, 0), (1, 1, 1)), Box((0, 0, 1), (1, 1, 2))][::order]
    origins = np.random.default_rng(2).uniform((0.1, 0.1, -1), (0.9, 0.9, -1), (50, 3))
    found = Intersector(boxes).intersect_all(origins, (0.01, 0.02, 1.0))
    assert (found.count == 4).all()
    for k in (0, 1):
        front = found.hits.front_face[found.hits.object_id == k].reshape(-1, 2)
        assert (front == (True, False)).all()


@pytest.mark.parametrize("order", [1, -1])
def test_contains_points_of_bodies_that_touch(order):
    """The shared face is left and entered: a point in either body is inside."""
    bodies = [Box((0, 0, 0), (1, 1, 1)), Box((0.2, 0.1, 1), (0.8, 1.5, 2))][::order]
    points = np.random.default_rng(6).uniform(-0.5, 2.5, (3000, 3))
    expected = np.any([((points > b.lo) & (points < b.hi)).all(axis=1) for b in bodies], axis=0)
    assert np.array_equal(RayMeshIntersector(bodies).contains_points(points), expected)
