"""Closest points of surfaces of all kinds: against closed forms, OpenCASCADE, and attempts to break the bound."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from hybrid_rt import (
    Asphere,
    BezierPatches,
    Box,
    ClosestPoint,
    Cone,
    Cylinder,
    Instances,
    Intersector,
    PatchSheet,
    Plane,
    Rectangle,
    Sphere,
    SurfaceOfRevolution,
    Torus,
    TriangleMesh,
    TrimmedSurface,
    circle,
    closest_point,
    polygon,
    read_cad,
)
from hybrid_rt.distance import Closeness

POINTS = np.random.default_rng(1).uniform(-2.0, 2.0, (300, 3))


def outside(*parts):
    """Return the length of the positive parts."""
    return np.sqrt(sum(np.maximum(part, 0) ** 2 for part in parts))


def to_box(x, y, z, _):
    away = [np.abs(c) - 1 for c in (x, y, z)]
    return outside(*away) + np.minimum(np.maximum.reduce(away), 0)


def to_cone(_x, _y, z, rho):
    """Of the cone from its apex at 0 to radius 1 at z = 2, in the half plane of an azimuth."""
    along = np.clip((rho + 2 * z) / np.longdouble(5), 0, 1)
    return np.hypot(rho - along, z - 2 * along)


def to_cap(_x, _y, z, rho):
    """Of the part of the unit sphere with polar angle below 0.7 pi about +z."""
    edge = np.pi * np.longdouble(0.7)
    to_edge = np.hypot(rho - np.sin(edge), z - np.cos(edge))
    return np.where(np.arctan2(rho, z) <= edge, np.abs(np.hypot(rho, z) - 1), to_edge)


def tilted():
    """Return a rotation with a shift, far from simple numbers."""
    matrix = np.eye(4)
    matrix[:3, :3] = trimesh.transformations.rotation_matrix(1.0, (3, -1, 2))[:3, :3]
    matrix[:3, 3] = 100.0, -50.0, 7.0
    return matrix


RING = [circle((0.5, 0.5), 0.45), circle((0.5, 0.5), 0.25)]
SQUARE = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
CAP = TrimmedSurface(Sphere((0, 0, 0), 1), [polygon([(0, 0.3), (1, 0.3), (1, 1), (0, 1)])])
# Of x, y, z and the distance from the z axis.
CLOSED_FORMS = {
    "sphere": (Sphere((0, 0, 0), 1), lambda _x, _y, z, rho: np.hypot(rho, z) - 1),
    "torus": (
        Torus((0, 0, 0), (0, 0, 1), 1, 0.25),
        lambda _x, _y, z, rho: np.hypot(rho - 1, z) - np.longdouble(0.25),
    ),
    "box": (Box((-1, -1, -1), (1, 1, 1)), to_box),
    "plane": (Plane((0, 0, 0.5), (0, 0, 1)), lambda _x, _y, z, _: np.abs(z - 0.5)),
    "rectangle": (SQUARE, lambda x, y, z, _: np.hypot(outside(np.abs(x) - 1, np.abs(y) - 1), z)),
    "cylinder": (
        Cylinder((0, 0, -1), (0, 0, 1), 0.75, 2),
        lambda _x, _y, z, rho: np.hypot(rho - 0.75, np.maximum(np.abs(z) - 1, 0)),
    ),
    "cone": (Cone((0, 0, 2), (0, 0, -1), 1, 2), to_cone),
    "trimmed rectangle": (
        TrimmedSurface(SQUARE, RING),
        lambda _x, _y, z, rho: np.hypot(outside(rho - np.longdouble(0.9), 0.5 - rho), z),
    ),
    "trimmed sphere": (CAP, to_cap),
}


def truth_of(name, points):
    """Return the distances with 11 bits more, so with next to no error."""
    x, y, z = np.longdouble(points).T
    return CLOSED_FORMS[name][1](x, y, z, np.hypot(x, y))


def count_wrong(name, points, found):
    truth = truth_of(name, points)
    # Loops of decimal numbers are off by their rounding.
    spare = 2e-16 if "trimmed" in name else 0.0
    is_wrong = np.abs(np.abs(found.distance) - np.abs(truth)) > found.bound + spare
    if CLOSED_FORMS[name][0].is_closed:
        is_wrong |= (found.side != np.sign(truth)) & (np.abs(truth) > found.bound)
    return np.count_nonzero(is_wrong)


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_distances_are_those_of_closed_forms(name):
    surface, _ = CLOSED_FORMS[name]
    found = ClosestPoint(surface).query(POINTS)
    assert count_wrong(name, POINTS, found) == 0
    assert found.bound.max() < 6e-13
    assert (found.status == Closeness.UNIQUE).all()
    at = np.linalg.norm(surface.point(found.u, found.v, found.patch_id) - found.position, axis=1)
    if surface.is_bounded:
        assert at.max() < 4e-15


@pytest.mark.nightly
@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_none_of_a_million_is_wrong(name):
    """A third anywhere, a third on axes, medial planes, edges and corners, a third near the unit sphere."""
    rng = np.random.default_rng(100)
    points = rng.uniform(-2, 2, (120_000, 3))
    points[1::3] = np.round(8 * points[1::3]) / 8
    points[2::3] /= np.linalg.norm(points[2::3], axis=1)[:, None]
    points[2::3] *= 1 + 1e-6 * rng.normal(size=(40_000, 1))
    assert count_wrong(name, points, ClosestPoint(CLOSED_FORMS[name][0]).query(points)) == 0


def bowl():
    return BezierPatches.from_polynomial([[0, 0, 0.5], [0, 0, 0], [0.5, 0, 0]], (-1, 1), (-1, 1))


def net(rng):
    x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    return np.stack([x, y, 0 * x], axis=-1) + 0.3 * rng.normal(size=(4, 4, 3))


def asphere():
    return Asphere(3, -0.5, [0, 0.02], 2, (0, 0, 0), (0, 0, 1))


def vase():
    return SurfaceOfRevolution([(0, 0.5), (0.3, 1.5), (0.6, 0.2), (1, 0.7)], (0, 0, 0), (1, 2, 3))


RNG = np.random.default_rng(3)
WAVY, WEIGHTS = net(RNG), RNG.uniform(0.3, 2.0, (4, 4))
HALVES = [net(RNG) * (0.5, 1, 1) + (shift, 0, 0) for shift in (-0.5, 0.5)]
HALVES[1][0] = HALVES[0][-1]
WINDOW = [circle((0.5, 0.5), 0.4), circle((0.5, 0.5), (0.2, 0.1))]
# With a flap beyond the border u = 1, which ends the surface there.
FLAP = [circle((0.9, 0.5), (0.4, 0.7))]
FREE = {
    "bowl": bowl(),
    "patch": BezierPatches([WAVY]),
    "rational": BezierPatches([WAVY], [WEIGHTS]),
    "asphere": asphere(),
    "flipped asphere": asphere().flipped(),
    "vase": vase(),
    "half a vase": SurfaceOfRevolution(vase().segments, (0, 0, 0), (0, 0, 1), u_range=(0.1, 0.6)),
    "window": TrimmedSurface(BezierPatches([WAVY]), WINDOW),
    "flap": TrimmedSurface(BezierPatches([WAVY], [WEIGHTS]), FLAP),
    "sheet": TrimmedSurface(PatchSheet.grid(BezierPatches(HALVES), 2, 1), WINDOW),
    "torus": TrimmedSurface(Torus((0, 0, 0), (0, 0, 1), 1, 0.3), [circle((0.9, 0.9), 0.4)]),
    "tube": TrimmedSurface(Cylinder((0, 0, -1), (0, 0, 1), 0.7, 2), [circle((0.0, 0.5), (0.4, 0.3))]),
    "lens": TrimmedSurface(asphere(), [circle((0.5, 0.5), (0.3, 0.2))]),
}  # fmt: skip


def samples(surface, n=150):
    """Return points of a surface, inside its loops, and how far apart neighbours are at most."""
    u, v = (x.ravel() for x in np.meshgrid(*2 * [np.linspace(0, 1, n)]))
    points = []
    for patch in range(len(surface)):
        spans = surface.spans
        a, b, c, d = (0, 1, 0, 1) if spans is None else spans[patch]
        at = a + u * (b - a), c + v * (d - c)
        if isinstance(surface, TrimmedSurface):
            inside = surface.contains(*at)[0]
            at = at[0][inside], at[1][inside]
        points.append(surface.point(*at, patch))
    return np.concatenate(points)


@pytest.mark.parametrize("name", FREE)
def test_no_sample_is_nearer(name):
    surface = FREE[name]
    found = ClosestPoint(surface).query(POINTS)
    nearest = cKDTree(samples(surface)).query(POINTS)[0]
    assert (nearest >= found.distance - found.bound - 1e-15).all()
    # Steps between samples are below 0.06, and so is what they miss.
    assert (nearest - found.distance).max() < 0.06
    assert np.isin(found.status, (Closeness.UNIQUE, Closeness.SEVERAL)).all()
    assert found.bound.max() < 6e-13
    at = surface.point(found.u, found.v, found.patch_id) - found.position
    assert np.abs(at).max() < 1e-14
    # Inside the surface the way is along the normal.
    inner = ~found.on_edge & (found.distance > 1e-3)
    along = ((POINTS - found.position) * found.normal).sum(axis=1)
    np.testing.assert_allclose(np.abs(along[inner]), found.distance[inner], rtol=1e-9)


def holes():
    """Return the centres and radii, from 1/16 to 2^-16, of holes in the unit square, and its loops."""
    radii = 2.0 ** -np.arange(4, 17)
    centres = [((k % 4 + 0.5) / 4, (k // 4 + 0.5) / 4) for k in range(len(radii))]
    rims = [circle(c, r) for c, r in zip(centres, radii.tolist(), strict=True)]
    return np.array(centres), radii, [polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), *rims]


def is_on(surface, found):
    """Tell which points are inside the loops, or within rounding of a curve."""
    inside, in_band = surface.contains(found.u, found.v)
    for du, dv in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        inside |= surface.contains(found.u + 1e-14 * du, found.v + 1e-14 * dv)[0]
    return inside | in_band


GRID = np.arange(-8, 9) / 8


@pytest.mark.parametrize("is_round", [True, False])
def test_no_point_is_inside_a_hole(is_round):
    """Above the rows and columns through vertices of the hole, and through its centre, as anywhere else.

    There corners of the boxes of curves are at the foot, though no curve is.
    """
    centres, radii, loops = holes()
    if not is_round:
        corners = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
        loops[1:] = [polygon(c + r * corners) for c, r in zip(centres, radii, strict=True)]
    plate = TrimmedSurface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), loops)
    x, y = (a.ravel() for a in np.meshgrid(GRID, GRID))
    into = 1 - np.hypot(x, y) if is_round else (1 - np.abs(x) - np.abs(y)) / np.sqrt(2)
    search = ClosestPoint(plate)
    for centre, r in zip(centres, radii.tolist(), strict=True):
        for height in (0.25 * r, 2 * r):
            points = np.column_stack(
                [centre[0] + r * x, centre[1] + r * y, np.full(len(x), height)]
            )
            found = search.query(points)
            truth = np.hypot(r * np.maximum(into, 0), height)
            # The curves are off by the rounding of (u, v).
            assert (np.abs(found.distance - truth) <= found.bound + 4e-16).all()
            assert is_on(plate, found).all()
            assert (found.on_edge == (into > 0))[np.abs(into) > 1e-9].all()


@pytest.mark.parametrize("name", ["cylinder", "torus", "sphere", "patch"])
def test_no_point_is_inside_a_hole_of_a_curved_surface(name):
    """The rims, at 2000 points each, are the nearest: what is nearer by more than their steps is inside a hole."""
    centres, radii, loops = holes()
    base = {
        "cylinder": Cylinder((0, 0, -1), (0, 0, 1), 0.75, 2),
        "torus": Torus((0, 0, 0), (0, 0, 1), 1, 0.25),
        "sphere": Sphere((0, 0, 0), 1),
        "patch": BezierPatches([WAVY]),
    }[name]
    plate = TrimmedSurface(base, loops)
    search = ClosestPoint(plate)
    turn = 2 * np.pi * np.arange(2000) / 2000
    x, y = (a.ravel() for a in np.meshgrid(GRID[4:-4], GRID[4:-4]))
    for centre, r in zip(centres, radii, strict=True):
        u, v = centre[0] + r * x, centre[1] + r * y
        points = base.point(u, v) + 0.1 * r * base.normal(u, v)
        found = search.query(points)
        rim = base.point(centre[0] + r * np.cos(turn), centre[1] + r * np.sin(turn))
        truth = np.linalg.norm(points[:, None] - rim, axis=-1).min(axis=1)
        # A step of the rim of less than s, at distance d, is nearer by less than s^2 / 4 d at its middle.
        step = np.linalg.norm(np.diff(rim, axis=0), axis=1).max()
        assert (np.abs(found.distance - truth) <= found.bound + step**2 / truth).all()
        assert found.on_edge.all()
        assert is_on(plate, found).all()


def test_a_paraboloid_is_that_of_its_cubic():
    """Of z = r^2 / 2 the foot has r^3 / 2 + r (1 - z) = rho, of which there is one inside the centre's curve."""
    points = POINTS * (0.3, 0.3, 0.2)
    rho, z = np.hypot(*np.longdouble(points[:, :2]).T), np.longdouble(points[:, 2])
    r = rho.copy()
    for _ in range(60):
        r -= (r**3 / 2 + r * (1 - z) - rho) / (1.5 * r**2 + 1 - z)
    truth = np.hypot(r - rho, r**2 / 2 - z)
    found = closest_point(bowl(), points)
    assert (np.abs(found.distance - truth) <= found.bound).all()


@pytest.mark.parametrize("is_trimmed", [False, True])
def test_of_two_minima_in_one_cell_the_nearer_is_found(is_trimmed):
    """Just above the centre of curvature of the trough z = x^2 / 2 there are two, at x^3 / 2 + x (1 - z) = p_x."""
    trough = BezierPatches.from_polynomial([[0], [0], [0.5]], (-0.35, 0.65), (-1, 1))
    points = np.random.default_rng(11).uniform((-1e-3, 0, 0.98), (1e-3, 0, 1.02), (1500, 3))
    beyond = 0.0
    if is_trimmed:  # the minima are on a curve
        trough = TrimmedSurface(trough, [polygon([(0, 0.1), (1, 0.1), (1, 0.9), (0, 0.9)])])
        points[:, 1], beyond = 1.8, 1.0
    found = closest_point(trough, points)
    for (px, _, pz), d, bound in zip(points, found.distance, found.bound, strict=True):
        roots = np.roots([0.5, 0, 1 - pz, -px])
        x = np.longdouble(roots[np.abs(roots.imag) < 1e-6].real)
        for _ in range(3):
            x -= (x**3 / 2 + x * (1 - pz) - px) / (1.5 * x**2 + 1 - pz)
        truth = np.sqrt((x - px) ** 2 + (x**2 / 2 - pz) ** 2 + beyond**2).min()
        assert abs(d - truth) <= bound
    assert found.bound.max() < 1e-7  # at a centre of curvature itself it is wider than rounding


HARD = {
    "centre of a sphere": (Sphere((1, 2, 3), 2), (1, 2, 3), 2, Closeness.SEVERAL),
    "beside it": (Sphere((1, 2, 3), 2), (1, 2, 3.125), 1.875, Closeness.UNIQUE),
    "centre of a torus": (Torus((0, 0, 0), (0, 0, 1), 2, 0.5), (0, 0, 0), 1.5, Closeness.SEVERAL),
    "its core": (Torus((0, 0, 0), (0, 0, 1), 2, 0.5), (0, 2, 0), 0.5, Closeness.SEVERAL),
    "axis of a cylinder": (Cylinder((0, 0, -1), (0, 0, 1), 0.75, 2), (0, 0, 0), 0.75, Closeness.SEVERAL),
    "above its rim": (Cylinder((0, 0, -1), (0, 0, 1), 0.75, 2), (0.75, 0, 2), 1, Closeness.UNIQUE),
    "apex of a cone": (Cone((0, 0, 2), (0, 0, -1), 1, 2), (0, 0, -1), 1, Closeness.UNIQUE),
    "middle of a box": (Box((0, 0, 0), (1, 1, 1)), (0.5, 0.5, 0.5), 0.5, Closeness.SEVERAL),
    "medial plane": (Box((0, 0, 0), (1, 2, 3)), (0.5, 0.75, 1.5), 0.5, Closeness.SEVERAL),
    "corner": (Box((0, 0, 0), (1, 1, 1)), (-2, -1, 3), 3, Closeness.UNIQUE),
    "on an edge": (Box((0, 0, 0), (1, 1, 1)), (0, 0, 0.5), 0, Closeness.UNIQUE),
    "focus of a bowl": (bowl(), (0, 0, 1), 1, Closeness.UNIQUE),
    "beyond it": (bowl(), (0, 0, 1.125), np.sqrt(np.longdouble(1.25)), Closeness.SEVERAL),
}  # fmt: skip


@pytest.mark.parametrize("name", HARD)
def test_hard_points(name):
    surface, point, truth, status = HARD[name]
    found = closest_point(surface, point)
    assert abs(abs(found.distance[0]) - truth) <= found.bound[0]
    if name in ("focus of a bowl", "beyond it"):
        # At the centre of curvature the distance grows by the fourth power of the way only, and beyond it a whole
        # circle is as near: the bound says what the search has reached.
        assert found.bound[0] < 2e-3
    else:
        assert found.status[0] == status
        assert found.bound[0] < 1e-12


def test_far_from_the_origin_and_turned():
    matrix = tilted()
    points = trimesh.transformations.transform_points(POINTS, matrix)
    found, truth = (
        closest_point(CAP.transformed(matrix), points),
        truth_of("trimmed sphere", POINTS),
    )
    # The points were rounded, to 2^-46 each coordinate.
    assert (np.abs(found.distance - truth) <= found.bound + 4e-14).all()


def test_instances_are_copies():
    torus, matrices = Torus((0, 0, 0), (0, 0, 1), 1, 0.3), np.tile(np.eye(4), (5, 1, 1))
    matrices[:, :3, :3] *= np.linspace(0.1, 0.5, 5)[:, None, None]
    matrices[:, 0, 3] = np.linspace(-1.5, 1.5, 5)
    matrices[2, :3, :3] = 0.3 * tilted()[:3, :3]
    placed, ball = Instances([torus, Sphere((0, 0, 1), 0.2)], matrices), Sphere((1, 1, 1), 0.2)
    found = closest_point([ball, placed], POINTS)
    images = [one.transformed(m) for m in matrices for one in placed.surfaces]
    copies = closest_point([ball, *images], POINTS)
    np.testing.assert_allclose(found.distance, copies.distance, rtol=0, atol=2e-15)
    is_ball = copies.object_id == 0
    assert (found.object_id == np.where(is_ball, 0, 1)).all()
    assert (found.instance_id == np.where(is_ball, -1, (copies.object_id - 1) // 2)).all()
    assert (found.patch_id == np.where(is_ball, 0, copies.object_id - 1)).all()
    np.testing.assert_allclose(found.normal, copies.normal, atol=1e-9)
    assert (found.side == copies.side).all()


def test_meshes_have_sides_where_they_are_closed():
    ball = trimesh.creation.icosphere(3)
    found = closest_point(TriangleMesh(ball), POINTS)
    radius = np.linalg.norm(POINTS, axis=1)
    assert (found.side[radius > 1] == 1).all()
    assert (found.side[radius < 0.99] == -1).all()
    rows = np.argmin(np.abs(radius - 1)), np.argmax(radius)
    for k in rows:
        corners = ball.triangles[found.patch_id[k]]
        u, v = found.u[k], found.v[k]
        place = (1 - u - v) * corners[0] + u * corners[1] + v * corners[2]
        np.testing.assert_allclose(place, found.position[k], atol=1e-15)
    # The corners of a fine mesh are at most its sagitta, 0.005, too near.
    np.testing.assert_allclose(found.distance, radius - 1, atol=0.006)
    ball.update_faces(np.arange(len(ball.faces)) > 0)
    assert (closest_point(TriangleMesh(ball), POINTS).side == 0).all()


def test_faces_of_a_body_are_closed_together():
    """Six rectangles, said to bound a body, have the distances of the box."""
    box = Box((-1, -1, -1), (1, 1, 1))
    faces = []
    for k in range(6):
        corner, along_u, along_v = box.point([0, 1, 0], [0, 0, 1], k)
        faces.append(Rectangle(corner, along_u - corner, along_v - corner))
    found = closest_point(faces, POINTS, closed=[True] * 6)
    truth = closest_point(box, POINTS)
    assert (found.distance == truth.distance).all()
    assert (found.object_id == truth.patch_id).all()
    assert (closest_point(faces, POINTS).side == 0).all()


def test_the_bits_do_not_depend_on_threads_or_batches():
    search = ClosestPoint(
        [FREE["vase"], FREE["flap"], FREE["tube"], Sphere((2, 0, 0), 0.5)], threads=2
    )
    points = np.random.default_rng(7).normal(size=(9000, 3))
    whole, alone = search.query(points), ClosestPoint(search.surfaces, threads=1)
    for begin in (0, 17, 4000):
        part = alone.query(points[begin : begin + 500])
        for name in (
            "distance",
            "bound",
            "u",
            "v",
            "position",
            "normal",
            "status",
            "object_id",
            "side",
        ):
            assert (getattr(part, name) == getattr(whole, name)[begin : begin + 500]).all(), name


def test_what_is_refused():
    with pytest.raises(ValueError, match=r"surfaces is empty: pass at least one"):
        ClosestPoint([])
    with pytest.raises(
        ValueError, match=r"closed is \[True, False\]: pass True or False for each of 1"
    ):
        ClosestPoint(Sphere((0, 0, 0), 1), closed=[True, False])
    with pytest.raises(ValueError, match=r"points\[1\] is \[nan, 0.0, 0.0\]: pass finite"):
        closest_point(Sphere((0, 0, 0), 1), [[0, 0, 0], [np.nan, 0, 0]])
    with pytest.raises(ValueError, match=r"points has shape \(2,\)"):
        closest_point(Sphere((0, 0, 0), 1), [0, 0])
    beyond = TrimmedSurface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), [circle((1.5, 1.5), 0.2)])
    with pytest.raises(ValueError, match=r"surfaces have no point inside their loops"):
        ClosestPoint(beyond)


def test_a_cad_part_agrees_with_opencascade():
    """A ring of two planes, two cylinders and two tori (NIST), judged by BRepExtrema."""
    pytest.importorskip("OCP")
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt
    from OCP.STEPControl import STEPControl_Reader

    file = "tests/data/nist_ftc_11_asme1_rb.stp"
    model = read_cad(file)
    low, high = model.bounds
    points = low + (high - low) * np.random.default_rng(2).uniform(-0.2, 1.2, (60, 3))
    found = closest_point(model.surfaces, points, closed=model.closed)
    reader = STEPControl_Reader()
    reader.ReadFile(file)
    reader.TransferRoots()
    shape = reader.OneShape()
    truth = [
        BRepExtrema_DistShapeShape(
            BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex(), shape
        ).Value()
        for point in points.tolist()
    ]
    # OpenCASCADE takes edges from curves in space, the faces here end at those in (u, v): apart by 1e-7.
    # To it a point inside of a solid has the distance 0.
    np.testing.assert_allclose(np.maximum(found.distance, 0), truth, rtol=0, atol=1e-6)
    crossings = Intersector(model.surfaces, coarse="none").intersect_all(points, (0.3, 0.5, 0.8))
    odd = model.paired(crossings)[0].count % 2 == 1
    assert model.closed.all()
    assert (found.side == np.where(odd, -1, 1)).all()
