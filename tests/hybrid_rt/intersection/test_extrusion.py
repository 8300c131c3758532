"""Extrusions: a cylinder swept from arcs, oblique ones, and what is refused."""

import numpy as np
import pytest

from hybrid_rt import Intersector, Status
from meshing import Cylinder, Extrusion, circular_arc


def arcs_at(radius):
    """A circle about z, as rational arcs in space."""
    segments, weights = circular_arc((0.0, 0.0), radius, 0.0, 1.0)
    return [np.column_stack([arc, np.zeros(3)]) for arc in segments], weights


def test_a_circle_moved_along_its_axis_is_the_cylinder():
    segments, weights = arcs_at(1.5)
    swept = Extrusion(segments, (0, 0, 4), weights)
    turned = Cylinder((0, 0, 0), (0, 0, 1), 1.5, 4)
    rng = np.random.default_rng(1)
    targets, ways = (
        rng.uniform((-1.5, -1.5, 0), (1.5, 1.5, 4), (5000, 3)),
        rng.normal(size=(5000, 3)),
    )
    ours, theirs = (
        Intersector(s, coarse="none").intersect_all(targets - 6 * ways, ways)
        for s in (swept, turned)
    )
    assert np.array_equal(ours.count, theirs.count)
    a, b = ours.hits, theirs.hits
    assert len(a) > 5000
    assert (np.abs(a.t - b.t) <= a.t_bound + b.t_bound).all()
    np.testing.assert_allclose(a.normal, b.normal, atol=1e-10)
    assert (a.status == Status.HIT).mean() > 0.999


def test_points_are_the_profile_and_its_shift():
    net, way = [(0, 0, 0), (1, 2, 0), (2, -1, 1), (3, 0, 0)], np.array((0.3, 0.2, 2.0))
    sheet = Extrusion(net, way)
    u, v = np.random.default_rng(2).random((2, 50))
    np.testing.assert_allclose(
        sheet.point(u, v), sheet.point(u, 0 * v) + v[:, None] * way, atol=1e-15
    )
    basis = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u**3], axis=1)
    np.testing.assert_allclose(sheet.point(u, 0 * u), basis @ np.array(net, float), atol=1e-15)
    assert len(Extrusion([net, [(3, 0, 0), (4, 0, 0)]], way, [[1, 2, 2, 1], None])) == 2


def test_a_narrow_strip_far_from_the_origin_has_an_area_and_a_rounded_line_has_none():
    at, beside = 1e6, 1e6 + 1e-7
    strip = Extrusion([(at, 0, 0), (beside, 0, 0)], (0, 0, 1))
    # The corners are exact, and so is the difference of two neighbours.
    assert strip.area_sampler().area == pytest.approx(beside - at, rel=1e-12)
    way = np.array((1.0, 2.0, 3.0)) / 7
    line = at + np.linspace(0, 1, 4)[:, None] * way
    with pytest.raises(ValueError, match="segment 0 runs along direction"):
        Extrusion(line, way)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([(0, 0, 0), (1, 0, 0)], (0, 0, 0)), "direction is the zero vector"),
        (
            ([(0, 0, 0), (1, 0, 0)], (2, 0, 0)),
            r"segment 0 runs along direction \[2\.0, 0\.0, 0\.0\]",
        ),
        (([(0, 0), (1, 0)], (0, 0, 1)), r"profile has shape \(2, 2\): pass \(n \+ 1, 3\)"),
        (([(0, 0, 0), (1, np.nan, 0)], (0, 0, 1)), "profile, point 1 is"),
        (([(0, 0, 0), (1, 0, 0)], (0, 0, 1), [1, 2, 3]), r"have shape \(3,\): pass \(2,\)"),
        (([(0, 0, 0), (1, 0, 0)], (0, 0, 1), [[1, 2], [1, 2]]), "are of 2 segments"),
        (([(0, 0, 0), (1, 0, 0)], (0, 0, 1), [1, -2]), "weight"),
        (([], (0, 0, 1)), "profile is empty"),
    ],
)
def test_what_sweeps_no_surface_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Extrusion(*arguments)
