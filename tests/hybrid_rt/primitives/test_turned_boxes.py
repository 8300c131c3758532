"""Boxes that are turned or skewed: all that holds for boxes along the axes."""

import itertools
import pickle

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Box,
    Intersector,
    Status,
    TriangleMesh,
)
from proof.exact.crossings import bits, rational
from proof.exact.truth import ExactScene

EPS = 2.0**-52
LO, HI = (-1.0, -0.5, -0.25), (1.0, 1.0, 0.5)


def affine(linear, shift=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, shift
    return matrix


def turn(axis, angle):
    return trimesh.transformations.rotation_matrix(angle, axis)[:3, :3]


TURN = turn((1, 2, 3), 0.7)
MAPS = {
    "turned": affine(TURN, (0.3, -0.2, 0.1)),
    "reflected": affine(TURN @ np.diag([1.0, -1.0, 1.0])),
    "skewed": affine([[1.0, 0.6, 0.2], [0.0, 1.0, -0.4], [0.3, 0.0, 1.0]]),
    "quarter turn": affine([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "far": affine(TURN, (1e5, 2e5, -1e5)),
    "slab": affine(TURN @ np.diag([1e3, 1e3, 1e-3])),
}
NAMES = list(MAPS)


def box(name):
    return Box(LO, HI).transformed(MAPS[name])


def inward_rays(surface, n, seed, spread=1.2):
    rng = np.random.default_rng(seed)
    low, high = surface.bounds
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    origin = middle + 3.0 * half.max() * unit(rng.normal(size=(n, 3)))
    weight = 0.5 + 0.5 * spread * rng.uniform(-1, 1, (n, 3))
    return origin, surface.lo + weight @ surface.edges - origin


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def mesh_of(surface):
    """The same box of twelve triangles, all in float64."""
    steps = np.array(list(itertools.product((0.0, 1.0), repeat=3)))
    hull = trimesh.convex.convex_hull(steps)
    return TriangleMesh(
        trimesh.Trimesh(surface.lo + hull.vertices @ surface.edges, hull.faces, process=False)
    )


@pytest.mark.parametrize("name", NAMES)
def test_hits_are_those_of_the_mesh_and_of_exact_roots(name):
    surface = box(name)
    rays = inward_rays(surface, 20_000, 1)
    hits, of_mesh = Intersector([surface]).intersect(*rays), None
    of_mesh = Intersector([mesh_of(surface)], coarse="none").intersect(*rays)
    certain = (hits.status != Status.TANGENT) & (of_mesh.status != Status.TANGENT)
    assert certain.mean() > 0.999
    np.testing.assert_array_equal(hits.hit[certain], of_mesh.hit[certain])
    assert 0.2 < hits.hit.mean() < 1.0
    rows = np.flatnonzero(hits.hit)[:400]
    scene = ExactScene([surface])
    for i in rows:
        exact = [one.crossing.t for one in scene.crossings(rays[0][i], rays[1][i])]
        with bits(512):
            gap = min(float(abs(t - rational(hits.t[i])).upper()) for t in exact)
        assert gap <= hits.t_bound[i]
    # A few roundings at the size of the scene, and those of the image, over the cosine.
    scale = np.linalg.norm(rays[0][rows] - surface.lo, axis=1) + np.abs(surface.edges).sum()
    length = np.linalg.norm(rays[1][rows], axis=1)
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal[rows], rays[1][rows])) / length
    assert (hits.t_bound[rows] * length <= (64 * EPS * scale + 2.0 * surface.moved) / cosine).all()


@pytest.mark.parametrize("name", NAMES)
def test_points_normals_and_parameters_fit_each_other(name):
    surface = box(name)
    o, d = inward_rays(surface, 5000, 2)
    for solid in (surface, surface.flipped()):
        hits = Intersector([solid]).intersect(o, d)
        rows = np.flatnonzero(hits.hit)
        at = hits.u[rows], hits.v[rows], hits.patch_id[rows]
        size = np.abs(solid.bounds).max()
        assert np.abs(solid.point(*at) - hits.position[rows]).max() <= 16 * EPS * size
        np.testing.assert_array_equal(solid.normal(*at), hits.normal[rows])
        assert (hits.front_face[rows] == (solid.orientation > 0)).all()
        assert hits.residual[rows].max() <= 64 * EPS * (size + np.abs(o).max())
        # S_u x S_v lies along the normal, whatever the map.
        s_u = solid.point(np.ones(6), np.zeros(6), np.arange(6))
        s_u -= solid.point(np.zeros(6), np.zeros(6), np.arange(6))
        s_v = solid.point(np.zeros(6), np.ones(6), np.arange(6))
        s_v -= solid.point(np.zeros(6), np.zeros(6), np.arange(6))
        along = unit(np.cross(s_u, s_v))
        # Differences of points carry the rounding of their coordinates.
        shortest = np.linalg.norm(solid.edges, axis=1).min()
        np.testing.assert_allclose(
            along, solid.normal(0.5, 0.5, np.arange(6)), atol=64 * EPS * size / shortest
        )


def test_faces_count_along_its_own_axes():
    """A quarter turn about z brings +x to +y, and u, v along."""
    turned = box("quarter turn")
    hit = Intersector([turned]).intersect((0, 5, 0), (0, -1, 0))
    assert hit.patch_id[0] == 1
    assert hit.t[0] == 4.0
    plain = Intersector([Box(LO, HI)]).intersect((5, 0, 0), (-1, 0, 0))
    np.testing.assert_allclose([hit.u[0], hit.v[0]], [plain.u[0], plain.v[0]], rtol=1e-15)


def test_scaling_along_the_axes_leaves_a_box_along_the_axes():
    image = Box(LO, HI).transformed(affine(np.diag([2.0, -1.0, 3.0]), (1.0, 2.0, 3.0)))
    assert image.is_upright
    np.testing.assert_array_equal(image.bounds, [[-1, 1, 2.25], [3, 2.5, 4.5]])


def test_no_ray_slips_through_an_edge():
    surface = box("skewed")
    rng = np.random.default_rng(6)
    n = 50_000
    weight = rng.random((n, 3))
    first, second = rng.integers(3, size=n), rng.integers(1, 3, size=n)
    weight[np.arange(n), first] = rng.integers(2, size=n)
    weight[np.arange(n), (first + second) % 3] = rng.integers(2, size=n)
    target = surface.lo + weight @ surface.edges
    origin = surface.bounds.mean(axis=0) + 5.0 * unit(rng.normal(size=(n, 3)))
    hits = Intersector([surface]).intersect(origin, target - origin)
    # The two faces at the edge, on the side of the weight; a silhouette may be passed by.
    sides = []
    for k in (first, (first + second) % 3):
        upper = weight[np.arange(n), k] > 0.5
        normal = surface.across[k] * np.where(upper, 1.0, -1.0)[:, None]
        sides.append(np.einsum("ij,ij->i", normal, target - origin))
    silhouette = sides[0] * sides[1] < 0.0
    assert hits.hit[~silhouette].all()
    assert (hits.status[~silhouette] == Status.HIT).mean() > 0.999
    assert (hits.status[silhouette] == Status.TANGENT).all()


def test_crossings_come_in_pairs():
    surface = box("turned")
    found = Intersector([surface]).intersect_all(*inward_rays(surface, 5000, 7))
    counts = np.diff(found.offsets)
    assert set(counts) <= {0, 2}


def test_bounds_copies_and_words():
    surface = box("turned")
    corners = surface.point(
        np.tile([0.0, 0.0, 1.0, 1.0], 6),
        np.tile([0.0, 1.0, 0.0, 1.0], 6),
        np.repeat(np.arange(6), 4),
    )
    np.testing.assert_allclose(
        surface.bounds, [corners.min(axis=0), corners.max(axis=0)], rtol=1e-15
    )
    copy = pickle.loads(pickle.dumps(surface))
    np.testing.assert_array_equal(copy.edges, surface.edges)
    assert not copy.is_upright
    assert repr(surface).startswith("Box at [")
    np.testing.assert_array_equal(surface.flipped().flipped().edges, surface.edges)
    back = surface.transformed(np.linalg.inv(MAPS["turned"]))
    np.testing.assert_allclose(back.bounds, [LO, HI], atol=1e-15)
    areas = [1.5 * 0.75, 2.0 * 0.75, 2.0 * 1.5]
    np.testing.assert_allclose(surface.areas, np.repeat(areas, 2), rtol=1e-15)
    np.testing.assert_allclose(Box(LO, HI).areas, np.repeat(areas, 2), rtol=1e-15)
