"""What every surface asks of its input: finite numbers, sensible shapes, usable matrices."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
FloatArray: TypeAlias = NDArray[np.float64]

# A matrix that squeezes one direction by more than this against another leaves only roundings.
SMALLEST_SQUEEZE = 8.0 * 2.0**-52
# Products of rotations, as callers build them, are orthogonal to a few roundings only.
SIMILARITY_TOLERANCE = 2.0**-40


def as_floats(value: ArrayLike, name: str) -> FloatArray:
    """Convert to a float64 array; complain by name about what is not numbers."""
    try:
        array = np.asarray(value)
        if array.dtype.kind == "c":
            raise TypeError(f"{name} is complex: real numbers are needed")
        return np.ascontiguousarray(array, dtype=np.float64)
    except ValueError as error:
        raise ValueError(f"{name} is not an array of numbers: {error}") from None


def as_vector(value: ArrayLike, name: str) -> FloatArray:
    """Convert to three finite float64 numbers."""
    vector = as_floats(value, name)
    if vector.shape != (3,):
        raise ValueError(f"{name} has shape {vector.shape}: three numbers are needed")
    if not np.isfinite(vector).all():
        raise ValueError(f"{name} = {vector.tolist()} is not finite")
    return vector.copy()


def unit(vector: FloatArray, name: str) -> FloatArray:
    """Return the vector at length one; scaled first, so that no square overflows."""
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise ValueError(f"{name} is the zero vector: give a direction")
    scaled = vector / np.exp2(np.floor(np.log2(largest)))
    result: FloatArray = scaled / np.sqrt(scaled @ scaled)
    return result


def as_affine(matrix: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Split a 4 x 4 matrix that acts on columns (x, y, z, 1) into its linear part and its shift."""
    array = as_floats(matrix, "matrix")
    if array.shape != (4, 4):
        raise ValueError(f"matrix has shape {array.shape}: (4, 4) is needed")
    if not np.isfinite(array).all():
        raise ValueError("matrix has entries that are not finite")
    if not np.array_equal(array[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(
            f"matrix is projective, its last row is {array[3].tolist()}: "
            "only affine ones, with last row (0, 0, 0, 1), keep a polynomial surface polynomial"
        )
    linear = array[:3, :3].copy()
    sizes = np.linalg.svd(linear, compute_uv=False)
    if not sizes[2] > SMALLEST_SQUEEZE * sizes[0]:
        raise ValueError(
            f"matrix is singular (it stretches by {sizes[0]:g} one way, {sizes[2]:g} another): "
            "it would flatten the surface"
        )
    return linear, array[:3, 3].copy()


def as_similarity(matrix: ArrayLike, kind: str) -> tuple[FloatArray, FloatArray, float, bool]:
    """Split a similarity into its orthogonal part, shift, scale, and whether it reflects."""
    linear, shift = as_affine(matrix)
    scale = float(np.sqrt((linear**2).sum() / 3.0))
    orthogonal = linear / scale
    error = float(np.abs(orthogonal @ orthogonal.T - np.eye(3)).max())
    if error > SIMILARITY_TOLERANCE:
        raise ValueError(
            f"matrix is not a similarity (off by {error:.3g}): {kind} stays one only under "
            "rotations, reflections, shifts and uniform scaling; use patches for other maps"
        )
    return orthogonal, shift, scale, bool(np.linalg.det(orthogonal) < 0.0)


def broadcast_parameters(
    u: ArrayLike, v: ArrayLike, patch_id: ArrayLike, n_patches: int, name: str
) -> tuple[FloatArray, FloatArray, NDArray[np.int64], tuple[int, ...]]:
    """Broadcast parameters to one flat length; check that the patches exist."""
    ids = np.asarray(patch_id)
    if ids.dtype.kind not in "iu":
        raise TypeError(f"{name} has dtype {ids.dtype}: whole numbers are needed")
    if ids.size and not (ids.min() >= 0 and ids.max() < n_patches):
        bad = ids[(ids < 0) | (ids >= n_patches)].flat[0]
        raise ValueError(f"{name} {bad} does not exist: this surface has 0 to {n_patches - 1}")
    u, v = as_floats(u, "u"), as_floats(v, "v")
    shape = np.broadcast_shapes(u.shape, v.shape, ids.shape)
    # Copies: kernels take contiguous arrays that own their memory.
    return (
        np.array(np.broadcast_to(u, shape), order="C").reshape(-1),
        np.array(np.broadcast_to(v, shape), order="C").reshape(-1),
        np.array(np.broadcast_to(ids, shape), dtype=np.int64, order="C").reshape(-1),
        shape,
    )


def freeze(array: FloatArray) -> FloatArray:
    """Make an array read-only; return it."""
    array.setflags(write=False)
    return array
