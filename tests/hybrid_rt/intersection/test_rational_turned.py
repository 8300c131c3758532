"""Rational profiles and parts of a turn: tori and spheres in closed form, parts of the whole."""

import pickle

import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere, Status, Torus
from meshing import Cone, Cylinder, SurfaceOfRevolution, circular_arc
from proof.cases.singular_surfaces import rational_torus

AXIS = np.array([0.3, -0.2, 1.0])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def rays_at(surface, n, rng):
    """From around to points of a box about a surface; some parallel to its axis."""
    low, high = surface.bounds
    targets, size = rng.uniform(low, high, (n, 3)), np.linalg.norm(high - low)
    ways = unit(rng.normal(size=(n, 3)))
    ways[: n // 8] = surface.revolution_frame[1] * rng.choice([-1.0, 1.0], (n // 8, 1))
    return targets - size * ways, ways


def agree(one, other, origins, directions):
    """All crossings of both are the same, to the bounds of both, but for what is within rounding."""
    ours, theirs = (Intersector(s).intersect_all(origins, directions) for s in (one, other))
    odd = ours.count != theirs.count
    for found in (ours, theirs):
        tangent = np.zeros(len(origins), bool)
        tangent[found.ray[found.hits.status == Status.TANGENT]] = True
        odd &= ~tangent
    assert not odd.any()
    same = ours.count == theirs.count
    a, b = ours.hits[same[ours.ray]], theirs.hits[same[theirs.ray]]
    assert len(a) > len(origins) / 3
    assert (np.abs(a.t - b.t) <= a.t_bound + b.t_bound).all()
    clear = a.status == Status.HIT
    # The normal turns by the shift of the point over the radius of curvature, 0.4 at least.
    steep = np.abs(np.einsum("ij,ij->i", a.normal, directions[ours.ray[same[ours.ray]]])) > 1e-3
    np.testing.assert_allclose(a.normal[clear & steep], b.normal[clear & steep], atol=1e-11)
    np.testing.assert_array_equal(a.front_face[clear], b.front_face[clear])


def test_a_torus_turned_from_a_rational_circle_is_the_closed_form():
    rng = np.random.default_rng(1)
    torus, turned = Torus((0.2, -0.1, 0.3), AXIS, 1.0, 0.4), rational_torus()
    agree(turned, torus, *rays_at(torus, 10_000, rng))
    arcs, weights = circular_arc((0.0, 1.0), 0.4, 0.25, 1.25)
    again = SurfaceOfRevolution(arcs, (0.2, -0.1, 0.3), AXIS, weights=weights).flipped()
    agree(again, torus, *rays_at(torus, 2000, rng))


def test_a_ball_turned_from_rational_arcs_is_the_sphere():
    rng = np.random.default_rng(2)
    arcs, weights = circular_arc((0.0, 0.0), 2.0, 0.5, 0.0)
    ball = SurfaceOfRevolution(arcs, (1, 2, 3), AXIS, weights=weights)
    origins, ways = rays_at(ball, 20_000, rng)
    sphere = Sphere((1, 2, 3), 2.0)
    ours, theirs = (Intersector(s).intersect(origins, ways) for s in (ball, sphere))
    clear = (ours.status != Status.TANGENT) & (theirs.status != Status.TANGENT)
    assert np.array_equal(ours.hit[clear], theirs.hit[clear])
    rows = clear & ours.hit
    assert rows.sum() > 8000
    ours, theirs = ours[rows], theirs[rows]
    assert (np.abs(ours.t - theirs.t) <= ours.t_bound + theirs.t_bound).all()
    np.testing.assert_allclose(ours.position, theirs.position, atol=1e-9)


def test_equal_weights_give_the_polynomial_bits():
    net = [(0, 1), (0.5, 2), (1.5, 0.2), (2, 1)]
    plain, weighted = (
        SurfaceOfRevolution(net, (0, 0, 0), AXIS, weights=w) for w in (None, [0.3] * 4)
    )
    origins, ways = rays_at(plain, 2000, np.random.default_rng(4))
    one, two = (Intersector(s).intersect(origins, ways) for s in (plain, weighted))
    for column in ("t", "t_bound", "u", "v", "position", "normal", "status"):
        assert np.array_equal(getattr(one, column), getattr(two, column), equal_nan=True)
    # A weight that differs by nothing that matters takes the other way, to the same answers.
    nearly = SurfaceOfRevolution(net, (0, 0, 0), AXIS, weights=[1, 1, 1 + 2e-16, 1])
    three = Intersector(nearly).intersect(origins, ways)
    clear = (one.status != Status.TANGENT) & one.hit
    assert np.array_equal(one.hit, three.hit)
    one, three = one[clear], three[clear]
    assert (np.abs(one.t - three.t) <= one.t_bound + three.t_bound).all()


@pytest.mark.parametrize("u_range", [(0.1, 0.35), (0.25, 0.75), (-0.2, 0.65), (0.5, 1.5)])
def test_a_part_is_where_the_whole_has_these_angles(u_range):
    """Of all crossings with the whole turn those within the part are left, with other u."""
    begin, end = u_range
    whole, part = rational_torus(), rational_torus(u_range)
    origins, ways = rays_at(whole, 5000, np.random.default_rng(5))
    ours, all_of_it = (Intersector(s).intersect_all(origins, ways) for s in (part, whole))
    turn = (all_of_it.hits.u - begin) % 1.0
    kept = turn <= end - begin
    assert 0.2 < kept.mean() <= 1.0
    assert np.array_equal(ours.ray, all_of_it.ray[kept])
    assert np.array_equal(ours.hits.t, all_of_it.hits.t[kept])
    np.testing.assert_allclose(ours.hits.u, turn[kept] / (end - begin), atol=1e-14)
    there = part.point(ours.hits.u, ours.hits.v, ours.hits.patch_id)
    np.testing.assert_allclose(there, ours.hits.position, atol=1e-14)
    # Certified, refined, without Embree, and pickled: the same.
    first = Intersector(part).intersect(origins, ways)
    for other in (Intersector(part, coarse="none"), pickle.loads(pickle.dumps(Intersector(part)))):
        assert np.array_equal(other.intersect(origins, ways).t, first.t)
    refined = Intersector(part, accuracy="refined").intersect(origins, ways)
    assert (refined.hit == first.hit).mean() > 0.99


def test_light_passes_where_the_rest_of_a_cylinder_is_not():
    whole = Cylinder((0, 0, 0), (0, 0, 1), 1, 2, reference=(1, 0, 0), u_range=(0, 0.25))
    assert Intersector(whole).occluded([0, 0, 1], [(-1, -1, 0), (1, 1, 0)]).tolist() == [0, 1]


def test_other_sides():
    part = rational_torus((0.3, 0.65))
    u, v, k = np.random.default_rng(7).random((3, 50))
    k = (4 * k).astype(int)
    other = part.flipped()
    np.testing.assert_allclose(other.point(u, 1 - v, 3 - k), part.point(u, v, k), atol=1e-14)
    np.testing.assert_allclose(other.normal(u, 1 - v, 3 - k), -part.normal(u, v, k), atol=1e-12)
    copy = pickle.loads(pickle.dumps(part))
    assert np.array_equal(copy.point(u, v, k), part.point(u, v, k))
    assert "rational" in repr(part)
    assert "u_range=(0.3, 0.65)" in repr(part)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": [1, 0, 1]}, "weights of segment 0 is 0 at 1: pass finite numbers above 0"),
        ({"weights": [1, -1, 1]}, "is -1 at 1"),
        ({"weights": [1, np.nan, 1]}, "is nan at 1"),
        ({"weights": [1, 1]}, r"have shape \(2,\): pass \(3,\)"),
        ({"weights": [1, 1e-7, 1]}, r"between 1e-07 and 1, more than 1e\+06 apart"),
        ({"weights": [[1, 1, 1], [1, 1, 1]]}, "are of 2 segments, the profile has 1"),
        ({"u_range": (0.5, 0.5)}, r"u_range is \(0\.5, 0\.5\): pass where"),
        ({"u_range": (0, 1.1)}, "at most one turn apart"),
        ({"u_range": (0, np.nan)}, "u_range is"),
        ({"u_range": 0.5}, "u_range has shape"),
    ],
)
def test_what_is_no_weight_or_part_is_refused(options, message):
    with pytest.raises(ValueError, match=message):
        SurfaceOfRevolution([(0, 1), (1, 2), (2, 1)], (0, 0, 0), AXIS, **options)


def test_negative_radii_are_found_under_weights():
    SurfaceOfRevolution([(0, 1), (1, -1), (2, 1)], (0, 0, 0), AXIS, weights=[1, 0.9, 1])
    with pytest.raises(ValueError, match=r"segment 0 reaches radius -"):
        SurfaceOfRevolution([(0, 1), (1, -1), (2, 1)], (0, 0, 0), AXIS, weights=[1, 2, 1])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Cylinder((0, 0, 0), AXIS, 0, 1), "Cylinder radius is 0"),
        (lambda: Cylinder((0, 0, 0), AXIS, 1, -1), "Cylinder length is -1"),
        (lambda: Cone((0, 0, 0), AXIS, 1, 1, -1), "Cone top_radius is -1"),
        (lambda: circular_arc((0, 1), 1, 0, 1.5), "pass angles in turns"),
        (lambda: circular_arc((5,), 1, 0, 0.5), r"circular_arc center is \(5,\): pass its axial"),
        (lambda: circular_arc((5, 0, 1), 1, 0, 0.5), r"circular_arc center is \(5, 0, 1\): pass"),
        (lambda: circular_arc(5, 1, 0, 0.5), "circular_arc center is 5: pass its axial"),
        (lambda: circular_arc((5, np.nan), 1, 0, 0.5), "circular_arc center is nan"),
    ],
)
def test_shapes_refuse_what_they_cannot_be(make, message):
    with pytest.raises(ValueError, match=message):
        make()
