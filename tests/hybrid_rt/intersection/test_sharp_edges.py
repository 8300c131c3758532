"""Flat faces at small angles: nothing is lost beside their edges, and points and bounds keep their digits."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from exact_vectors import cross, dot, exact

from hybrid_rt import Box, Intersector, Rectangle, Status, TriangleMesh
from hybrid_rt.core.records import NamedPoints
from hybrid_rt.primitives.box import TurnedBox
from meshing import BezierPatches, TrimmedSurface, polygon

EPS = 2.0**-52
ANGLES = [0.1, 1e-3, 1e-6]


def along(corner, steps, edges):
    """Return corner + sum of steps times edges."""
    return [
        c + sum(s * e[k] for s, e in zip(steps, edges, strict=True)) for k, c in enumerate(corner)
    ]


def faces_of(surface):
    """Return (corner, edge, edge, whether it is a triangle) of each face, as fractions."""
    if isinstance(surface, TriangleMesh):
        corners = [[exact(vertex) for vertex in face] for face in surface.vertices[surface.faces]]
        return [(a, along(b, [-1], [a]), along(c, [-1], [a]), True) for a, b, c in corners]
    if isinstance(surface, Box):
        lo, edges = exact(surface.lo), [exact(edge) for edge in surface.edges]
        return [
            (along(lo, [upper], [edges[k]]), edges[k - 2], edges[k - 1], False)
            for k in range(3)
            for upper in (0, 1)
        ]
    return [(exact(surface.corner), exact(surface.edge_u), exact(surface.edge_v), False)]


def root(face, origin, direction):
    """Return t, u, v where a ray meets the plane of a face, and |n.d|^2 / |n|^2."""
    corner, e, f, _ = face
    normal, d = cross(e, f), exact(direction)
    away = along(exact(origin), [-1], [corner])
    square = dot(normal, normal)
    t = -dot(normal, away) / dot(normal, d)
    point = along(away, [t], [d])
    weights = dot(cross(point, f), normal) / square, dot(cross(e, point), normal) / square
    return t, *weights, dot(normal, d) ** 2 / square


def first_root(faces, origin, direction, left):
    """Return the smallest t > 0 at which a ray meets another face than that which it leaves; None: it misses."""
    found = []
    for k, face in enumerate(faces):
        if k != left:
            t, u, v, _ = root(face, origin, direction)
            if t > 0 and min(u, v) >= 0 and (u + v if face[3] else max(u, v)) <= 1:
                found.append(t)
    return min(found, default=None)


def rotation(seed):
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]


def sheared(angle, turn, scale=1.0):
    """A unit cube whose z edge becomes (0, 1, angle): the sharp edges are along x."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * turn @ np.array([[1, 0, 0], [0, 1, 1], [0, 0, angle]])
    return Box((0, 0, 0), (1, 1, 1)).transformed(matrix)


def wedge(kind, angle, turn, scale):
    """Surfaces with two faces, the first ones listed, that meet in the sharp edge ``turn`` x from 0."""
    x, y, z = scale * turn.T
    corners = [np.zeros(3), x, y, 0.7 * y + angle * z]
    if kind == "box":
        box = sheared(angle, turn, scale)
        return [box], [faces_of(box)[4], faces_of(box)[2]]
    if kind == "rectangles":
        pair = [Rectangle(corners[0], x, corners[2]), Rectangle(corners[0], corners[3], x)]
        return pair, [face for one in pair for face in faces_of(one)]
    mesh = TriangleMesh(SimpleNamespace(vertices=corners, faces=[(0, 1, 2), (0, 3, 1)]))
    if kind == "mesh":
        return [mesh], faces_of(mesh)
    nets = [
        [[corners[0], corners[2]], [x, corners[2] + x]],
        [[corners[0], corners[3]], [x, corners[3] + x]],
    ]
    faces = [(exact(c), along(exact(b), [-1], [exact(c)]), along(exact(a), [-1], [exact(c)]), False)
             for (c, a), (b, _) in nets]  # fmt: skip
    return [BezierPatches([net]) for net in nets], faces


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("kind", ["box", "rectangles", "mesh", "patches"])
@pytest.mark.parametrize("scale", [1.0, 2.0**-40])
def test_rays_that_leave_a_face_beside_a_sharp_edge_meet_the_other_one(kind, angle, scale):
    """At 1e-1 to 1e-17 of the size from the edge: found, or TANGENT within rounding of both faces."""
    rng, n = np.random.default_rng(5), 60
    turn = rotation(6)
    surfaces, faces = wedge(kind, angle, turn, scale)
    beside, place = 10.0 ** rng.uniform(-17, -1, n), rng.uniform(0.2, 0.6, n)
    origins = scale * (np.stack([place, beside, 0 * place], axis=1) @ turn.T)
    upward = np.abs(rng.normal(size=n)) + 0.2
    directions = np.stack([rng.normal(size=n), rng.normal(size=n), upward], axis=1)
    # A third meets both faces at one angle.
    directions[::3] = (0.0, -np.sin(angle / 2), np.cos(angle / 2))
    directions = directions @ turn.T
    source = NamedPoints(np.zeros(n, np.int32), origins)
    hits = Intersector(surfaces, coarse="none").intersect(origins, directions, source=source)
    n_met = 0
    for i in range(n):
        t = first_root(faces, origins[i], directions[i], 0)
        # Rounding of origin and planes, some ulp of the size, must not matter beyond the band.
        if beside[i] * angle > 64 * EPS * 2.0:
            assert hits.status[i] != Status.TANGENT
        if t is None or hits.status[i] == Status.TANGENT:
            continue
        n_met += 1
        assert hits.hit[i]
        assert abs(Fraction(float(hits.t[i])) - t) <= Fraction(float(hits.t_bound[i]))
    assert n_met > 5


def test_rays_that_leave_the_only_face_there_are_not_marked():
    """Nor where two triangles lie in one plane: the start is on their common edge."""
    rng, n = np.random.default_rng(7), 500
    square = TriangleMesh(
        SimpleNamespace(
            vertices=[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0.0)], faces=[(0, 1, 2), (0, 2, 3)]
        )
    )
    box = sheared(1e-3, np.eye(3))
    place = rng.uniform(0.1, 0.9, (n, 1))
    for surface, origins in (
        (square, place * (1, 1, 0)),
        (box, np.stack([place[:, 0], rng.uniform(0.1, 0.9, n), np.zeros(n)], axis=1)),
    ):
        source = NamedPoints(np.zeros(n, np.int32), origins)
        hits = Intersector(surface).intersect(origins, rng.normal(size=(n, 3)), source=source)
        assert (hits.status != Status.TANGENT).all()


def test_faces_of_two_objects_in_one_plane_do_not_mark_each_other():
    """Rays that leave a box where it stands on a slanted floor."""
    rng, n = np.random.default_rng(8), 200
    turn = np.eye(4)
    turn[:3, :3] = rotation(9)
    box = Box((-1, -1, 0), (1, 1, 1)).transformed(turn)
    floor = Rectangle((-5, -5, 0), (10, 0, 0), (0, 10, 0)).transformed(turn)
    tracer = Intersector([box, floor])
    origins = np.stack([*rng.uniform(-0.9, 0.9, (2, n)), np.zeros(n)], axis=1) @ turn[:3, :3].T
    source = NamedPoints(np.zeros(n, np.int32), origins)
    hits = tracer.intersect(origins, rng.normal(size=(n, 3)), source=source)
    assert (hits.status != Status.TANGENT).all()


SKEW = {
    "rectangle": lambda a: Rectangle((0.1, 0.2, 0.3), (1, 0.3, 0.2), (1 + 0.3 * a, 0.3 - a, 0.2 + 0.7 * a)),
    "obtuse rectangle": lambda a: Rectangle((0, 0, 0), (1, 0.3, 0.2), (-2 + a, -0.6 - a, -0.4 + a)),
    "box": lambda a: sheared(a, rotation(10)),
    "flat box": lambda a: Box((-1, -0.5, -0.25), (1, 0.75, 1.5)).transformed(
        np.array([[1, 0, 0, 0], [0, 1, 0.5, 0], [0, 0, a, 0], [0, 0, 0, 1]])
    ),
    "mesh": lambda a: TriangleMesh(
        SimpleNamespace(vertices=[(0.1, 0.2, 0.3), (1, 0.3, 0.2), (1, 0.3 + a, 0.2 - a)], faces=[(0, 1, 2)])
    ),
}  # fmt: skip


def points_in(face, n, rng):
    """Return points (n, 3) float64 next to a face."""
    u, v = rng.uniform(0.01, 0.99, (2, n))
    if face[3]:
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    corner, e, f = (np.array([float(x) for x in vector]) for vector in face[:3])
    return corner + u[:, None] * e + v[:, None] * f


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("kind", SKEW)
def test_points_lie_on_their_rays_and_bounds_are_tight(kind, angle):
    surface, rng, n = SKEW[kind](angle), np.random.default_rng(11), 25
    tracer, n_hits = Intersector(surface), 0
    for face in faces_of(surface):
        directions = rng.normal(size=(n, 3))
        origins = points_in(face, n, rng) - directions
        hits = tracer.intersect(origins, directions)
        for i in np.flatnonzero(hits.status == Status.HIT):
            own = faces_of(surface)[hits.patch_id[i]]
            t, _, _, slope = root(own, origins[i], directions[i])
            u, v = hits.u[i], hits.v[i]
            if isinstance(surface, Box) and surface._is_swapped(hits.patch_id[i : i + 1])[0]:
                u, v = v, u
            point = along(own[0], exact([u, v]), own[1:3])
            gap = along(
                point, [-1, -Fraction(float(hits.t[i]))], [exact(origins[i]), exact(directions[i])]
            )
            length = np.linalg.norm(directions[i])
            band = 64 * EPS * max(surface.size, length)
            # A quarter: what rounding leaves, and not what the angle makes of it.
            assert dot(gap, gap) <= Fraction(0.25 * band) ** 2
            assert abs(Fraction(float(hits.t[i])) - t) <= Fraction(float(hits.t_bound[i]))
            # 64 eps x scale / cos is what is expected of t itself.
            assert hits.t_bound[i] <= 2 * band / float(slope) ** 0.5
            n_hits += 1
    assert n_hits >= n / 2


@pytest.mark.parametrize("angle", [1e-3, 1e-6])
def test_loops_on_a_skew_rectangle_are_where_they_belong(angle):
    """Lines of equal u + v run across both edges: with u and v each off by eps / angle, it matters."""
    edges = np.array([[1.0, 0.3, 0.2], [1 + 0.3 * angle, 0.3 - angle, 0.2 + 0.7 * angle]])
    whole = Rectangle((0, 0, 0), *edges)
    loop = polygon([(0.5, 0.125), (0.875, 0.5), (0.5, 0.875), (0.125, 0.5)])
    tracer, face = Intersector(TrimmedSurface(whole, [loop])), faces_of(whole)[0]
    rng, n = np.random.default_rng(12), 300
    total = rng.choice([0.625, 1.375], n) + rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-13, -9, n)
    apart = rng.uniform(-0.2, 0.2, n)
    directions = rng.normal(size=(n, 3))
    origins = 0.5 * np.stack([total + apart, total - apart], axis=1) @ edges - directions
    hits = tracer.intersect(origins, directions)
    for i in range(n):
        _, u, v, _ = root(face, origins[i], directions[i])
        assert hits.hit[i] == (0.625 <= u + v <= 1.375) or hits.status[i] == Status.TANGENT
    assert (hits.status == Status.TANGENT).mean() < 0.5


@pytest.mark.parametrize("angle", [1e-2, 1e-5, 1e-8])
def test_rays_past_a_sharp_edge_of_a_box_are_decided_by_its_line(angle):
    """1e-13 to 1e-3 of the size beside it: planes that meet at this angle tell where it is to eps / angle only."""
    rng, n = np.random.default_rng(13), 150
    turn = rotation(14)
    box = sheared(angle, turn)
    tracer, faces = Intersector(box), faces_of(box)
    outside = 10.0 ** rng.uniform(-12.5, -3, n) * rng.choice([-1, 1], n)
    points = np.stack([rng.uniform(0.1, 0.9, n), outside, 0 * outside], axis=1) @ turn.T
    directions = rng.normal(size=(n, 3))
    origins = points - directions
    hits = tracer.intersect(origins, directions)
    for i in range(n):
        t = first_root(faces, origins[i], directions[i], None)
        if hits.status[i] != Status.TANGENT:
            assert hits.hit[i] == (t is not None)
        if hits.status[i] == Status.HIT:
            assert abs(Fraction(float(hits.t[i])) - t) <= Fraction(float(hits.t_bound[i]))
    # The band and the distance from the ray's line, not the angle, make the marks.
    assert (hits.status == Status.TANGENT).mean() < 0.1


def test_boxes_of_no_volume_are_refused():
    with pytest.raises(ValueError, match="in one plane: pass edges that span a volume"):
        TurnedBox((0, 0, 0), [(1, 0, 0), (0, 1, 0), (1, 1, 0)])
