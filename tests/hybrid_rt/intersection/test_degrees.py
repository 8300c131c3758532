"""Patches of every degree: elevated twins, mixed degrees, and a fine mesh as a second opinion."""

import numpy as np
import pytest

from hybrid_rt import Intersector, Status
from meshing import BezierPatches


def elevate(net, times):
    """Raise both degrees without changing the surface."""
    for _ in range(times):
        for _ in range(2):
            n = len(net)
            weight = (np.arange(n + 1) / n).reshape(-1, 1, 1)
            below = np.concatenate([np.zeros_like(net[:1]), net])
            above = np.concatenate([net, np.zeros_like(net[:1])])
            net = (weight * below + (1.0 - weight) * above).swapaxes(0, 1)
    return net


def bumpy(degree_u, degree_v, seed):
    """A height field over the unit square with random bumps."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, degree_u + 1), np.linspace(0, 1, degree_v + 1))
    height = rng.normal(size=u.T.shape) * 0.4
    return np.stack([u.T, v.T, height], axis=-1)


def chords(n, seed):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, n, 3))
    a *= 1.5 / np.linalg.norm(a, axis=1, keepdims=True)
    b *= 1.5 / np.linalg.norm(b, axis=1, keepdims=True)
    return np.array([0.5, 0.5, 0.0]) + a, b - a


@pytest.mark.parametrize("times", [1, 12, 27])
def test_elevated_patch_gives_the_same_hits(times):
    """A06: bicubic against the same surface at degree up to 30 x 30."""
    net = bumpy(3, 3, seed=1)
    rays = chords(4000, seed=2)
    low = Intersector([BezierPatches([net])], coarse="none").intersect(*rays)
    high = Intersector([BezierPatches([elevate(net, times)])], coarse="none").intersect(*rays)
    sure = (low.status != Status.TANGENT) & (high.status != Status.TANGENT)
    np.testing.assert_array_equal(low.hit[sure], high.hit[sure])
    both = sure & low.hit
    # Elevation rounds each point `times` times, which moves the surface by as many ulps.
    slope = np.abs(np.einsum("ij,ij->i", low.normal, rays[1]))[both]
    slack = low.t_bound[both] + high.t_bound[both] + 8 * (times + 1) * 2.0**-52 / slope
    assert (np.abs(low.t[both] - high.t[both]) <= slack).all()


def test_mixed_degrees_agree_with_embree_and_with_a_fine_mesh():
    degrees = [(1, 1), (2, 5), (4, 4), (7, 3), (12, 1), (9, 9)]
    nets = [np.add(bumpy(m, n, seed=10 + m), (0.0, 0.0, 0.02 * m)) for m, n in degrees]
    surface = BezierPatches(nets)
    rays = chords(20_000, seed=3)
    exact = Intersector([surface]).intersect(*rays)
    bare = Intersector([surface], coarse="none").intersect(*rays)
    for name in ("t", "patch_id", "u", "v", "status"):
        np.testing.assert_array_equal(getattr(exact, name), getattr(bare, name), err_msg=name)
    mesh = Intersector([surface], accuracy="mesh", tolerance=1e-4).intersect(*rays)
    # Facets of 1e-4 decide otherwise only where a ray grazes or passes a border that closely.
    t, t_mesh = np.where(exact.hit, exact.t, 9.0), np.where(mesh.hit, mesh.t, 9.0)
    assert (np.abs(t - t_mesh) > 0.05).mean() < 2e-3
    found = exact.hit
    end = rays[0][found] + exact.t[found, None] * rays[1][found]
    gap = surface.point(exact.u[found], exact.v[found], exact.patch_id[found]) - end
    assert np.abs(gap).max() < 1e-14
