"""Rational patches and NURBS to judge hits on: quadrics by whole numbers, poles, breaks."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches, NurbsSurface

# A quarter of the unit circle whose figures are all whole: x = (1 - s^2) / (1 + s^2).
ARC = np.array([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
ARC_WEIGHTS = np.array([1.0, 1.0, 2.0])


def octant(pace_u: float = 1.0, pace_v: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """Net and weights of an exact octant of the unit sphere; paces move u and v along it."""
    radius, height = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
    net = np.empty((3, 3, 3))
    net[..., :2] = ARC[:, None, :] * radius[:, None]
    net[..., 2] = height
    along_u, along_v = (
        ARC_WEIGHTS * pace_u ** np.arange(3.0),
        ARC_WEIGHTS * pace_v ** np.arange(3.0),
    )
    return net, along_u[:, None] * along_v


def octants() -> BezierPatches:
    """Return the unit sphere as eight octants."""
    net, weights = octant()
    signs = [(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)]
    return BezierPatches([net * s for s in signs], [weights] * 8)


def half_pipe() -> BezierPatches:
    """Return half a cylinder about z in two patches."""
    net = np.array([[(x, y, z) for z in (-1.0, 1.0)] for x, y in ARC])
    weights = np.repeat(ARC_WEIGHTS[:, None], 2, axis=1)
    return BezierPatches([net, net * (-1.0, 1.0, 1.0)], [weights] * 2)


def weighted_petal() -> BezierPatches:
    """Return a patch with two collapsed edges, weights from 0.4 to 2."""
    middle = [(1, -1, 0.3), (1, 0, 0.6), (1, 1, 0.2)]
    net = np.array([[(0, 0, 0)] * 3, middle, [(2, 0, 0)] * 3])
    return BezierPatches([net], [[(1, 0.5, 2), (0.7, 1.5, 0.4), (1, 1, 0.6)]])


def torn_nurbs() -> NurbsSurface:
    """Return a bumpy sheet with weights, a crease along v and a break along u."""
    rng = np.random.default_rng(12)
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    net = np.stack([x, y, 0.6 * rng.normal(size=(6, 5))], axis=-1)
    return NurbsSurface(
        net, [0, 0, 0, 1, 1, 1, 2, 2, 2], [0, 0, 0, 1, 1, 3, 3, 3], 2, 0.5 + rng.random((6, 5))
    )


def nurbs_sphere() -> NurbsSurface:
    """Return the unit sphere as one NURBS surface: half a circle of degree 2, turned."""
    half = np.sqrt(0.5)
    turn = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    radius, height = np.array([0, 1, 1, 1, 0]), np.array([-1, -1, 0, 1, 1])
    net = np.empty((9, 5, 3))
    net[..., :2] = np.array(turn)[:, None, :] * radius[:, None]
    net[..., 2] = height
    weights = np.outer([1, half, 1, half, 1, half, 1, half, 1], [1, half, 1, half, 1])
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], [0, 0, 0, 1, 1, 2, 2, 2]
    return NurbsSurface(net, *knots, 2, weights)


def rational_sheet() -> NurbsSurface:
    """Return a bumpy bicubic sheet of 6 x 5 patches with weights around 1."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(9.0), np.arange(8.0), indexing="ij")
    net = np.stack([x, y, 0.6 * rng.normal(size=x.shape)], axis=-1)
    knots = [0] * 4 + [1, 2, 3, 4, 5] + [6] * 4, [0] * 4 + [1, 2, 3, 4] + [5] * 4
    return NurbsSurface(net, *knots, 3, np.exp(0.3 * rng.normal(size=x.shape)))
