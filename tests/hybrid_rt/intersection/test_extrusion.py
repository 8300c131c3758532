"""Extrusions: a cylinder swept from arcs, oblique ones, and what is refused."""

import numpy as np
import pytest

from meshing import Extrusion


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
