"""Exact crossings of rays in rational arithmetic, to test the oracle (needs python-flint).

Floats are rationals. On a patch whose first two coordinates are affine in (u, v), and on a surface
of revolution about the z axis, the crossings of a ray are the roots of one polynomial with rational
coefficients, which flint isolates with proof (Johansson 2017, "Arb: efficient arbitrary-precision
midpoint-radius interval arithmetic").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches, SurfaceOfRevolution
from proof.judges.kernels.events import ROOT
from proof.judges.oracle import Truth, first_hits

# Decimal digits 60: roots that agree with float64 to the last bit, however close to each other.
BITS = 200
# Heights are multiples of this, and so are the entries of the shears: products stay exact.
GRAIN = 2.0**-8


@dataclass(frozen=True)
class Comparison:
    """Results of comparing the oracle with exact roots.

    Attributes
    ----------
    rays : int
    roots : int
        Certain roots of the oracle.
    doubtful : int
        Events that it left open.
    lost : list of (ray, t)
        Exact roots of which the oracle knows nothing.
    invented : list of (ray, t)
        Certain roots of the oracle that do not exist.
    worst : float
        Largest error of t, in units of the last place of max(|t|, 1); surfaces have size 1 to 3.
    """

    rays: int
    roots: int
    doubtful: int
    lost: list[tuple[int, float]]
    invented: list[tuple[int, float]]
    worst: float


def rational(x: float) -> Any:
    """Return a float as the fraction that it is."""
    return flint.fmpq(*float(x).as_integer_ratio())


def real_roots(polynomial: Any) -> list[Any]:
    """Return the real roots of an ``fmpq_poly``, each once, as balls of `BITS` bits."""
    if polynomial.degree() < 1:
        return []
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        return [root.real for root, _ in polynomial.numer().complex_roots() if root.imag == 0]
    finally:
        flint.ctx.prec = before


def bernstein(degree: int, k: int, x: Any) -> Any:
    """Bernstein polynomial of a polynomial."""
    return comb(degree, k) * x**k * (1 - x) ** (degree - k)


def height_field(heights: FloatArray, shear: FloatArray, origin: FloatArray) -> BezierPatches:
    """Make the patch origin + (u, v, h(u, v)) shear, with h the Bernstein sum of ``heights``.

    All figures must be multiples of `GRAIN` of moderate size: then the control points are exact
    where the degrees divide them (1, 2, 4).
    """
    m, n = heights.shape[0] - 1, heights.shape[1] - 1
    u, v = np.meshgrid(np.arange(m + 1) / m, np.arange(n + 1) / n, indexing="ij")
    return BezierPatches([np.stack([u, v, heights], axis=-1) @ shear + origin])


def height_field_roots(
    heights: FloatArray,
    shear: FloatArray,
    at: FloatArray,
    origin: FloatArray,
    direction: FloatArray,
) -> list[Any]:
    """Return the t of all crossings of a ray with a `height_field`, u and v from 0 to 1."""
    matrix = flint.fmpq_mat(3, 3, [rational(x) for x in shear.T.ravel()])
    start = flint.fmpq_mat(
        3, 1, [rational(a) - rational(b) for a, b in zip(origin, at, strict=True)]
    )
    along = flint.fmpq_mat(3, 1, [rational(x) for x in direction])
    o, d = matrix.solve(start), matrix.solve(along)
    u, v, w = (flint.fmpq_poly([o[k, 0], d[k, 0]]) for k in range(3))
    m, n = heights.shape[0] - 1, heights.shape[1] - 1
    across = [bernstein(n, j, v) for j in range(n + 1)]
    gap = -w
    for i in range(m + 1):
        row = flint.fmpq_poly([0])
        for j in range(n + 1):
            row += rational(heights[i, j]) * across[j]
        gap += bernstein(m, i, u) * row
    return [
        t for t in real_roots(gap) if all(not (x < 0 or x > 1) for x in (_ball(u, t), _ball(v, t)))
    ]


def lathe_roots(
    segments: Sequence[FloatArray], origin: FloatArray, direction: FloatArray
) -> list[Any]:
    """Return the t of all crossings of a ray with a profile turned about the z axis.

    The ray must not be perpendicular to the axis.
    """
    ox, oy, oz = (rational(x) for x in origin)
    dx, dy, dz = (rational(x) for x in direction)
    found = []
    for segment in segments:
        degree = len(segment) - 1
        s = flint.fmpq_poly([0, 1])
        z = sum(rational(p) * bernstein(degree, k, s) for k, p in enumerate(segment[:, 0]))
        r = sum(rational(p) * bernstein(degree, k, s) for k, p in enumerate(segment[:, 1]))
        t = (flint.fmpq_poly([-oz]) + z) / dz
        squares = (ox + t * dx) ** 2 + (oy + t * dy) ** 2 - r**2
        found += [_ball(t, root) for root in real_roots(squares) if not (root < 0 or root > 1)]
    return found


def _ball(polynomial: Any, x: Any) -> Any:
    before, flint.ctx.prec = flint.ctx.prec, BITS
    try:
        return flint.arb_poly(polynomial)(x)
    finally:
        flint.ctx.prec = before


def compare(truth: Truth, exact: Sequence[Sequence[Any]]) -> Comparison:
    """Compare the oracle's roots of n rays with the exact ones (t of any sign; t > 0 counts)."""
    lost, invented, worst, n_roots, n_doubtful = [], [], 0.0, 0, 0
    roots = truth.roots
    for i, balls in enumerate(exact):
        rows = slice(roots.offsets[i], roots.offsets[i + 1])
        t, kind, cosine = roots.t[rows], roots.kind[rows], roots.cosine[rows]
        slack = roots.band[rows] / (np.maximum(cosine, 1e-13) * truth.length[i])
        true = np.array([float(ball) for ball in balls])
        for root in true[true > 0]:
            if not (np.abs(t - root) <= slack).any():
                lost.append((i, float(root)))
        for k in np.flatnonzero(kind == ROOT):
            n_roots += 1
            if not len(true) or np.abs(true - t[k]).min() > slack[k]:
                invented.append((i, float(t[k])))
                continue
            nearest = balls[int(np.abs(true - t[k]).argmin())]
            error = abs(float(nearest - flint.arb(float(t[k]))))
            worst = max(worst, error / float(np.spacing(max(abs(t[k]), 1.0))))
        n_doubtful += int((kind != ROOT).sum())
    return Comparison(len(exact), n_roots, n_doubtful, lost, invented, worst)


def check_patches(n: int, seed: int) -> Comparison:
    """Judge the oracle by height fields of degrees 1, 2 and 4: a third of the rays graze."""
    rng = np.random.default_rng(seed)
    parts = []
    for m, k in ((4, 4), (2, 4), (1, 1), (4, 2), (2, 2)):
        heights = np.round(rng.normal(0.0, 0.4, (m + 1, k + 1)) / GRAIN) * GRAIN
        shear = np.round((np.eye(3) + rng.normal(0.0, 0.3, (3, 3))) / GRAIN) * GRAIN
        at = np.round(rng.normal(size=3) / GRAIN) * GRAIN
        surface = height_field(heights, shear, at)
        origins, directions = _rays_at(surface, n // 5, rng)
        exact = [
            height_field_roots(heights, shear, at, o, d)
            for o, d in zip(origins, directions, strict=True)
        ]
        parts.append(compare(first_hits([surface], origins, directions), exact))
    return _sum(parts)


def check_lathes(n: int, seed: int) -> Comparison:
    """Judge the oracle by random profiles about the z axis."""
    rng = np.random.default_rng(seed)
    parts = []
    for degree in (1, 2, 3, 5):
        profile = np.stack(
            [np.linspace(-1.0, 1.0, degree + 1), rng.uniform(0.2, 1.2, degree + 1)], axis=1
        )
        profile[:, 0] += rng.normal(0.0, 0.2, degree + 1)
        surface = SurfaceOfRevolution(profile, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        origins, directions = _rays_at(surface, n // 4, rng)
        exact = [lathe_roots([profile], o, d) for o, d in zip(origins, directions, strict=True)]
        parts.append(compare(first_hits([surface], origins, directions), exact))
    return _sum(parts)


def _rays_at(surface: Any, n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return chords through random points, and tangents moved by 1e-2 .. 1e-9 along the normal."""
    u, v = rng.random((2, n))
    patch = np.zeros(n, np.int64)
    points, normals = surface.point(u, v, patch), surface.normal(u, v, patch)
    directions = rng.normal(size=(n, 3))
    tangents = np.cross(normals, directions)
    grazes = rng.random(n) < 0.34
    offset = np.where(grazes, 10.0 ** rng.uniform(-9, -2, n) * rng.choice([-1.0, 1.0], n), 0.0)
    directions = np.where(grazes[:, None], tangents, directions)
    origins = points + offset[:, None] * normals - 2.0 * directions
    return origins, directions


def _sum(parts: Sequence[Comparison]) -> Comparison:
    return Comparison(
        sum(p.rays for p in parts),
        sum(p.roots for p in parts),
        sum(p.doubtful for p in parts),
        [x for p in parts for x in p.lost],
        [x for p in parts for x in p.invented],
        max(p.worst for p in parts),
    )
