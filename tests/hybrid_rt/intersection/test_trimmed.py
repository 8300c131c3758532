"""First hits on trimmed surfaces: closed forms, exact arithmetic beside edges, all queries agree."""

import dataclasses
import pickle

import numpy as np
import pytest
from trimmed_surfaces import (
    OUTLINE,
    ball_piece,
    bumpy,
    cap,
    cut_lens,
    edge_rays,
    part_of_cone,
    plate,
    ring,
    sheet,
    slanted_plane,
    turned_part,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)

from hybrid_rt import Box, Intersector, Rectangle, Sphere, Status
from hybrid_rt.core.records import Flag
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.kernels.search.axial_trims import rough_share
from hybrid_rt.intersection.kinds.patches import PatchKind
from hybrid_rt.trimesh_adapter import RayMeshIntersector
from meshing import (
    BezierPatches,
    Curve2,
    Cylinder,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    polygon,
)
from proof.exact.judge import ExactJudge

SURFACES = {
    "plate": plate, "bumpy": bumpy, "sheet": sheet, "ball_piece": ball_piece,
    "windowed_cylinder": windowed_cylinder, "part_of_cone": part_of_cone, "cap": cap,
    "slanted_plane": slanted_plane, "turned_part": turned_part, "ring": ring,
    "windowed_ball": windowed_ball, "windowed_torus": windowed_torus, "cut_lens": cut_lens,
}  # fmt: skip
each = pytest.mark.parametrize("name", SURFACES)


def columns(record):
    return [getattr(record, item.name) for item in dataclasses.fields(record)]


def assert_same(one, other):
    for a, b in zip(columns(one), columns(other), strict=True):
        np.testing.assert_array_equal(a, b)


def down(points, height=2.0):
    """Rays straight down onto points (n, 2)."""
    origins = np.column_stack([points, np.full(len(points), height)])
    return origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)


@each
def test_hits_beside_edges_are_the_exact_ones(name):
    surface = SURFACES[name]()
    origins, directions, beside = edge_rays(surface, 24, 11)
    hits = Intersector([surface], coarse="none").intersect(origins, directions)
    verdict = ExactJudge([surface]).judge(hits, origins, directions, distance=beside)
    # Behind the windows of a ball there is the ball.
    assert 0 < verdict.hits < (25 if name == "windowed_ball" else 24)
    assert verdict.faults == verdict.left_open == 0
    assert verdict.worst_bound <= 1.0


@each
def test_all_queries_agree(name):
    surface = SURFACES[name]()
    scene = [surface, Sphere((0.2, 0, -1.5), 0.4)]
    *rays, beside = edge_rays(surface, 3000, 5)
    alone = Intersector(scene, coarse="none", threads=1)
    hits = alone.intersect(*rays)
    assert_same(hits, Intersector(scene, threads=1).intersect(*rays))
    assert_same(hits, Intersector(scene, coarse="none", threads=2).intersect(*rays))
    np.testing.assert_array_equal(alone.occluded(*rays), hits.hit)
    # All crossings are those of the whole surface that are inside, and its first is the first hit.
    all_of = alone.intersect_all(*rays)
    first = all_of.offsets[:-1][all_of.count > 0]
    assert_same(all_of.hits[first], hits[hits.hit])
    whole = Intersector([surface.surface, scene[1]], coarse="none").intersect_all(*rays)
    v = whole.hits.v
    if isinstance(surface.surface, SurfaceOfRevolution):  # hits on a whole one have v of segments
        k = np.where(whole.hits.object_id == 0, whole.hits.patch_id, 0)
        v = surface.surface.v_breaks[k] + v * np.diff(surface.surface.v_breaks)[k]
    inside = surface.contains(np.clip(whole.hits.u, 0, 1), np.clip(v, 0, 1))[0]
    kept = inside | (whole.hits.object_id == 1)
    sure = beside > 1e-9
    for crossings in (whole, all_of):
        sure[crossings.ray[crossings.hits.status == Status.TANGENT]] = False
    sure &= hits.status != Status.TANGENT
    count = np.bincount(whole.ray[kept], minlength=len(sure))
    np.testing.assert_array_equal(all_of.count[sure], count[sure])
    assert sure.mean() > 0.4


def test_plate_with_a_round_hole_by_its_closed_form():
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (20_000, 2))
    tracer = Intersector(plate(), coarse="none")
    hits = tracer.intersect(*down(points))
    r = np.hypot(*points.T)
    np.testing.assert_array_equal(hits.hit, (np.abs(points).max(axis=1) <= 1) & (r >= 0.5))
    np.testing.assert_allclose(hits.t[hits.hit], 2.0, atol=1e-15)
    assert (hits.status[hits.hit] == Status.HIT).all()
    # Within the band of the edge, and nowhere else, TANGENT: 64 eps x 3 is 4.3e-14.
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 500)
    for beside in (0.0, 1e-14, -1e-14, 3e-14, 1e-13, -1e-13, 1e-6, -1e-6):
        at = (0.5 + beside) * np.column_stack([np.cos(angle), np.sin(angle)])
        hits = tracer.intersect(*down(at))
        is_open = abs(beside) < 4e-14
        assert ((hits.status == Status.TANGENT) == is_open).all()
        assert is_open or (hits.hit == (beside > 0)).all()


def test_window_in_a_cylinder_shows_the_far_wall():
    surface = windowed_cylinder()
    # From outside through the middle of the window across the seam, and beside it.
    middle, beside = surface.point([0.0, 0.3], [0.5, 0.5])
    axis_point = surface.surface.origin + surface.surface.axis
    o = 3 * (np.array([middle, beside]) - axis_point) + axis_point
    hits = Intersector(surface).intersect(o, axis_point - o)
    assert (hits.t[0] > 1.0) != (hits.t[1] > 1.0)
    # The wall of radius 1, on the far side after 4 / 3 of the way, is there but for the round hole.
    np.testing.assert_allclose(hits.t[1], 2 / 3, rtol=1e-12)
    through = Intersector(surface).intersect_all(o, axis_point - o)
    assert through.count.tolist() == [int(hits.hit[0]), 2]


def test_rays_leave_trimmed_surfaces_by_identity():
    surface = bumpy()
    rays = edge_rays(surface, 2000, 9)[:2]
    tracer = Intersector(surface, coarse="none")
    hits = tracer.intersect(*rays)
    hits, ways = hits[hits.hit], rays[1][hits.hit]
    again = tracer.intersect(hits.position, ways, source=hits)
    all_of = tracer.intersect_all(*rays)
    np.testing.assert_array_equal(again.hit, all_of.count[all_of.count > 0] > 1)


def test_a_root_behind_that_the_band_moves_ahead_is_open():
    # The ray runs down through the plane at 1e-14 of its length, just behind its origin: moved by the
    # band, 64 eps x 2, it would pass anywhere up to the hole and beyond.
    hole = polygon([(0.5, 0.25), (0.75, 0.25), (0.75, 0.75), (0.5, 0.75)])
    surface = TrimmedSurface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), [OUTLINE, hole])
    z = np.array([-1e-18, -1e-12, 1e-18])
    origins = np.column_stack([np.full(3, 0.45), np.full(3, 0.5), z])
    hits = Intersector(surface).intersect(origins, (1, 0, -1e-14))
    assert hits.status.tolist() == [Status.TANGENT, Status.MISS, Status.TANGENT]


def test_limits_of_t_pass_over_roots():
    two = [plate(), plate().transformed(np.diag([1, 1, 1, 1.0]) - np.eye(4, k=3) * 1.0)]
    rays = down(np.array([(0.8, 0.8), (0.0, 0.0)]))
    tracer = Intersector([two[0], BezierPatches(two[1].surface.patches)], coarse="none")
    assert tracer.intersect(*rays).object_id.tolist() == [0, 1]
    assert tracer.intersect(*rays, t_min=2.5).object_id.tolist()[1] in (1, -1)
    assert tracer.intersect(*rays, t_max=1.5).object_id.tolist() == [-1, -1]


def test_hits_within_the_gap_are_edges():
    gap = 1e-3
    tracer, exact = Intersector(plate(gap=gap)), Intersector(plate())
    angle = np.linspace(0, 6, 50)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    for beside, is_hit, is_edge in (
        (-1.1e-3, False, False), (-0.9e-3, True, True), (0.9e-3, True, True),
        (1.1e-3, True, False),
    ):  # fmt: skip
        rays = down((0.5 + beside) * ring)
        hits = tracer.intersect(*rays)
        assert (hits.hit == is_hit).all()
        assert ((hits.flags & Flag.EDGE > 0) == is_edge).all()
        assert (exact.intersect(*rays).hit == (beside > 0)).all()
        if is_edge:
            assert (hits.t_bound >= gap).all()
            assert (hits.t_bound <= 1.001 * gap).all()
    # Of a curve that has a tenth of the gap it is a tenth.
    hole = [Curve2(c.control, c.weights, 0.1) for c in plate().loops[1]]
    shared = TrimmedSurface(plate().surface, [plate().loops[0], hole], gap)
    for image in (shared, pickle.loads(pickle.dumps(shared)), shared.flipped().flipped()):
        narrow = Intersector(image)
        for beside, is_edge in ((-0.9e-4, True), (1.1e-4, False), (0.9e-3, False)):
            hits = narrow.intersect(*down((0.5 + beside) * ring))
            assert ((hits.flags & Flag.EDGE > 0) == is_edge).all()
        assert not narrow.intersect(*down((0.5 - 1.1e-4) * ring)).hit.any()
    # Met at 60 degrees the gap reaches twice as far along the surface, and along the ray.
    slanted = np.array([np.sqrt(3.0), 0.0, -1.0])
    for beside, is_hit in ((-1.9e-3, True), (-2.1e-3, False)):
        at = np.array([0.5 + beside, 0.0, 0.0])
        hits = tracer.intersect(at - slanted, slanted)
        assert hits.hit[0] == is_hit
        if is_hit:
            np.testing.assert_allclose(hits.t_bound, 2 * gap / 2, rtol=1e-3)
            np.testing.assert_array_equal(tracer.occluded(at - slanted, slanted), [True])


def test_edge_at_a_seam_is_an_edge():
    # A cylinder of radius 1 cut at u = 0 and 0.4, so that there is nothing below y = 0 beside (1, 0).
    tube = SurfaceOfRevolution([(0, 1), (2, 1)], (0, 0, 0), (0, 0, 1), (1, 0, 0))
    surface = TrimmedSurface(tube, [polygon([(0, 0), (0.4, 0), (0.4, 1), (0, 1)])])
    y = np.array([0, 1e-18, -1e-18, 1e-14, -1e-14, 1e-12, -1e-12])
    origins = np.column_stack([np.full(len(y), 3.0), y, np.full(len(y), 1.0)])
    hits = Intersector(surface).intersect(origins, [-1, 0, 0], t_max=3.0)
    # 64 eps x 3 is 4.3e-14.
    np.testing.assert_array_equal(hits.status == Status.TANGENT, np.abs(y) < 4e-14)
    np.testing.assert_array_equal(hits.hit[-2:], [True, False])


def test_segments_of_one_cylinder_are_hit_as_one():
    loops = windowed_cylinder().loops
    one = SurfaceOfRevolution([(0, 1), (2, 1)], (0, 0, 0), (0, 0, 1))
    parts = [[(0, 1), (0.5, 1)], [(0.5, 1), (1.5, 1)], [(1.5, 1), (2, 1)]]
    three = SurfaceOfRevolution(parts, (0, 0, 0), (0, 0, 1))
    assert three.v_breaks.tolist() == [0, 0.25, 0.75, 1]
    rays = edge_rays(TrimmedSurface(one, loops), 3000, 8)[:2]
    hits, same = (Intersector(TrimmedSurface(s, loops)).intersect(*rays) for s in (three, one))
    # A root as far from an edge as the band is wide may be told either way.
    assert (hits.status != same.status).sum() <= 3
    sure = (hits.status != Status.TANGENT) & (same.status != Status.TANGENT)
    np.testing.assert_array_equal(hits.hit[sure], same.hit[sure])
    assert sure.mean() > 0.7
    hits, same = hits[sure], same[sure]
    np.testing.assert_allclose(hits.t[hits.hit], same.t[hits.hit], rtol=1e-12)
    np.testing.assert_allclose(hits.v[hits.hit], same.v[hits.hit], atol=1e-12)
    at = np.array([0.0, 0.25, 0.75])
    np.testing.assert_array_equal(
        hits.patch_id[hits.hit], np.searchsorted(at, hits.v[hits.hit], side="right") - 1
    )


def test_band_reaches_beyond_a_bend_that_a_ray_sees_along():
    # A disc, then a cone that widens by 1e-3 of its length, cut after 1e-11: seen along the axis the
    # cut is 1e-14 beyond the disc, within the band of 64 eps x 2.8; on the surface it is far from it.
    part = SurfaceOfRevolution([[(0, 0.2), (0, 1)], [(0, 1), (1, 1.001)]], (0, 0, 0), (0, 0, 1))
    end = part.v_breaks[1] + 1e-11 * (1 - part.v_breaks[1])
    surface = TrimmedSurface(part, [polygon([(0, 0), (1, 0), (1, end), (0, end)])])
    r = 1 - np.array([1e-15, 1e-14, 1e-12, 1e-9])
    origins = np.column_stack([r * np.cos(1), r * np.sin(1), np.full(4, -1.0)])
    hits = Intersector(surface).intersect(origins, [0, 0, 1])
    np.testing.assert_array_equal(hits.status == Status.TANGENT, r > 1 - 3e-14)
    assert hits.hit.all()


@pytest.mark.parametrize("is_flipped", [False, True])
@pytest.mark.parametrize("name", ["windowed_ball", "windowed_torus", "cut_lens"])
def test_edges_of_surfaces_about_an_axis(name, is_flipped):
    # Cut at v = 1/2, met along the normal beside that: distances on the surface are those in space.
    whole = SURFACES[name]().surface
    whole = whole.flipped() if is_flipped else whole
    gap, u = 1e-4, np.random.default_rng(4).random(40)
    speed = np.linalg.norm(whole.partials(0.3, 0.5)[1])
    lower = [polygon([(0, 0), (1, 0), (1, 0.5), (0, 0.5)])]
    exact, wide = (TrimmedSurface(whole, lower, gap=g) for g in (0.0, gap))
    for beside in (-1e-5, -1e-12, 0.0, 1e-12, 0.9e-4, 1.1e-4, 1e-2):
        v = 0.5 + beside / speed
        point, normal = whole.point(u, v), whole.normal(u, v)
        rays = point + 0.05 * normal, -normal
        hits, hits_wide = (Intersector(s).intersect(*rays, t_max=0.1) for s in (exact, wide))
        # 64 eps x 3 is 4.3e-14.
        np.testing.assert_array_equal(hits.status == Status.TANGENT, beside == 0.0)
        assert beside == 0.0 or (hits.hit == (beside < 0.0)).all()
        np.testing.assert_array_equal(hits_wide.hit, beside < gap)
        np.testing.assert_array_equal(hits_wide.flags & Flag.EDGE > 0, abs(beside) < gap)
        if abs(beside) < gap:
            np.testing.assert_allclose(hits_wide.t_bound, gap, rtol=1e-3)


@pytest.mark.parametrize("gap", [1e-4, 0.01, 0.1, 0.5])
@pytest.mark.parametrize("name", ["rectangle", "patch", "cylinder"])
def test_loops_along_the_border_flag_the_hits_within_the_gap(name, gap):
    # 40 x 20 from the origin, and a cylinder as tall, met 3 right of its left end or on its ruling.
    surface, rays = {
        "rectangle": (Rectangle((0, 0, 0), (40, 0, 0), (0, 20, 0)), down),
        "patch": (
            BezierPatches([np.array([[[0, 0, 0], [0, 20, 0]], [[40, 0, 0], [40, 20, 0]]])]), down,
        ),
        "cylinder": (Cylinder((0, 0, 0), (0, 1, 0), 5.0, 20.0), beside_cylinder),
    }[name]  # fmt: skip
    border = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    trimmed = TrimmedSurface(surface, [border], gap=gap)
    for from_edge, is_edge in ((0.5 * gap, True), (0.99 * gap, True), (1.01 * gap, False)):
        points = np.array([[3.0, from_edge], [3.0, 20.0 - from_edge]])
        hits = Intersector(trimmed).intersect(*rays(points))
        assert hits.hit.all()
        np.testing.assert_array_equal(hits.flags & Flag.EDGE > 0, is_edge)


def beside_cylinder(points, height=8.0):
    """Rays against the cylinder's radius at heights y of points (n, 2)."""
    origins = np.column_stack([np.full(len(points), height), points[:, 1], np.zeros(len(points))])
    return origins, np.broadcast_to([-1.0, 0.0, 0.0], origins.shape)


def test_a_ball_among_others_is_hit_as_alone():
    surface = windowed_ball()
    rays = edge_rays(surface, 2000, 5)[:2]
    far = np.ptp(surface.bounds, axis=0).max() * 20 * np.eye(4, k=3)
    many = [surface, *(surface.transformed(np.eye(4) + k * far) for k in range(1, 12))]
    hits = Intersector(surface).intersect(*rays)
    assert hits.hit.sum() > 500
    assert_same(hits[hits.hit], Intersector(many).intersect(*rays)[hits.hit])


def test_sides_on_a_ball_at_the_borders_of_its_map():
    # Half axes 0.2 and 0.3 about a point of the seam; the map has 64 to 512 tiles a side.
    ball = Sphere((0.3, -0.2, 0.1), 2.0, pole=(1, 2, 3), meridian=(3, 0, -1))
    surface = TrimmedSurface(ball, [circle((0.0, 0.5), (0.2, 0.3))])
    u, v = np.random.default_rng(7).integers(0, 513, (2, 40_000)) / 512
    u, v = ((x + np.tile([-1e-6, -1e-12, 0, 1e-12, 1e-6], 8000)) % 1.0 for x in (u, v))
    directions = (ball.point(u, v) - ball.center) / ball.radius
    hits = Intersector(surface).intersect(np.tile(ball.center, (len(u), 1)), directions)
    beyond = ((u - np.round(u)) / 0.2) ** 2 + ((v - 0.5) / 0.3) ** 2 - 1.0
    clear = abs(beyond) > 1e-11
    np.testing.assert_array_equal(hits.hit[clear], beyond[clear] < 0.0)
    assert clear.mean() > 0.99
    assert 0.1 < hits.hit.mean() < 0.3
    assert (hits.status[abs(beyond) > 1e-9] != Status.TANGENT).all()


def test_rough_angles_are_as_near_as_they_say():
    angle = np.concatenate([np.linspace(0, 2 * np.pi, 100_001)[:-1], np.arange(8) * np.pi / 4])
    for size in (1.0, 1e-150, 1e150):
        x, y = size * np.cos(angle), size * np.sin(angle)
        got = np.array([rough_share(b, a) for b, a in zip(y, x, strict=True)])
        exact = np.arctan2(y, x) / (2 * np.pi)
        assert abs(got - (exact + (y < 0))).max() < 2e-6
        assert got.min() >= 0.0
        assert got.max() <= 1.0


@pytest.mark.parametrize("accuracy", ["refined", "mesh"])
def test_meshes_of_trimmed_surfaces_miss_only_beside_edges(accuracy):
    for surface in (sheet(), windowed_cylinder()):
        *rays, beside = edge_rays(surface, 4000, 3)
        truth = Intersector(surface, coarse="none").intersect(*rays)
        # Rays along the border of the surface itself miss the triangles there.
        whole = Intersector(surface.surface, coarse="none").intersect(*rays)
        inner = np.abs(np.column_stack([whole.u, whole.v]) - 0.5).max(axis=1) < 0.49
        rows = (beside > 1e-6) & inner
        hits = Intersector(surface, accuracy=accuracy, tolerance=1e-3).intersect(*rays)
        if accuracy == "refined":
            assert (hits.hit == truth.hit)[rows].mean() > 0.97
            both = hits.hit & truth.hit & rows
            assert (np.abs(hits.t[both] - truth.t[both]) < 1e-9).mean() > 0.99
        else:
            # Whole triangles stay where an edge runs through them.
            assert (hits.hit >= truth.hit)[rows].mean() > 0.99
            assert hits.hit[rows].sum() > truth.hit[rows].sum()


def test_loops_that_enclose_nothing_are_never_hit():
    twice = TrimmedSurface(plate().surface, [OUTLINE, OUTLINE])
    for coarse in ("embree", "none"):
        hits = Intersector(twice, coarse=coarse).intersect(*down(np.zeros((5, 2))))
        assert not hits.hit.any()


def test_other_surfaces_are_refused_by_name():
    with pytest.raises(TypeError, match=r"Box.*no other is trimmed"):
        TrimmedSurface(Box((0, 0, 0), (1, 1, 1)), [circle((0.5, 0.5), 0.2)])
    with pytest.raises(TypeError, match="each to its own"):
        PatchKind([(0, plate()), (1, plate().surface)], Pool(1))


def test_trimesh_queries_take_trimmed_surfaces():
    points = np.random.default_rng(1).uniform(-1.1, 1.1, (500, 2))
    inside = (np.abs(points).max(axis=1) <= 1) & (np.hypot(*points.T) >= 0.5)
    tracer, rays = RayMeshIntersector(plate(), coarse="none"), down(points)
    np.testing.assert_array_equal(tracer.intersects_any(*rays), inside)
    np.testing.assert_array_equal(tracer.intersects_first(*rays), inside - 1)
    locations, ray, piece = tracer.intersects_location(*rays)
    np.testing.assert_array_equal(ray, np.flatnonzero(inside))
    np.testing.assert_allclose(locations[:, :2], points[inside], atol=1e-15)
    assert not piece.any()


def test_repr_names_the_loops():
    assert repr(plate(gap=0.5)).endswith("2 loops of 8 curves, gap=0.5)")
    words = repr(Intersector([plate(), plate([polygon([(0, 0), (1, 0), (0, 1)])])], coarse="none"))
    assert "trimmed Bezier patches: 2" in words


def test_both_faces_of_an_edge_are_crossings_at_the_very_same_t():
    """A wedge of two squares, met where they meet: in by one and out by the other, or past both."""
    border, gap = [polygon([(0, 0), (1, 0), (1, 1), (0, 1)])], 1e-6
    wedge = [
        TrimmedSurface(Rectangle((0, 0, 0), (1, 0, side), (0, 1, 0)), border, gap)
        for side in (1, -1)
    ]
    wedge[1] = wedge[1].flipped()
    tracer = Intersector(wedge)
    for y in (0.5, 0.25):
        crossings = tracer.intersect_all((0, y, 4), (0, 0, -1))
        assert crossings.hits.t.tolist() == [4.0, 4.0]
        assert sorted(crossings.hits.front_face.tolist()) == [False, True]
        assert (crossings.hits.flags & Flag.EDGE).all()
    # From the side both are met from in front: one crossing.
    assert tracer.intersect_all((-4, 0.5, 0), (1, 0, 0)).count[0] == 1
