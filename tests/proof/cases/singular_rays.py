"""Rays aimed at singular points of surfaces, at chosen distances.

`Targets` are points of a singular set, each with a characteristic direction (the axis of a tip, the
tangent of an edge, a ruling) and a normal of the surface nearby. There are four ways to aim: past
the point, nearly in the tangent plane, in a plane parallel to it, and away from a hit on it. Every
function takes a random generator, so a seed determines all rays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.analysis.ray_sets import PLANE_EXTENT, two_normals, unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Plane
from meshing import BezierPatches, SurfaceOfRevolution
from meshing.profiles import radius_rounding

# How far before their target rays begin, in sizes; and in distances from the singular set.
BACKS = (0.3, 3.0, 1e3)
NEAR_BACKS = (2.0, 30.0)
# Where on a side of a singular point the surface's normal is taken.
BESIDE = 1e-3
TURN = 2.0 * np.pi
# Edges whose control points agree to this part of the patch are points.
COLLAPSED = 1e-12

Random = np.random.Generator


class Targets(NamedTuple):
    """Points of a singular set."""

    points: FloatArray  # (n, 3)
    along: FloatArray  # (n, 3) unit: the direction that matters there
    normals: FloatArray  # (n, 3) unit: of the surface beside
    size: float  # of the surface


Finder = Callable[[Sequence[Any], int, Random], Targets]


class Aimed(NamedTuple):
    """Rays at one distance from a singular set."""

    origins: FloatArray  # (n, 3)
    directions: FloatArray  # (n, 3)
    distance: float  # scene units; of rays within a plane, the sine of their angle with it


# --- targets


def poles(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find ends of a profile on its axis: tips, rounded poles, spindles."""
    surface = surfaces[0]
    slack = radius_rounding(surface.segments)
    ends = [end for end, radius in _ends(surface) if abs(radius) <= slack]
    segment, v = _picked(ends, n, rng)
    u = rng.random(n)
    return Targets(
        surface.point(u, v, segment),
        np.tile(surface.axis, (n, 1)),
        surface.normal(u, np.abs(v - BESIDE), segment),
        size_of(surface),
    )


def circles(joined: bool) -> Finder:
    """Find circles at which segments of a profile meet; or those at which it ends, off the axis."""

    def find(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
        surface = surfaces[0]
        outer = (0, 0.0), (len(surface.segments) - 1, 1.0)
        ends = [
            end
            for end, radius in _ends(surface)
            if radius > radius_rounding(surface.segments) and (end in outer) != joined
        ]
        segment, v = _picked(ends, n, rng)
        u = rng.random(n)
        around, _ = surface.partials(u, v, segment)
        return Targets(
            surface.point(u, v, segment),
            unit(around),
            surface.normal(u, np.abs(v - BESIDE), segment),
            size_of(surface),
        )

    return find


def _ends(surface: SurfaceOfRevolution) -> Iterator[tuple[tuple[int, float], float]]:
    """Yield the ends of all segments, each with its radius."""
    for k, net in enumerate(surface.segments):
        yield (k, 0.0), net[0][1]
        yield (k, 1.0), net[-1][1]


def seam(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find points of the meridian u = 0 of a surface of revolution."""
    surface = surfaces[0]
    segment, v = rng.integers(len(surface), size=n), rng.random(n)
    _, along = surface.partials(np.zeros(n), v, segment)
    normals = surface.normal(np.zeros(n), v, segment)
    return Targets(surface.point(np.zeros(n), v, segment), unit(along), normals, size_of(surface))


def interior(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find any points; along S_v, of a turned surface the profile."""
    return _at(surfaces, n, rng, False)


def edges(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find points of the borders of patches, faces and triangles, a quarter of them corners."""
    return _at(surfaces, n, rng, True)


def at_parameters(places: Sequence[tuple[float | None, float | None]], along_u: bool) -> Finder:
    """Find points at given parameters (u, v) of each patch; None stands for any."""

    def find(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
        surface = surfaces[int(rng.integers(len(surfaces)))]
        pick = rng.integers(len(places), size=n)
        u, v = (
            np.array([rng.random() if places[p][k] is None else places[p][k] for p in pick])
            for k in range(2)
        )
        patch = rng.integers(len(surface), size=n)
        return _targets_of(surface, u, v, patch, along_u)

    return find


def collapsed(surfaces: Sequence[Any], n: int, rng: Random) -> Targets:
    """Find edges of patches that are points; along the limit normal."""
    surface = surfaces[0]
    assert isinstance(surface, BezierPatches)
    ends = []
    for k, net in enumerate(surface.patches):
        size = np.abs(net - net[0, 0]).max()
        for side, edge in enumerate((net[0], net[-1], net[:, 0], net[:, -1])):
            if np.abs(edge - edge[0]).max() <= COLLAPSED * size:
                ends.append((k, side))
    patch, side = _picked(ends, n, rng)
    s = rng.random(n)
    u = np.where(side < 2, side, s).astype(np.float64)
    v = np.where(side < 2, s, side - 2).astype(np.float64)
    targets = _targets_of(surface, u, v, patch, True)
    return targets._replace(along=targets.normals)


def size_of(surface: Any) -> float:
    """Return the diameter of a surface's box; of a plane, of what is looked at."""
    if not surface.is_bounded:
        return PLANE_EXTENT
    return float(np.linalg.norm(surface.bounds[1] - surface.bounds[0]))


def _picked(pairs: Sequence[tuple[int, float]], n: int, rng: Random) -> tuple[Any, Any]:
    """Pick some of pairs, and return their columns."""
    pick = rng.integers(len(pairs), size=n)
    first, second = (np.array(column)[pick] for column in zip(*pairs, strict=True))
    return first, second


def _at(surfaces: Sequence[Any], n: int, rng: Random, on_border: bool) -> Targets:
    surface = surfaces[int(rng.integers(len(surfaces)))]
    u, v = rng.random((2, n))
    along_u = False
    if on_border:
        side = rng.integers(4, size=n)
        s = np.where(rng.random(n) < 0.25, rng.integers(2, size=n), u)
        u = np.where(side < 2, side, s).astype(np.float64)
        v = np.where(side < 2, s, side - 2).astype(np.float64)
    if surface.is_triangular:
        over = u + v > 1.0
        u, v = (
            (u, np.where(over, 1.0 - u, v))
            if on_border
            else (np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v))
        )
    return _targets_of(surface, u, v, rng.integers(len(surface), size=n), along_u)


def _targets_of(surface: Any, u: FloatArray, v: FloatArray, patch: Any, along_u: bool) -> Targets:
    size = size_of(surface)
    if isinstance(surface, Plane):
        first, second = surface.axes
        u = surface.origin[first] + size * (u - 0.5)
        v = surface.origin[second] + size * (v - 0.5)
    points = surface.point(u, v, patch)
    # A step inward, along which something can be seen even where a derivative vanishes.
    inward_u, inward_v = (np.where(x > 0.5, x - BESIDE, x + BESIDE) for x in (u, v))
    other = surface.point(inward_u, v, patch) if along_u else surface.point(u, inward_v, patch)
    normals = surface.normal(inward_u, inward_v, patch)
    step = other - points
    still = np.linalg.norm(step, axis=1) <= 1e-9 * size
    step[still] = two_normals(normals)[0][still]
    return Targets(points, unit(step), normals, size)


# --- ways to aim


def beside(targets: Targets, k: float, rng: Random) -> Aimed:
    """Pass each point at k sizes: from anywhere, grazing, along and across what matters there."""
    n = len(targets.points)
    small = 10.0 ** rng.uniform(-12.0, -1.0, n) * (rng.random(n) < 0.7)
    random = unit(rng.normal(size=(n, 3)))
    turn = rng.uniform(0.0, TURN, n)
    grazing = _across(targets.normals, turn) + small[:, None] * targets.normals
    along = targets.along + small[:, None] * random
    across = _across(targets.along, turn) + small[:, None] * targets.along
    modes = rng.integers(4, size=n)
    directions = unit(np.choose(modes[:, None], [random, grazing, along, across]))
    directions *= rng.choice([-1.0, 1.0], n)[:, None]
    aside = _across(directions, rng.uniform(0.0, TURN, n))
    back = _backs(n, k, rng)[:, None]
    size = targets.size
    origins = targets.points + k * size * aside - size * back * directions
    return Aimed(origins, directions, k * size)


def within(targets: Targets, k: float, rng: Random) -> Aimed:
    """Meet each point at a sine of k, along what matters there or any way."""
    n = len(targets.points)
    tangent = _tangents(targets, rng)
    directions = unit(tangent + k * rng.choice([-1.0, 1.0], n)[:, None] * targets.normals)
    back = rng.choice([1e-3, *BACKS], n)[:, None]
    return Aimed(targets.points - targets.size * back * directions, directions, k)


def parallel(targets: Targets, k: float, rng: Random) -> Aimed:
    """Pass each point in its tangent plane's direction, k sizes above or below."""
    n = len(targets.points)
    tangent = _tangents(targets, rng)
    size = targets.size
    lift = k * size * rng.choice([-1.0, 1.0], n)[:, None]
    back = _backs(n, k, rng)[:, None]
    origins = targets.points + lift * targets.normals - size * back * tangent
    return Aimed(origins, tangent, k * size)


def away(normals: FloatArray, k: float, rng: Random) -> FloatArray:
    """Return directions that leave points at a cosine of k, to both sides."""
    n = len(normals)
    tangent = _across(normals, rng.uniform(0.0, TURN, n))
    return unit(tangent + k * rng.choice([-1.0, 1.0], n)[:, None] * normals)


def _across(vectors: FloatArray, turn: FloatArray) -> FloatArray:
    """Return unit vectors perpendicular to some, turned around them."""
    first, second = two_normals(vectors)
    found: FloatArray = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    return found


def _tangents(targets: Targets, rng: Random) -> FloatArray:
    n = len(targets.points)
    anyway = _across(targets.normals, rng.uniform(0.0, TURN, n))
    across = (targets.along * targets.normals).sum(axis=1, keepdims=True)
    along = targets.along - across * targets.normals
    steep = np.linalg.norm(along, axis=1, keepdims=True) < 1e-3
    tangents = np.where(steep | (rng.random(n)[:, None] < 0.5), anyway, along)
    signed: FloatArray = unit(tangents) * rng.choice([-1.0, 1.0], n)[:, None]
    return signed


def _backs(n: int, k: float, rng: Random) -> FloatArray:
    """Return how far before its target each ray begins, in sizes: half of them from near."""
    near = k * rng.choice(NEAR_BACKS, n)
    return np.asarray(np.where(rng.random(n) < 0.5, near, rng.choice(BACKS, n)))
