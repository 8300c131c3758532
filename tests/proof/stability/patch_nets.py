"""Nets of patches for the rows, and rays at them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray, HitRecord


def flat_net(z: float = 0.0, degree: int = 3) -> FloatArray:
    """Return the net of the flat square [-1, 1]^2 at a height."""
    line = np.linspace(-1.0, 1.0, degree + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    return np.stack([x, y, np.full_like(x, z)], axis=-1)


def bumpy_net(degree_u: int = 3, degree_v: int = 3, seed: int = 1) -> FloatArray:
    """Return a height field over the unit square with random bumps."""
    u, v = np.meshgrid(np.linspace(0, 1, degree_u + 1), np.linspace(0, 1, degree_v + 1))
    height = 0.4 * np.random.default_rng(seed).normal(size=u.T.shape)
    return np.stack([u.T, v.T, height], axis=-1)


def elevated(points: FloatArray, times: int) -> FloatArray:
    """Raise all degrees of a curve (n + 1, k) or a net (m + 1, n + 1, k): exactly, then rounded once."""
    exact = np.vectorize(lambda x: Fraction(float(x)), otypes=[object])(points)
    for axis in times * [*range(exact.ndim - 1)]:
        exact = np.moveaxis(exact, axis, 0)
        n = len(exact)
        weight = np.array([Fraction(k, n) for k in range(n + 1)]).reshape(
            -1, *[1] * (exact.ndim - 1)
        )
        none = np.full_like(exact[:1], Fraction(0))
        below, above = np.concatenate([none, exact]), np.concatenate([exact, none])
        exact = np.moveaxis(weight * below + (1 - weight) * above, 0, axis)
    rounded: FloatArray = exact.astype(np.float64)
    return rounded


def bumpy_chords(n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return rays between random points of a ball around the unit square."""
    a, b = (1.5 * unit(rng.normal(size=(n, 3))) for _ in range(2))
    return np.array([0.5, 0.5, 0.0]) + a, b - a


def cosines(hits: HitRecord, directions: FloatArray) -> FloatArray:
    """Return |n.d| / |d| of hits."""
    found: FloatArray = np.abs(np.einsum("ij,ij->i", hits.normal, unit(directions)))
    return found
