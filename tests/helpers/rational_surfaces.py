"""Quadrics as rational patches, and other rational surfaces."""

import numpy as np

from meshing import BezierPatches
from proof.cases.rational_surfaces import weighted_petal as petal

__all__ = ["bumpy", "cylinder", "octant", "petal", "rational_values", "sphere"]

HALF = np.sqrt(0.5)
# A quarter of the unit circle: points and weights.
ARC = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
ARC_WEIGHTS = np.array([1.0, HALF, 1.0])


def octant():
    """Net and weights of an octant of the unit sphere, from its pole (collapsed) to the equator."""
    radius, height = np.array([0.0, 1.0, 1.0]), np.array([1.0, 1.0, 0.0])
    xy = ARC[:, None, :] * radius[:, None]
    net = np.concatenate([xy, np.broadcast_to(height[:, None], (3, 3, 1))], axis=2)
    return net, ARC_WEIGHTS[:, None] * ARC_WEIGHTS


def sphere():
    """The unit sphere in eight octants."""
    net, weights = octant()
    signs = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    return BezierPatches([net * s for s in signs], [weights] * 8)


def cylinder():
    """The unit cylinder about z, from -1 to 1, in four quarters."""
    net = np.array([[(x, y, z) for z in (-1.0, 1.0)] for x, y in ARC])
    weights = np.repeat(ARC_WEIGHTS[:, None], 2, axis=1)
    nets = [net * (x, y, 1) for x in (1, -1) for y in (1, -1)]
    return BezierPatches(nets, [weights] * 4)


def bumpy(degree_u, degree_v, spread, seed):
    """A net over the unit square with bumps, and weights whose logarithms have that spread."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, degree_u + 1), np.linspace(0, 1, degree_v + 1))
    net = np.stack([u.T, v.T, 0.3 * rng.normal(size=u.T.shape)], axis=-1)
    return net, np.exp(spread * rng.normal(size=u.T.shape))


def rational_values(net, weights, u, v):
    """Points by the definition, in float64: the weighted mean with Bernstein polynomials."""

    def basis(n, x):
        binomial = [1.0]
        for k in range(n):
            binomial.append(binomial[-1] * (n - k) / (k + 1))
        return np.stack([b * x**k * (1 - x) ** (n - k) for k, b in enumerate(binomial)], axis=1)

    m, n = weights.shape
    share = basis(m - 1, u)[:, :, None] * basis(n - 1, v)[:, None, :] * weights
    return np.einsum("pij,ijc->pc", share, net) / share.sum(axis=(1, 2))[:, None]
