"""Checks that all primitives share: each error names the object, the value and the remedy."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.records import FloatArray


def as_vector(value: ArrayLike, what: str) -> FloatArray:
    """Return a finite vector (3,), read-only."""
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (3,):
        raise ValueError(f"{what} has shape {vector.shape}: pass three numbers")
    if not np.isfinite(vector).all():
        raise ValueError(f"{what} is {vector.tolist()}: pass finite numbers")
    vector.flags.writeable = False
    return vector


def as_unit(value: ArrayLike, what: str) -> FloatArray:
    """Return a direction of length one, read-only."""
    vector = as_vector(value, what)
    largest = np.abs(vector).max()
    if largest == 0.0:
        raise ValueError(f"{what} is the zero vector: pass a direction")
    scaled = vector / largest
    unit: FloatArray = scaled / np.linalg.norm(scaled)
    unit.flags.writeable = False
    return unit


def as_affine(matrix: ArrayLike, what: str) -> tuple[FloatArray, FloatArray]:
    """Split an affine 4 x 4 matrix into its linear part and its translation."""
    m = np.array(matrix, dtype=np.float64)
    if m.shape != (4, 4) or not np.isfinite(m).all():
        raise ValueError(f"{what}: the matrix has shape {m.shape}: pass a finite (4, 4) matrix")
    if not np.array_equal(m[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(
            f"{what}: the last row of the matrix is {m[3].tolist()}: pass an affine map, "
            "last row (0, 0, 0, 1)"
        )
    if np.linalg.matrix_rank(m[:3, :3]) < 3:
        raise ValueError(f"{what}: the matrix is singular: pass one that keeps three dimensions")
    return m[:3, :3], m[:3, 3]


def as_similarity(matrix: ArrayLike, what: str) -> tuple[FloatArray, FloatArray, float]:
    """As `as_affine` for a similarity; also its scale."""
    linear, shift = as_affine(matrix, what)
    scale = float(np.cbrt(abs(np.linalg.det(linear))))
    if np.abs(linear.T @ linear / scale**2 - np.eye(3)).max() > 1e-12:
        raise ValueError(
            f"{what}: the matrix is not a similarity: only rotation, reflection, uniform scale and "
            "translation keep its shape (use BezierPatches for others)"
        )
    return linear, shift, scale
