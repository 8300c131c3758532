"""Trimmed surfaces to judge hits on, and points of their edges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Rectangle
from hybrid_rt.verify.cases.rational_surfaces import torn_nurbs
from hybrid_rt.verify.cases.rays import unit
from hybrid_rt.verify.cases.singular_rays import Random, Targets, size_of
from meshing import BezierPatches, Curve2, Cylinder, TrimmedSurface, circle, polygon

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


def trim_edges(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find points of the loops of a trimmed surface, a quarter of them ends of curves."""
    surface = surfaces[0]
    assert isinstance(surface, TrimmedSurface)
    curves = [curve for loop in surface.loops for curve in loop]
    s = np.where(rng.random(n) < 0.25, rng.integers(0, 2, n), rng.random(n))
    pairs = [
        curves[k].point(np.array([x, x + STEP if x < 0.5 else x - STEP]))
        for k, x in zip(rng.integers(len(curves), size=n), s, strict=True)
    ]
    here, there = (np.array([pair[i] for pair in pairs]) % 1.0 for i in range(2))
    points = surface.point(*here.T)
    step = surface.point(*there.T) - points
    return Targets(points, unit(step), surface.normal(*here.T), size_of(surface))
