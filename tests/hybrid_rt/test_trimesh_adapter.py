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
def test_a_large_or_small_box_is_left_once(size):
    ours = RayMeshIntersector(trimesh.creation.box(extents=(size, size, size)))
    tri, ray = ours.intersects_id([[0.0, 0.0, 0.5 * size]], [[0.0, 0.0, -1.0]])
    # From the top itself: t > 0 excludes the face of departure.
    assert len(tri) == len(ray) == 1
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
