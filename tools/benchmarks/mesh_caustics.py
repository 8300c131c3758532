"""The error of a caustic when its glass is a triangle mesh.

A glass surface of revolution over a diffuse floor under a small light: the exact surface, and
meshes of more and more triangles, with face normals or interpolated vertex normals. Photons and
passes are the same; the reference is a long render of the exact surface.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators import PPMOptions
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Rectangle, TriangleMesh
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.sensor.image_metrics import relative_mse
from meshing import SurfaceOfRevolution

TRUTH_SEED, SEED = 1000, 1

# (height, radius): a rounded foot, a waist, a belly that closes at the top; cubics that join
# smoothly but at the foot.
PROFILE = (
    ((0.0, 0.0), (0.0, 0.25), (0.0, 0.5), (0.0, 0.62)),
    ((0.0, 0.62), (0.0, 0.78), (0.16, 0.78), (0.3, 0.6)),
    ((0.3, 0.6), (0.48, 0.37), (0.62, 0.42), (0.8, 0.62)),
    ((0.8, 0.62), (1.02, 0.86), (1.5, 0.8), (1.72, 0.52)),
    ((1.72, 0.52), (1.88, 0.32), (1.95, 0.12), (1.95, 0.0)),
)


def body() -> SurfaceOfRevolution:
    """Return the exact surface, just above the floor."""
    return SurfaceOfRevolution(PROFILE, (0.0, 0.0, 0.02), (0.0, 0.0, 1.0))


def grid_mesh(surface: SurfaceOfRevolution, n_triangles: int) -> TriangleMesh:
    """Return a mesh of about the given number of triangles on a surface closed on its axis.

    Rings of vertices are spaced evenly along every segment of the profile, about as far apart as
    the vertices within a ring.
    """
    n_segments = len(surface)
    around = max(round(math.sqrt(0.9 * n_triangles)), 3)
    along = max(round(n_triangles / (2.0 * around) / n_segments), 1)
    rings: list[NDArray[np.int64]] = []
    vertices: list[NDArray[np.float64]] = []
    n = 0
    u = np.arange(around) / around
    low, high = surface.bounds
    tiny = 1e-12 * float(np.linalg.norm(high - low))
    for segment in range(n_segments):
        for k in range(along + (segment == n_segments - 1)):
            points = surface.point(u, np.full(around, k / along), np.full(around, segment))
            if np.ptp(points, axis=0).max() <= tiny:
                points = points[:1]
            rings.append(n + np.arange(len(points)) % len(points))
            vertices.append(points)
            n += len(points)
    faces = []
    for lower, upper in itertools.pairwise(rings):
        a, b = np.resize(lower, around), np.resize(upper, around)
        a_next, b_next = np.roll(a, -1), np.roll(b, -1)
        if len(lower) > 1:
            faces.append(np.stack([a, a_next, b], axis=1))
        if len(upper) > 1:
            faces.append(np.stack([a_next, b_next, b], axis=1))
    mesh: Any = SimpleNamespace(vertices=np.concatenate(vertices), faces=np.concatenate(faces))
    return TriangleMesh(mesh)


def scene_of(surface: SurfaceOfRevolution | TriangleMesh, smooth: bool, size: int) -> Scene:
    """Return the body on a floor, seen from above where its caustic lies."""
    floor = Rectangle((-6.0, -6.0, 0.0), (12.0, 0.0, 0.0), (0.0, 12.0, 0.0))
    return Scene(
        Camera((2.2, -2.6, 3.4), (1.05, 0.05, 0.2), (0.0, 0.0, 1.0), 44.0, size, size),
        [
            Object(floor, Lambertian(0.8), "floor"),
            Object(surface, Dielectric(1.5), "body", smooth=smooth),
        ],
        [RectangleLight((-3.03, -0.03, 3.6), (0.0, 0.06, 0.0), (0.045, 0.0, 0.04), 800.0)],
    )


@dataclass
class Curve:
    """A body, and the seconds and errors of its renders."""

    name: str
    n_triangles: int
    smooth: bool
    seconds: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    build_seconds: float = 0.0
    image: NDArray[np.float32] | None = None


def truth(size: int, passes: int, photons: int, threads: int | None) -> NDArray[np.float32]:
    """Return a long render of the exact body."""
    options = PPMOptions(photons)
    scene = scene_of(body(), False, size)
    result = render(scene, "ppm", passes, seed=TRUTH_SEED, threads=threads, options=options)
    return result.image


def curves(
    reference: NDArray[np.float32],
    triangles: Sequence[int],
    passes: Sequence[int],
    photons: int,
    threads: int | None = None,
) -> Iterator[Curve]:
    """Render every body with every number of passes.

    Errors are the relative MSE on the floor beside the body, which shows only the body's shadow and
    caustic.
    """
    size = len(reference)
    exact = body()
    seen = floor_beside(size)
    cases: list[Curve] = [Curve("exact", 0, False)]
    for n in triangles:
        cases += [Curve(f"{n} triangles", n, False), Curve(f"{n} triangles, smoothed", n, True)]
    for case in cases:
        surface = grid_mesh(exact, case.n_triangles) if case.n_triangles else exact
        scene = scene_of(surface, case.smooth, size)
        options = PPMOptions(photons)
        render(scene.with_camera(scene.camera.resized(8, 8)), "ppm", 1, options=PPMOptions(100))
        for n in passes:
            result = render(scene, "ppm", n, seed=SEED, threads=threads, options=options)
            case.seconds.append(result.report.total_seconds)
            case.build_seconds = result.report.seconds["build"]
            case.errors.append(relative_mse(result.image[seen], reference[seen]))
        case.image = result.image
        yield case


def floor_beside(size: int) -> NDArray[np.bool_]:
    """Return the pixels (size, size) that see the floor past the body, with a little room."""
    from hybrid_rt.intersection import Intersector

    scene = scene_of(body(), False, size)
    tracer = Intersector([item.surface for item in scene.objects])
    seen = np.ones(size * size, dtype=np.bool_)
    row, column = np.divmod(np.arange(size * size), size)
    for down in (-0.5, 0.5, 1.5):
        for across in (-0.5, 0.5, 1.5):
            hits = tracer.intersect(*scene.camera.rays(column + across, row + down))
            seen &= hits.object_id == 0
    return seen.reshape(size, size)
