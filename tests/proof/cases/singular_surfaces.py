"""Surfaces that have singular sets: collapsed edges, poles, cusps, creases, corners."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.demo import teapot
from hybrid_rt.primitives import Box, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution

Z = (0.0, 0.0, 1.0)
ZERO = (0.0, 0.0, 0.0)
# Quarter circles as cubics.
ARC = 0.5522847498307936


def lathe(*segments: Any) -> Callable[[], SurfaceOfRevolution]:
    """Return what makes a surface turned about z from profile segments."""
    return partial(SurfaceOfRevolution, list(segments), ZERO, Z)


def ball() -> SurfaceOfRevolution:
    """Return two quarter circles, nearly a sphere of radius 1."""
    low = [(-1.0, 0.0), (-1.0, ARC), (-ARC, 1.0), (0.0, 1.0)]
    high = [(-z, r) for z, r in reversed(low)]
    return SurfaceOfRevolution([low, high], ZERO, Z)


def rational_torus(u_range: tuple[float, float] = (0.0, 1.0)) -> SurfaceOfRevolution:
    """Return a torus turned from four quarter circles, rational quadratics."""
    ring = [
        (0, 1.4),
        (0.4, 1.4),
        (0.4, 1),
        (0.4, 0.6),
        (0, 0.6),
        (-0.4, 0.6),
        (-0.4, 1),
        (-0.4, 1.4),
    ]
    ring.append(ring[0])
    arcs = [ring[k : k + 3] for k in range(0, 8, 2)]
    weights = [(1.0, math.sqrt(0.5), 1.0)] * 4
    return SurfaceOfRevolution(
        arcs, (0.2, -0.1, 0.3), (0.3, -0.2, 1.0), weights=weights, u_range=u_range
    )


def rational_ball() -> SurfaceOfRevolution:
    """Return a ball of radius 1 turned from two quarter circles."""
    arcs = [[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (1, 1), (1, 0)]]
    return SurfaceOfRevolution(arcs, ZERO, Z, weights=[(1.0, math.sqrt(0.5), 1.0)] * 2)


def uneven_profile() -> SurfaceOfRevolution:
    """Return a part of a rational cubic whose weights differ by a factor of 1000."""
    return SurfaceOfRevolution(
        [(-1, 0.8), (-0.5, 2.5), (0.6, 0.1), (1, 1.2)], ZERO, (1.0, 2.0, 2.0),
        weights=[1.0, 0.02, 20.0, 3.0], u_range=(0.1, 0.85),
    )  # fmt: skip


def lid() -> BezierPatches:
    """Return the lid of the teapot: eight patches, four of them with an edge at the apex."""
    nets = teapot().patches
    return BezierPatches(
        [net for net in nets if net[..., 2].min() >= 2.39 and np.abs(net[..., :2]).max() < 1.31]
    )


def petal() -> BezierPatches:
    """Return a bicubic patch one edge of which is a point, curved there."""
    rng = np.random.default_rng(8)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([u, 0.7 * u * v, 0.4 * u * u], axis=-1) + 0.05 * rng.normal(size=(4, 4, 3))
    net[0] = net[0, 0]
    return BezierPatches([net])


def lune() -> BezierPatches:
    """Return a biquadratic patch two opposite edges of which are points."""
    net = np.zeros((3, 3, 3))
    net[:, 0], net[:, 2] = (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)
    net[:, 1] = [(1.0, -1.0, 0.0), (1.0, 0.2, 1.2), (1.0, 1.0, 1.0)]
    return BezierPatches([net])


def uneven_lune() -> BezierPatches:
    """Return a patch of degrees 1 and 2 with two such edges."""
    return BezierPatches([[[(0, 0, 0), (1, -1, 0), (2, 0, 0)], [(0, 0, 0), (1, 1, 1), (2, 0, 0)]]])


def pinched_corner() -> BezierPatches:
    """Return a bicubic patch with parallel tangents in a corner: S_u x S_v vanishes there."""
    rng = np.random.default_rng(9)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    net = np.stack([u, v, 0.5 * u * v], axis=-1) + 0.05 * rng.normal(size=(4, 4, 3))
    net[0, 0], net[1, 0], net[0, 1] = (0, 0, 0), (0.3, 0.3, 0.1), (0.2, 0.2, 0.1 * 2 / 3)
    return BezierPatches([net])


def roof() -> BezierPatches:
    """Return two curved patches that meet in a sharp edge."""
    line = np.linspace(-1.0, 1.0, 4)
    nets = []
    for side in (-1.0, 1.0):
        x, y = np.meshgrid(side * np.linspace(0.0, 1.0, 4), line, indexing="ij")
        nets.append(np.stack([x, y, -0.8 * np.abs(x) - 0.2 * x * x + 0.1 * y * y], axis=-1))
    return BezierPatches(nets)


def cube() -> BezierPatches:
    """Return the six faces of a cube as bilinear patches, normals outward."""
    box = Box((-1, -1, -1), (1, 1, 1))
    nets = []
    for face in range(6):
        corners = [box.point(u, v, face) for u in (0, 1) for v in (0, 1)]
        nets.append(np.array(corners).reshape(2, 2, 3))
    return BezierPatches(nets)


def bent_sheet() -> BezierPatches:
    """Return two bicubic patches of one smooth sheet, with an edge in common."""
    rng = np.random.default_rng(10)
    x, y = np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([x, y, 0.5 * x * x], axis=-1) + 0.1 * rng.normal(size=(7, 4, 3))
    net[3] = 0.5 * (net[2] + net[4])
    return BezierPatches([net[:4], net[3:]])


def tilted_flat() -> BezierPatches:
    """Return a bicubic patch in a skew plane, unevenly drawn: flat only up to rounding."""
    rng = np.random.default_rng(11)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    u, v = u + 0.08 * rng.normal(size=u.shape), v + 0.08 * rng.normal(size=v.shape)
    p, q = np.array([1.7, 0.3, -0.4]), np.array([-0.2, 1.1, 0.9])
    return BezierPatches([u[..., None] * p + v[..., None] * q])


def skew_box() -> Box:
    """Return a box that is turned and skewed."""
    matrix = ((0.8, -0.6, 0.2, -1.3), (0.6, 0.8, 0.0, 0.4), (0.1, 0.0, 1.0, -0.7), (0, 0, 0, 1))
    return Box((-0.5, -0.25, -0.5), (0.5, 0.75, 0.25)).transformed(matrix)


def closed_torus() -> Torus:
    """Return a torus in closed form, about an oblique axis."""
    return Torus((0.2, -0.1, 0.3), (0.3, -0.2, 1.0), 1.0, 0.4)


def asphere() -> Asphere:
    """Return an asphere that bends both ways, about an oblique axis."""
    return Asphere(4.0, -0.7, [-0.2, 0.08, -0.01], 4.0, (0.2, -0.1, 0.3), (0.3, -0.2, 1.0))


def fan() -> TriangleMesh:
    """Return an open cap of triangles about a vertex, and a needle."""
    import trimesh

    turn = np.arange(7) / 7 * 2 * np.pi
    rim = np.stack([np.cos(turn), np.sin(turn), -0.4 + 0.1 * np.cos(3 * turn)], axis=1)
    vertices = np.concatenate([[(0, 0, 0)], rim, [(3, 0, 0.1), (0.5, 2e-4, 0.2), (0.5, 0, 0.2)]])
    faces = [(0, 1 + k, 1 + (k + 1) % 7) for k in range(7)] + [(8, 9, 10)]
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def part(profile: Any, begin: float, end: float) -> SurfaceOfRevolution:
    """Return a part of a turned surface."""
    return SurfaceOfRevolution(profile, ZERO, Z, u_range=(begin, end))


CYLINDER = [(-1.0, 1.0), (1.0, 1.0)]
CONE = [(0.0, 0.0), (2.0, 1.0)]
PARABOLOID = [(0.0, 0.0), (0.0, 0.5), (1.0, 1.0)]
EGG = [(-1.0, 0.0), (-1.0, 0.9), (1.2, 1.3), (1.2, 0.0)]
LENS = [(-0.5, 0.0), (0.0, 1.2), (0.5, 0.0)]
SPINDLE = [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]
DIAMOND = ([(-1.0, 0.3), (0.0, 1.0)], [(0.0, 1.0), (1.5, 0.2)])
