"""Loops in parameter planes: sides by exact winding numbers, what is refused, what is kept."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import BSpline
from trimmed_surfaces import (
    OUTLINE,
    ball_piece,
    bumpy,
    cut_lens,
    plate,
    ring,
    sheet,
    turned_part,
    wavy_loop,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)

from hybrid_rt.core.fingerprint import fingerprint
from meshing import (
    BezierPatches,
    Curve2,
    Cylinder,
    NurbsSurface,
    SurfaceOfRevolution,
    TrimmedSurface,
    bspline,
    circle,
    polygon,
    tessellate,
)
from meshing.curve2 import _slopes, _turns
from meshing.tessellation import whole_triangles
from proof.exact.loops import ExactLoops

EPS = 2.0**-52


def loops_of(kind):
    rng = np.random.default_rng(3)
    if kind == "disc":
        return [OUTLINE, circle((0.5, 0.5), 0.25)]
    if kind == "squares":  # horizontal and vertical pieces, two loops that touch and cross
        return [
            polygon([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)]),
            polygon([(0.5, 0.5), (0.75, 0.5), (0.75, 0.25), (0.25, 0.75)]),
        ]
    return [
        wavy_loop(rng, 0.3, 3, 5, True),
        wavy_loop(rng, 0.3, 4, 3, False),
    ]


def points_on_and_beside(surface, n, seed):
    """Points anywhere, on the curves and beside them by 1e-1 to 1e-16, and as high as vertices."""
    rng = np.random.default_rng(seed)
    curves = [curve for loop in surface.loops for curve in loop]
    at = np.concatenate(
        [c.point(np.concatenate([c.cuts(), rng.random(n // len(curves))])) for c in curves]
    )
    step = 10.0 ** -rng.integers(1, 17, at.shape) * rng.choice([-1, 0, 1], at.shape)
    heights = surface.table.piece[:, [2, 5]].ravel()
    level = np.column_stack([rng.random(n // 4), rng.choice(heights, n // 4)])
    # A point of the border itself counts as just inside, where an outline runs along it.
    points = np.concatenate([at + step, level, rng.random((n // 2, 2))])
    return np.clip(points, EPS, 1 - EPS)


@pytest.mark.parametrize("kind", ["disc", "squares", "wild"])
def test_sides_are_those_of_exact_winding_numbers(kind):
    surface = plate(loops_of(kind))
    judge = ExactLoops(surface.loops)
    points = points_on_and_beside(surface, 600, 1)
    inside, in_band = surface.contains(*points.T)
    for (u, v), ours, open_ in zip(points.tolist(), inside, in_band, strict=True):
        exact = judge.is_inside(u, v)
        assert open_ if exact is None else (open_ or exact == ours), (u, v)
    # Most points beside a curve are decided: the band is a few roundings wide.
    assert in_band.mean() < 0.5


def test_band_is_as_wide_as_stated():
    surface = plate()
    angle = np.random.default_rng(2).uniform(0, 2 * np.pi, 2000)
    stated = 2.0**-52 * (8 * 2 + 14)
    for beside, is_open in ((4 * stated, False), (-4 * stated, False), (EPS, True), (0.0, True)):
        r = 0.25 + beside
        inside, in_band = surface.contains(0.5 + r * np.cos(angle), 0.5 + r * np.sin(angle))
        assert (in_band == is_open).all()
        assert is_open or (inside == (beside > 0)).all()


def test_every_turn_of_a_coordinate_is_cut():
    # x = 3 s (1 - s) (1 - 2 s) has its turns at (3 -+ sqrt 3) / 6, y = s has none.
    curve = Curve2([(0.5, 0), (1, 1 / 3), (0, 2 / 3), (0.5, 1)])
    np.testing.assert_allclose(curve.cuts(), [0, 0.5 - 12**-0.5, 0.5 + 12**-0.5, 1], atol=2**-47)
    # A double zero needs no cut, but is one of two roots that are not to be told apart: both hold.
    assert len(_turns(_slopes(np.array([0.0, 0.5, 0.5, 1.0]), None))) <= 2
    quarter = circle((0.5, 0.5), 0.25)[0]
    assert quarter.cuts() == [0.0, 1.0]


def test_border_of_the_square_is_inside_a_loop_along_it():
    surface = plate()
    u, v = np.array([(0, 0.5), (1, 0.5), (0.5, 0), (0.5, 1), (0, 0), (1, 1), (1, 0)]).T
    assert surface.contains(u, v)[0].all()


def test_loops_across_the_seam_count_a_turn_away():
    surface = windowed_cylinder()
    judge = ExactLoops(surface.loops, surface.closes)
    u, v = np.random.default_rng(4).random((2, 500))
    inside, in_band = surface.contains(u, v)
    exact = [judge.is_inside(*pair) for pair in zip(u.tolist(), v.tolist(), strict=True)]
    assert not in_band.any()
    np.testing.assert_array_equal(inside, exact)
    # An outline all the way round leaves no edge at the seam.
    assert not surface.contains([0.0, 1.0, 1e-17, 0.5], [0.9, 0.9, 0.9, 0.9])[1].any()


@pytest.mark.parametrize("make", [turned_part, ring])
def test_v_goes_on_from_segment_to_segment(make):
    surface = make()
    judge = ExactLoops(surface.loops, surface.closes)
    assert surface.closes == ((False, True) if make is ring else (True, False))
    u, v = np.random.default_rng(6).random((2, 300))
    inside, in_band = surface.contains(u, v)
    exact = [judge.is_inside(*pair) for pair in zip(u.tolist(), v.tolist(), strict=True)]
    assert not in_band.any()
    np.testing.assert_array_equal(inside, exact)
    at = surface.surface.v_breaks
    k = np.searchsorted(at, v) - 1
    own = (v - at[k]) / np.diff(at)[k]
    np.testing.assert_array_equal(surface.point(u, v), surface.surface.point(u, own, k))
    np.testing.assert_array_equal(surface.point(u, v, k), surface.point(u, v))
    step = 2.0**-20
    for d, (du, dv) in zip(surface.partials(u, v), ((step, 0), (0, step)), strict=True):
        there, here = surface.point(u + du, v + dv, k), surface.point(u - du, v - dv, k)
        np.testing.assert_allclose(d, (there - here) / (2 * step), atol=1e-8)
    # Each segment's part is as long as its control polygon; all straight, v is the way along it.
    lengths = [np.linalg.norm(np.diff(s, axis=0), axis=1).sum() for s in surface.surface.segments]
    np.testing.assert_allclose(np.diff(at), lengths / np.sum(lengths), rtol=1e-14)
    mesh = tessellate(surface, 1e-3)
    gap = mesh.vertices[mesh.faces] - surface.point(
        *mesh.uv.transpose(2, 0, 1), mesh.patch_id[:, None]
    )
    assert np.abs(gap).max() < 1e-12


def test_ends_that_nearly_meet_are_joined_and_open_loops_refused():
    near = [Curve2([(0.2, 0.2), (0.8, 0.2)]), Curve2([(0.8, 0.2 + 4e-6), (0.2, 0.8)]),
            Curve2([(0.2, 0.8), (0.2, 0.2)])]  # fmt: skip
    surface = plate([near])
    assert [len(loop) for loop in surface.loops] == [4]
    ends = [(a.control[-1] == b.control[0]).all() for a, b in
            zip(surface.loops[0], surface.loops[0][1:], strict=False)]  # fmt: skip
    assert all(ends)
    with pytest.raises(ValueError, match=r"loops\[0\] is open: curve 1 ends .*0\.6 away"):
        plate([near[:2]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Curve2([(0, 0)]), "degree 0: pass 1 to 30"),
        (lambda: Curve2([(0, 0, 0), (1, 1, 1)]), r"shape \(2, 3\)"),
        (lambda: Curve2([(0, 0), (np.nan, 1)]), r"control point 1 is \[nan, 1\.0\]"),
        (lambda: Curve2([(0, 0), (3, 1)]), r"control point 1 is \[3\.0, 1\.0\].*from -1 to 2"),
        (lambda: Curve2([(0.5, 0.5), (0.5, 0.5)]), r"is the point \[0\.5, 0\.5\]"),
        (lambda: Curve2([(0, 0), (1, 1)], [1, -1]), "Curve2 weights"),
        (lambda: Curve2([(0, 0), (1, 1)], [1, 1, 1]), r"shape \(3,\) for 2 points"),
        (lambda: circle((0.5, 0.5), 0), "positive radius"),
        (lambda: circle((0.5, 0.5), (1, 2, 3)), r"circle has .* radius \(1, 2, 3\): pass two numbers"),
        (lambda: circle(0.5, 1), "circle has center 0.5"),
        (lambda: polygon([(0, 0), (1, 1)]), "at least 3"),
        (lambda: polygon([(0.5, 0), (1, 0), (1, 1), (0.5, 0)]),
         r"^polygon: the last corner, \[0\.5, 0\.0\], repeats the first: leave it out"),
        (lambda: plate([[]]), r"loops\[0\] is empty"),
        (lambda: TrimmedSurface(plate().surface, []), "loops is empty"),
        (lambda: TrimmedSurface(plate().surface, OUTLINE), r"loops\[0\] is Curve2"),
        (lambda: TrimmedSurface(plate().surface, [[1]]), r"loops\[0\]\[0\] is 1"),
        (lambda: plate(gap=-1), "gap is -1"),
        (lambda: TrimmedSurface(plate(), [OUTLINE]), "no other is trimmed"),
        (lambda: TrimmedSurface(BezierPatches([plate().surface.patches[0]] * 2), [OUTLINE]), "of 2 pieces"),
        (lambda: plate([circle((1.5, 0.5), 0.2)]).area_sampler(), "no area inside its loops"),
        (lambda: TrimmedSurface(SurfaceOfRevolution([[(0, 1), (1, 1)], [(1, 1), (1, 1 + 1e-10)]],
                                                    (0, 0, 0), (0, 0, 1)), [OUTLINE]),
         "segment 1 is 1e-10 of the profile"),
    ],
)  # fmt: skip
def test_what_is_no_loop_is_refused_by_name(make, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make()


@pytest.mark.parametrize(
    "surface",
    [
        bumpy(),
        sheet(),
        ball_piece(),
        windowed_cylinder(),
        turned_part(),
        ring(),
        windowed_ball(),
        windowed_torus(),
        cut_lens(),
    ],
    ids=lambda s: repr(s)[15:50],
)
def test_moved_turned_and_pickled_surfaces_keep_their_loops(surface):
    copy = pickle.loads(pickle.dumps(surface))
    assert fingerprint(copy) == fingerprint(surface) != fingerprint(surface.surface)
    u, v = np.random.default_rng(5).random((2, 500))
    inside = surface.contains(u, v)[0]
    move = np.array([[0, -2, 0, 1], [2, 0, 0, 3], [0, 0, 2, 5], [0, 0, 0, 1]], float)
    np.testing.assert_array_equal(surface.transformed(move).contains(u, v)[0], inside)
    # The flipped surface has the same points inside, at its own (u, v).
    over = surface.flipped()
    uv = {"swapped": (v, u), "v reversed": (u, 1 - v), "u reversed": (1 - u, v)}
    uv = uv[surface.surface.flip_of_uv]
    np.testing.assert_array_equal(over.contains(*uv)[0], inside)
    np.testing.assert_allclose(over.point(*uv), surface.point(u, v), atol=1e-14)
    np.testing.assert_allclose(over.normal(*uv), -surface.normal(u, v), atol=1e-12)


def test_gap_grows_with_the_surface():
    moved = plate(gap=1e-3).transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
    assert moved.gap == 2e-3


def test_whole_triangles_are_those_that_reach_inside():
    surface = TrimmedSurface(
        Cylinder((0, 0, 0), (0, 0, 1), 1, 2), [polygon([(0, 0), (0.4, 0), (0.4, 1), (0, 1)])]
    )
    mesh, whole = whole_triangles(surface, 1e-4), tessellate(surface.surface, 1e-4)
    assert len(mesh) < 0.5 * len(whole)
    assert mesh.deviation_bound == whole.deviation_bound
    u = mesh.uv[..., 0]
    assert u.min() == 0.0
    # Triangles that touch the edge at u = 0 from the other side of the seam are kept as well.
    assert 0.4 <= u[u < 0.9].max() < 0.42
    # Every point inside is in a triangle's (u, v).
    area = 0.5 * np.abs(np.linalg.det(mesh.uv[:, 1:] - mesh.uv[:, :1])).sum()
    assert 0.4 <= area < 0.43


@pytest.mark.parametrize("is_rational", [False, True])
def test_arcs_of_a_spline_are_the_spline(is_rational):
    """Against scipy, with a double knot and parameters of the surface's own."""
    rng = np.random.default_rng(8)
    knots, degree = np.array([0, 0, 0, 0, 1, 2.5, 2.5, 3, 4, 4, 4, 4.0]), 3
    low, high = np.array([2.0, -1.0]), np.array([6.0, 1.0])
    control = low + (high - low) * rng.random((8, 2))
    weights = rng.uniform(0.5, 2.0, 8) if is_rational else np.ones(8)
    arcs = bspline(control, knots, degree, weights if is_rational else None, low=low, high=high)
    columns = np.concatenate([control * weights[:, None], weights[:, None]], axis=1)
    spline, s = BSpline(knots, columns, degree), np.linspace(0.0, 1.0, 20)
    breaks = np.unique(knots)
    assert len(arcs) == len(breaks) - 1
    for arc, begin, end in zip(arcs, breaks[:-1], breaks[1:], strict=True):
        x, y, w = spline(np.minimum(begin + s * (end - begin), 4.0)).T
        expected = (np.stack([x / w, y / w], axis=1) - low) / (high - low)
        # A dozen convex combinations of numbers below 1.
        np.testing.assert_allclose(arc.point(s), expected, atol=40 * EPS)
    # Neighbours share their end to the bit, as loops must be closed.
    assert all((a.control[-1] == b.control[0]).all() for a, b in pairwise(arcs))


@pytest.mark.parametrize("weights", [None, 0.7])
@pytest.mark.parametrize("degree", [2, 3, 7])
def test_arcs_of_a_spline_without_weights_are_polynomial(weights, degree):
    """Against scipy, at 57 spans whose matrices have rows that add up to 1 only to rounding."""
    rng = np.random.default_rng(degree)
    inside = np.sort(rng.random(56))
    knots = np.concatenate([np.zeros(degree + 1), inside, np.ones(degree + 1)])
    control = rng.random((57 + degree, 2))
    given = None if weights is None else np.full(len(control), weights)
    arcs = bspline(control, knots, degree, given)
    assert len(arcs) == 57
    assert all(arc.weights is None for arc in arcs)
    spline, s = BSpline(knots, control, degree), np.linspace(0.0, 1.0, 20)
    for arc, begin, end in zip(arcs, knots[degree:], knots[degree + 1 :], strict=False):
        at = np.minimum(begin + s * (end - begin), end)
        # Convex combinations of numbers below 1 at each of degree levels, of shares that are rounded
        # by 1 ulp of the knots over their distance; scipy's as well.
        atol = 20 * degree * EPS * (1.0 + 1.0 / (end - begin))
        np.testing.assert_allclose(arc.point(s), spline(at), atol=atol)
    assert all((a.control[-1] == b.control[0]).all() for a, b in pairwise(arcs))


def test_an_arc_is_rational_only_where_its_weights_differ():
    """Two straight spans, and a quarter of a circle between them."""
    root = np.sqrt(0.5)
    control = [(0, 0), (0.3, 0), (0.6, 0), (0.8, 0), (0.8, 0.2), (0.8, 0.5), (0.8, 0.9)]
    knots = np.repeat([0.0, 1.0, 2.0, 3.0], [3, 2, 2, 3])
    arcs = bspline(control, knots, 2, [1, 1, 1, root, 1, 1, 1])
    assert [arc.weights is None for arc in arcs] == [True, False, True]
    assert np.hypot(*(arcs[1].point(0.3)[0] - (0.6, 0.2))) == pytest.approx(0.2, abs=4 * EPS)


@pytest.mark.parametrize("is_rational", [False, True])
def test_spans_that_stay_in_a_point_are_left_out(is_rational):
    """Degree + 1 equal poles, as where a file stops at a corner; against scipy on the others."""
    rng = np.random.default_rng(5)
    knots, degree = np.array([0, 0, 0, 0, 0.7, 1.1, 1.9, 2.3, 3.1, 4, 4, 4, 4.0]), 3
    control = rng.random((9, 2))
    control[2:6] = control[2]  # those of the span from 1.1 to 1.9
    weights = rng.uniform(0.5, 2.0, 9) if is_rational else np.ones(9)
    arcs = bspline(control, knots, degree, weights if is_rational else None)
    breaks = np.unique(knots)
    begins, ends = np.delete(breaks[:-1], 2), np.delete(breaks[1:], 2)
    assert len(arcs) == len(begins) == 5
    columns = np.concatenate([control * weights[:, None], weights[:, None]], axis=1)
    spline, s = BSpline(knots, columns, degree), np.linspace(0.0, 1.0, 20)
    for arc, begin, end in zip(arcs, begins, ends, strict=True):
        x, y, w = spline(np.minimum(begin + s * (end - begin), end)).T
        np.testing.assert_allclose(arc.point(s), np.stack([x / w, y / w], axis=1), atol=40 * EPS)
    # Before and behind the span that is left out, too.
    assert all((a.control[-1] == b.control[0]).all() for a, b in pairwise(arcs))
    assert (arcs[1].control[-1] == control[2]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"control": [0.5, 0.5]}, r"shape \(2,\): pass \(p, 2\)"),
        ({"knots": [0, 0, 1, 1]}, "pass 5 knots, for 3 control points and degree 1"),
        ({"knots": [0, 1, 0, 2, 3]}, "descends from 1 to 0"),
        ({"weights": [1.0, 1.0]}, "pass one each"),
        ({"weights": [1.0, 0.0, 1.0]}, "bspline weights"),
        ({"high": (1.0, 0.0)}, "the first below the second"),
        ({"high": (1.0, np.inf)}, r"high \[1.0, inf\]: pass \(u, v\) each, finite"),
        ({"low": (-np.inf, 0.0)}, r"low is \[-inf, 0.0\] .*finite"),
        ({"control": [(0, 0), (np.nan, 0), (1, 1)]}, r"control point 1 is \[nan, 0.0\]"),
        (
            {"control": [(0.5, 0.3)] * 3},
            r"the point \[0.5, 0.3\] on all spans: leave the curve out",
        ),
        ({"control": [(0, 0), (9, 0), (1, 1)]}, "finite numbers from -1 to 2"),
    ],
)
def test_splines_that_are_none_are_refused(change, message):
    given = {"control": [(0, 0), (0.5, 1), (1, 0)], "knots": [0, 0, 1, 2, 2], "degree": 1}
    with pytest.raises(ValueError, match=message):
        bspline(**(given | change))


class TestSeams:
    """An oval tube as a periodic cubic, whose Bezier patches meet to the bit with some knots only."""

    WHOLE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    ACROSS = circle((0, 0.5), (0.03, 0.2))

    @staticmethod
    def tube(knots):
        n = len(knots) - 7
        turn = 2 * np.pi * (np.arange(n + 3) % n) / n
        ring = np.stack([np.cos(turn) * (3 + np.cos(turn)), 3 * np.sin(turn), 0 * turn], axis=1)
        control = np.stack([ring, ring + np.array([0, 0, 1])], axis=1)
        return NurbsSurface(control, knots, [0, 0, 1, 1], (3, 1))

    def test_whole_knots_close_and_a_window_has_both_halves(self):
        cut = TrimmedSurface(self.tube(np.arange(32.0) - 3), [self.WHOLE, self.ACROSS])
        assert cut.closes == (True, False)
        inside, _ = cut.contains([0.01, 0.99, 0.05], 0.5)
        np.testing.assert_array_equal(inside, [False, False, True])

    @pytest.mark.parametrize("side", [0.0, 1.0])
    def test_a_window_across_borders_that_meet_by_rounding_is_refused(self, side):
        tube = self.tube((np.arange(32.0) - 3) / 25)
        assert tube.closes == (False, False)
        words = r"loops\[1\] goes on to u = (-0.03|1.03), but the surface closes along u only up to \de-1\d: make"
        with pytest.raises(ValueError, match=words):
            TrimmedSurface(tube, [self.WHOLE, circle((side, 0.5), (0.03, 0.2))])

    def test_what_is_not_meant_to_go_on_is_taken(self):
        """All around, by less than the gap of a part, or where the borders are far apart."""
        tube = self.tube((np.arange(32.0) - 3) / 25)
        TrimmedSurface(tube, [polygon([(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)])])
        half = polygon([(-1e-3, 0), (0.5, 0), (0.5, 1), (-1e-3, 1)])
        TrimmedSurface(tube, [half], gap=0.01)
        with pytest.raises(ValueError, match=r"loops\[0\] goes on to u = -0.001"):
            TrimmedSurface(tube, [half])
        TrimmedSurface(tube, [self.WHOLE, circle((0.5, 0), (0.2, 0.3))])
