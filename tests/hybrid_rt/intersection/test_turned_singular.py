"""Rays at tips, poles, rims and joints of turned surfaces, in closed form and both ways.

tests/proof_tests/cases/test_campaign.py and the rows F01 to F03 and F08 hold them to exact arithmetic.
"""

import numpy as np
import pytest

from hybrid_rt import Intersector, Status
from meshing import SurfaceOfRevolution

EPS = 2.0**-52

SHAPES = {"cone": [[(0, 0), (2, 1)]], "paraboloid": [[(0, 0), (0, 0.5), (1, 1)]]}


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def aimed(surface, circle, beside, distance, n, rng):
    """Rays from all around at points this far beside a circle (z, r), from that distance."""
    turn = rng.uniform(0.0, 2.0 * np.pi, n)
    frame = np.stack([surface.radial, surface.binormal, surface.axis])
    at = np.stack([circle[1] * np.cos(turn), circle[1] * np.sin(turn), np.full(n, circle[0])], 1)
    at += beside * unit(rng.normal(size=(n, 3)))
    d = unit(rng.normal(size=(n, 3)))
    o = at - distance * rng.uniform(0.5, 1.5, (n, 1)) * d
    return surface.origin + o @ frame, d @ frame


def band_of(surface, origins):
    """64 eps x scale."""
    points = np.concatenate(surface.segments)
    low, high = points[:, 0].min(), points[:, 0].max()
    middle = surface.origin + 0.5 * (low + high) * surface.axis
    size = np.hypot(high - low, 2.0 * points[:, 1].max())
    return 64 * EPS * np.maximum(np.linalg.norm(origins - middle, axis=1), size)


def test_tangent_at_the_tip_of_a_cone_in_closed_form():
    """Seen along the ray a cone is a wedge: its tip, and two edges if the ray does not point in."""
    surface = SurfaceOfRevolution([(0, 0), (2, 1)], (0, 0, 0), (0, 0, 1))
    rng = np.random.default_rng(9)
    # From near the tip, where its figures are relative to 1e-3: exact beside the band of 3e-14.
    o, d = aimed(surface, (0, 0), 1.0, 1e-3, 20_000, rng)
    o = (o + 1e-3 * d) * 6e-14 * rng.random((len(o), 1)) - 1e-3 * d
    hits, band = Intersector([surface], coarse="none").intersect(o, d), band_of(surface, o)
    # The normals (cos a, sin a, -1/2) of the two meridians that touch the ray's direction.
    across = np.hypot(d[:, 0], d[:, 1])
    cosine = 0.5 * d[:, 2] / across
    points_in = np.abs(cosine) > 1.0
    cosine = np.clip(cosine, -1.0, 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    ex, ey = d[:, 0] / across, d[:, 1] / across
    depth = np.full(len(o), np.inf)
    for side in (1.0, -1.0):
        n = np.stack([cosine * ex - side * sine * ey, cosine * ey + side * sine * ex,
                      np.full(len(o), -0.5)], axis=1) / np.sqrt(1.25)  # fmt: skip
        depth = np.minimum(depth, -np.einsum("ij,ij->i", n, o))
    aside = np.linalg.norm(np.cross(o, d), axis=1)
    clear = ~points_in & (np.abs(np.abs(cosine) - 1.0) > 0.05)
    hit, tangent = hits.hit[clear], (hits.status == Status.TANGENT)[clear]
    ratio, aside = depth[clear] / band[clear], aside[clear] / band[clear]
    # Rounding of the ray, of its shift above and of the code stay below a tenth of the band.
    assert hit[ratio > 0.1].all()
    assert not hit[ratio < -0.6].any()
    assert tangent[(ratio > -0.1) & (ratio < 0.9)].all()
    assert tangent[(aside < 0.9)].all()
    assert not tangent[(ratio > 1.1) & (aside > 1.1)].any()
    assert not tangent[ratio < -1.5].any()
    # A ray that points into the cone crosses it once wherever it passes.
    steep = points_in & (0.5 * np.abs(d[:, 2]) > 1.05 * across)
    up = d[steep, 2] > 0
    assert hits.hit[steep][up].all()
    assert (hits.status[steep] != Status.TANGENT).all()
    assert tangent.mean() > 0.3


def test_far_from_a_tip_the_bound_has_room_for_the_rounding_of_t():
    """The exact t of such a ray is no float64: half a spacing of these is the least bound there is."""
    apex = np.array([0.3, -0.2, 0.1])
    cone = SurfaceOfRevolution([(0, 0), (2, 1)], apex, (1, 2, 3))
    rng = np.random.default_rng(6)
    d = rng.normal(size=(500, 3))
    beside = 10.0 ** rng.uniform(-17, -14, (500, 1)) * rng.normal(size=(500, 3))
    hits = Intersector(cone).intersect(apex + beside - 10.0 ** rng.uniform(2, 4, (500, 1)) * d, d)
    assert hits.hit.sum() > 150
    assert (hits.t_bound >= 0.5 * np.spacing(hits.t))[hits.hit].all()


@pytest.mark.parametrize("tilt", [0.0, 1e-300, 1e-120, 1e-90, 1e-18, 1e-12, 1e-6])
def test_rays_along_the_axis_meet_it_on_every_side(tilt):
    """Where nothing leads across the axis no side of it is the first."""
    rng = np.random.default_rng(10)
    x, y = rng.uniform(-0.99, 0.99, (2, 400)) * np.sqrt(0.5)
    x[:80] *= 10.0 ** rng.uniform(-16, -1, 80)
    y[:40] *= 10.0 ** rng.uniform(-16, -1, 40)
    o = np.stack([x, y, np.full(400, -1.0)], axis=1)
    d = np.array([tilt, 0.0, 1.0])
    # Cone z = 2 rho, paraboloid z = rho^2: a tilt of 1e-6 moves a point by as much, times rho'.
    for shape, height in (("cone", 2.0 * np.hypot(x, y)), ("paraboloid", x * x + y * y)):
        surface = SurfaceOfRevolution(SHAPES[shape], (0, 0, 0), (0, 0, 1))
        hits = Intersector([surface], coarse="none").intersect(o, d)
        assert hits.hit.all()
        np.testing.assert_allclose(hits.t, 1.0 + height, rtol=0, atol=8.0 * tilt + 1e-14)


def test_rays_by_the_axis_meet_a_groove_twice_on_each_side():
    """Next to the axis a ray's distance from it grows evenly, to the last bit.

    A groove z = r^2 - 0.6 r about an oblique axis, seen from the side just above its bottom, where
    r = 0.3: it is met where r^2 - 0.6 r = z_0 + tilt t, with r = 1 - t.
    """
    rng = np.random.default_rng(17)
    n = 20_000
    turn, depth = rng.uniform(0, 2 * np.pi, n), 10.0 ** rng.uniform(-8, -3, n)
    tilt = 10.0 ** rng.uniform(-6, -2, n) * rng.choice([-1, 1], n)
    h = 10.0 ** rng.uniform(-16, -7, n)
    c, s, zero = np.cos(turn), np.sin(turn), np.zeros(n)
    start = -0.09 + depth - 0.7 * tilt  # above the bottom by the depth where r = 0.3
    o = np.stack([-c - h * s, -s + h * c, start], axis=1)
    d = np.stack([c, s, zero + tilt], axis=1)
    frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    groove = SurfaceOfRevolution(
        [(0, 0), (-0.3, 0.5), (0.4, 1)], (0, 0, 0), frame[:, 2], reference=frame[:, 0]
    )
    frame[:, 1] = groove.binormal
    hits = Intersector([groove], coarse="none").intersect(o @ frame.T, d @ frame.T)
    # t^2 - (1.4 + tilt) t + 0.4 - start = 0
    b = 1.4 + tilt
    first = 0.5 * b - np.sqrt(0.25 * b * b - 0.4 + start)
    assert hits.hit.all()
    # The next crossing is 1e-4 behind the first, or more; h leaves 1e-14 open.
    np.testing.assert_allclose(hits.t, first, atol=1e-9, rtol=0)


def test_a_ray_flat_past_the_rim_of_a_disc_is_no_hit():
    # It passes the rim by less than a band to twenty, nearest to it about where it meets the plane of the
    # disc. All these rays miss the can, or meet the cone above the disc.
    can = SurfaceOfRevolution([[(0, 0), (0, 1)], [(0, 1), (1, 1.4)]], (0, 0, 0), (0, 0, 1))
    rng = np.random.default_rng(8)
    n = 20_000
    aside, slope = 10.0 ** rng.uniform(-15, -12, n), 10.0 ** rng.uniform(-10, -7, n)
    back, below = rng.uniform(0, 1e-6, n), 10.0 ** rng.uniform(-17, -13, n)
    o = np.stack([-back, 1.0 + aside, -below], axis=1)
    d = np.stack([np.ones(n), np.zeros(n), slope], axis=1)
    hits = Intersector(can, coarse="none").intersect(o, d)
    on_disc = hits.hit & (hits.patch_id == 0)
    assert (hits.status[on_disc] == Status.TANGENT).all()
    assert on_disc.any()
    assert (hits.status == Status.MISS).any()


# A body with a step: caps at z = 0 and 5, a step at z = 2, walls of radius 3 and 1.
STEPPED = [[(0, 0), (0, 3)], [(0, 3), (2, 3)], [(2, 3), (2, 1)], [(2, 1), (5, 1)], [(5, 1), (5, 0)]]


@pytest.mark.parametrize("coarse", ["none", "embree"])
@pytest.mark.parametrize("slope", [0.0, 3e-14, 1e-12])
def test_rays_along_a_wall_leave_the_body_that_they_have_entered(coarse, slope):
    """Enter through the cap below the upper wall: the step is 2 away, the upper cap 5."""
    tracer = Intersector(SurfaceOfRevolution(STEPPED, (0, 0, 0), (0, 0, 1)), coarse=coarse)
    rng = np.random.default_rng(6)
    angle = rng.uniform(0.0, 2.0 * np.pi, 4000)
    below = np.stack([np.cos(angle), np.sin(angle), np.zeros(4000)], axis=1)
    direction = np.column_stack([slope * rng.normal(size=(4000, 2)), np.ones(4000)])
    entered = tracer.intersect(below - 5.0 * direction, direction)
    assert (entered.patch_id == 0).all()
    left = tracer.intersect(entered.position, direction, source=entered)
    assert left.hit.all()
    by_t_min = tracer.intersect(entered.position, direction, t_min=1e-9)
    assert np.array_equal(left.t, by_t_min.t)
    assert np.array_equal(left.status, by_t_min.status)
    # Either of both is right within the band only: 1e-13 from the wall, 2 or 5 units away.
    away = np.hypot(*(entered.position + 2.0 * direction)[:, :2].T) - 1.0
    assert np.allclose(left.t[away > 1e-13], 2.0, rtol=0.0, atol=1e-12)
    assert np.allclose(left.t[away < -3e-13], 5.0, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("origin", "direction", "crossings"),
    [
        ((3, 0, -5), (0, 0, 1), [5, 7]),  # along the lower wall
        ((3, 0, 9), (0, 0, -1), [7, 9]),
        ((-9, 0, 0), (1, 0, 0), [6, 12]),  # within the caps
        ((-9, 0, 5), (1, 0, 0), [8, 10]),
        ((-9, 0, 2), (1, 0, 0), [6, 8, 10, 12]),  # within the step
        ((-9, 1, 2), (1, 0, 0), [9 - 8**0.5, 9 + 8**0.5]),
    ],
)
def test_rays_within_walls_and_faces_go_in_and_out(origin, direction, crossings):
    tracer = Intersector(SurfaceOfRevolution(STEPPED, (0, 0, 0), (0, 0, 1)))
    found = tracer.intersect_all(origin, direction).hits
    assert found.t == pytest.approx(crossings, abs=1e-12)
    assert (found.status == Status.TANGENT).all()
