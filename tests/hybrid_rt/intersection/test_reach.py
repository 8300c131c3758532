"""Surfaces rejected in one go: hits keep every bit that they have when each surface is tested."""

import numpy as np
import pytest

from hybrid_rt import Rectangle, Sphere
from hybrid_rt.intersection.coarse.embree import CoarseScene
from hybrid_rt.intersection.kernels.rectangle import (
    offer_parallelogram,
    rectangle_table,
    trace_rectangles,
)
from hybrid_rt.intersection.kernels.search.coarse import rays_to_float32
from hybrid_rt.intersection.kernels.search.nearest import Rays
from hybrid_rt.intersection.kernels.sphere import offer_sphere, sphere_table, trace_spheres
from hybrid_rt.intersection.kind import new_nearest
from meshing.kernels.jit import kernel

N = 4000
COLUMNS = ("t", "t_bound", "object_id", "a", "b", "tangent", "doubt")


@kernel
def each_rectangle(table, rays, best):
    for i in range(rays.origin.shape[0]):
        for k in range(table.object_id.shape[0]):
            offer_parallelogram(i, k, table, rays, best)


@kernel
def each_sphere(table, rays, best):
    for i in range(rays.origin.shape[0]):
        for k in range(table.object_id.shape[0]):
            offer_sphere(i, k, table, rays, best)


def start(t_max):
    best = new_nearest(t_max.copy())
    best.a[:] = best.b[:] = 0.0
    return best


def rays_at(rng, targets, scale):
    """Rays from near and far that aim at points, or just beside them; some begin there."""
    n = len(targets)
    away = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-12, 3, (n, 1)) * scale
    aside = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-18, -1, (n, 1)) * scale
    aside *= rng.random((n, 1)) < 0.7
    origin = targets + away
    direction = targets + aside - origin
    lengths = np.abs(direction).max(axis=1, keepdims=True)
    direction = np.where(lengths > 0.0, direction, [1.0, 0.0, 0.0])
    # As the intersector scales them: the largest component is in [1/2, 1).
    direction *= 2.0 ** -np.ceil(np.log2(np.abs(direction).max(axis=1, keepdims=True) * 1.0000001))
    t_min = np.where(rng.random(n) < 0.1, -1.0, 0.0)
    rays = Rays(origin, direction, t_min, np.empty((0, 4)))
    length = np.linalg.norm(away, axis=1)
    t_max = np.where(rng.random(n) < 0.5, np.inf, length * rng.choice([0.5, 1.0, 2.0], n))
    return rays, np.maximum(t_max, 1e-300)


def assert_same(found, expected):
    # Doubts beyond the nearest root have no effect.
    for hits in (found, expected):
        hits.doubt[hits.doubt > hits.t] = np.inf
    for name in COLUMNS:
        a, b = getattr(found, name), getattr(expected, name)
        assert np.array_equal(a, b), f"{name} of {np.count_nonzero(a != b)} rays"


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e12, 1e-55])
@pytest.mark.parametrize("n", [1, 7, 40])
def test_rectangles(n, scale):
    """Aimed at rims, at corners and along the planes; 40 rectangles take two masks."""
    rng = np.random.default_rng(n)
    corner, u = rng.normal(size=(n, 3)) * 3.0, rng.normal(size=(n, 3))
    v = np.cross(u, rng.normal(size=(n, 3))) * 10.0 ** rng.uniform(-3, 1, (n, 1))
    shapes = [Rectangle(*(scale * np.array(row))) for row in zip(corner, u, v, strict=True)]
    table = rectangle_table(shapes, np.arange(n, dtype=np.int32))
    k = rng.integers(n, size=N)
    place = rng.random((N, 2))
    snap = rng.random((N, 2)) < 0.5
    place[snap] = np.round(place[snap])
    targets = scale * (corner[k] + place[:, :1] * u[k] + place[:, 1:] * v[k])
    rays, t_max = rays_at(rng, targets, scale)
    found, expected = start(t_max), start(t_max)
    trace_rectangles(table, table.object_id.size, rays, found, False)
    each_rectangle(table, rays, expected)
    assert_same(found, expected)
    some = start(t_max)
    trace_rectangles(table, table.object_id.size, rays, some, True)
    assert np.array_equal(some.object_id >= 0, expected.object_id >= 0)
    assert np.count_nonzero(expected.object_id >= 0) > N // 20
    assert np.count_nonzero(np.isfinite(expected.doubt)) > 0


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e12])
@pytest.mark.parametrize("n", [1, 11, 40])
def test_spheres(n, scale):
    """Aimed at silhouettes and through the inside of huge spheres."""
    rng = np.random.default_rng(n)
    radius = 10.0 ** rng.uniform(-2, 3, n)
    center = rng.normal(size=(n, 3)) * 3.0
    shapes = [Sphere(scale * c, scale * r) for c, r in zip(center, radius, strict=True)]
    table = sphere_table(shapes, np.arange(n, dtype=np.int32))
    k = rng.integers(n, size=N)
    normal = rng.normal(size=(N, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rays, t_max = rays_at(rng, scale * (center[k] + radius[k, None] * normal), scale)
    # Half of them touch the sphere there.
    d = rays.direction - (rays.direction * normal).sum(axis=1, keepdims=True) * normal
    size = np.abs(d).max(axis=1, keepdims=True)
    touches = (np.arange(N)[:, None] % 2 == 0) & (size > 1e-3)
    np.copyto(rays.direction, d * 2.0 ** -np.ceil(np.log2(size * 1.0000001)), where=touches)
    along = rays.direction * 10.0 ** rng.uniform(-6, 2, (N, 1)) * scale
    target = scale * (center[k] + radius[k, None] * normal)
    np.copyto(rays.origin, target - along, where=touches)
    found, expected = start(t_max), start(t_max)
    trace_spheres(table, n, rays, found, False)
    each_sphere(table, rays, expected)
    assert_same(found, expected)
    some = start(t_max)
    trace_spheres(table, n, rays, some, True)
    assert np.array_equal(some.object_id >= 0, expected.object_id >= 0)
    assert np.count_nonzero(expected.object_id >= 0) > N // 20
    assert np.count_nonzero(np.isfinite(expected.doubt)) > 0


def test_spheres_whose_squares_underflow():
    """Aimed within 0.9 of the radius: all of them hit."""
    rng = np.random.default_rng(7)
    radius = 1e-162
    table = sphere_table([Sphere((0, 0, 0), radius)], np.zeros(1, np.int32))
    away = rng.normal(size=(300, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    aside = np.cross(away, rng.normal(size=(300, 3)))
    aside *= 0.9 * rng.random((300, 1)) / np.linalg.norm(aside, axis=1, keepdims=True)
    direction = aside - 3.0 * away
    direction *= 2.0 ** -np.ceil(np.log2(np.abs(direction).max(axis=1, keepdims=True) * 1.0000001))
    rays = Rays(3.0 * radius * away, direction, np.zeros(300), np.empty((0, 4)))
    found, expected = start(np.full(300, np.inf)), start(np.full(300, np.inf))
    trace_spheres(table, 1, rays, found, False)
    each_sphere(table, rays, expected)
    assert (expected.object_id == 0).all()
    assert np.array_equal(found.object_id, expected.object_id)
    assert np.array_equal(found.t, expected.t)


def test_box_of_triangles():
    """Embree finds the same triangles when it is not given the rays that miss their box."""
    rng = np.random.default_rng(4)
    vertices = rng.uniform(-1.0, 1.0, (60, 3)) * [1.0, 0.2, 3.0] + [5.0, -2.0, 1.0]
    # Some lie in the sides of the box.
    side = rng.integers(3, size=30)
    vertices[np.arange(30), side] = vertices[:, side].max(axis=0)
    scene = CoarseScene(vertices, rng.permutation(60).reshape(20, 3))
    targets = vertices[rng.integers(60, size=N)] + rng.normal(size=(N, 3)) * 0.5
    origin = targets + rng.normal(size=(N, 3)) * 10.0 ** rng.uniform(-1, 2, (N, 1))
    direction = targets - origin
    t_min = np.zeros(N)
    t_max = np.where(rng.random(N) < 0.3, rng.uniform(0.1, 2.0, N), np.inf)
    found = scene.first(origin, direction, t_min, t_max)
    everywhere = scene.frame._replace(half=np.full(3, 1e30))
    scene.frame, frame = everywhere, scene.frame
    expected = scene.first(origin, direction, t_min, t_max)
    near, away = np.empty((N, 3), np.float32), np.empty((N, 3), np.float32)
    rest = np.empty(N, np.float32), np.empty(N), np.empty(N, np.int64)
    given = rays_to_float32(origin, direction, t_min, t_max, frame, near, away, *rest)
    for a, b in zip(found, expected, strict=True):
        hit = expected.face >= 0
        assert np.array_equal(a[hit], b[hit])
    assert np.array_equal(found.face, expected.face)
    assert np.count_nonzero(found.face >= 0) <= given < 0.8 * N
