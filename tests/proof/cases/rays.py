"""Rays that are hard to decide, aimed at any list of surfaces; every generator has a seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import (
    RaySet,
    camera,
    middle_and_size,
    named,
    random_points,
    silhouettes,
    tilted,
    unit,
)


def chords(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays between random points of the sphere around everything: incoherent."""
    rng = np.random.default_rng(seed)
    middle, size = middle_and_size(surfaces)
    a, b = unit(rng.normal(size=(n, 3))), unit(rng.normal(size=(n, 3)))
    return named("chords", middle + 0.5 * size * a, 0.5 * size * (b - a))


def edges(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays at edges, corners, seams, joints, poles, loops: on them and 1e-15 .. 1e-1 beside."""
    rng = np.random.default_rng(seed)
    points, _, sizes = random_points(surfaces, n, rng, at_edges=True)
    exponent = rng.integers(-15, 0, n)
    offset = np.where(rng.random(n) < 0.4, 0.0, 10.0**exponent)
    targets = points + (offset * sizes)[:, None] * unit(rng.normal(size=(n, 3)))
    directions = unit(rng.normal(size=(n, 3)))
    back = sizes * rng.choice([0.25, 1.0, 4.0], n)
    return named("edges", targets - back[:, None] * directions, directions)


def grazing_edges(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that pass edges and poles at a grazing angle: cos 1e-1 .. 1e-8."""
    rng = np.random.default_rng(seed)
    points, normals, sizes = random_points(surfaces, n, rng, at_edges=True)
    directions = tilted(normals, 10.0 ** rng.uniform(-8.0, -1.0, n), rng)
    back = sizes * rng.choice([0.1, 1.0], n)
    return named("grazing edges", points - back[:, None] * directions, directions)


def shallow(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that meet random points at cos 1e-3 .. 1e-7, mostly from nearby."""
    rng = np.random.default_rng(seed)
    points, normals, sizes = random_points(surfaces, n, rng)
    cosine = 10.0 ** rng.uniform(-7.0, -3.0, n)
    directions = tilted(normals, cosine, rng)
    # From so near that the surface cannot come between on its way round.
    back = sizes * cosine * 10.0 ** rng.uniform(-2.0, 0.5, n)
    return named("shallow", points - back[:, None] * directions, directions)


def secondary(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that leave random points to both sides at cos 0.5 .. 1e-6."""
    rng = np.random.default_rng(seed)
    points, normals, _ = random_points(surfaces, n, rng)
    return named("secondary", points, tilted(normals, 10.0 ** rng.uniform(-6, -0.3, n), rng))


def far_origins(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays from 1e3 .. 1e8 sizes away, at random points."""
    rng = np.random.default_rng(seed)
    points, _, sizes = random_points(surfaces, n, rng)
    directions = unit(rng.normal(size=(n, 3)))
    back = sizes * 10.0 ** rng.uniform(3.0, 8.0, n)
    return named("far origins", points - back[:, None] * directions, directions)


def axis_parallel(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays along coordinate axes, some with components of -0."""
    rng = np.random.default_rng(seed)
    points, _, sizes = random_points(surfaces, n, rng)
    directions = np.where(rng.random((n, 3)) < 0.5, 0.0, -0.0)
    directions[np.arange(n), rng.integers(3, size=n)] = rng.choice([-1.0, 1.0], n)
    return named("axis-parallel", points - 2.0 * sizes[:, None] * directions, directions)


def about_axes(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays parallel or perpendicular to axes of revolution, exactly or by 1e-12 .. 1e-3.

    Without surfaces of revolution: the z axis through the middle.
    """
    rng = np.random.default_rng(seed)
    middle, _ = middle_and_size(surfaces)
    found = [s for s in surfaces if s.revolution_frame is not None]
    frames = [s.revolution_frame for s in found] or [np.stack([middle, *np.eye(3)[[2, 0, 1]]])]
    pick = rng.integers(len(frames), size=n)
    origin, axis, radial, binormal = (np.array([f[k] for f in frames])[pick] for k in range(4))
    points, _, sizes = random_points(found or surfaces, n, rng)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None]
    across = np.cos(turn) * radial + np.sin(turn) * binormal
    tilt = np.where(rng.random(n) < 0.3, 0.0, 10.0 ** rng.uniform(-12.0, -3.0, n))[:, None]
    is_parallel = rng.random(n)[:, None] < 0.5
    directions = np.where(is_parallel, axis + tilt * across, across + tilt * axis)
    # A third of the rays meet the axis itself.
    height = np.einsum("ij,ij->i", points - origin, axis)[:, None]
    points = np.where(rng.random(n)[:, None] < 0.3, origin + height * axis, points)
    directions *= rng.choice([-1.0, 1.0], n)[:, None]
    return named("about axes", points - 1.5 * sizes[:, None] * directions, directions)


GENERATORS = {
    # Generator: its share of the mix, in percent.
    silhouettes: 27,
    shallow: 35,
    edges: 10,
    grazing_edges: 6,
    chords: 6,
    camera: 3,
    secondary: 6,
    far_origins: 3,
    axis_parallel: 2,
    about_axes: 2,
}


def hard_rays(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Mix the generators: over 30 % of |cos| below 1e-3, over 10 % aimed at edges and poles."""
    counts = [n * share // 100 for share in GENERATORS.values()]
    counts[0] += n - sum(counts)
    sets = [
        generate(surfaces, count, seed + 1000 * k)
        for k, (generate, count) in enumerate(zip(GENERATORS, counts, strict=True))
        if count
    ]
    order = np.random.default_rng(seed).permutation(n)
    return RaySet(*(np.concatenate(column)[order] for column in zip(*sets, strict=True)))
