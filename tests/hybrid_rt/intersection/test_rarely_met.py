"""Faults that random rays on ordinary scenes do not meet: each was there, and is held mended here."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh
from exact_vectors import cross, dot, exact, minus

from hybrid_rt import Box, Intersector, Plane, Rectangle, Sphere, Status, TriangleMesh
from hybrid_rt.core.records import NamedPoints
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface, polygon, tessellate


def exact_root(rectangle, origin, direction):
    """Return t and (u, v) where a ray meets a rectangle's plane, as fractions."""
    corner, u, v, o, d = map(
        exact, (rectangle.corner, rectangle.edge_u, rectangle.edge_v, origin, direction)
    )
    normal = cross(u, v)
    away = minus(corner, o)
    t = dot(normal, away) / dot(normal, d)
    point = [t * a - b for a, b in zip(d, away, strict=True)]
    square = dot(normal, normal)
    return t, dot(cross(point, v), normal) / square, dot(cross(u, point), normal) / square


@pytest.mark.parametrize("lean", [1.0, 1e-2, 1e-3, 1e-6, 1e-9, 1e-10])
def test_bounds_hold_on_parallelograms_whose_edges_are_nearly_parallel(lean):
    rng = np.random.default_rng(0)
    for _ in range(40):
        corner, u, w = rng.normal(size=(3, 3))
        rectangle = Rectangle(corner, u, u * rng.uniform(0.5, 1) + lean * w)
        a, b = rng.uniform(0.2, 0.8, 2)
        origin = 3.0 * rng.normal(size=3)
        direction = corner + a * rectangle.edge_u + b * rectangle.edge_v - origin
        t, exact_u, exact_v = exact_root(rectangle, origin, direction)
        found = Intersector([rectangle]).intersect(origin, direction)
        # The rounding of the aim is large beside a needle.
        if lean < 1e-9 and not (0 <= exact_u <= 1 and 0 <= exact_v <= 1):
            continue
        assert found.hit[0] or found.status[0] == Status.TANGENT
        if found.hit[0]:
            assert abs(Fraction(float(found.t[0])) - t) <= Fraction(float(found.t_bound[0]))


def test_bounds_hold_where_rounding_moves_a_root_to_the_rim():
    """Rays nearly along the plane, that cross it next to an edge."""
    rng = np.random.default_rng(1)
    rectangle = Rectangle((0.1, 0.2, 0.3), (1.0, 0.3, 0.2), (-0.3, 1.0, 0.0))
    tracer = Intersector([rectangle])
    n, n_met = 3000, 0
    slope = 10.0 ** rng.uniform(-8, -3, n)
    along = rectangle.edge_u / np.linalg.norm(rectangle.edge_u)
    beside = 10.0 ** rng.uniform(-17, -14, n) * rng.choice([-1, 1], n)
    start = rectangle.point(rng.uniform(0.2, 0.8, n), beside)
    directions = along + slope[:, None] * rectangle.unit_normal
    origins = start - rng.uniform(0.5, 2, n)[:, None] * directions
    found = tracer.intersect(origins, directions)
    for i in np.flatnonzero(found.hit):
        t, u, v = exact_root(rectangle, origins[i], directions[i])
        if 0 <= u <= 1 and 0 <= v <= 1:
            n_met += 1
            assert abs(Fraction(float(found.t[i])) - t) <= Fraction(float(found.t_bound[i]))
    assert n_met > 300


@pytest.mark.parametrize("far", [1e3, 1e6, 3e8, 1e9, 1e12])
def test_patches_small_beside_the_scene_share_their_edges(far):
    """Two patches with one border, bit for bit, and a third far away."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.linspace(0, 2, 7), np.linspace(0, 1, 4), indexing="ij")
    net = np.stack([x, y, 0.2 * rng.normal(size=x.shape)], axis=-1)
    pair = BezierPatches([net[:4], net[3:]])
    distant = BezierPatches([np.add(net[:4], (far, 0, -5))])
    n = 1000
    aims = pair.point(1.0, rng.uniform(0.1, 0.9, n), 0)
    origins = aims + rng.normal(size=(n, 3)) * (0.3, 0.3, 0) + (0, 0, 1)
    tracer = Intersector([pair, distant])
    found = tracer.intersect(origins, aims - origins)
    assert (found.hit | (found.status == Status.TANGENT)).all()
    assert np.abs(found.t[found.hit] - 1.0).max() < 1e-9
    # Positions are rounded to their own size, not to that of all: rays that leave them do not meet them again.
    hits = found[found.hit]
    again = tracer.intersect(hits.position, rng.normal(size=(len(hits), 3)), source=hits)
    assert not (again.t < 1e-5).any()
    assert not tracer.occluded(hits.position, (0, 0, 1), source=hits).any()


def test_a_box_is_in_doubt_where_it_passes_and_not_where_its_sides_are():
    """Rays that leave a surface: t_bound is no coordinate of the box."""
    box, other = Box((0, 0, 0), (100, 100, 100)), Sphere((110, 110, 500), 1)
    origin = np.array([[110.0, 110.0, 50.0]])
    source = NamedPoints(np.array([1], np.int32), origin.copy())
    found = Intersector([box, other]).intersect(origin, (1, 1, 0), source=source)
    assert found.status[0] == Status.MISS
    for low in (100.0, -200.0):
        box = Box((low,) * 3, (low + 100.0,) * 3)
        origin = np.array([[low + 100.0, low + 100.0 - 1e-13, low + 50.0]])
        source = NamedPoints(np.array([0], np.int32), origin.copy())
        found = Intersector([box]).intersect(origin, (1e-3, 1, 0), source=source)
        assert found.status[0] == Status.TANGENT


CUBIC = np.stack(
    [*np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij"), np.zeros((4, 4))],
    axis=-1,
)
PROFILE = [[(0, 0), (0, 1)], [(0, 1), (2, 1)], [(2, 1), (2, 0)]]
CAN = SurfaceOfRevolution(PROFILE, (0, 0, 0), (0, 0, 1))


@pytest.mark.parametrize("accuracy", ["certified", "refined", "mesh"])
@pytest.mark.parametrize("turned", [False, True])
def test_what_a_ray_does_not_see_hides_nothing(accuracy, turned):
    near, far = (
        (CAN, CAN.transformed(np.diag([2.0, 2, 2, 1])))
        if turned
        else (BezierPatches([np.add(CUBIC, (0, 0, 1))]), BezierPatches([CUBIC]))
    )
    tracer = Intersector([near, far], accuracy)
    origin, direction = ((0.3, -9.0, 1.0), (0, 1, 0)) if turned else ((0.3, 0.4, 5.0), (0, 0, -1))
    assert tracer.intersect(origin, direction).object_id[0] == (1 if turned else 0)
    unseen = np.array([1 if turned else 0], np.int32)
    found = tracer.intersect(origin, direction, unseen=unseen)
    assert found.object_id[0] == (0 if turned else 1)


@pytest.mark.parametrize("accuracy", ["certified", "refined", "mesh"])
def test_a_vertex_of_no_face_changes_nothing(accuracy):
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    x, y = np.meshgrid(np.linspace(0.05, 0.45, 6), np.linspace(0.05, 0.45, 6))
    origins = np.stack([x.ravel(), y.ravel(), np.ones(36)], axis=1)
    for more in ([], [(1e8, 0, 0)]):
        mesh = TriangleMesh(trimesh.Trimesh(corners + more, [(0, 1, 2)], process=False))
        assert Intersector([mesh], accuracy).intersect(origins, (0, 0, -1)).hit.all()


@pytest.mark.parametrize("accuracy", ["certified", "refined", "mesh"])
def test_hits_on_trimmed_profiles_name_their_points(accuracy):
    can = TrimmedSurface(CAN, [polygon([(0.1, 0.3), (0.4, 0.3), (0.4, 0.7), (0.1, 0.7)])])
    rng = np.random.default_rng(5)
    origins = rng.normal(size=(200, 3)) * 0.2 + (0, 0, 1)
    found = Intersector([can], accuracy, tolerance=1e-4).intersect(
        origins, rng.normal(size=(200, 3))
    )
    hits = found[found.hit]
    points = can.point(hits.u, hits.v)
    assert len(hits) >= 40
    # Triangles lie within their tolerance of the surface, and so do their parameters.
    limit = 1e-2 if accuracy == "mesh" else 1e-12
    assert np.linalg.norm(points - hits.position, axis=1).max() < limit


@pytest.mark.parametrize("begin", [-1.0, -0.85, -0.7, -0.3, 0.0, 0.15, 0.25, 0.3, 0.57, 0.99])
def test_turns_that_are_whole_but_for_rounding_are_whole(begin):
    can = SurfaceOfRevolution(PROFILE, (0, 0, 0), (0, 0, 1), u_range=(begin, begin + 1.0))
    assert can.is_whole_turn
    assert can.u_range[0] == pytest.approx(begin, abs=1e-15)
    assert tessellate(can, 0.01).mesh.is_watertight
    seam = 2 * np.pi * begin
    aim = can.origin + np.cos(seam) * can.radial + np.sin(seam) * can.binormal + can.axis
    found = Intersector([can]).intersect(can.origin + can.axis, aim - can.origin - can.axis)
    assert found.status[0] == Status.HIT
    assert found.t[0] == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("normal", [*np.eye(3), *-np.eye(3), (1, -2, 3), (1, -3, 2), (-3, 1, 2)])
def test_normals_of_planes_are_along_the_cross_product_of_their_partials(normal):
    plane = Plane((0.3, 0.4, 0.5), normal)
    s_u, s_v = plane.partials(0.2, 0.7)
    assert np.cross(s_u, s_v) @ plane.unit_normal > 0.0
    found = Intersector([plane]).intersect(
        np.add((0.9, 0.8, 0.7), 9 * plane.unit_normal), -plane.unit_normal
    )
    # u and v of hits are the fractions of these coordinates.
    point = found.position[0]
    expected = [point[k] - np.floor(point[k]) for k in plane.axes]
    np.testing.assert_allclose([found.u[0], found.v[0]], expected, atol=1e-15)


@pytest.mark.parametrize("z", [0.0012345, 1e-8, 1e-14])
def test_bounds_hold_where_t_is_subnormal(z):
    direction = np.array([0.1, 0.2, -1.0]) * 1.5e308
    found = Intersector([Plane((0, 0, 0), (0, 0, 1))]).intersect((0, 0, z), direction)
    off = abs(Fraction(float(found.t[0])) - Fraction(z) / -Fraction(float(direction[2])))
    assert 0 < off <= Fraction(float(found.t_bound[0]))


def test_a_source_beside_the_ray_excludes_nothing():
    tracer = Intersector([Plane((0, 0, 5), (0, 0, 1))])
    for beside, is_met in ((1.0, True), (1e-3, True), (1e-15, False), (0.0, False)):
        source = NamedPoints(np.zeros(1, np.int32), np.array([[0.0, beside, 5.0]]))
        assert tracer.intersect((0, 0, 0), (0, 0, 1), source=source).hit[0] == is_met


def test_embree_alone_refuses_what_single_precision_does_not_tell_apart():
    far = [BezierPatches([CUBIC]), BezierPatches([np.add(CUBIC, (1e8, 0, 0))])]
    for accuracy in ("refined", "mesh"):
        with pytest.raises(
            ValueError, match=r"surfaces\[0\] is 1\.\d+ across, less than.*certified"
        ):
            Intersector(far, accuracy)
    assert Intersector(far).intersect((0.3, 0.4, 1), (0, 0, -1)).hit.all()
