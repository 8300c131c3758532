"""Sets of random rays aimed at any list of surfaces; every generator has a seed."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing import TrimmedSurface

# Planes are infinite; rays are aimed at this much of them around their point.
PLANE_EXTENT = 4.0


class RaySet(NamedTuple):
    """Rays of one or several generators."""

    origins: FloatArray  # (n, 3)
    directions: FloatArray  # (n, 3)
    names: NDArray[np.str_]  # (n,), the generator of each


def at_box(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays from all around at random points of the bounding box: incoherent, most of them hit."""
    rng = np.random.default_rng(seed)
    middle, size = middle_and_size(surfaces)
    boxes = [s.bounds for s in surfaces if s.is_bounded]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    origins = middle + 0.5 * size * unit(rng.normal(size=(n, 3)))
    return named("at box", origins, rng.uniform(low, high, (n, 3)) - origins)


def camera(surfaces: Sequence[Any], n: int, seed: int) -> RaySet:
    """Rays of a pinhole camera with a random position, pixel by pixel."""
    rng = np.random.default_rng(seed)
    middle, size = middle_and_size(surfaces)
    forward = unit(rng.normal(size=(1, 3)))
    right, up = two_normals(forward)
    side = int(np.ceil(np.sqrt(n)))
    x, y = (np.indices((side, side)).reshape(2, -1)[:, :n] + 0.5) / side - 0.5
    directions = forward + 0.8 * (x[:, None] * right + y[:, None] * up)
    return named("camera", np.repeat(middle - 1.5 * size * forward, n, axis=0), directions)


def silhouettes(
    surfaces: Sequence[Any], n: int, seed: int, offsets: Sequence[float] | None = None
) -> RaySet:
    """Tangents at random points, moved along the normal by +- 1e-1 .. 1e-10 of the size.

    ``offsets`` gives other distances, relative to the size; inside is negative.
    """
    rng = np.random.default_rng(seed)
    points, normals, sizes = random_points(surfaces, n, rng)
    along = tangents(normals, rng)
    if offsets is None:
        offset = 10.0 ** rng.uniform(-10.0, -1.0, n) * rng.choice([-1.0, -1.0, 1.0], n)
    else:
        offset = rng.choice(np.asarray(offsets), n)
    origins = points + (offset * sizes)[:, None] * normals
    origins -= (sizes * rng.choice([0.1, 0.5, 2.0], n))[:, None] * along
    return named("silhouettes", origins, along)


def unit(vectors: FloatArray) -> FloatArray:
    """Scale rows to length one."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def named(name: str, origins: FloatArray, directions: FloatArray) -> RaySet:
    """Return rays of one generator."""
    return RaySet(origins, directions, np.full(len(origins), name, dtype="U16"))


def middle_and_size(surfaces: Sequence[Any]) -> tuple[FloatArray, float]:
    """Middle and diameter of what is finite."""
    boxes = [s.bounds for s in surfaces if s.is_bounded] or [
        surfaces[0].middle + PLANE_EXTENT * np.array([[-0.5], [0.5]])
    ]
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    return 0.5 * (low + high), float(np.linalg.norm(high - low))


def two_normals(directions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit normals of unit vectors."""
    helper = np.eye(3)[np.abs(directions).argmin(axis=1)]
    first = unit(np.cross(directions, helper))
    return first, np.cross(directions, first)


def tangents(normals: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Random unit vectors, each across its normal."""
    first, second = two_normals(normals)
    turn = rng.uniform(0.0, 2.0 * np.pi, len(normals))[:, None]
    return unit(np.cos(turn) * first + np.sin(turn) * second)


def tilted(normals: FloatArray, cosine: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Directions at a given |cos| to the normals, to both sides."""
    side = (cosine * rng.choice([-1.0, 1.0], len(cosine)))[:, None]
    return unit(side * normals + np.sqrt(1.0 - side**2) * tangents(normals, rng))


def random_points(
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
