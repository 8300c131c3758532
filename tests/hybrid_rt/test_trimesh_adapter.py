"""The trimesh adapter in situations that trimesh tests its own ray queries with."""

import numpy as np
import pytest
import trimesh

from hybrid_rt.trimesh_adapter import RayMeshIntersector
from meshing import SurfaceOfRevolution


@pytest.fixture
def cube():
    return trimesh.creation.box(extents=(2, 2, 2))


def test_a_ray_through_a_vertex_leaves_the_cube_once(cube):
    ours = RayMeshIntersector(cube)
    origins = np.zeros_like(cube.vertices)
    assert ours.intersects_any(origins, cube.vertices).all()
    _, ray, _ = ours.intersects_location(origins, cube.vertices)
    assert np.array_equal(np.sort(ray), np.arange(8))


def test_hits_lie_on_rays_and_faces(cube):
    ours = RayMeshIntersector(cube)
    x = np.linspace(-0.98, 0.98, 50)
    origins = np.array([(a, b, -100.0) for a in x for b in x])
    directions = np.tile([0.0, 0.0, 1.0], (len(origins), 1))
    places, ray, tri = ours.intersects_location(origins, directions)
    assert np.array_equal(np.bincount(ray), np.full(len(origins), 2))
    # Points are weighted means of corners: two roundings.
    assert np.abs(places[:, :2] - origins[ray, :2]).max() < 1e-15
    assert np.abs(np.abs(places[:, 2]) - 1.0).max() < 1e-15
    # Each point is on the plane of the face that is named.
    corner = cube.triangles[tri, 0]
    assert np.abs(np.einsum("ij,ij->i", places - corner, cube.face_normals[tri])).max() < 1e-15


def test_first_hits_see_the_near_side_and_all_hits_both(cube):
    ours = RayMeshIntersector(cube)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.05, 0.05, 64)] * 2), axis=-1).reshape(-1, 2)
    directions = np.column_stack([grid, np.ones(len(grid))])
    origins = np.tile([0.0, 0.0, -15.0], (len(grid), 1))
    first, _ = ours.intersects_id(origins, directions, multiple_hits=False)
    both, _ = ours.intersects_id(origins, directions, multiple_hits=True)
    assert len(np.unique(first)) == 2
    assert len(np.unique(both)) == 4


def test_points_inside_and_outside(cube):
    ours = RayMeshIntersector(cube)
    assert ours.contains_points(cube.vertices / 1.5).all()
    assert ours.contains_points([cube.center_mass]).all()
    assert not ours.contains_points(cube.vertices * 1.5).any()
    assert not ours.contains_points(np.random.default_rng(1).uniform(2, 100, (30, 3))).any()


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e7])
def test_a_box_of_any_size_is_met_twice_also_from_its_top(size):
    ours = RayMeshIntersector(trimesh.creation.box(extents=(size, size, size)))
    tri, ray = ours.intersects_id([[0.0, 0.0, 0.5 * size]], [[0.0, 0.0, -1.0]])
    # trimesh's engines count the face that a ray starts on.
    assert len(tri) == len(ray) == 2
    ahead = ours.intersector.intersect_all([[0.0, 0.0, 0.5 * size]], [[0.0, 0.0, -1.0]])
    assert ahead.hits.t.tolist() == [size]
    tri, _ = ours.intersects_id([[0.0, 0.0, size]], [[0.0, 0.0, -1.0]])
    assert len(tri) == 2


def test_queries_that_find_nothing_return_empty_arrays(cube):
    ours = RayMeshIntersector([cube, SurfaceOfRevolution([(0, 1), (1, 1)], (0, 0, 5), (0, 0, 1))])
    origins, directions = np.full((10, 3), 50.0), np.tile([0.0, 1.0, 0.0], (10, 1))
    places, ray, tri = ours.intersects_location(origins, directions)
    assert places.shape == (0, 3)
    assert ray.shape == tri.shape == (0,)
    assert np.array_equal(ours.intersects_first(origins, directions), np.full(10, -1))
    assert not ours.intersects_any(origins, directions).any()


def test_trimeshs_own_search_for_what_contains_a_point_runs_on_it():
    """It reads the engine's mesh, and its primitives are meshes as well."""
    ball = trimesh.primitives.Sphere(radius=2.0)
    points = np.random.default_rng(4).uniform(-3.0, 3.0, (500, 3))
    distance = np.linalg.norm(points, axis=1)
    points, distance = points[abs(distance - 2.0) > 0.1], distance[abs(distance - 2.0) > 0.1]
    found = trimesh.ray.ray_util.contains_points(RayMeshIntersector(ball), points)
    assert np.array_equal(found, distance < 2.0)


def test_primitives_take_it_as_their_engine_while_they_are_made(monkeypatch):
    monkeypatch.setattr(trimesh.ray.ray_pyembree, "RayMeshIntersector", RayMeshIntersector)
    box = trimesh.primitives.Box(extents=(2, 2, 2))
    assert isinstance(box.ray, RayMeshIntersector)
    assert box.ray.intersects_any([[0, 0, 5]], [[0, 0, -1]]).all()


def test_a_mesh_that_is_changed_is_looked_at_anew(cube):
    ours = RayMeshIntersector(cube, scale_to_box=False)
    cube.apply_translation((10, 0, 0))  # before anything was built
    assert not ours.intersects_any([[0, 0, 5]], [[0, 0, -1]]).any()
    cube.apply_translation((-10, 0, 0))
    assert ours.intersects_any([[0, 0, 5]], [[0, 0, -1]]).all()
    assert ours.intersector is ours.intersector


def test_the_cavity_of_a_body_is_outside():
    outer, inner = trimesh.creation.box(), trimesh.creation.box(extents=(0.1, 0.1, 0.1))
    inner.invert()
    ours = RayMeshIntersector(trimesh.util.concatenate([outer, inner]))
    assert ours.contains_points([(0, 0, 0), (0.2, 0, 0), (2, 0, 0)]).tolist() == [
        False,
        True,
        False,
    ]


def test_a_stack_of_plates_is_crossed_as_often_as_by_trimesh():
    plates = [trimesh.creation.box(extents=(2, 2, 0.5)) for _ in range(30)]
    for k, plate in enumerate(plates):
        plate.apply_translation((0, 0, k))
    mesh = trimesh.util.concatenate(plates)
    o, d = [[0.1, 0.2, 50.0], [5.0, 0.0, 0.0]], [[0, 0, -1], [0, 0, 1]]
    theirs = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh).intersects_id(o, d)
    ours = RayMeshIntersector(mesh).intersects_id(o, d)
    assert [len(found) for found in ours] == [60, 60] == [len(found) for found in theirs]
    assert RayMeshIntersector(mesh).intersects_first(o, d).dtype == np.int64


def test_bodies_that_touch_are_told_apart_as_items_of_the_geometry():
    left, right = trimesh.creation.box(), trimesh.creation.box()
    right.apply_translation((1, 0, 0))
    points = np.random.default_rng(1).uniform((-1, -1, -1), (2, 1, 1), (1000, 3))
    inside = (abs(points - (0.5, 0, 0)) < (1.0, 0.5, 0.5)).all(axis=1)
    assert np.array_equal(RayMeshIntersector([left, right]).contains_points(points), inside)


def test_what_is_no_geometry_is_named():
    with pytest.raises(TypeError, match=r"geometry\[1\] is 'cube': pass a trimesh"):
        RayMeshIntersector([trimesh.creation.box(), "cube"])
    with pytest.raises(ValueError, match="accuracy is 'exact'"):
        RayMeshIntersector(trimesh.creation.box(), accuracy="exact")
