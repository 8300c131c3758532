"""The hard cases, as data: surfaces, rays and expected hits.

The expected t is a closed form, or that of the judges. The letter of an id is the kind of case: A
patches, B surfaces of revolution, C spheres, D rays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import RaySet, silhouettes, unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import teapot, vase
from hybrid_rt.primitives import Box, Sphere
from meshing import BezierPatches, SurfaceOfRevolution
from proof.cases.rays import about_axes, chords, edges, secondary, shallow
from proof.cases.scenes import patches_of_mixed_degrees, torus

# Pieces that one search may look at: a tangent ray's are bounded by rounding, not by luck.
MOST_PIECES = 5000
# However few rays are asked for, so many are traced.
LEAST_RAYS = 20


@dataclass(frozen=True)
class Case:
    """One hard case."""

    id: str
    name: str
    surfaces: Callable[[], list[Any]]
    # Returns origins and directions; the factor multiplies their number where they are random.
    rays: Callable[[list[Any], float, int], tuple[FloatArray, FloatArray]]
    # First hits in closed form, inf for a miss; None: judged by exact arithmetic.
    t: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    most_pieces: int = MOST_PIECES  # of one search
    # Bound on |t - exact| |d| |cos|, relative to the distance of the hit or 1, whichever is larger: near a
    # sphere that is much larger than its distance rounding relative to the scale would be too lax.
    most_error: float | None = None
    has_marks: bool = False  # whether exact arithmetic judges the marks TANGENT as well


def _rays(make: Callable[..., RaySet], n: int, **options: Any) -> Any:
    def of(
        surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
    ) -> tuple[FloatArray, FloatArray]:
        rays = make(surfaces, max(round(factor * n), LEAST_RAYS), seed=17 + seed, **options)
        return rays.origins, rays.directions

    return of


def _fixed(origins: Any, directions: Any) -> Any:
    o, d = np.array(origins, dtype=np.float64), np.array(directions, dtype=np.float64)
    both = tuple(np.broadcast_arrays(np.atleast_2d(o), np.atleast_2d(d)))
    return lambda _surfaces, _factor=1.0, _seed=0: both


def _aimed(at: Callable[[np.random.Generator], FloatArray], distance: float = 3.0) -> Any:
    """Rays from all around at given points."""

    def of(
        _surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
    ) -> tuple[FloatArray, FloatArray]:
        rng = np.random.default_rng([23, seed])
        points = _as_many(lambda: at(rng), factor, rng)
        directions = unit(rng.normal(size=points.shape))
        return points - distance * directions, directions

    return of


def _as_many(draw: Callable[[], FloatArray], factor: float, rng: np.random.Generator) -> FloatArray:
    """Draw points often enough for a multiple of their number; some of them for a part."""
    points = draw()
    n = max(round(factor * len(points)), min(LEAST_RAYS, len(points)))
    if n < len(points):
        chosen: FloatArray = points[np.sort(rng.permutation(len(points))[:n])]
        return chosen
    return np.concatenate([points, *(draw() for _ in range(n // len(points) - 1))])


def parabola_sheet() -> BezierPatches:
    """Y = x^2 for x from -1 to 1, drawn along z from 0 to 1."""
    x, y = np.array([-1.0, 0.0, 1.0]), np.array([1.0, -1.0, 1.0])
    net = np.zeros((3, 2, 3))
    net[:, :, 0], net[:, :, 1], net[:, :, 2] = x[:, None], y[:, None], np.array([0.0, 1.0])
    return BezierPatches([net])


def square(z: float = 0.0) -> BezierPatches:
    """Return the flat square [0, 1]^2 at a height."""
    return BezierPatches([[[(0, 0, z), (0, 1, z)], [(1, 0, z), (1, 1, z)]]])


def saddle() -> BezierPatches:
    """Z = x y over [-1, 1]^2: ruled twice."""
    return BezierPatches([[[(-1, -1, 1), (-1, 1, -1)], [(1, -1, -1), (1, 1, 1)]]])


def cuspidal_edge() -> BezierPatches:
    """(s^2, s^3) for s from -1 to 1, drawn along z: singular along the line x = y = 0."""
    net = np.zeros((4, 2, 3))
    net[:, :, 0] = np.array([1.0, -1.0 / 3.0, -1.0 / 3.0, 1.0])[:, None]
    net[:, :, 1] = np.array([-1.0, 1.0, -1.0, 1.0])[:, None]
    net[:, 1, 2] = 1.0
    return BezierPatches([net])


def loop_sheet() -> BezierPatches:
    """Return a cubic with a loop, drawn along z: intersects itself."""
    curve = np.array([[0.0, 0.0], [2.0, 1.0], [-1.0, 1.0], [1.0, 0.0]])
    net = np.zeros((4, 2, 3))
    net[:, :, :2], net[:, 1, 2] = curve[:, None, :], 1.0
    return BezierPatches([net])


def thin_patch() -> BezierPatches:
    """Return a bicubic patch stretched by 1e6 in one direction."""
    net = patches_of_mixed_degrees().patches[0]
    return BezierPatches([net * (1e3, 1e-3, 1.0)])


def uneven_patch() -> BezierPatches:
    """Control points crowd into one corner: |S_u| runs from 1e-6 to about 1."""
    s = np.array([0.0, 1e-6, 1e-3, 1.0])
    x, y = np.meshgrid(s, s, indexing="ij")
    return BezierPatches([np.stack([x, y, 0.3 * x * (1 - x) + 0.2 * y], axis=-1)])


def wavy_patch() -> BezierPatches:
    """Degree 12 with heights ten times the spacing."""
    x, y = np.meshgrid(np.linspace(0, 1, 13), np.linspace(0, 1, 13), indexing="ij")
    heights = np.random.default_rng(2).normal(0.0, 10.0 / 12.0, (13, 13))
    return BezierPatches([np.stack([x, y, heights], axis=-1)])


def ring(z: float = 0.0, inner: float = 0.5, outer: float = 1.0) -> SurfaceOfRevolution:
    """Return a flat ring about the z axis."""
    return SurfaceOfRevolution([(z, inner), (z, outer)], (0, 0, 0), (0, 0, 1))


def cylinder(radius: float = 1.0) -> SurfaceOfRevolution:
    """Return a cylinder from z = -1 to 1."""
    return SurfaceOfRevolution([(-1, radius), (1, radius)], (0, 0, 0), (0, 0, 1))


def cone() -> SurfaceOfRevolution:
    """Return a cone with its tip at the origin, radius 1 at z = 1."""
    return SurfaceOfRevolution([(0, 0), (1, 1)], (0, 0, 0), (0, 0, 1))


def looped() -> SurfaceOfRevolution:
    """Return a surface that passes through itself."""
    profile = [(0.0, 0.6), (2.0, 1.6), (-1.0, 1.6), (1.0, 0.6)]
    return SurfaceOfRevolution(profile, (0, 0, 0), (0, 0, 1))


def with_a_line() -> SurfaceOfRevolution:
    """Return two cones, joined by a segment on the axis, which has no area."""
    segments = [[(0, 1), (1, 0)], [(1, 0), (2, 0)], [(2, 0), (3, 1)]]
    return SurfaceOfRevolution(segments, (0, 0, 0), (0, 0, 1))


def _about_teapot_apex(rng: np.random.Generator) -> FloatArray:
    """Points 0 .. 1e-1 beside the apex of the lid, where an edge of four patches is one point."""
    apex = np.array([0.0, 0.0, 3.15])
    beside = np.repeat([0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1e-1], 20)
    return apex + beside[:, None] * unit(rng.normal(size=(len(beside), 3)))


def _sphere_t(center: Any, radius: float) -> Any:
    """First hit of a sphere in high precision."""

    def t(origins: FloatArray, directions: FloatArray) -> FloatArray:
        import mpmath

        first = np.full(len(origins), np.inf)
        with mpmath.workdps(60):
            for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
                w = [
                    mpmath.mpf(float(a)) - mpmath.mpf(float(b))
                    for a, b in zip(o, center, strict=True)
                ]
                v = [mpmath.mpf(float(x)) for x in d]
                a, b = mpmath.fdot(v, v), mpmath.fdot(v, w)
                rest = b * b - a * (mpmath.fdot(w, w) - mpmath.mpf(radius) ** 2)
                if rest < 0:
                    continue
                roots = [(-b - mpmath.sqrt(rest)) / a, (-b + mpmath.sqrt(rest)) / a]
                first[i] = min((float(x) for x in roots if x > 0), default=np.inf)
        return first

    return t


def _at_apex(
    _surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Rays from 3 above the apex of the lid: it comes first, as the knob is convex there."""
    n = max(round(200 * factor), LEAST_RAYS)
    directions = unit(np.random.default_rng([31, seed]).normal(size=(n, 3)) * (0.2, 0.2, 1.0))
    directions[:, 2] = -np.abs(directions[:, 2])
    return np.array([0.0, 0.0, 3.15]) - 3.0 * directions, directions


def steep_sheet() -> BezierPatches:
    """Z = 4 x y over [-1, 1]^2, which fills its box."""
    return BezierPatches([[[(-1, -1, 4), (-1, 1, -4)], [(1, -1, -4), (1, 1, 4)]]])


def _within_box(
    _surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Rays up from within the box of the steep sheet, on either side of it."""
    n = max(round(2000 * factor), LEAST_RAYS)
    o = np.random.default_rng([37, seed]).uniform((-0.9, -0.9, -3), (0.9, 0.9, 3), (n, 3))
    return o, np.tile((0.0, 0.0, 1.0), (n, 1))


def _up_to_steep_sheet(origins: FloatArray, _d: FloatArray) -> FloatArray:
    above = 4.0 * origins[:, 0] * origins[:, 1] - origins[:, 2]
    return np.where(above > 0.0, above, np.inf)


def _through_axis(
    surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    """Rays that meet the axis of a turned surface, at any angle but along it."""
    surface, rng = surfaces[0], np.random.default_rng([41, seed])
    n = max(round(100 * factor), LEAST_RAYS)
    at = surface.origin + rng.uniform(0.05, 0.95, (n, 1)) * surface.axis
    turn = rng.uniform(0.0, 2.0 * np.pi, (n, 1))
    across = np.cos(turn) * surface.radial + np.sin(turn) * surface.binormal
    directions = across + rng.uniform(-0.5, 0.5, (n, 1)) * surface.axis
    return at - 3.0 * directions, directions


def _across_tube(radius: float, outside: Sequence[float] = ()) -> Any:
    """Rays along x at a tube about z: within it, and some that pass it by."""

    def of(
        _surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
    ) -> tuple[FloatArray, FloatArray]:
        rng = np.random.default_rng([43, seed])
        n = max(round(500 * factor), LEAST_RAYS)
        y, z = rng.uniform(-0.99, 0.99, (2, n))
        y[: len(outside)] = outside
        return np.stack([np.full(n, -3.0), radius * y, z], axis=1), np.tile((1.0, 0, 0), (n, 1))

    return of


def _tube_t(radius: float) -> Any:
    def t(origins: FloatArray, _d: FloatArray) -> FloatArray:
        y = origins[:, 1]
        root = np.sqrt(np.maximum((radius - y) * (radius + y), 0.0))
        return np.where(np.abs(y) < radius, 3.0 - root, np.inf)

    return t


def _down(points: Any) -> Any:
    return _fixed(np.array(points, dtype=np.float64) + np.array([0.0, 0.0, 5.0]), (0.0, 0.0, -1.0))


def _near_wall(rng: np.random.Generator) -> FloatArray:
    return rng.uniform(-1.0, 1.0, (400, 3)) * (1.0, 1.0, 0.0) + (0.0, 0.0, 1e-3)


def _from_far(at: Any, size: float, distance: float) -> Any:
    def of(
        _surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
    ) -> tuple[FloatArray, FloatArray]:
        rng = np.random.default_rng([29, seed])
        n = max(round(400 * factor), LEAST_RAYS)
        origins = distance * unit(rng.normal(size=(n, 3)))
        targets = np.asarray(at) + size * rng.uniform(-1.2, 1.2, (n, 3))
        return origins, targets - origins

    return of


def _along_axis(
    surfaces: Sequence[Any], factor: float = 1.0, seed: int = 0
) -> tuple[FloatArray, FloatArray]:
    origins, _ = _rays(about_axes, 300)(surfaces, factor, seed)
    return origins, np.repeat(surfaces[0].axis[None], len(origins), axis=0)


OFFSETS = [sign * 10.0**-k for k in range(2, 11) for sign in (1, -1)]

CATALOGUE = (
    Case("A01", "near a silhouette", lambda: [teapot()], _rays(silhouettes, 600, offsets=OFFSETS)),
    Case(
        "A02", "tangent line of a parabola", lambda: [parabola_sheet()],
        _fixed([(-2.0, y, 0.5) for y in (0.0, 1e-300, -1e-9, 1e-4)], (1.0, 0.0, 0.0)),
    ),
    Case(
        "A03", "ray within a flat patch", lambda: [square()],
        _fixed([(-1.0, 0.5, 0.0), (-1.0, 0.25, 0.0)], (1.0, 0.0, 0.0)),
    ),
    Case(
        "A04", "ray along a ruling", lambda: [saddle()],
        _fixed([(-3.0, 0.5, -1.5)], (1.0, 0.0, 0.5)),
    ),
    Case("A05", "bilinear", lambda: [saddle()], _rays(secondary, 400)),
    Case("A05", "bilinear, any way", lambda: [saddle()], _rays(chords, 60), has_marks=True),
    Case("A08", "apex of the lid", lambda: [teapot()], _aimed(_about_teapot_apex), most_pieces=500),
    Case(
        "A08", "through the apex", lambda: [teapot()], _at_apex, lambda o, _d: np.full(len(o), 3.0),
        most_pieces=500,
    ),
    Case(
        "A10", "cuspidal edge", lambda: [cuspidal_edge()],
        _aimed(lambda rng: np.stack([np.zeros(200), np.zeros(200), rng.random(200)], axis=1)),
    ),
    Case("A11", "patch through itself", lambda: [loop_sheet()], _rays(secondary, 400)),
    Case("A11", "the same, any way", lambda: [loop_sheet()], _rays(chords, 20), has_marks=True),
    Case("A12", "two coincident patches", lambda: [saddle(), saddle()], _rays(secondary, 400)),
    Case("A13", "shared edges and corners", lambda: [teapot()], _rays(edges, 2000)),
    Case("A15", "leaving the surface", lambda: [teapot()], _rays(secondary, 1000)),
    Case("A20", "aspect ratio 1e6", lambda: [thin_patch()], _rays(secondary, 300)),
    Case("A21", "uneven parametrisation", lambda: [uneven_patch()], _rays(secondary, 300)),
    Case("A22", "wavy patch of degree 12", lambda: [wavy_patch()], _rays(secondary, 150)),
    Case(
        "A23", "origin on the surface", lambda: [square()],
        _fixed((0.5, 0.5, 0.0), [(0.0, 0.0, 1.0), (0.3, 0.1, -1.0)]),
        lambda o, _d: np.full(len(o), np.inf),
    ),
    Case("A24", "within its box", lambda: [steep_sheet()], _within_box, _up_to_steep_sheet),
    Case(
        "A25", "pointing away", lambda: [teapot()],
        _fixed((0.0, 0.0, 10.0), [(0.0, 0.0, 1.0), (0.1, 0.2, 1.0)]),
        lambda o, _d: np.full(len(o), np.inf),
    ),
    Case("A30", "one patch", lambda: [saddle()], _rays(silhouettes, 400)),
    Case("A30", "one patch, any way", lambda: [saddle()], _rays(chords, 1000)),
    Case(
        "B01", "parallel to the axis", lambda: [torus()],
        _along_axis,
    ),
    Case("B02-B04", "nearly parallel, perpendicular", lambda: [torus()], _rays(about_axes, 2000)),
    Case("B02-B04 vase", "the same on ten joints", lambda: [vase(0, 0, 5)], _rays(about_axes, 2000)),
    Case(
        "B05", "through the axis", lambda: [cone()],
        _fixed((-2.0, 0.0, 0.5), (1.0, 0.0, 0.0)), lambda _o, _d: np.array([1.5]),
    ),
    Case("B05", "of a cone, any way", lambda: [cone()], _through_axis, has_marks=True),
    Case("B05", "of a torus, any way", lambda: [torus()], _through_axis, has_marks=True),
    Case("B03", "across a cylinder", lambda: [cylinder()], _across_tube(1.0), _tube_t(1.0)),
    Case(
        "B07", "at the tip of a cone", lambda: [cone()],
        _fixed((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)), lambda _o, _d: np.array([1.0]),
    ),
    Case("B09", "profile on the axis over an interval", lambda: [with_a_line()], _rays(secondary, 400)),
    Case("B09", "the same, at the axis", lambda: [with_a_line()], _rays(about_axes, 60), has_marks=True),
    Case("B10", "profile with a loop", lambda: [looped()], _rays(secondary, 400)),
    Case("B10", "the same, any way", lambda: [looped()], _rays(chords, 20), has_marks=True),
    Case("B11", "open profile", lambda: [cylinder()], _rays(chords, 400), has_marks=True),
    Case(
        "B13", "disc and cylinder", lambda: [ring(), cylinder()],
        _down([(0.75, 0.0, 0.0), (0.0, -0.6, 0.0), (0.2, 0.0, 0.0)]),
        lambda _o, _d: np.array([5.0, 5.0, np.inf]),
    ),
    Case("B13", "rings, any way", lambda: [ring()], _rays(chords, 20), has_marks=True),
    Case("B13", "from beside", lambda: [ring(0.0, 0.0, 1.0)], _rays(shallow, 20), has_marks=True),
    Case("B14", "joints of the profile", lambda: [vase(0, 0, 5)], _rays(edges, 2000)),
    Case("B16", "grazing the equators", lambda: [torus()], _rays(silhouettes, 1000, offsets=OFFSETS)),
    Case(
        "B18", "a wire of radius 1e-9", lambda: [cylinder(1e-9)],
        _across_tube(1e-9, (1.5, -2.0, 30.0)), _tube_t(1e-9),
    ),
    Case(
        "C01", "wall of radius 1e5", lambda: [Sphere((0, 0, -1e5), 1e5)], _aimed(_near_wall, 2.0),
        _sphere_t((0, 0, -1e5), 1e5), most_error=2e-13,
    ),
    Case(
        "C02", "ground of radius 1000", lambda: [Sphere((0, 0, -1000), 1000)],
        _aimed(_near_wall, 0.5), _sphere_t((0, 0, -1000), 1000.0), most_error=2e-15,
    ),
    Case(
        "C03", "unit sphere from 1e8", lambda: [Sphere((0, 0, 0), 1)],
        _from_far((0, 0, 0), 1.0, 1e8), _sphere_t((0, 0, 0), 1.0),
    ),
    Case(
        "C10", "concentric, 1e-12 apart", lambda: [Sphere((0, 0, 0), 1), Sphere((0, 0, 0), 1 + 1e-12)],
        _aimed(lambda rng: 0.9 * unit(rng.normal(size=(200, 3)))), _sphere_t((0, 0, 0), 1 + 1e-12),
    ),
    Case(
        "C12", "radius 1e-9 and 1e9", lambda: [Sphere((0, 0, 0), 1e-9), Sphere((0, 0, -2e9), 1e9)],
        _aimed(lambda rng: 5e-10 * unit(rng.normal(size=(200, 3)))), _sphere_t((0, 0, 0), 1e-9),
    ),
    Case(
        "C12", "beside the small one", lambda: [Sphere((0, 0, 0), 1e-9), Sphere((0, 0, -2e9), 1e9)],
        _aimed(lambda rng: 5e-10 * unit(rng.normal(size=(100, 3))), 1e-8), has_marks=True,
    ),
    Case(
        "D02", "directions of length 1e-300 and 1e300", lambda: [Sphere((0, 0, 0), 1)],
        _fixed((0, 0, 3), [(0, 0, -1e-300), (0, 0, -1e300)]),
        lambda _o, _d: np.array([2e300, 2e-300]),
    ),
    Case(
        "D05", "along the faces of a box", lambda: [Box((0, 0, 0), (1, 1, 1))],
        _fixed([(-1.0, 0.5, 0.5), (-1.0, -0.5, 0.5)], [(1.0, 0.0, -0.0), (1.0, -0.0, 0.0)]),
        lambda _o, _d: np.array([1.0, np.inf]),
    ),
)  # fmt: skip
