"""Tori: closed forms, hard rays at every singular set judged by exact quartics, and the manners."""

import numpy as np
import pytest
from hard_rays import (
    ANY_SURFACE,
    OFFSETS,
    assert_crossings_are_exact,
    assert_decided_exactly,
    at_set,
    offsets,
    share_met_on_the_way,
    unit,
)

from hybrid_rt import Intersector, Status, Torus
from proof.cases.singular_rays import at_parameters, parallel

TORI = {
    "ring": Torus((0.2, -0.1, 0.3), (0.3, -0.2, 1), 1, 0.4),
    "nearly horn": Torus((0, 0, 0), (1, 1, 0), 1, 1 - 1e-6),
    "wire": Torus((1, 2, 3), (0, 0, 1), 1, 1e-6).flipped(),
    "large and far away": Torus((1e9, -2e9, 3e8), (1, 2, 3), 1.5e6, 0.5e6),
}


def on_torus(torus, n, rng, v=None):
    """Points, normals, and two unit tangents: about the axis and about the tube."""
    u, v = rng.random(n), rng.random(n) if v is None else v
    along = [unit(partial) for partial in torus.partials(u, v)]
    return torus.point(u, v), torus.normal(u, v), *along


def placed(torus, points, directions, rng, back=(0.0, 0.6, 3.0)):
    """Rays through points given about origin, radial, binormal and axis, from some way before."""
    frame = torus.revolution_frame
    directions = directions @ frame[1:]
    way = (
        torus.size
        * rng.choice(back, len(points))[:, None]
        / np.linalg.norm(directions, axis=1, keepdims=True)
    )
    return frame[0] + points @ frame[1:] - way * directions, directions


def within_rim_planes(torus, n, rng):
    """In the planes that touch the torus along a circle, or beside them: four roots in two pairs."""
    turn, r = rng.uniform(0, 2 * np.pi, n), torus.minor_radius
    beside = torus.major_radius * rng.choice([0, 0.5, 1, 1], n) + offsets(torus, n, rng)[:, 0]
    height = r * rng.choice([-1, 1], n) + offsets(torus, n, rng)[:, 0]
    x, y = np.cos(turn), np.sin(turn)
    tilt = rng.choice([0, 1], n) * 10.0 ** rng.uniform(-15, -3, n)
    points = np.stack([-y * beside, x * beside, height], axis=1)
    return placed(torus, points, np.stack([x, y, tilt], axis=1), rng)


def along_tube(torus, n, rng):
    """Beside tangents of the circle in the tube's middle: there q is flat to fourth order."""
    turn, over = rng.uniform(0, 2 * np.pi, (2, n))
    r = torus.minor_radius * (rng.choice([0, 0.5, 1, 1], n) + rng.choice(OFFSETS, n))
    far = torus.major_radius + r * np.cos(over)
    points = np.stack([far * np.cos(turn), far * np.sin(turn), r * np.sin(over)], axis=1)
    ways = np.stack([-np.sin(turn), np.cos(turn), np.zeros(n)], axis=1)
    ways += rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-16, -1, n)[:, None]
    return placed(torus, points, ways, rng)


def twice_tangent(torus, n, rng):
    """In planes that touch the torus twice: through both points, or tangent to Villarceau's circles."""
    middle, r = torus.major_radius, torus.minor_radius
    slope, turn = np.arcsin(r / middle), rng.uniform(0, 2 * np.pi, n)[:, None]
    one = np.array([np.cos(slope), 0, np.sin(slope)])
    two = np.array([0.0, 1.0, 0.0])
    points = rng.choice([-r, r], n)[:, None] * two + middle * (
        np.cos(turn) * one + np.sin(turn) * two
    )
    ways = np.cos(turn) * two - np.sin(turn) * one
    is_through = rng.random(n)[:, None] < 0.5
    points, ways = np.where(is_through, 0.0, points), np.where(is_through, one, ways)
    points = points + rng.normal(size=(n, 3)) * offsets(torus, n, rng)
    return placed(torus, points, ways, rng)


RAYS = {
    "rim planes": within_rim_planes,
    "along the tube": along_tube,
    "twice tangent": twice_tangent,
    "equators": at_set(at_parameters([(None, 0.0), (None, 0.5)], True), parallel),
    **ANY_SURFACE,
}


@pytest.mark.parametrize("kind", RAYS)
@pytest.mark.parametrize("name", TORI)
def test_hard_rays_are_decided_as_the_exact_quartic_says(name, kind):
    torus, rng = TORI[name], np.random.default_rng(len(name) + 100 * len(kind))
    assert_decided_exactly(torus, *RAYS[kind](torus, 40, rng))


def test_closed_forms():
    torus = Torus((0, 0, 0), (0, 0, 1), 1.0, 0.25)
    tracer = Intersector([torus])
    origins = [(-3, 0, 0), (-0.5, 0, 0), (1, 0, 5), (0, 0, 5), (-3, 0, 0.15), (-1, 0, 0)]
    directions = [(1, 0, 0), (2, 0, 0), (0, 0, -1), (0, 0, -1), (1, 0, 0), (0, 0, 3)]
    found = tracer.intersect_all(origins, directions)
    assert found.count.tolist() == [4, 2, 2, 0, 4, 1]
    # At height 0.15 the tube is 0.2 to both sides of its middle.
    exact = [1.75, 2.25, 3.75, 4.25, 0.625, 0.875, 4.75, 5.25, 1.8, 2.2, 3.8, 4.2, 0.25 / 3]
    assert np.abs(found.hits.t - exact).max() <= 4e-16 * 5
    assert (np.abs(found.hits.t - exact) <= found.hits.t_bound).all()
    first = found.hits[found.offsets[0] : found.offsets[1]]
    np.testing.assert_allclose(first.normal, np.outer([-1, 1, -1, 1], [1, 0, 0]), atol=1e-15)
    assert first.front_face.tolist() == [True, False, True, False]
    np.testing.assert_allclose(first.u, [0.5, 0.5, 0, 0])
    np.testing.assert_allclose(first.v, [0, 0.5, 0.5, 0])
    np.testing.assert_allclose(torus.point(first.u, first.v), first.position, atol=1e-15)


def test_a_wire_is_met_along_itself():
    """Here q is flat to rounding where its curvature changes: neither piece alone has a minimum."""
    tracer = Intersector([Torus((0, 0, 0), (0, 0, 1), 1.0, 1e-7)])
    hits = tracer.intersect(
        [
            [-2.6097259868943055, 7.628193958634007, -1.2578807664230927e-09],
            [0.8655777582647778, 2.0617409861659994, 2.4781076509591978e-08],
        ],
        [
            [0.20384020639109915, -0.9790041727606662, 1.5723508007944033e-10],
            [-0.7585792114109919, -0.651580815667692, -1.2390537015337526e-08],
        ],
    )
    # Roots of the exact quartics, rounded.
    assert (np.abs(hits.t - [7.999553586121368, 1.9995529944675776]) <= hits.t_bound).all()
    assert (hits.t_bound < 1e-10).all()  # rounding over a cosine of 4e-4
    assert hits.status.tolist() == [Status.HIT, Status.HIT]


def test_the_plane_of_the_top_rim_touches_along_a_circle():
    """Rays in it touch the torus twice, or once to fourth order: within the band that is TANGENT."""
    tracer = Intersector([Torus((0, 0, 0), (0, 0, 1), 1.0, 0.25)])
    heights = 0.25 + np.array([-1e-13, -1e-15, 0.0, 1e-15, 1e-13])
    for beside in (0.0, 0.3, 1.0):
        origins = np.stack([np.full(5, -3.0), np.full(5, beside), heights], axis=1)
        hits = tracer.intersect(origins, (1, 0, 0))
        assert hits.status[1:4].tolist() == [Status.TANGENT] * 3
        assert (hits.status[0], hits.status[4]) == (Status.HIT, Status.MISS)
        # Tangency moves t by the root of the height: at 1e-13 under it by sqrt(2 r 1e-13); where
        # the ray follows the circle by its fourth root.
        wide = 3e-7 if beside < 1 else 1e-3
        assert abs(hits.t[0] - (3 - np.sqrt(1 - beside**2))) < wide


@pytest.mark.parametrize("name", TORI)
def test_nothing_is_met_by_rays_that_leave_the_outer_half_outward(name):
    """It lies on the boundary of the convex hull."""
    torus, rng = TORI[name], np.random.default_rng(5)
    tracer = Intersector([torus])
    points, normals, about, over = on_torus(torus, 2000, rng, rng.uniform(-0.24, 0.24, 2000))
    outward = torus.orientation * normals
    seen = tracer.intersect(points + torus.size * outward, -outward)
    assert seen.hit.all()
    tilt = 10.0 ** rng.uniform(-4, 0, (2000, 1))
    ways = tilt * torus.orientation * seen.normal + unit(rng.normal(size=(2000, 1)) * over + about)
    assert not tracer.intersect(seen.position, ways, source=seen).hit.any()


@pytest.mark.parametrize("name", list(TORI)[:3])
def test_departures_are_not_met_again_and_the_other_roots_are(name):
    rng = np.random.default_rng(9)
    # A third surface may lie within a thousandth behind.
    assert share_met_on_the_way(TORI[name], on_torus, 0.3, rng) < 0.05


def test_all_crossings_are_the_roots_of_the_quartic():
    torus = TORI["ring"]
    rng = np.random.default_rng(2)
    targets = torus.origin + rng.uniform(-1, 1, (300, 3))
    origins = torus.origin + 4 * unit(rng.normal(size=(300, 3)))
    found = assert_crossings_are_exact(torus, origins, targets - origins, {0, 2, 4})
    # In and out by turns.
    assert np.array_equal(
        found.hits.front_face, (np.arange(len(found)) - found.offsets[found.ray]) % 2 == 0
    )


def test_carriers_of_the_same_torus_are_equal():
    torus = Torus((1, 2, 3), (0, 1, -2), 2, 1)
    assert torus.carrier == Torus((1, 2, 3), (0, -1, 2), 2, 1, (1, 0, 0)).flipped().carrier
    assert torus.carrier != Torus((1, 2, 3), (0, 1, -2), 2, 0.5).carrier
    assert torus.area_sampler().area == pytest.approx(4 * np.pi**2 * 2 * 1, rel=1e-3)
