"""Meshes of trimmed surfaces and of bodies: areas, volumes, borders, and that nothing is open."""

from itertools import combinations, pairwise

import numpy as np
import pytest
import trimesh
from trimmed_surfaces import (
    OUTLINE,
    bumpy,
    cut_lens,
    plate,
    ring,
    sheet,
    turned_part,
    windowed_torus,
)

from hybrid_rt import Rectangle, Sphere, Torus
from meshing import (
    BezierPatches,
    Curve2,
    Cylinder,
    Extrusion,
    TrimmedSurface,
    circle,
    polygon,
    tessellate,
)
from meshing.body_mesh import _with_edges_of_two, _without_flaps

TUBE = Cylinder((0, 0, 0), (0, 0, 1), 1.0, 2.0)
SQUARE = Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))


def distances(points, mesh):
    """Distances of points from the nearest triangle."""
    best = np.full(len(points), np.inf)
    for triangle in mesh.mesh.triangles:
        pairs = np.broadcast_to(triangle, (len(points), 3, 3))
        nearest = trimesh.triangles.closest_point(pairs, points)
        best = np.minimum(best, np.linalg.norm(nearest - points, axis=1))
    return best


def border(surface, per_curve):
    """Points of the curves that are edges: with points inside at one side only."""
    uv = np.concatenate(
        [c.point(np.linspace(0, 1, per_curve)) for loop in surface.loops for c in loop]
    )
    for axis in np.flatnonzero(surface.closes):
        uv[:, axis] = np.where((uv[:, axis] < 0) | (uv[:, axis] > 1), uv[:, axis] % 1, uv[:, axis])
    uv = uv[((uv >= 0) & (uv <= 1)).all(axis=1)]
    around = uv + 1e-10 * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])[:, None]
    for axis in np.flatnonzero(surface.closes):
        around[..., axis] %= 1.0
    beyond = ((around < 0) | (around > 1)).any(axis=2)
    inside = surface.contains(*np.clip(around, 0, 1).transpose(2, 0, 1))[0] & ~beyond
    uv = uv[inside.any(axis=0) & ~inside.all(axis=0)]
    return surface.point(*uv.T)


def box_with_hole(radius=0.5, height=1.0, gap=0.0, aside=0.0):
    """A box of sides 2, 2 and its height, drilled along z by a cylinder that may be off by a little."""
    hole = circle((0.5, 0.5), radius / 2)
    bottom = Rectangle((-1, -1, 0), (0, 2, 0), (2, 0, 0))
    top = Rectangle((-1, -1, height), (2, 0, 0), (0, 2, 0))
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]
    walls = [
        Rectangle((*a, 0), (*np.subtract(b, a), 0), (0, 0, height)) for a, b in pairwise(corners)
    ]
    drill = Cylinder((aside, 0, 0), (0, 0, 1), radius, height).flipped()
    return [TrimmedSurface(face, [OUTLINE, hole], gap) for face in (bottom, top)] + walls + [drill]


def drilled_tube():
    """A tube about z with radii 1 and 2."""
    loops = [circle((0.5, 0.5), 0.5), circle((0.5, 0.5), 0.25)]
    ends = [
        Rectangle((-2, -2, 0), (0, 4, 0), (4, 0, 0)),
        Rectangle((-2, -2, 3), (4, 0, 0), (0, 4, 0)),
    ]
    sides = [Cylinder((0, 0, 0), (0, 0, 1), r, 3.0) for r in (2.0, 1.0)]
    return [TrimmedSurface(end, loops) for end in ends] + [sides[0], sides[1].flipped()]


def dome():
    """Half a ball on a disc."""
    half = polygon([(0, 0.5), (1, 0.5), (1, 1), (0, 1)])
    disc = Rectangle((-1, -1, 0), (0, 2, 0), (2, 0, 0))
    ball = TrimmedSurface(Sphere((0, 0, 0), 1.0), [half])
    return [ball, TrimmedSurface(disc, [circle((0.5, 0.5), 0.5)])]


def cusp(gap):
    """A prism over 0 <= y <= x^2, x <= 1: in its sharp corner edges are nearer to each other than the gap."""
    below = [
        Curve2([(0, 0), (1, 0)]), Curve2([(1, 0), (1, 1)]), Curve2([(1, 1), (0.5, 0), (0, 0)])
    ]  # fmt: skip
    top = TrimmedSurface(Rectangle((0, 0, 1), (1, 0, 0), (0, 1, 0)), [below], gap)
    bottom = TrimmedSurface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), [below], gap).flipped()
    front = Rectangle((0, 0, 0), (1, 0, 0), (0, 0, 1))
    side = Rectangle((1, 0, 0), (0, 1, 0), (0, 0, 1))
    back = Extrusion([(0, 0, 0), (0.5, 0, 0), (1, 1, 0)], (0, 0, 1)).flipped()
    return [top, bottom, front, side, back]


BODIES = {
    "cusp": (cusp(0.0), 1 / 3),
    "cusp with gap": (cusp(1e-3), 1 / 3),
    "box with hole": (box_with_hole(), 4 - np.pi / 4),
    # Its drill is half a gap aside: the faces do not meet, but within the gap they do.
    "box with gap": (box_with_hole(gap=2e-3, aside=1e-3), 4 - np.pi / 4),
    "tube": (drilled_tube(), 9 * np.pi),
    "dome": (dome(), 2 / 3 * np.pi),
    "ball": ([Sphere((0, 0, 0), 1.0)], 4 / 3 * np.pi),
    "torus": ([Torus((0, 0, 0), (0, 0, 1), 2.0, 0.5)], np.pi**2),
}


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("tolerance", [0.1, 1e-2])
def test_bodies_become_watertight_and_hold_their_volume(name, tolerance):
    faces, volume = BODIES[name]
    result = tessellate(faces, tolerance)
    mesh = result.mesh
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    # What is between two surfaces so near to each other has at most area times distance, of the larger area.
    assert abs(mesh.volume - volume) <= 1.1 * mesh.area * result.deviation_bound
    assert result.deviation_bound <= tolerance + 5e-3 * name.endswith("gap")
    assert set(result.surface_id) == set(range(len(faces)))


def test_flat_triangles_that_hang_together_between_two_faces_are_left_out():
    """Two fans along a line, and between them a flap of four triangles, one of which has no such edge."""
    line = [(x, 0.0, 0.0) for x in (0.0, 1.0, 2.0, 3.0)]
    points = np.array([*line, (1.5, 1.0, 0.0), (1.5, -1.0, 0.0), (1.5, 0.0, 1e-4)])
    fans = [(k, k + 1, apex) for apex in (4, 5) for k in range(3)]
    flap = [(0, 1, 6), (1, 2, 6), (2, 3, 6), (0, 6, 3)]
    faces = np.array([*fans, *flap])
    kept, off = _without_flaps(points, faces, np.full(len(faces), 1e-3))
    assert np.flatnonzero(kept).tolist() == list(range(6))
    assert off == pytest.approx(1e-4)
    # Alone it is a face that narrow.
    kept, _ = _without_flaps(points, np.array(flap), np.full(4, 1e-3))
    assert kept.all()


def test_a_drilled_tube_has_its_hole():
    surface = TrimmedSurface(
        Cylinder((0, 0, 0), (0, 0, 1), 12.0, 50.0), [OUTLINE, circle((0.5, 0.5), (0.1, 0.2))]
    )
    whole = 2 * np.pi * 12 * 50
    truth = whole * (1 - np.pi * 0.02)
    edge = 2 * 2 * np.pi * 12 + 2 * (2 * np.pi * 12 * 0.2 + 50 * 0.4)
    for tolerance in (0.1, 0.01):
        result = tessellate(surface, tolerance)
        # Triangles inside by d have a part d / R less area; edges may be aside by d.
        allowed = result.deviation_bound * (whole / 12 + edge)
        assert abs(result.mesh.area - truth) <= allowed
        assert result.mesh.euler_number == -1
        assert result.deviation_bound <= tolerance


SURFACES = {
    "plate": plate(),
    "bumpy": bumpy(),
    "sheet": sheet(),
    "turned": turned_part(),
    "ring": ring(),
    "torus": windowed_torus(),
    "annulus": TrimmedSurface(SQUARE, [circle((0.5, 0.5), 0.5), circle((0.5, 0.5), 0.3)]),
    "across the seam": TrimmedSurface(TUBE, [OUTLINE, circle((0.0, 0.5), (0.1, 0.25))]),
    "touches the border": TrimmedSurface(TUBE, [OUTLINE, circle((0.5, 0.25), (0.1, 0.25))]),
    "touches the seam": TrimmedSurface(TUBE, [OUTLINE, circle((0.1, 0.5), (0.1, 0.25))]),
    "half, from the seam": TrimmedSurface(TUBE, [polygon([(0, 0), (0.5, 0), (0.5, 1), (0, 1)])]),
    "tiny island": TrimmedSurface(TUBE, [circle((0.3, 0.3), 1e-7)]),
    "nested": TrimmedSurface(TUBE, [circle((0.5, 0.5), r) for r in (0.4, 0.3, 0.2)]),
    "needle": TrimmedSurface(TUBE, [polygon([(0.1, 0.1), (0.9, 0.5), (0.1, 0.1 + 1e-9)])]),
    "from pole to pole": TrimmedSurface(
        Sphere((0, 0, 0), 1.0), [polygon([(-0.1, 0), (0.3, 0), (0.3, 1), (-0.1, 1)])]
    ),
    "lens": TrimmedSurface(
        SQUARE,
        [[Curve2([(0.1, 0.5), (0.5, 0.502), (0.9, 0.5)]), Curve2([(0.9, 0.5), (0.5, 0.5), (0.1, 0.5)])]],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SURFACES)
def test_both_ways_no_point_is_farther_than_the_bound(name):
    surface = SURFACES[name]
    result = tessellate(surface, 0.03 * surface.size)
    stated = result.deviation_bound * (1 + 1e-9) + 1e-15
    assert result.deviation_bound <= 0.03 * surface.size
    rng = np.random.default_rng(1)
    u, v = rng.random((2, 400))
    inside, _ = surface.contains(u, v)
    edge = border(surface, 60)
    points = np.concatenate([surface.point(u[inside], v[inside]), edge])
    assert distances(points, result).max() <= stated
    # From the mesh: to the same (u, v) where that is inside, to an edge elsewhere.
    weights = rng.dirichlet((0.5, 0.5, 0.5), len(result))
    at = np.einsum("fk,fkx->fx", weights, result.mesh.triangles)
    uv = np.clip(np.einsum("fk,fkx->fx", weights, result.uv), 0, 1)
    apart = np.linalg.norm(at - surface.point(*uv.T, result.patch_id), axis=1)
    assert apart.max() <= stated
    fine = border(surface, 500)
    step = 4 * surface.size / 499
    for point in at[~surface.contains(*uv.T)[0]][:50]:
        assert np.linalg.norm(fine - point, axis=1).min() <= stated + step


@pytest.mark.parametrize("name", SURFACES)
def test_triangles_do_not_overlap_and_only_borders_are_open(name):
    surface = SURFACES[name]
    result = tessellate(surface, 0.01 * surface.size)
    areas = np.linalg.det(result.uv[:, 1:] - result.uv[:, :1])
    assert areas.min() > -1e-15
    edges = np.stack([result.faces, np.roll(result.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    assert len(np.unique(edges, axis=0)) == len(edges)
    _, place, counts = np.unique(np.sort(edges), axis=0, return_inverse=True, return_counts=True)
    ends = np.stack([result.uv, np.roll(result.uv, -1, axis=1)], axis=2).reshape(-1, 2)
    open_ends = ends.reshape(-1, 2, 2)[counts[place] == 1].reshape(-1, 2)
    # A vertex of the border is on a curve: a box of some roundings around it is crossed by one.
    boxes = np.stack([open_ends - 1e-13, open_ends + 1e-13], axis=2).reshape(-1, 4)
    on_square = ((open_ends == 0.0) | (open_ends == 1.0)).any(axis=1)
    assert (on_square | (surface.sides(boxes) == 2)).all()


def even_odd_area(loops):
    """The area within the square: between the heights of corners and crossings, widths are linear."""
    sides = np.array([curve.control for loop in loops for curve in loop])
    heights = {0.0, 1.0, *sides[..., 1].ravel()}
    for (a, b), (c, d) in combinations(sides, 2):
        across = np.linalg.det([b - a, d - c])
        if across:
            heights.add(float(a[1] + np.linalg.det([c - a, d - c]) / across * (b - a)[1]))
    area = 0.0
    for low, high in pairwise(sorted(h for h in heights if 0 <= h <= 1)):
        middle = 0.5 * (low + high)
        crossed = sides[(sides[:, 0, 1] > middle) != (sides[:, 1, 1] > middle)]
        (x, y), (z, w) = crossed[:, 0].T, crossed[:, 1].T
        at = np.clip(np.sort(x + (middle - y) / (w - y) * (z - x)), 0, 1)
        area += (at[1::2] - at[::2]).sum() * (high - low)
    return area


def slanted(corners):
    return polygon(np.array(corners) / 16)


POLYGONS = {
    "notch along the border": [OUTLINE, polygon([(0.25, 0), (0.5, 0), (0.5, 0.5), (0.25, 0.5)])],
    "hole along a line of leaves": [OUTLINE, polygon([(0.5, 0.5), (1, 0.5), (1, 1), (0.5, 1)])],
    "edges in common": [
        polygon([(0.1, 0.1), (0.7, 0.1), (0.7, 0.9), (0.1, 0.9)]),
        polygon([(0.3, 0.1), (0.5, 0.1), (0.5, 0.4), (0.3, 0.4)]),
    ],
    "island where a hole is outside": [
        polygon([(0.1, 0.1), (0.6, 0.1), (0.6, 0.6), (0.1, 0.6)]),
        polygon([(0.4, 0.4), (0.9, 0.4), (0.9, 0.9), (0.4, 0.9)]),
    ],
    "beyond the square": [polygon([(-0.5, 0.25), (1.5, 0.25), (1.5, 0.75), (-0.5, 0.75)])],
    "touching in a point": [
        OUTLINE,
        polygon([(0.2, 0.2), (0.5, 0.2), (0.5, 0.5), (0.2, 0.5)]),
        polygon([(0.5, 0.5), (0.8, 0.5), (0.8, 0.8), (0.5, 0.8)]),
    ],
    "nothing": [polygon([(0.2, 1.2), (0.8, 1.2), (0.5, 1.8)])],
    "star": [slanted([(8, 16), (3, 1), (16, 10), (0, 10), (13, 1)])],
    # Crossings that are not on whole numbers, on lines that leave others by a rounding.
    "crossing lines": [
        slanted([(3, 11), (4, 15), (11, 7), (2, 5), (15, 5), (15, 8), (11, 15), (0, 0)]),
        OUTLINE,
    ],
    # As files have them: borders and lines of leaves that are missed by some roundings.
    "beside the border": [
        polygon(
            [(1e-13, -1e-12), (1 + 1e-13, 2e-13), (1 - 7e-14, 1 + 1.03e-12), (-1e-13, 1 + 2e-13)]
        )
    ],
    "leaning from a line of leaves": [
        polygon([(0.5, 0.1), (0.9, 0.1), (0.9, 0.9), (0.5 - 6.8e-14, 0.9)])
    ],
    "through corners of leaves": [slanted([(0, 0), (16, 16), (16, 0), (0, 16)])],
}


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("bend", [0.0, 0.4])
def test_loops_of_straight_lines_keep_their_area(name, bend):
    loops = POLYGONS[name]
    z = bend * np.array([[0, 1, 0], [1, -1, 1], [0, 1, 0]])
    x, y = np.meshgrid([0, 0.5, 1], [0, 0.5, 1], indexing="ij")
    surface = TrimmedSurface(BezierPatches(np.stack([x, y, z], axis=-1)[None]), loops)
    result = tessellate(surface, 0.01)
    areas = 0.5 * np.linalg.det(result.uv[:, 1:] - result.uv[:, :1])
    assert (areas > -1e-15).all()
    assert areas.sum() == pytest.approx(even_odd_area(loops), abs=1e-11)


@pytest.mark.parametrize("suffix", ["stl", "ply", "glb"])
def test_one_line_exports_it(suffix, tmp_path):
    result = tessellate(drilled_tube(), 0.05)
    result.mesh.export(tmp_path / f"tube.{suffix}")
    again = trimesh.load(tmp_path / f"tube.{suffix}", force="mesh")
    again.merge_vertices()
    assert again.is_watertight
    assert again.volume == pytest.approx(result.mesh.volume, rel=1e-5)  # single precision


def test_what_cannot_be_meshed_is_named():
    with pytest.raises(ValueError, match="is an empty list"):
        tessellate([], 0.1)
    with pytest.raises(TypeError, match=r"surface\[1\] is 3: pass surfaces"):
        tessellate([SQUARE, 3], 0.1)
    with pytest.raises(TypeError, match=r"Asphere.*: pass BezierPatches"):
        tessellate(cut_lens(), 0.1)
    with pytest.raises(ValueError, match="max_triangles = 100"):
        tessellate(BODIES["tube"][0], 1e-6, max_triangles=100)


@pytest.mark.parametrize(("share", "vertices"), [(1.0, 6), (1e-6, 8)])
def test_a_wide_curve_widens_no_other_one(share, vertices):
    """Two squares 0.1 apart, whose far sides have a gap of 0.2 and whose near ones a share of that."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]

    def square(x, wide):
        sides = polygon(corners)
        loop = [Curve2(c.control, None, 1.0 if k == wide else share) for k, c in enumerate(sides)]
        return TrimmedSurface(Rectangle((x, 0, 0), (1, 0, 0), (0, 1, 0)), [loop], 0.2)

    mesh = tessellate([square(0.0, 1), square(-1.1, 3)], 0.01)
    assert len(mesh.vertices) == vertices


def test_edges_of_two_faces_on_each_other_are_told_apart():
    """A square and its back with the same diagonal: one of them gets a vertex in its middle."""
    points = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    faces = np.array([(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)])
    of = np.array([0, 0, 1, 1], np.int32)
    more, faces, uv, rows = _with_edges_of_two(points, faces, points[faces][:, :, :2], of)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    assert (np.unique(edges.reshape(-1, 2), axis=0, return_counts=True)[1] == 2).all()
    assert more[4:].tolist() == [[0.5, 0.5, 0.0]]
    np.testing.assert_array_equal(more[faces][:, :, :2], uv)
    normal = np.cross(*(more[faces][:, k] - more[faces][:, 0] for k in (1, 2)))[:, 2]
    assert (np.sign(normal) == np.where(of[rows] == 0, 1, -1)).all()
