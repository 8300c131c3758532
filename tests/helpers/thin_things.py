"""Nets and perforated sheets, which are thinner than the discs that photons are gathered on."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.primitives import Rectangle, TriangleMesh
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import BezierPatches, TrimmedSurface, circle, polygon

ALBEDO, RADIANCE = 0.5, 2.0
WIDTH, DEPTH, HEIGHT = 0.8, 0.6, 1.5


def mesh_of(quads: ArrayLike) -> TriangleMesh:
    """Return a mesh of quadrangles in the plane z = 0, (n, 4, 2)."""
    corners = np.array(quads, float)
    vertices = np.concatenate([corners, np.zeros((*corners.shape[:2], 1))], axis=2).reshape(-1, 3)
    first = 4 * np.arange(len(corners))[:, None]
    faces = np.concatenate([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))])
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def net() -> tuple[TriangleMesh, float]:
    """Return strips of 0.01 every 0.05, as one mesh, and their part of the plane."""
    x = -0.5 * WIDTH + 0.05 * np.arange(16) + 0.02
    low, high = np.full(16, -0.5 * DEPTH), np.full(16, 0.5 * DEPTH)
    corners = ((x, low), (x + 0.01, low), (x + 0.01, high), (x, high))
    return mesh_of(np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)), 0.2


def perforated_sheet() -> tuple[TrimmedSurface, float]:
    """Return a rectangle with a hole of radius 0.04 in each square of 0.1, and what the holes leave."""
    x, y = 0.5 * WIDTH, 0.5 * DEPTH
    flat = BezierPatches([[[[-x, -y, 0], [-x, y, 0]], [[x, -y, 0], [x, y, 0]]]])
    holes = [
        circle(((i + 0.5) / 8, (j + 0.5) / 6), (0.04 / WIDTH, 0.04 / DEPTH))
        for i in range(8)
        for j in range(6)
    ]
    outline = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
    return TrimmedSurface(flat, [outline, *holes]), 1.0 - np.pi * 0.04**2 / 0.1**2


def at_the_end_of_a_pipe(surface: TriangleMesh | TrimmedSurface) -> Scene:
    """Return a view of a surface below walls of perfect mirrors, with a lamp that fills the other end.

    The mirrors repeat the lamp without end, so the surface has the irradiance pi x radiance everywhere,
    most of it by way of mirrors. What it sends back ends at the lamp.
    """
    x, y = 0.5 * WIDTH, 0.5 * DEPTH
    walls = [
        Rectangle((-x, -y, 0), (0, DEPTH, 0), (0, 0, HEIGHT)),
        Rectangle((x, -y, 0), (0, DEPTH, 0), (0, 0, HEIGHT)),
        Rectangle((-x, -y, 0), (WIDTH, 0, 0), (0, 0, HEIGHT)),
        Rectangle((-x, y, 0), (WIDTH, 0, 0), (0, 0, HEIGHT)),
    ]
    lamp = RectangleLight((-x, -y, HEIGHT), (0, DEPTH, 0), (WIDTH, 0, 0), radiance=RADIANCE)
    far = 0.8 * HEIGHT
    angle = 2 * np.degrees(np.arctan(y / far))
    camera = Camera((0, 0, far), (0, 0, 0), (0, 1, 0), angle, width=32, height=24)
    return Scene(
        camera,
        [Object(surface, Lambertian(ALBEDO)), *(Object(wall, Mirror(1.0)) for wall in walls)],
        [lamp],
    )
