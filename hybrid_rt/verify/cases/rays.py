"""Rays that are hard to decide, aimed at any list of surfaces; every generator has a seed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.ray_set import RaySet
from hybrid_rt.core.records import FloatArray
from meshing import TrimmedSurface

# Planes are infinite; rays are aimed at this much of them around their point.
PLANE_EXTENT = 4.0


def chords(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays between random points of the sphere around everything: incoherent."""
    rng = np.random.default_rng(seed)
    middle, size = _extent(surfaces)
    a, b = unit(rng.normal(size=(n, 3))), unit(rng.normal(size=(n, 3)))
    return _named("chords", middle + 0.5 * size * a, 0.5 * size * (b - a))


def at_box(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays from all around at random points of the bounding box: incoherent, most of them hit."""
    rng = np.random.default_rng(seed)
    middle, size = _extent(surfaces)
    boxes = [s.bounds for s in surfaces if s.is_bounded]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    origins = middle + 0.5 * size * unit(rng.normal(size=(n, 3)))
    return _named("at box", origins, rng.uniform(low, high, (n, 3)) - origins)


def camera(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays of a pinhole camera with a random position, pixel by pixel."""
    rng = np.random.default_rng(seed)
    middle, size = _extent(surfaces)
    forward = unit(rng.normal(size=(1, 3)))
    right, up = _across(forward)
    side = int(np.ceil(np.sqrt(n)))
    x, y = (np.indices((side, side)).reshape(2, -1)[:, :n] + 0.5) / side - 0.5
    directions = forward + 0.8 * (x[:, None] * right + y[:, None] * up)
    return _named("camera", np.repeat(middle - 1.5 * size * forward, n, axis=0), directions)


def silhouettes(
    surfaces: Sequence[Any], n: int, seed: int, offsets: Sequence[float] | None = None
) -> RaySet:
    """Tangents at random points, moved along the normal by +- 1e-1 .. 1e-10 of the size.

    ``offsets`` gives other distances, relative to the size; inside is negative.
    """
    rng = np.random.default_rng(seed)
    points, normals, sizes = _points(surfaces, n, rng)
    along = _in_plane(normals, rng)
    if offsets is None:
        offset = 10.0 ** rng.uniform(-10.0, -1.0, n) * rng.choice([-1.0, -1.0, 1.0], n)
    else:
        offset = rng.choice(np.asarray(offsets), n)
    origins = points + (offset * sizes)[:, None] * normals
    origins -= (sizes * rng.choice([0.1, 0.5, 2.0], n))[:, None] * along
    return _named("silhouettes", origins, along)


def edges(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays at edges, corners, seams, joints, poles, loops: on them and 1e-15 .. 1e-1 beside."""
    rng = np.random.default_rng(seed)
    points, _, sizes = _points(surfaces, n, rng, at_edges=True)
    exponent = rng.integers(-15, 0, n)
    offset = np.where(rng.random(n) < 0.4, 0.0, 10.0**exponent)
    targets = points + (offset * sizes)[:, None] * unit(rng.normal(size=(n, 3)))
    directions = unit(rng.normal(size=(n, 3)))
    back = sizes * rng.choice([0.25, 1.0, 4.0], n)
    return _named("edges", targets - back[:, None] * directions, directions)


def grazing_edges(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that pass edges and poles at a grazing angle: cos 1e-1 .. 1e-8."""
    rng = np.random.default_rng(seed)
    points, normals, sizes = _points(surfaces, n, rng, at_edges=True)
    directions = _tilted(normals, 10.0 ** rng.uniform(-8.0, -1.0, n), rng)
    back = sizes * rng.choice([0.1, 1.0], n)
    return _named("grazing edges", points - back[:, None] * directions, directions)


def shallow(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that meet random points at cos 1e-3 .. 1e-7, mostly from nearby."""
    rng = np.random.default_rng(seed)
    points, normals, sizes = _points(surfaces, n, rng)
    cosine = 10.0 ** rng.uniform(-7.0, -3.0, n)
    directions = _tilted(normals, cosine, rng)
    # From so near that the surface cannot come between on its way round.
    back = sizes * cosine * 10.0 ** rng.uniform(-2.0, 0.5, n)
    return _named("shallow", points - back[:, None] * directions, directions)


def secondary(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays that leave random points to both sides at cos 0.5 .. 1e-6."""
    rng = np.random.default_rng(seed)
    points, normals, _ = _points(surfaces, n, rng)
    return _named("secondary", points, _tilted(normals, 10.0 ** rng.uniform(-6, -0.3, n), rng))


def far_origins(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays from 1e3 .. 1e8 sizes away, at random points."""
    rng = np.random.default_rng(seed)
    points, _, sizes = _points(surfaces, n, rng)
    directions = unit(rng.normal(size=(n, 3)))
    back = sizes * 10.0 ** rng.uniform(3.0, 8.0, n)
    return _named("far origins", points - back[:, None] * directions, directions)


def axis_parallel(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays along coordinate axes, some with components of -0."""
    rng = np.random.default_rng(seed)
    points, _, sizes = _points(surfaces, n, rng)
    directions = np.where(rng.random((n, 3)) < 0.5, 0.0, -0.0)
    directions[np.arange(n), rng.integers(3, size=n)] = rng.choice([-1.0, 1.0], n)
    return _named("axis-parallel", points - 2.0 * sizes[:, None] * directions, directions)


def about_axes(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays parallel or perpendicular to axes of revolution, exactly or by 1e-12 .. 1e-3.

    Without surfaces of revolution: the z axis through the middle.
    """
    rng = np.random.default_rng(seed)
    middle, _ = _extent(surfaces)
    found = [s for s in surfaces if s.revolution_frame is not None]
    frames = [s.revolution_frame for s in found] or [np.stack([middle, *np.eye(3)[[2, 0, 1]]])]
    pick = rng.integers(len(frames), size=n)
    origin, axis, radial, binormal = (np.array([f[k] for f in frames])[pick] for k in range(4))
    points, _, sizes = _points(found or surfaces, n, rng)
    turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None]
    across = np.cos(turn) * radial + np.sin(turn) * binormal
    tilt = np.where(rng.random(n) < 0.3, 0.0, 10.0 ** rng.uniform(-12.0, -3.0, n))[:, None]
    is_parallel = rng.random(n)[:, None] < 0.5
    directions = np.where(is_parallel, axis + tilt * across, across + tilt * axis)
    # A third of the rays meet the axis itself.
    height = np.einsum("ij,ij->i", points - origin, axis)[:, None]
    points = np.where(rng.random(n)[:, None] < 0.3, origin + height * axis, points)
    directions *= rng.choice([-1.0, 1.0], n)[:, None]
    return _named("about axes", points - 1.5 * sizes[:, None] * directions, directions)


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
    """Mix the generators: over 30 % of |cos| below 1e-3, over 10 % aimed at edges and poles.

    Parameters
    ----------
    surfaces : sequence of surfaces
    n : number of rays
    seed : int

    Returns
    -------
    RaySet of n rays, in random order
    """
    counts = [n * share // 100 for share in GENERATORS.values()]
    counts[0] += n - sum(counts)
    sets = [
        generate(surfaces, count, seed + 1000 * k)
        for k, (generate, count) in enumerate(zip(GENERATORS, counts, strict=True))
        if count
    ]
    order = np.random.default_rng(seed).permutation(n)
    return RaySet(*(np.concatenate(column)[order] for column in zip(*sets, strict=True)))


def unit(vectors: FloatArray) -> FloatArray:
    """Scale rows to length one."""
    scaled: FloatArray = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return scaled


def _named(name: str, origins: FloatArray, directions: FloatArray) -> RaySet:
    return RaySet(origins, directions, np.full(len(origins), name, dtype="U16"))


def _extent(surfaces: Sequence[Any]) -> tuple[FloatArray, float]:
    """Middle and diameter of what is finite."""
    boxes = [s.bounds for s in surfaces if s.is_bounded] or [
        surfaces[0].middle + PLANE_EXTENT * np.array([[-0.5], [0.5]])
    ]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    return 0.5 * (low + high), float(np.linalg.norm(high - low))


def _across(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit normals of unit vectors."""
    helper = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = unit(np.cross(directions, helper))
    return first, np.cross(directions, first)


def _in_plane(normals: FloatArray, rng: np.random.Generator) -> FloatArray:
    first, second = _across(normals)
    turn = rng.uniform(0.0, 2.0 * np.pi, len(normals))[:, None]
    return unit(np.cos(turn) * first + np.sin(turn) * second)


def _tilted(normals: FloatArray, cosine: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Directions at a given |cos| to the normals, to both sides."""
    side = (cosine * rng.choice([-1.0, 1.0], len(cosine)))[:, None]
    return unit(side * normals + np.sqrt(1.0 - side**2) * _in_plane(normals, rng))


def _points(
    surfaces: Sequence[Any], n: int, rng: np.random.Generator, at_edges: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Random points, their unit normals, and the size of each one's surface."""
    points, normals, sizes = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    pick = rng.integers(len(surfaces), size=n)
    for i, surface in enumerate(surfaces):
        rows = np.flatnonzero(pick == i)
        u, v = rng.random((2, len(rows)))
        patch = rng.integers(len(surface), size=len(rows))
        if at_edges:
            side = rng.integers(4, size=len(rows))
            corner = rng.random(len(rows)) < 0.25
            s = np.where(corner, rng.integers(2, size=len(rows)), u)
            u = np.where(side < 2, side, s)
            v = np.where(side < 2, s, side - 2)
        elif surface.is_triangular:
            over = u + v > 1.0
            u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
        if at_edges and surface.is_triangular:
            v = np.where(u + v > 1.0, 1.0 - u, v)
        if surface.is_bounded:
            extent = float(np.linalg.norm(surface.bounds[1] - surface.bounds[0]))
        else:
            # (u, v) of what has no end are two of the coordinates.
            extent = PLANE_EXTENT
            axes = list(surface.axes)
            u, v = (
                surface.middle[a] + extent * (x - 0.5) for a, x in zip(axes, (u, v), strict=True)
            )
        where: tuple[Any, ...] = (u, v, patch)
        if isinstance(surface, TrimmedSurface):
            # Its (u, v) say which patch it is; what it has of edges are its loops.
            where = _on_loops(surface, rng, len(rows)) if at_edges else (u, v)
        points[rows] = surface.point(*where)
        normals[rows] = surface.normal(*where)
        sizes[rows] = extent
    return points, normals, sizes


def _on_loops(
    surface: TrimmedSurface, rng: np.random.Generator, n: int
) -> tuple[FloatArray, FloatArray]:
    """Return u and v of random points of the loops, a quarter of them ends of curves."""
    curves = [curve for loop in surface.loops for curve in loop]
    pick = rng.integers(len(curves), size=n)
    s = np.where(rng.random(n) < 0.25, rng.integers(2, size=n), rng.random(n))
    at = np.empty((n, 2))
    for k, curve in enumerate(curves):
        at[pick == k] = curve.point(s[pick == k])
    closes = np.array(surface.closes)
    at = np.where(closes & ((at < 0.0) | (at > 1.0)), at % 1.0, np.clip(at, 0.0, 1.0))
    return at[:, 0], at[:, 1]
