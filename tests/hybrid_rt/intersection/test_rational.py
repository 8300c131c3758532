"""First hits on rational patches and on sheets: closed forms, exact arithmetic, polynomial twins."""

import numba
import numpy as np
import pytest
from rational_surfaces import bumpy, cylinder, octant, petal, sphere

from hybrid_rt import Intersector, Status
from hybrid_rt.intersection.kernels.patch import bicubic
from hybrid_rt.lights.cells import Cells
from meshing import BezierPatches, NurbsSurface, tessellate
from proof.exact.judge import ExactJudge

EPS = 2.0**-52
COLUMNS = ("t", "object_id", "patch_id", "u", "v", "position", "normal", "status", "t_bound")


def units(n, rng):
    vectors = rng.normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def chords(n, seed, reach=1.0):
    """Rays from around the unit ball to points of the cube around it."""
    rng = np.random.default_rng(seed)
    start = 3.0 * units(n, rng)
    return start, reach * rng.uniform(-1, 1, (n, 3)) - start


def quadric_times(origins, directions, form, is_on):
    """First t > 0 at which a quadric x.form.x = 1 is met in a point that is on the surface."""
    o, d = origins.astype(np.longdouble), directions.astype(np.longdouble)
    a, b, c = (d * d) @ form, (o * d) @ form, (o * o) @ form - 1
    first = np.full(len(o), np.inf, np.longdouble)
    with np.errstate(all="ignore"):
        root = np.sqrt(b * b - a * c)
        # Without cancellation: the products of both roots is c / a.
        q = -(b + np.sign(b) * root)
        for t in (q / a, c / q):
            on = (t > 0) & is_on(o + t[:, None] * d)
            first = np.where(on & (t < first), t, first)
    return first


@pytest.mark.parametrize(
    ("surface", "form", "is_on"),
    [
        (BezierPatches(*([x] for x in octant())), (1, 1, 1), lambda p: (p >= 0).all(axis=1)),
        (sphere(), (1, 1, 1), lambda p: p[:, 0] < 2),
        (cylinder(), (1, 1, 0), lambda p: abs(p[:, 2]) <= 1),
    ],
    ids=["octant", "sphere", "cylinder"],
)
def test_quadrics_by_their_closed_form(surface, form, is_on):
    rays = chords(20_000, 1)
    hits = Intersector([surface], coarse="none").intersect(*rays)
    t = quadric_times(*rays, np.array(form, np.longdouble), is_on)
    sure = hits.status != Status.TANGENT
    assert (~sure).sum() <= 2
    np.testing.assert_array_equal(hits.hit[sure], np.isfinite(t)[sure])
    both = sure & hits.hit
    error = np.abs(hits.t[both] - t[both])
    # The control points are rounded: that moves the surface by an ulp or two.
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal, rays[1]))[both]
    assert (error <= hits.t_bound[both] + 2 * EPS / cosine).all()
    assert np.quantile(error, 0.999) < 1e-13
    assert (
        np.abs(hits.position[both] - rays[0][both] - hits.t[both, None] * rays[1][both]).max()
        < 1e-14
    )


def test_sphere_is_crossed_twice_also_on_seams_and_poles():
    rng = np.random.default_rng(2)
    away = units(400, rng)
    away[:100, 2] = 0.0  # through the equator and the seams that it crosses
    away[100:200, 0] = 0.0
    away[200:210] = (0.0, 0.0, 1.0)
    away /= np.linalg.norm(away, axis=1)[:, None]
    crossings = Intersector([sphere()], coarse="none").intersect_all(3 * away, -away)
    np.testing.assert_array_equal(crossings.count, 2)
    np.testing.assert_allclose(crossings.hits.t.reshape(-1, 2), [[2.0, 4.0]] * 400, atol=1e-14)


def hard_rays(surface, n, seed):
    """Rays past borders, corners and points within patches at 1e-1 to 1e-14, some nearly tangent."""
    rng = np.random.default_rng(seed)
    base = surface.pieces if isinstance(surface, NurbsSurface) else surface
    u, v = rng.random((2, n))
    side, patch = rng.integers(0, 6, n), rng.integers(len(base), size=n)
    u, v = np.where(side < 2, side, u), np.where((side == 2) | (side == 3), side - 2, v)
    corner = side == 4
    u[corner], v[corner] = rng.integers(0, 2, (2, corner.sum()))
    size = np.linalg.norm(np.diff(surface.bounds, axis=0))
    beside = 10.0 ** -rng.uniform(1, 14, n) * size
    target = base.point(u, v, patch) + beside[:, None] * units(n, rng)
    normal, direction = base.normal(u, v, patch), units(n, rng)
    grazing = rng.random(n) < 0.4
    keep = np.where(grazing, 10.0 ** -rng.uniform(0, 10, n), 1.0)[:, None]
    along = np.einsum("ij,ij->i", direction, normal)[:, None] * normal
    direction = direction - along + keep * along
    origin = target - size * rng.uniform(0.3, 2, (n, 1)) * direction
    return origin, direction, beside


def nurbs():
    rng = np.random.default_rng(6)
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    net = np.stack([x, y, 0.7 * rng.normal(size=(5, 4))], axis=2)
    return NurbsSurface(
        net, [0, 0, 0, 0, 1, 3, 3, 3, 3], [0, 0, 0, 1, 2, 2, 2], (3, 2), 0.5 + rng.random((5, 4))
    )


@pytest.mark.parametrize(
    "make",
    [
        sphere, petal, nurbs, lambda: BezierPatches(*([x] for x in bumpy(3, 3, 0.7, 4))),
        lambda: BezierPatches(*([x] for x in bumpy(5, 6, 0.4, 7))),
    ],
    ids=["sphere", "petal", "nurbs", "bicubic", "degrees 5 and 6"],
)  # fmt: skip
def test_hard_rays_by_exact_crossings(make):
    surface = make()
    origins, directions, beside = hard_rays(surface, 60, 3)
    records = [
        Intersector([surface], coarse=way).intersect(origins, directions)
        for way in ("none", "embree")
    ]
    for name in COLUMNS:
        first, second = (getattr(record, name) for record in records)
        np.testing.assert_array_equal(first, second, err_msg=name)
    verdict = ExactJudge([surface]).judge(records[0], origins, directions, distance=beside)
    assert verdict.hits > 20
    assert verdict.n_wrong == verdict.wrong_tangent == verdict.left_open == 0
    assert verdict.bounds_broken == verdict.off_ray == verdict.unmarked == 0
    assert verdict.worst_bound <= 1.0


def test_equal_weights_are_the_polynomial_patches_and_nearly_equal_ones_agree():
    net, noise = bumpy(3, 3, 1e-13, 5)
    rays = chords(5000, 4, 0.7)
    plain, equal, near = (
        Intersector([BezierPatches([net - 0.5], weights)]).intersect(*rays)
        for weights in (None, [np.full((4, 4), 0.3)], [noise])
    )
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(plain, name), getattr(equal, name), err_msg=name)
    sure = (plain.status == Status.HIT) & (near.status == Status.HIT)
    assert sure.sum() > 1000
    # 1e-13 of the weights moves points by less.
    slope = np.abs(np.einsum("ij,ij->i", plain.normal[sure], rays[1][sure]))
    assert (np.abs(plain.t[sure] - near.t[sure]) <= 1e-12 / slope + plain.t_bound[sure]).all()


def test_the_pace_of_the_parameters_changes_no_hit():
    """A28: weights w_i c^i give the same sphere, u and v moved: Moebius, down to 1e-6."""
    net, weights = octant()
    rays = chords(4000, 5)
    same = Intersector([BezierPatches([net], [weights])], coarse="none").intersect(*rays)
    for c in (0.5, 0.03, 1.2e-3, 16.0, 800.0):
        pace = c ** np.arange(3.0)
        moved = BezierPatches([net], [weights * pace[:, None]])
        hits = Intersector([moved], coarse="none").intersect(*rays)
        sure = (same.status == Status.HIT) & (hits.status == Status.HIT)
        assert (hits.hit == same.hit)[(same.status != Status.TANGENT)].all()
        assert sure.sum() > 0.9 * same.hit.sum()
        slack = hits.t_bound[sure] + same.t_bound[sure]
        assert (np.abs(hits.t[sure] - same.t[sure]) <= slack).all()


def test_what_leaves_a_sphere_does_not_meet_its_departure():
    surface = sphere()
    tracer = Intersector([surface], coarse="none")
    first = tracer.intersect(*chords(3000, 6))
    first = first[first.hit]
    out = tracer.intersect(first.position, first.normal * np.sign(
        np.einsum("ij,ij->i", first.normal, first.position))[:, None], source=first)  # fmt: skip
    assert not out.hit.any()
    assert not tracer.occluded(2 * first.position, -first.position, t_max=1.0, target=first).any()


def test_sheets_have_one_u_and_v_in_every_accuracy():
    surface = nurbs()
    rng = np.random.default_rng(7)
    origins = rng.uniform((0.2, 0.2, 5), (3.8, 2.8, 6), (800, 3))
    directions = np.array((0.05, -0.02, -1.0)) + np.zeros((800, 3))
    for accuracy, most in (("certified", 1e-13), ("refined", 1e-13), ("mesh", 0.1)):
        hits = Intersector([surface], accuracy=accuracy).intersect(origins, directions)
        found = hits[hits.hit]
        assert len(found) > 700
        for patch in (found.patch_id, None):
            gap = surface.point(found.u, found.v, patch) - found.position
            assert np.abs(gap).max() < most
        assert len(np.unique(found.patch_id)) == len(surface) == 4


@numba.njit
def _values(control, u, v):
    return (
        bicubic.evaluate_rational_bicubic(control, 0, u, v),
        bicubic.evaluate_rational_biquadratic(control, 1, u, v),
    )


def test_vector_code_has_twins():
    rng = np.random.default_rng(10)
    for u, v in rng.uniform(0.0, 1.0, (20, 2)):
        control = rng.normal(size=(16, 4))
        control[:, 3] = rng.uniform(0.5, 2.0, 16)
        cubic, quadratic = _values(control, u, v)
        twins = (
            bicubic.evaluate_rational_bicubic_plain(control, 0, u, v),
            bicubic.evaluate_rational_biquadratic_plain(control, 1, u, v),
        )
        np.testing.assert_array_equal(cubic, twins[0])
        np.testing.assert_array_equal(quadratic, twins[1])
        for values, rows, side in ((cubic, control, 4), (quadratic, control[1:10], 3)):
            net, weights = rows[:, :3] / rows[:, 3:], rows[:, 3].reshape(side, side)
            surface = BezierPatches([net.reshape(side, side, 3)], [weights])
            points = (surface.point(u, v), *surface.partials(u, v))
            np.testing.assert_allclose(values, np.concatenate(points, axis=None), atol=1e-12)


def test_light_is_taken_from_all_of_a_sheet():
    surface, rng = nurbs(), np.random.default_rng(11)
    cells, n = Cells(surface), 4000
    seen_from = np.tile((2.0, 1.5, 9.0), (n, 1))
    patch, u, v, density = cells.choose(seen_from, rng.random((n, 2)))
    # Both ways to the density; points on a border of cells aside.
    np.testing.assert_allclose(cells.pdf_area(seen_from, patch, u, v), density, rtol=1e-6)
    low, high = surface.spans[patch][:, ::2], surface.spans[patch][:, 1::2]
    assert ((low <= np.stack([u, v], 1)) & (np.stack([u, v], 1) <= high)).all()
    # The mean of 1 / pdf is the area, to four standard errors.
    ratio = 1.0 / density
    area = tessellate(surface, 1e-3).mesh.area
    assert abs(ratio.mean() - area) < 4 * ratio.std() / np.sqrt(n) + 1e-3 * area
