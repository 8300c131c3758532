"""First hits against closed forms."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import Box, Intersector, Plane, Rectangle, Sphere, TriangleMesh
from meshing import BezierPatches, SurfaceOfRevolution

EPS = 2.0**-52


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_origin_on_a_sphere_finds_the_other_side():
    rng = np.random.default_rng(3)
    normal = unit(rng.normal(size=(5000, 3)))
    tracer = Intersector([Sphere((1.0, 2.0, 3.0), 2.5)])
    hits = tracer.intersect(np.array([1.0, 2.0, 3.0]) + 9.0 * normal, -normal)
    inward = unit(-normal + 0.99 * unit(rng.normal(size=normal.shape)))
    across = tracer.intersect(hits.position, inward, source=hits)
    outward = tracer.intersect(hits.position, -inward, source=hits)
    # The other root is -2 (o - c).d for a unit direction.
    expected = -2.0 * np.einsum("ij,ij->i", hits.position - (1.0, 2.0, 3.0), inward)
    np.testing.assert_allclose(across.t, expected, rtol=0, atol=1e-13)
    assert not outward.hit.any()


def test_boxes_rectangles_and_planes():
    tracer = Intersector(
        [Box((-1, -1, -1), (1, 1, 1)), Rectangle((-3, -3, 5), (6, 0, 0), (0, 6, 0)),
         Plane((0, 0, -4), (0, 0, 2))]
    )  # fmt: skip
    rays = [
        ((-5, 0.25, 0.5), (1, 0, 0), 4.0, 0, 0, (-1, 0, 0)),
        ((0, 0, 0), (0, -0.0, 2), 0.5, 0, 5, (0, 0, 1)),
        ((2, 2, 0), (0, 0, 1), 5.0, 1, 0, (0, 0, 1)),
        ((2.5, 1.25, 0), (0, 0, -2), 2.0, 2, 0, (0, 0, 1)),
        ((5, 5, 0), (0, 0, 1), np.inf, -1, -1, None),
    ]
    origin, direction = (np.array([ray[k] for ray in rays], float) for k in range(2))
    hits = tracer.intersect(origin, direction)
    np.testing.assert_array_equal(hits.t, [ray[2] for ray in rays])
    np.testing.assert_array_equal(hits.object_id, [ray[3] for ray in rays])
    np.testing.assert_array_equal(hits.patch_id, [ray[4] for ray in rays])
    for normal, ray in zip(hits.normal, rays, strict=True):
        if ray[5] is not None:
            np.testing.assert_array_equal(normal, ray[5])
    np.testing.assert_allclose(hits.u[:4], [0.75, 0.5, 5 / 6, 0.5])
    np.testing.assert_allclose(hits.v[:4], [0.625, 0.5, 5 / 6, 0.25])
    np.testing.assert_array_equal(hits.front_face[:4], [True, False, False, True])


def test_no_ray_slips_between_triangles():
    ball = trimesh.creation.icosphere(subdivisions=4)
    rng = np.random.default_rng(5)
    n = 20_000
    origin = 2.0 * unit(rng.normal(size=(n, 3)))
    k = rng.integers(len(ball.vertices), size=n)
    other = ball.vertices[[ball.vertex_neighbors[i][0] for i in k]]
    weight = np.where(rng.random(n) < 0.5, 0.0, rng.random(n))[:, None]
    target = (1.0 - weight) * ball.vertices[k] + weight * other
    for coarse in ("embree", "none"):
        hits = Intersector([TriangleMesh(ball)], coarse=coarse).intersect(origin, target - origin)
        # Only vertices on the silhouette can be passed by: the ray is then tangent to the ball.
        cosine = np.abs(np.einsum("ij,ij->i", unit(target - origin), unit(target)))
        assert hits.hit[cosine > 0.1].all()
        assert (hits.t[hits.hit] <= 1 + 1e-9).all()


def test_ray_along_the_axis_meets_the_pole():
    cone, disc = (
        SurfaceOfRevolution([(z, 0.0), (1.0 - z, 1.0)], (0.5, -0.25, 1.0), (0, 0, 1))
        for z in (0.0, 0.5)
    )
    hits = Intersector([disc, cone], coarse="none").intersect((0.5, -0.25, 9.0), (0, 0, -1))
    assert hits.t[0] == 7.5
    np.testing.assert_allclose(np.abs(hits.normal[0]), (0, 0, 1), atol=1e-15)


@pytest.mark.parametrize("length", [1e-200, 1e-9, 1.0, 1e9, 1e200])
def test_axes_of_any_length_are_scaled_to_one(length):
    tube = SurfaceOfRevolution([(0, 1), (1, 1)], (0, 0, 0), (0, 0, length))
    assert Intersector([tube]).intersect((5, 0, 0.5), (-1, 0, 0)).t[0] == 4.0


def test_the_exit_is_seen_from_behind():
    sphere = Sphere((0.3, -0.2, 0.5), 0.7)
    hits = Intersector([sphere]).intersect(np.tile(sphere.center, (3, 1)), np.eye(3))
    np.testing.assert_allclose(hits.t, 0.7, rtol=1e-15)
    assert not hits.front_face.any()


def test_coincident_spheres_squares_and_patches_tie():
    rng = np.random.default_rng(12)
    d = rng.normal(size=(2000, 3))
    hits = Intersector([Sphere((0, 0, 0), 1)] * 3).intersect(-5 * d, d)
    assert set(hits.object_id.tolist()) == {0}
    square = BezierPatches([[[(-1, -1, 0), (-1, 1, 0)], [(1, -1, 0), (1, 1, 0)]]])
    flat = [square, square, Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))]
    origins = rng.uniform((-0.9, -0.9, 3), (0.9, 0.9, 3), (500, 3))
    for order in ((0, 1, 2), (2, 1, 0)):
        hits = Intersector([flat[k] for k in order]).intersect(origins, (0, 0, -1))
        assert (hits.t == 3.0).all()
        assert (hits.object_id == 0).all()
