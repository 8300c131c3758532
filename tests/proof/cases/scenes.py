"""Scenes of every kind of surface."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from hybrid_rt.demo import teapot, vase
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from proof.cases.placed import placed
from proof.cases.rational_surfaces import octants, torn_nurbs, weighted_petal
from proof.cases.singular_surfaces import rational_torus
from proof.cases.trimmed_surfaces import (
    cut_lens,
    drilled_plate,
    trimmed_patch,
    trimmed_sheet,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)


def patches_of_mixed_degrees() -> BezierPatches:
    """Twelve random patches of degrees 1 to 7, turned and strewn about."""
    rng = np.random.default_rng(3)
    nets = []
    for _ in range(12):
        m, n = rng.integers(1, 8, 2)
        x, y = np.meshgrid(np.linspace(-1, 1, m + 1), np.linspace(-1, 1, n + 1), indexing="ij")
        net = np.stack([x, y, np.zeros_like(x)], axis=-1)
        net += rng.normal(0.0, 0.35, (m + 1, n + 1, 3))
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        nets.append(net @ turn + rng.normal(0.0, 1.2, 3))
    return BezierPatches(nets)


def torus() -> SurfaceOfRevolution:
    """Four cubic arcs about a skew axis."""
    k, arcs = 0.5522847498307936, []
    # Whole numbers, not sines: the profile closes to the last bit.
    turns = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 1.0)])
    for p, q in pairwise(turns):
        f, g = np.array([p[1], -p[0]]), np.array([q[1], -q[0]])
        arcs.append(np.array([0.0, 1.0]) + 0.4 * np.array([p, p + k * f, q - k * g, q]))
    return SurfaceOfRevolution(arcs, (0.0, 0.0, 0.0), (0.3, -0.2, 1.0))


def ellipsoid() -> TriangleMesh:
    """Return a closed mesh of 1280 triangles."""
    import trimesh

    ball = trimesh.creation.icosphere(3, 1.0)
    squeezed = ball.vertices * (1.0, 0.8, 1.2)
    return TriangleMesh(trimesh.Trimesh(squeezed, ball.faces, process=False))


def closed_forms() -> list[Any]:
    """Spheres up to a radius of 1e5, a box, a rectangle and a plane."""
    return [
        Sphere((0, 0, 0), 1),
        Sphere((0.5, 0.2, 0.3), 0.7),
        Sphere((0, 0, -1e5 - 1), 1e5),
        Sphere((0.2, -1.5, 0.3), 0.3),
        Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7)),
        Rectangle((-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2)),
        Plane((0, 0, -1.3), (0.1, 0.2, 1)),
    ]


def trimmed() -> list[Any]:
    """Return surfaces of seven kinds cut by loops, three of them across seams, and one with a gap."""
    return [
        _aside(surface, k)
        for k, surface in enumerate(
            (
                trimmed_patch(),
                trimmed_sheet(),
                windowed_cylinder(),
                drilled_plate(),
                windowed_ball(),
                windowed_torus(),
                cut_lens(),
                TrimmedSurface(trimmed_patch().surface, trimmed_patch().loops, gap=1e-3),
            )
        )
    ]


def rational() -> list[Any]:
    """Return patches, a NURBS surface and turned profiles with weights, and parts of turns."""
    cone = SurfaceOfRevolution([(0, 1), (1, 0.2)], (0, 0, 0), (0.2, -0.1, 1), u_range=(0.1, 0.8))
    surfaces = (
        octants(), weighted_petal(), torn_nurbs(), rational_torus(), rational_torus((0.9, 1.3)), cone,
    )  # fmt: skip
    return [_aside(surface, k) for k, surface in enumerate(surfaces)]


def _aside(surface: Any, number: int) -> Any:
    """Return a surface moved to its place in two rows that overlap."""
    matrix = np.eye(4)
    matrix[:3, 3] = 1.5 * (number % 4), 1.5 * (number // 4), 0.3 * number
    return placed(surface, matrix)


def mixed() -> list[Any]:
    """Return some of everything."""
    aside = np.eye(4)
    aside[:3, 3] = -3.0, 3.0, 1.5
    return [
        teapot(),
        vase(3.5, 3.0, 4.3),
        Sphere((2.7, -2.4, 1.0), 1.0),
        Box((-5, -5, 0), (-4, -3, 2)),
        Rectangle((-10, -10, 0), (20, 0, 0), (0, 20, 0)),
        ellipsoid().transformed(aside),
    ]


def tori() -> list[Any]:
    """Return a torus, and a thin one that passes through it."""
    return [
        Torus((0, 0, 0), (0.3, -0.2, 1.0), 1.0, 0.4),
        Torus((0.9, 0.4, 0.1), (1, 0, 0), 0.8, 0.05).flipped(),
    ]


def aspheres() -> list[Any]:
    """Return two aspheres that overlap."""
    return [
        Asphere(2.0, -0.6, [0.0, 0.02, -0.01], 2.4, (0, 0, 0), (0.3, -0.2, 1.0)),
        Asphere(-1.5, 0.4, [0.05, -0.04], 1.6, (0.9, 0.4, 0.8), (1, 0, 0)).flipped(),
    ]


def turned_boxes() -> list[Any]:
    """Return a turned box and a sheared one."""
    turn = ((0.8, -0.6, 0, 0.3), (0.6, 0.8, 0, -0.2), (0, 0, 1, 0.1), (0, 0, 0, 1))
    skew = ((-1, 0.6, 0.2, 1.5), (0, 1, -0.4, 0.3), (0.3, 0, 1, 0.2), (0, 0, 0, 1))
    return [
        Box((-1, -0.5, -0.25), (1, 1, 0.5)).transformed(turn),
        Box((-0.5, -0.5, -0.5), (0.5, 1, 0.5)).transformed(skew).flipped(),
    ]


SCENES: dict[str, Callable[[], list[Any]]] = {
    "teapot": lambda: [teapot()],
    "patches": lambda: [patches_of_mixed_degrees()],
    "vase": lambda: [vase(0.0, 0.0, 5.0)],
    "torus": lambda: [torus()],
    "mesh": lambda: [ellipsoid()],
    "closed forms": closed_forms,
    "trimmed": trimmed,
    "rational": rational,
    "mixed": mixed,
    "tori": tori,
    "aspheres": aspheres,
    "turned boxes": turned_boxes,
}
