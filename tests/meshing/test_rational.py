"""Rational patches: what they refuse, their points, boxes and triangles."""

import pickle

import numpy as np
import pytest
from rational_surfaces import bumpy, cylinder, octant, petal, rational_values, sphere

from hybrid_rt.core.fingerprint import fingerprint
from meshing import BezierPatches, tessellate

EPS = 2.0**-52


def parameters(n, seed=1):
    return np.random.default_rng(seed).random((2, n))


@pytest.mark.parametrize(
    ("weights", "words"),
    [
        ([np.zeros((3, 3))], r"weights of patch 0 is 0 at \(0, 0\): pass finite numbers above 0"),
        ([np.full((3, 3), np.inf)], "is inf at"),
        ([np.full((3, 3), np.nan)], "is nan at"),
        ([1.0 + (1e-7 - 1.0) * np.eye(3)], "lies between 1e-07 and 1, more than 1e"),
        ([np.ones((3, 4))], r"weights of patch 0 has shape \(3, 4\): pass \(3, 3\)"),
        ([np.ones((3, 3))] * 2, "2 arrays for 1 patches"),
        (2.0, "weights is 2.0: pass one array for each patch"),
        ([[["a"] * 3] * 3], "weights of patch 0 is"),
    ],
)
def test_bad_weights_are_refused_by_name(weights, words):
    with pytest.raises((ValueError, TypeError), match=words):
        BezierPatches([octant()[0]], weights)


def test_negative_weights_are_refused():
    weights = np.ones((3, 3))
    weights[1, 2] = -0.5
    with pytest.raises(ValueError, match=r"weights of patch 0 is -0.5 at \(1, 2\)"):
        BezierPatches([octant()[0]], [weights])


def test_a_curve_with_weights_has_no_area():
    net = np.zeros((3, 3, 3))
    net[..., 0] = np.arange(3)[:, None]
    with pytest.raises(ValueError, match="patch 0 has no area"):
        BezierPatches([net], [np.arange(1.0, 10.0).reshape(3, 3)])


def test_equal_weights_are_polynomial_patches():
    net, _ = bumpy(3, 2, 0.0, 3)
    assert type(BezierPatches([net], [np.full((4, 3), 7.0)])) is BezierPatches
    assert BezierPatches([net], [np.full((4, 3), 7.0)]).weights is None


def test_points_by_the_definition():
    for m, n in ((1, 2), (3, 3), (6, 4)):
        net, weights = bumpy(m, n, 1.0, m)
        surface, (u, v) = BezierPatches([net], [weights]), parameters(500)
        # A few roundings a degree.
        assert np.abs(surface.point(u, v) - rational_values(net, weights, u, v)).max() < 40 * EPS


def test_the_sphere_is_one():
    surface = sphere()
    u, v = parameters(2000)
    patch = np.arange(2000) % 8
    points = surface.point(u, v, patch)
    assert np.abs(np.linalg.norm(points, axis=1) - 1.0).max() < 4 * EPS
    # Normals lose digits beside the pole, where S_u vanishes: at 1e-4 by 1e-16 / 1e-4.
    away = v > 1e-4
    along = np.abs(np.einsum("ij,ij->i", surface.normal(u, v, patch), points))
    assert np.abs(along - 1.0)[away].max() < 1e-12
    pole = surface.normal(np.linspace(0, 1, 9), 0.0, 0)
    np.testing.assert_allclose(np.abs(pole), [[0, 0, 1]] * 9, atol=1e-14)
    # Sixteen by sixteen cells, nine points each: to a part in 1e-3.
    assert abs(surface.area_sampler().area / (4 * np.pi) - 1.0) < 1e-3
    np.testing.assert_allclose(surface.bounds, [[-1] * 3, [1] * 3], atol=4 * EPS)


def test_partials_are_slopes():
    net, weights = bumpy(3, 4, 0.7, 5)
    surface, (u, v), h = BezierPatches([net], [weights]), parameters(200), 2.0**-17
    s_u, s_v = surface.partials(u, v)
    s_uu, s_uv, s_vv = surface.second_partials(u, v)
    # Central differences: off by h^2 times third partials, and eps / h.
    for slope, (du, dv) in ((s_u, (h, 0)), (s_v, (0, h))):
        ahead, behind = surface.point(u + du, v + dv), surface.point(u - du, v - dv)
        assert np.abs((ahead - behind) / (2 * h) - slope).max() < 1e-7
    for slope, k, (du, dv) in ((s_uu, 0, (h, 0)), (s_uv, 0, (0, h)), (s_vv, 1, (0, h))):
        ahead, behind = surface.partials(u + du, v + dv)[k], surface.partials(u - du, v - dv)[k]
        assert np.abs((ahead - behind) / (2 * h) - slope).max() < 1e-5


def test_an_affine_map_goes_through_the_control_points():
    net, weights = bumpy(3, 3, 1.0, 8)
    surface, (u, v) = BezierPatches([net], [weights]), parameters(300)
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(2).normal(size=(3, 4))
    image = surface.transformed(matrix)
    there = surface.point(u, v) @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(image.point(u, v) - there).max() < 40 * EPS
    np.testing.assert_array_equal(image.weights[0], weights)
    turned = surface.flipped()
    np.testing.assert_allclose(turned.point(v, u), surface.point(u, v), atol=10 * EPS)
    np.testing.assert_allclose(turned.normal(v, u), -surface.normal(u, v), atol=1e-13)


def test_far_from_the_origin_no_digits_are_lost_but_those_of_the_points():
    net, weights = bumpy(3, 3, 0.5, 9)
    net = np.round(net * 2.0**20) * 2.0**-20
    near, far = BezierPatches([net], [weights]), BezierPatches([net + 2.0**20], [weights])
    u, v = parameters(200)
    np.testing.assert_allclose(far.partials(u, v), near.partials(u, v), rtol=0, atol=1e-13)
    np.testing.assert_allclose(far.normal(u, v), near.normal(u, v), rtol=0, atol=1e-13)


def test_pickle_and_fingerprint_keep_the_weights():
    net, weights = bumpy(2, 2, 0.5, 1)
    surface, plain = BezierPatches([net], [weights]), BezierPatches([net])
    again = pickle.loads(pickle.dumps(surface))
    np.testing.assert_array_equal(again.homogeneous, surface.homogeneous)
    assert fingerprint(again) == fingerprint(surface)
    assert fingerprint(plain) != fingerprint(surface)
    assert repr(surface) == "BezierPatches(1 of degree 2, rational)"


def test_a_file_without_room_for_weights_is_not_written(tmp_path):
    with pytest.raises(ValueError, match="hold no weights"):
        sphere().write(tmp_path / "sphere.bpt")


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3])
def test_triangles_stay_within_their_bound(tolerance):
    rng = np.random.default_rng(4)
    shapes = [sphere(), cylinder(), petal(), BezierPatches(*([x] for x in bumpy(3, 3, 1.0, 6)))]
    for surface in shapes:
        mesh = tessellate(surface, tolerance)
        face, share = rng.integers(len(mesh), size=4000), rng.dirichlet((1, 1, 1), 4000)
        flat = np.einsum("ij,ijk->ik", share, mesh.vertices[mesh.faces[face]])
        u, v = np.einsum("ij,ijk->ki", share, mesh.uv[face])
        gap = np.linalg.norm(flat - surface.point(u, v, mesh.patch_id[face]), axis=1).max()
        assert gap <= mesh.deviation_bound <= tolerance
        if tolerance < 1e-2:  # on coarser leaves weights turn much
            assert mesh.deviation_bound < 6 * gap, surface


def test_octants_are_joined_without_cracks():
    for scale in (1.0, 3.0):
        net, weights = octant()
        signs = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
        # Weights count up to a factor.
        surface = BezierPatches([net * s for s in signs], [weights] * 7 + [scale * weights])
        assert tessellate(surface, 1e-2).mesh.is_watertight


def test_edges_of_other_weights_are_other_curves():
    net, weights = octant()
    other = weights.copy()
    other[-1, 1] = 3.0
    nets = [net, net * (-1, 1, 1)]
    joined, apart = (BezierPatches(nets, [weights, w]) for w in (weights, other))
    # One disk; two that share two points.
    assert tessellate(joined, 1e-2).mesh.euler_number == 1
    assert tessellate(apart, 1e-2).mesh.euler_number == 0
