"""Trimmed surfaces to judge hits on, and points of their edges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from meshing import (
    BezierPatches,
    Curve2,
    Cylinder,
    NurbsSurface,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    polygon,
)
from proof.cases.rational_surfaces import torn_nurbs
from proof.cases.singular_rays import Random, Targets, size_of

OUTLINE = [(0, 0), (1, 0), (1, 1), (0, 1)]
# So far from a point of a curve the next one is taken, for its tangent.
STEP = 2.0**-12


def wavy_loop(rng: Random, radius: float, arcs: int, degree: int, rational: bool) -> list[Curve2]:
    """Return a closed chain of random arcs around the middle of the square."""
    n = arcs * degree
    turn = 2.0 * np.pi * np.arange(n) / n
    away = radius * rng.uniform(0.6, 1.3, n)
    points: FloatArray = 0.5 + away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.concatenate([points, points[:1]])
    return [
        Curve2(points[k : k + degree + 1], rng.uniform(0.3, 2.0, degree + 1) if rational else None)
        for k in range(0, n, degree)
    ]


def trimmed_patch() -> TrimmedSurface:
    """Return a bumpy patch inside cubics, with a hole of rational quadratics."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([x, y, rng.uniform(-0.5, 0.5, (4, 4))], axis=-1)
    loops = [wavy_loop(rng, 0.38, 4, 3, False), wavy_loop(rng, 0.15, 3, 2, True)]
    return TrimmedSurface(BezierPatches(net[None]), loops)


def trimmed_nurbs() -> TrimmedSurface:
    """Return a torn sheet with three holes, one across a crease."""
    holes = [circle((0.5, 0.4), 0.2), circle((0.8, 0.7), (0.05, 0.2)), circle((0.15, 0.9), 0.06)]
    return TrimmedSurface(torn_nurbs(), [polygon(OUTLINE), *holes])


def trimmed_sheet() -> TrimmedSurface:
    """Return a polynomial spline of 3 x 2 patches with three holes across their borders."""
    rng = np.random.default_rng(2)
    x, y = np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([x, y, rng.uniform(-0.3, 0.3, (6, 4))], axis=-1)
    knots = [0, 0, 0, 0, 1, 2, 3, 3, 3, 3], [0, 0, 0, 1, 2, 2, 2]
    holes = [circle((1 / 3, 0.5), 0.2), circle((0.7, 0.4), (0.1, 0.25)), circle((0.8, 0.9), 0.05)]
    return TrimmedSurface(NurbsSurface(net, *knots, (3, 2)), [polygon(OUTLINE), *holes])


def windowed_cylinder() -> TrimmedSurface:
    """Return a cylinder with a window across its seam and a round one."""
    window = polygon([(-0.1, 0.3), (0.15, 0.25), (0.12, 0.7), (-0.08, 0.6)])
    return TrimmedSurface(
        Cylinder((0.1, 0.2, -1), (0.2, 0.1, 1), 1.0, 2.0),
        [polygon(OUTLINE), window, circle((0.5, 0.5), (0.1, 0.2))],
    )


def drilled_plate() -> TrimmedSurface:
    """Return a parallelogram inside a wavy outline, with a round hole."""
    rng = np.random.default_rng(8)
    plane = Rectangle((-1, -0.5, 0.3), (2, 0.3, 0.1), (0.2, 1.5, -0.4))
    return TrimmedSurface(plane, [wavy_loop(rng, 0.38, 4, 3, True), circle((0.45, 0.5), 0.1)])


def drilled_part() -> TrimmedSurface:
    """Return a turned part of five segments with a hole across three and a slot across the seam."""
    corner = float(np.sqrt(0.5))
    segments: list[Any] = [
        [(0, 0.3), (0, 1)],
        [(0, 1), (0.9, 1)],
        [(0.9, 1), (1, 1), (1, 0.9)],
        [(1, 0.9), (1.2, 0.4)],
        [(1.2, 0.4), (1.5, 0.5), (1.8, 0.2), (2, 0.3)],
    ]
    weights: list[Any] = [None, None, (1, corner, 1), None, None]
    part = SurfaceOfRevolution(segments, (0.1, 0, -1), (0.2, 0.1, 1), weights=weights)
    middle = 0.5 * float(part.v_breaks[2] + part.v_breaks[3])
    slot = polygon([(-0.05, 0.2), (0.1, 0.25), (0.08, 0.8), (-0.02, 0.85)])
    return TrimmedSurface(part, [polygon(OUTLINE), circle((0.6, middle), (0.08, 0.2)), slot])


def windowed_ball() -> TrimmedSurface:
    """Return a sphere without a sector at its pole and a round window across the seam."""
    sector = polygon([(0.55, 1), (0.7, 0.8), (0.85, 1)])
    ball = Sphere((0.1, 0.2, -0.3), 0.8, (0.2, 0.1, 1), (1, 0.3, 0))
    return TrimmedSurface(ball, [polygon(OUTLINE), sector, circle((0.02, 0.45), (0.1, 0.2))])


def windowed_torus() -> TrimmedSurface:
    """Return a torus with a window across both seams, and a round one."""
    across = polygon([(-0.1, -0.2), (0.12, -0.15), (0.08, 0.2), (-0.05, 0.1)])
    ring = Torus((0.1, -0.2, 0.3), (0.3, -0.2, 1), 1.0, 0.45)
    return TrimmedSurface(ring, [polygon(OUTLINE), across, circle((0.5, 0.55), (0.2, 0.15))])


def cut_lens() -> TrimmedSurface:
    """Return an asphere inside an outline with corners, around the vertex, with a round hole."""
    shape = polygon([(0, 0), (0, 0.6), (0.3, 0.95), (0.7, 0.5), (1, 0.6), (1, 0)])
    lens = Asphere(1.5, -0.7, [0, 0.05, -0.02], 2.0, (0.1, 0.2, 0), (0.2, 0, 1))
    return TrimmedSurface(lens, [shape, circle((0.35, 0.5), (0.1, 0.2))])


def trim_edges(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find points of the loops of a trimmed surface, a quarter of them ends of curves."""
    surface = surfaces[0]
    assert isinstance(surface, TrimmedSurface)
    # A curve along a pole is a point, and no edge.
    poles = [v for v, is_pole in zip((0.0, 1.0), surface.poles, strict=True) if is_pole]
    curves = [c for loop in surface.loops for c in loop if not _is_along(c, poles)]
    s = np.where(rng.random(n) < 0.25, rng.integers(0, 2, n), rng.random(n))
    pairs = [
        curves[k].point(np.array([x, x + STEP if x < 0.5 else x - STEP]))
        for k, x in zip(rng.integers(len(curves), size=n), s, strict=True)
    ]
    here, there = (np.array([pair[i] for pair in pairs]) for i in range(2))
    for column in np.flatnonzero(surface.closes):
        here[:, column] %= 1.0
        there[:, column] %= 1.0
    points = surface.point(*here.T)
    step = surface.point(*there.T) - points
    return Targets(points, unit(step), surface.normal(*here.T), size_of(surface))


def _is_along(curve: Curve2, poles: Sequence[float]) -> bool:
    return any(bool((curve.control[:, 1] == v).all()) for v in poles)
