"""B-splines and NURBS against SciPy's B-splines, and sheets of patches."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import BSpline

from meshing import (
    BezierPatches,
    NurbsSurface,
    PatchSheet,
    SurfaceOfRevolution,
    bspline,
    tessellate,
)
from meshing.knots import lengthened

KNOTS = {
    "repeated": ([0, 0, 0, 0, 1, 2, 2, 3, 3, 3, 3], 3),
    "crease": ([0, 0, 0, 1, 1, 4, 4, 4], 2),
    "break": ([0, 0, 0, 1, 1, 1, 2, 2, 2], 2),
    "unclamped": (np.arange(9.0) * 1e5, 3),
    "lines": ([-1, -1, 0, 0.25, 1, 1], 1),
    "one piece": ([2] * 5 + [5] * 5, 4),
}


def surface_of(u, v, is_rational, seed=1):
    (knots_u, m), (knots_v, n) = KNOTS[u], KNOTS[v]
    p, q = len(knots_u) - m - 1, len(knots_v) - n - 1
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(p), np.arange(q), indexing="ij")
    net = np.stack([x, y, rng.normal(size=(p, q))], axis=2) + 0.3 * rng.random((p, q, 3))
    weights = np.exp(rng.normal(size=(p, q))) if is_rational else None
    return NurbsSurface(net, knots_u, knots_v, (m, n), weights)


def by_scipy(surface, u, v):
    """Points of the homogeneous spline, divided by the last coordinate."""
    share = []
    for x, knots, d in zip((u, v), surface.knots, surface.degree, strict=True):
        p = len(knots) - d - 1
        at = np.clip(knots[d] + x * (knots[p] - knots[d]), knots[d], knots[p])
        share.append(BSpline.design_matrix(at, knots, d).toarray())
    weights = np.ones(surface.control.shape[:2]) if surface.weights is None else surface.weights
    columns = np.concatenate([surface.control * weights[..., None], weights[..., None]], axis=2)
    values = np.einsum("ni,nj,ijc->nc", *share, columns)
    return values[:, :3] / values[:, 3:]


@pytest.mark.parametrize("is_rational", [False, True])
@pytest.mark.parametrize(
    ("u", "v"), [("repeated", "crease"), ("break", "unclamped"), ("one piece", "lines")]
)
def test_points_are_those_of_scipy(u, v, is_rational):
    surface = surface_of(u, v, is_rational)
    a, b = np.random.default_rng(2).random((2, 3000))
    # Coordinates up to 6; knots of 1e5 are rounded to 1e-16 of them.
    assert np.abs(surface.point(a, b) - by_scipy(surface, a, b)).max() < 1e-13


def test_partials_are_those_of_the_sheet():
    surface = surface_of("repeated", "unclamped", True)
    u, v = np.random.default_rng(3).uniform(0.01, 0.99, (2, 200))
    h = 2.0**-18
    s_u, s_v = surface.partials(u, v)
    slope_u = (surface.point(u + h, v) - surface.point(u - h, v)) / (2 * h)
    slope_v = (surface.point(u, v + h) - surface.point(u, v - h)) / (2 * h)
    # Central differences, but where a knot with a jump of the curvature is within h.
    assert np.quantile(np.abs(slope_u - s_u), 0.99) < 1e-6
    assert np.quantile(np.abs(slope_v - s_v), 0.99) < 1e-6


def test_one_patch_for_each_span_and_shared_borders_to_the_bit():
    surface = surface_of("repeated", "crease", True)
    assert len(surface) == 3 * 2
    nets = surface.pieces.patches
    for p, q in ((0, 2), (2, 4)):
        np.testing.assert_array_equal(nets[p][-1], nets[q][0])
    np.testing.assert_array_equal(nets[0][:, -1], nets[1][:, 0])
    np.testing.assert_allclose(surface.spans[0], [0, 1 / 3, 0, 0.25])
    assert tessellate(surface, 0.05).mesh.body_count == 1


def test_a_break_leaves_two_sheets():
    surface = surface_of("break", "lines", False)
    mesh = tessellate(surface, 0.05)
    assert mesh.mesh.body_count == 2
    assert mesh.uv.min() == 0.0
    assert mesh.uv.max() == 1.0


def test_a_periodic_surface_closes():
    angle = 2 * np.pi * np.arange(8) / 8
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    ring = np.concatenate([ring, ring[:3]])
    net = np.stack([ring, np.add(ring, (0, 0, 1))], axis=1)
    surface = NurbsSurface(net, np.arange(15.0), [0, 0, 1, 1], (3, 1))
    assert len(surface) == 8
    assert np.abs(surface.point(0.0, 0.3) - surface.point(1.0, 0.3)).max() < 1e-15
    assert tessellate(surface, 1e-2).mesh.euler_number == 0


@pytest.mark.parametrize("gap", [9e-13, 1e-13, 1e-15])
@pytest.mark.parametrize("far", [0.0, 1e6])
def test_knots_of_a_break_that_are_nearly_equal_are_refused(gap, far):
    # Two double knots of a cubic: it goes on between them, by a fifth of its length.
    x = np.array([0, 0.1, 0.25, 0.4, 0.6, 0.75, 0.9, 1.0]) + far
    net = np.zeros((8, 2, 3))
    net[..., 0], net[:, 1, 1] = x[:, None], 1.0
    knots = np.array([0, 0, 0, 0, 0.5, 0.5, 0.5 + gap, 0.5 + gap, 1, 1, 1, 1])
    words = r"knots_{} holds 0.5 and 0.5000.*, closer than 1e-12 .* goes on by 0.2, or breaks"
    with pytest.raises(ValueError, match=words.format("u")):
        NurbsSurface(net, knots, [0, 0, 1, 1], (3, 1))
    with pytest.raises(ValueError, match=words.format("v")):
        NurbsSurface(net.swapaxes(0, 1), [0, 0, 1, 1], knots, (1, 3))
    # Farther apart it is a patch of its own; where both ends are one point nothing is lost.
    knots[6:8] = 0.5 + 2e-12
    assert len(NurbsSurface(net, knots, [0, 0, 1, 1], (3, 1))) == 3
    knots[6:8], net[4] = 0.5 + gap, net[3]
    assert len(NurbsSurface(net, knots, [0, 0, 1, 1], (3, 1))) == 2


@pytest.mark.parametrize("gap", [1e-9, 1e-13, 2.0**-52])
def test_double_knots_of_a_loop_that_are_nearly_equal_keep_it_whole(gap):
    # The same cubic as a curve: arcs, also that of the short span, join to the bit, and x grows.
    x = np.array([0, 0.1, 0.25, 0.4, 0.6, 0.75, 0.9, 1.0])
    knots = [0, 0, 0, 0, 0.5, 0.5, 0.5 + gap, 0.5 + gap, 1, 1, 1, 1]
    arcs = bspline(np.stack([x, x**2], 1), knots, 3)
    assert len(arcs) == 3
    for one, other in pairwise(arcs):
        assert one.control[-1].tolist() == other.control[0].tolist()
    assert (np.diff(np.concatenate([arc.control[:, 0] for arc in arcs])) >= -1e-15).all()
    # The blossom of a span that vanishes: its ends, twice each.
    np.testing.assert_allclose(arcs[1].control[:, 0], [0.4, 0.4, 0.6, 0.6], atol=8 * gap)


def test_knots_of_twelve_digits_are_one():
    knots = [0, 0, 0, 1 / 3, 0.333333333333, 1, 1, 1]
    surface = NurbsSurface(np.random.default_rng(1).random((5, 3, 3)), knots, [0] * 3 + [1] * 3, 2)
    assert len(surface) == 2
    np.testing.assert_array_equal(surface.knots[0][3:5], [1 / 3] * 2)


def test_image_flip_and_pickle():
    surface = surface_of("crease", "unclamped", True)
    u, v = np.random.default_rng(4).random((2, 200))
    matrix = np.eye(4)
    matrix[:3] += np.random.default_rng(5).normal(size=(3, 4))
    there = surface.point(u, v) @ matrix[:3, :3].T + matrix[:3, 3]
    np.testing.assert_allclose(surface.transformed(matrix).point(u, v), there, atol=1e-13)
    np.testing.assert_allclose(surface.flipped().point(v, u), surface.point(u, v), atol=1e-14)
    again = pickle.loads(pickle.dumps(surface))
    np.testing.assert_array_equal(again.point(u, v), surface.point(u, v))
    assert repr(again) == "NurbsSurface(5 x 5 points of degree 2 x 3, 4 patches, rational)"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"control": np.zeros((4, 3))}, r"control has shape \(4, 3\): pass \(p, q, 3\)"),
        ({"knots_u": [0, 0, 1, 1]}, r"knots_u has shape \(4,\): pass 6 knots"),
        ({"knots_u": [0, 0, 0, 1, 1, 0.5]}, "knots_u descends from 1 to 0.5 at 4"),
        ({"knots_u": [0, 0, 0, 0, 0, 1]}, "knots_u leaves an empty domain"),
        ({"knots_v": [0, 0, 0, np.nan, 1, 1]}, "knots_v is"),
        ({"degree": 0}, "degree in u is 0: pass an integer from 1 to 30"),
        ({"degree": (2, 2.0)}, "degree in v is 2.0: pass an integer"),
        ({"degree": (1, 2, 3)}, r"degree is \(1, 2, 3\): pass one number or two"),
        ({"weights": np.zeros((3, 3))}, r"NurbsSurface weights is 0 at \(0, 0\)"),
        ({"weights": np.ones((3, 2))}, r"weights has shape \(3, 2\)"),
        ({"control": np.zeros((3, 3, 3))}, "NurbsSurface: BezierPatches patch 0 has no area"),
        ({"control": np.full((3, 3, 3), np.inf)}, r"control point \(0, 0\) is \[inf"),
    ],
)
def test_bad_arguments_are_refused_by_name(changes, words):
    x, y = np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij")
    good = {
        "control": np.stack([x, y, x * y], axis=2), "degree": 2,
        "knots_u": [0, 0, 0, 1, 1, 1], "knots_v": [0, 0, 0, 1, 1, 1],
    }  # fmt: skip
    NurbsSurface(**good)
    with pytest.raises((ValueError, TypeError), match=words):
        NurbsSurface(**{**good, **changes})


def test_too_many_equal_knots_are_refused():
    with pytest.raises(ValueError, match="knots_u holds 1 4 times: pass a knot at most 3 times"):
        NurbsSurface(np.ones((7, 3, 3)), [0, 0, 0, 1, 1, 1, 1, 2, 2, 2], [0] * 3 + [1] * 3, 2)


def test_a_sheet_of_patches_has_one_picture():
    x, y = np.meshgrid(np.arange(4.0), np.arange(7.0), indexing="ij")
    net = np.stack([x, y, 0.1 * x * y], axis=2)
    sheet = PatchSheet.grid(BezierPatches([net[:, :4], net[:, 3:]]), 1, 2)
    points = sheet.point(0.5, np.linspace(0.0, 1.0, 9))
    np.testing.assert_allclose(points[:, 1], np.linspace(0.0, 6.0, 9), atol=1e-14)
    patch, u, v = sheet.area_sampler().choose(np.random.default_rng(1).random((500, 2)))
    assert ((v <= 0.5) == (patch == 0)).all()
    assert (sheet.area_sampler().pdf_area(patch, u, v) > 0.0).all()
    with pytest.raises(ValueError, match="PatchSheet of 2 x 2 for 2 patches"):
        PatchSheet.grid(sheet.pieces, 2, 2)


def turned(profile):
    """A Bezier profile turned about the z axis, as NURBS: the recipe of docs/howto/scene.md."""
    z, radius = np.array(profile, dtype=float).T
    circle = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    control = np.empty((9, len(z), 3))
    control[..., :2] = np.array(circle)[:, None] * radius[:, None]
    control[..., 2] = z
    weights = np.outer([1, *[np.sqrt(0.5), 1] * 4], np.ones(len(z)))
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0] * len(z) + [1] * len(z)
    return NurbsSurface(control, *knots, (2, len(z) - 1), weights)


def test_a_turned_profile_as_nurbs_takes_any_map():
    """It is the surface of revolution, up to how u runs; scaling the profile is a map as well."""
    profile = np.array([(0, 0), (0.6, 1.2), (1.2, 0.3), (2, 0.6)])
    surface = turned(profile)
    u, v = np.random.default_rng(4).random((2, 500))
    x, y, z = surface.point(u, v).T
    whole = SurfaceOfRevolution(profile, (0, 0, 0), (0, 0, 1))
    angle = np.arctan2(y, x) / (2 * np.pi) % 1
    np.testing.assert_allclose(whole.point(angle, v), np.stack([x, y, z], axis=1), atol=4e-15)
    outward = np.cross(*surface.partials(u, v))
    assert (np.einsum("ni,ni->n", outward, np.cross(*whole.partials(angle, v))) > 0).all()
    oval = np.array([[2, 0.5, 0, 1], [0, 1, 0, 2], [0, 0, 0.5, 3], [0, 0, 0, 1]])
    np.testing.assert_allclose(
        surface.transformed(oval).point(u, v),
        surface.point(u, v) @ oval[:3, :3].T + oval[:3, 3],
        atol=4e-15,
    )
    np.testing.assert_allclose(
        surface.transformed(np.diag([2, 2, 0.5, 1])).point(u, v),
        SurfaceOfRevolution(profile * (0.5, 2), (0, 0, 0), (0, 0, 1)).point(angle, v),
        atol=8e-15,
    )


@pytest.mark.parametrize("name", list(KNOTS))
@pytest.mark.parametrize(("low", "high"), [(-0.02, 1.01), (0.3, 1.02), (-0.01, 0.7), (0.2, 0.9)])
def test_lengthened_splines_go_on_as_polynomials(name, low, high):
    knots, degree = np.array(KNOTS[name][0], np.float64), KNOTS[name][1]
    n = len(knots) - degree - 1
    begin, end = knots[degree], knots[n]
    low, high = begin + low * (end - begin), begin + high * (end - begin)
    net = np.random.default_rng(4).normal(size=(n, 3))
    longer, reaching = lengthened(net, knots, degree, low, high)
    assert (reaching[degree], reaching[n]) == (min(low, begin), max(high, end))
    x = np.linspace(min(low, begin), max(high, end), 101)[:-1]  # at breaks both sides hold
    off = BSpline(knots, net, degree)(x) - BSpline(reaching, longer, degree)(x)
    assert np.abs(off).max() < 1e-14 * 2**degree * np.abs(net).max()
