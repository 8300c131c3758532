"""Loops across the seams of sheets that close on themselves, against closed forms and a quarter turn."""

import numpy as np
import pytest
from trimmed_surfaces import OUTLINE, edge_rays, nurbs_torus, nurbs_tube

from hybrid_rt import Intersector, Sphere, Status, Torus
from meshing import (
    BezierPatches,
    Curve2,
    NurbsSurface,
    PatchSheet,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    polygon,
)
from proof.exact.judge import ExactJudge

# One eighth of a turn to either side of the seam: there rational quarters are at 45 degrees.
WINDOW = polygon([(-0.125, 0.25), (0.125, 0.25), (0.125, 0.75), (-0.125, 0.75)])
# Across both seams of a torus.
CORNER = polygon([(-0.125, -0.125), (0.125, -0.125), (0.125, 0.125), (-0.125, 0.125)])


def ball_rays(n, seed):
    """Rays from a sphere of radius 3 at random points of the cube about the origin."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(n, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1)[:, None]
    return origins, rng.uniform(-1, 1, (n, 3)) - origins


def assert_same_hits(one, other, least):
    """Hits of two forms of a surface agree wherever neither is TANGENT."""
    sure = (one.status != Status.TANGENT) & (other.status != Status.TANGENT)
    np.testing.assert_array_equal(one.hit[sure], other.hit[sure])
    both = sure & one.hit
    np.testing.assert_allclose(one.t[both], other.t[both], rtol=1e-12)
    assert sure.mean() > least
    assert both.sum() > 100


def test_sheets_close_where_their_borders_are_equal():
    assert nurbs_tube().closes == (True, False)
    assert nurbs_tube().flipped().closes == (False, True)
    assert nurbs_torus().closes == (True, True)
    angle = 2 * np.pi * np.arange(8) / 8
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)[[*range(8), 0, 1, 2]]
    periodic = NurbsSurface(
        np.stack([ring, np.add(ring, (0, 0, 1))], axis=1), np.arange(15.0), [0, 0, 1, 1], (3, 1)
    )
    assert periodic.closes == (True, False)


@pytest.mark.parametrize("part", ["control", "weights", "degrees"])
def test_a_sheet_that_nearly_closes_does_not(part):
    pieces = nurbs_tube().pieces
    nets, weights = [net.copy() for net in pieces.patches], [w.copy() for w in pieces.weights]
    # Weights of a patch have no scale: powers of two leave them equal.
    same = PatchSheet.grid(BezierPatches(nets, [weights[0] * 4, *weights[1:]]), 4, 1)
    assert same.closes == (True, False)
    if part == "control":
        nets[3][2, 1, 1] = 1e-300
    elif part == "weights":
        weights[3][2, 1] *= 1 + 2.0**-52
    else:
        nets[3] = nets[3][:, [0, 0, 1]]
        nets[3][:, 1] = 0.5 * (nets[3][:, 0] + nets[3][:, 2])
        weights[3] = weights[3][:, [0, 0, 1]]
    assert PatchSheet.grid(BezierPatches(nets, weights), 4, 1).closes == (False, False)


@pytest.mark.parametrize("coarse", ["none", "embree"])
def test_a_hole_across_the_seam_is_that_of_a_cylinder(coarse):
    rays = ball_rays(6000, 1)
    other = SurfaceOfRevolution([(0, 1), (2, 1)], (0, 0, -1), (0, 0, 1), (1, 0, 0))
    hits, same = (
        Intersector(TrimmedSurface(whole, [OUTLINE, WINDOW]), coarse=coarse).intersect(*rays)
        for whole in (nurbs_tube(), other)
    )
    assert_same_hits(hits, same, 0.999)
    # By the closed form no hit is in the window, and there are some above and below it.
    x, y, z = hits.position[hits.status == Status.HIT].T
    assert not ((x > np.abs(y)) & (np.abs(z) < 0.5)).any()
    assert ((x > 0) & (np.abs(y) < 0.5 * x) & (np.abs(z) > 0.5)).sum() > 100


@pytest.mark.parametrize(
    ("make", "n", "window"),
    [(nurbs_tube, 20, WINDOW), (nurbs_torus, 8, WINDOW), (nurbs_torus, 12, CORNER)],
)
def test_edges_across_seams_are_judged_exactly(make, n, window):
    surface = TrimmedSurface(make(), [OUTLINE, circle((0.5, 0.5), (0.1, 0.2)), window])
    origins, directions, beside = edge_rays(surface, n, 11)
    hits = Intersector(surface, coarse="none").intersect(origins, directions)
    verdict = ExactJudge([surface]).judge(hits, origins, directions, distance=beside)
    assert verdict.hits > 0
    assert verdict.faults == verdict.left_open == 0


@pytest.mark.parametrize("weight", [1.0, 1.5])
def test_a_single_patch_that_closes_wraps(weight):
    # The circle as one arc of degree 5 (Chou 1995), whose weights are 5, 1, 1, 1, 1, 5 up to a factor.
    circle_of_5 = np.array([(1, 0), (1, 4), (-3, 2), (-3, -2), (1, -4), (1, 0)], float)
    net = np.stack([np.insert(circle_of_5, 2, z, axis=1) for z in (-1.0, 1.0)], axis=1)
    weights = weight * np.repeat([[5.0], [1], [1], [1], [1], [5]], 2, axis=1)
    tube = BezierPatches([net], [weights])
    np.testing.assert_allclose(np.hypot(*tube.point(np.linspace(0, 1, 50), 0.3)[:, :2].T), 1.0)
    assert (tube.closes, tube.flipped().closes) == ((True, False), (False, True))
    surface = TrimmedSurface(tube, [OUTLINE, WINDOW])
    rays = ball_rays(3000, 5)
    hits = Intersector(surface).intersect(*rays)
    # u = 1/8 and 7/8 are a certain angle on either side of the seam, where v is 1/4 to 3/4.
    x, y, _ = tube.point([0.125, 0.875], 0.5).T
    assert x[0] == pytest.approx(x[1])
    assert y[0] == pytest.approx(-y[1])
    whole = Intersector(tube).intersect_all(*rays)
    px, _, pz = whole.hits.position.T
    in_window = (px > x[0]) & (np.abs(pz) < 0.5)
    kept = np.bincount(whole.ray[~in_window], minlength=len(rays[0])) > 0
    sure = hits.status != Status.TANGENT
    np.testing.assert_array_equal(hits.hit[sure], kept[sure])
    assert in_window.sum() > 100
    verdict = ExactJudge([surface]).judge(hits[:40], *(ray[:40] for ray in rays))
    assert verdict.hits > 0
    assert verdict.faults == verdict.left_open == 0


def test_patches_with_parameters_of_their_own_do_not_close():
    ring = nurbs_tube().pieces
    assert ring.closes == (False, False)
    assert BezierPatches(ring.patches[:1], ring.weights[:1]).closes == (False, False)


def test_an_open_sheet_does_not_wrap():
    flat = PatchSheet.grid(BezierPatches([[[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]]), 1, 1)
    surface = TrimmedSurface(flat, [OUTLINE, WINDOW])
    assert surface.closes == (False, False)
    np.testing.assert_array_equal(surface.contains([0.05, 0.95], 0.5)[0], [False, True])


RING = Torus((0, 0, 0), (0, 0, 1), 3, 1)


def box(u0, u1, v0, v1):
    return polygon([(u0, v0), (u1, v0), (u1, v1), (u0, v1)])


def stripe(shift, wide=0.2):
    """A stripe that winds around: once along u while v goes on by 0.6."""
    return polygon(
        [(-0.3, shift), (1.3, shift + 0.96), (1.3, shift + 0.96 + wide), (-0.3, shift + wide)]
    )


@pytest.mark.parametrize(
    ("surface", "loop"),
    [
        (RING, box(-0.3, 1.3, 0.2, 0.4)),
        (RING, box(0.2, 0.4, -0.3, 1.3)),
        (RING, box(-0.01, 1.01, -0.2, 1.2)),
        (RING, box(-0.9, 1.9, 0.3, 0.4)),
        (RING, box(0.0, 1.0 + 1e-4, 0.1, 0.2)),
        (RING, box(0.0, 2.0, 0.1, 0.2)),
        (RING, stripe(-0.2, 0.7)),
        (RING, [Curve2([(c * 0.9 + 0.5, s * 0.1 + 0.5) for c, s in p], w)
                for p, w in (([(1, 0), (1, 1), (0, 1)], [1, 0.5**0.5, 1]), ([(0, 1), (-1, 1), (-1, 0)], [1, 0.5**0.5, 1]),
                             ([(-1, 0), (-1, -1), (0, -1)], [1, 0.5**0.5, 1]), ([(0, -1), (1, -1), (1, 0)], [1, 0.5**0.5, 1]))]),
        (Sphere((1, 2, 3), 2), box(-0.2, 0.9, 0.4, 0.5)),
        (SurfaceOfRevolution([(0, 1), (1, 2)], (0, 0, 0), (0, 1, 1)), box(0.3, 1.4, 0.4, 0.5)),
        (nurbs_torus(), box(0.2, 0.4, -0.1, 1.2)),
    ],
)  # fmt: skip
def test_loops_that_overlap_themselves_after_a_turn_are_refused(surface, loop):
    # An island elsewhere, so that the number in the message counts.
    with pytest.raises(
        ValueError, match=r"loops\[1\] is .* wide in u .* overlaps itself after whole turns"
    ):
        TrimmedSurface(surface, [circle((0.8, 0.8), 0.02), loop])


@pytest.mark.parametrize("low", [0.0, -0.25, 0.3, -0.7])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_band_all_around_may_touch_itself(low, axis):
    band = box(low, low + 1.0, 0.2, 0.4) if axis == 0 else box(0.2, 0.4, low, low + 1.0)
    surface = TrimmedSurface(RING, [band])
    around, across = np.random.default_rng(1).random((2, 4000))
    inside, in_band = surface.contains(*((around, across) if axis == 0 else (across, around)))
    sure = ~in_band
    np.testing.assert_array_equal(inside[sure], ((across > 0.2) & (across < 0.4))[sure])


def test_stripes_that_wind_around_are_kept():
    # Wider than a turn, but nowhere over themselves: v - 0.6 u, modulo its turn, says who is inside. Ends
    # at u = -0.3 and 1.3 lie on the way of the stripe one turn on only if v = 0.6 there, so they do not.
    surface = TrimmedSurface(RING, [stripe(-0.2)])
    u, v = np.random.default_rng(2).random((2, 20000))
    inside, in_band = surface.contains(u, v)
    expected = np.zeros(len(u), bool)
    for i in (-1, 0, 1, 2):
        for j in (-2, -1, 0, 1, 2):
            x, y = u + i, v + j
            at = -0.2 + 0.6 * (x + 0.3)
            expected |= (x > -0.3) & (x < 1.3) & (at < y) & (y < at + 0.2)
    np.testing.assert_array_equal(inside[~in_band], expected[~in_band])
    # A border that waves, and its copy one turn on, touch all along.
    wave = [(0.0, 0.2), (0.35, 0.25), (-0.35, 0.35), (0.0, 0.4)]
    loop = [
        Curve2([(0.0, 0.2), (1.0, 0.2)]), Curve2(np.add(wave, (1, 0))),
        Curve2([(1.0, 0.4), (0.0, 0.4)]), Curve2(wave[::-1]),
    ]  # fmt: skip
    inside, in_band = TrimmedSurface(RING, [loop]).contains(u, v)
    np.testing.assert_array_equal(inside[~in_band], ((v > 0.2) & (v < 0.4))[~in_band])
    assert in_band.mean() < 1e-3


def test_different_loops_that_overlap_after_a_turn_count_by_the_even_odd_rule():
    surface = TrimmedSurface(RING, [box(-0.3, 0.3, 0.2, 0.4), box(0.6, 1.2, 0.2, 0.4)])
    u = np.array([0.1, 0.25, 0.45, 0.65, 0.8])
    inside, _ = surface.contains(u, np.full(5, 0.3))
    assert inside.tolist() == [False, True, False, True, False]
