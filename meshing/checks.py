"""Argument checks: errors are raised before any work starts.

Every message names the argument and its value and, after a colon, what to pass instead. ``what`` is
the name of object and parameter that messages use, as in "Sphere radius". Numbers and shapes that are not
allowed are a ValueError, other things a TypeError.
"""

import math
import os
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
FloatArray: TypeAlias = NDArray[np.float64]
IdArray: TypeAlias = NDArray[np.int64]

# A matrix that squeezes one direction by more than this against another leaves only roundings.
SMALLEST_SQUEEZE = 8.0 * 2.0**-52
# Products of rotations, as callers build them, are orthogonal to a few roundings only.
SIMILARITY_TOLERANCE = 2.0**-40


def shown(value: object) -> str:
    """Return a short, one-line representation of a value for error messages."""
    # Python does not write out integers of very many digits; other classes may raise anything.
    is_whole = isinstance(value, int)
    text = f"a very large {type(value).__name__}" if is_whole else f"a {type(value).__name__}"
    with suppress(Exception):
        text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def text_of(error: BaseException) -> str:
    """Return the message of an exception on one line; "" if formatting it raises."""
    with suppress(Exception):
        return " ".join(str(error).split())
    return ""


def as_floats(value: ArrayLike, what: str) -> FloatArray:
    """Return real numbers as a float64 array; refuse all else, and rows of unequal length."""
    if type(value) is np.ndarray and value.dtype == np.float64 and value.flags.c_contiguous:
        return value
    refuse_mask(value, what)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(f"{what} is {shown(value)}: pass rows of equal length") from None
    if array.dtype.kind == "O":
        # Fractions and decimals; one by one, since numpy turns None into nan.
        try:
            array = np.array([float(x) for x in array.flat]).reshape(array.shape)
        except OverflowError:
            raise ValueError(f"{what} is {shown(value)}: pass numbers within 1e308") from None
        except (TypeError, ValueError):
            raise TypeError(f"{what} is {shown(value)}: pass real numbers") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{what} is {shown(value)}: pass real numbers")
    if array.dtype.itemsize <= 8:
        return np.asarray(array, dtype=np.float64, order="C")
    with np.errstate(over="ignore"):  # what is too large becomes inf, which callers refuse
        return np.asarray(array, dtype=np.float64, order="C")


def refuse_mask(value: object, what: str) -> None:
    """Refuse an array with masked elements: NumPy would return the data under the mask."""
    if isinstance(value, np.ndarray) and np.any(getattr(value, "mask", False)):
        raise ValueError(
            f"{what} has masked elements: leave them out, or fill them with .filled(...)"
        )


def as_vector(value: ArrayLike, what: str, *, up_to: float = np.inf) -> FloatArray:
    """Return three finite float64 numbers of magnitude at most ``up_to``, read-only."""
    vector = as_floats(value, what)
    if vector.shape != (3,):
        raise ValueError(f"{what} has shape {vector.shape}: pass three numbers")
    if not np.isfinite(vector).all():
        raise ValueError(f"{what} is {vector.tolist()}: pass finite numbers")
    if up_to < np.inf and np.abs(vector).max() > up_to:
        raise ValueError(f"{what} is {vector.tolist()}: scale the scene to within {up_to:g}")
    return freeze(vector.copy())


def unit(vector: FloatArray, what: str) -> FloatArray:
    """Normalise a vector (3,), not zero; it is scaled first, so that no square overflows."""
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise ValueError(f"{what} is the zero vector: pass a direction")
    scaled = vector / math.ldexp(1.0, math.frexp(largest)[1] - 1)
    return scaled / math.sqrt(scaled @ scaled)


def still_unit(vector: FloatArray, what: str) -> FloatArray:
    """Normalise a vector about one long; one of length one up to rounding stays bit for bit."""
    return vector if abs(vector @ vector - 1.0) <= 4.0 * 2.0**-52 else unit(vector, what)


def units(vectors: FloatArray) -> FloatArray:
    """Return vectors (n, 3) over their lengths, which may be any but zero."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    # By a power of two first, so that no square overflows or vanishes.
    scaled = np.ldexp(vectors, -np.frexp(largest)[1][:, None])
    return scaled / np.linalg.norm(scaled, axis=1, keepdims=True)


def as_direction(value: ArrayLike, what: str) -> FloatArray:
    """Normalise a direction of any length but zero; return it read-only."""
    return freeze(unit(as_vector(value, what), what))


def direction_across(axis: FloatArray, reference: ArrayLike | None, what: str) -> FloatArray:
    """Return the unit vector of ``reference`` normal to a unit ``axis``, read-only.

    None stands for the coordinate axis least aligned with ``axis``.
    """
    if reference is None:
        start = np.zeros(3)
        start[np.argmin(np.abs(axis))] = 1.0
    else:
        start = as_direction(reference, what)
    across = start - (start @ axis) * axis
    if not across @ across > 2.0**-80:
        raise ValueError(
            f"{what} is {shown(reference)}, parallel to the axis: pass another direction"
        )
    across = unit(across, what)
    # Once more: what was left along the axis had been rounded when the rest was small.
    return freeze(unit(across - (across @ axis) * axis, what))


def number(
    value: float,
    what: str,
    *,
    above: float = -np.inf,
    below: float = np.inf,
    at_least: float = -np.inf,
    up_to: float = np.inf,
    hint: str = "",
) -> float:
    """Return one finite number within limits, exclusive and inclusive; ``hint`` says what to pass."""
    if type(value) is float:  # there may be many
        result = value
    else:
        try:
            array = as_floats(value, what)
            if array.shape != ():
                raise TypeError(f"{what} is {shown(value)}: pass one number")
        except TypeError as error:
            raise TypeError(f"{error} ({hint})" if hint else str(error)) from None
        result = float(array)
    inside = above < result < below and at_least <= result <= up_to
    if not (inside and math.isfinite(result)):
        limits = [
            f"{word} {limit:g}"
            for word, limit in (
                ("above", above), ("at least", at_least), ("below", below), ("at most", up_to),
            )
            if np.isfinite(limit)
        ]  # fmt: skip
        wanted = " ".join(["a finite number", " and ".join(limits)]).strip()
        raise ValueError(f"{what} is {result:g}: pass {wanted}" + (f" ({hint})" if hint else ""))
    return result


def whole(value: int, what: str, *, at_least: int, up_to: int | None = None) -> int:
    """Return an integer from ``at_least`` to ``up_to``; None: there is no upper limit."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{what} is {shown(value)}: pass an integer")
    if value < at_least or (up_to is not None and value > up_to):
        limits = f"from {at_least} on" if up_to is None else f"from {at_least} to {up_to}"
        raise ValueError(f"{what} is {shown(value)}: pass an integer {limits}")
    return int(value)


def as_path(value: str | os.PathLike[str], what: str) -> Path:
    """Return the path of a file; no null byte is in it."""
    if not isinstance(value, str | os.PathLike):
        raise TypeError(f"{what} is {shown(value)}: pass a path")
    path = Path(value)
    if "\0" in str(path):
        raise ValueError(f"{what} is {shown(value)}: pass a path without null bytes")
    return path


def check_is_file(path: Path, what: str) -> None:
    """Refuse a path at which there is no file; ``what`` names it."""
    if path.is_dir():
        raise IsADirectoryError(f"{what} is a folder: pass a file")
    if not path.is_file():
        raise FileNotFoundError(f"{what}: there is no such file")


def as_affine(matrix: ArrayLike, kind: str) -> tuple[FloatArray, FloatArray]:
    """Split a (4, 4) affine map, not singular, into linear part (3, 3) and translation (3,).

    ``kind`` is the kind of surface that is to be transformed.
    """
    array = as_floats(matrix, f"{kind} matrix")
    if array.shape != (4, 4):
        raise ValueError(f"{kind} matrix has shape {array.shape}: pass one of (4, 4)")
    if not np.isfinite(array).all():
        bad = np.argwhere(~np.isfinite(array))[0]
        raise ValueError(
            f"{kind} matrix is {array[tuple(bad)]} in row {bad[0]}, column {bad[1]}: "
            "pass finite numbers"
        )
    if not np.array_equal(array[3], [0.0, 0.0, 0.0, 1.0]):
        raise ValueError(
            f"{kind} matrix has the last row {array[3].tolist()}: pass an affine map, "
            "last row (0, 0, 0, 1)"
        )
    linear = array[:3, :3].copy()
    sizes = np.linalg.svd(linear, compute_uv=False)
    if not sizes[2] > SMALLEST_SQUEEZE * sizes[0]:
        raise ValueError(
            f"{kind} matrix is singular (it stretches by {sizes[0]:g} one way, {sizes[2]:g} "
            "another): pass one that does not flatten the surface"
        )
    return linear, array[:3, 3].copy()


def as_similarity(
    matrix: ArrayLike, kind: str, otherwise: str = "use a NurbsSurface"
) -> tuple[FloatArray, FloatArray, float, bool]:
    """Split a similarity (4, 4): orthogonal part, translation, scale, and whether it reflects.

    ``otherwise`` says in the message what takes other maps.
    """
    linear, shift = as_affine(matrix, kind)
    # By a power of two first, so that no square overflows.
    unit = math.ldexp(1.0, math.frexp(float(np.abs(linear).max()))[1] - 1)
    linear = linear / unit
    scale = float(np.sqrt((linear**2).sum() / 3.0))
    orthogonal = linear / scale
    scale *= unit
    error = float(np.abs(orthogonal @ orthogonal.T - np.eye(3)).max())
    if error > SIMILARITY_TOLERANCE:
        raise ValueError(
            f"{kind} matrix is no similarity (off by {error:.3g}): pass a rotation, reflection, "
            f"shift or uniform scaling; for other maps {otherwise}"
        )
    return orthogonal, shift, scale, bool(np.linalg.det(orthogonal) < 0.0)


def broadcast_parameters(
    u: ArrayLike, v: ArrayLike, patch_id: ArrayLike, n_patches: int
) -> tuple[FloatArray, FloatArray, IdArray, tuple[int, ...]]:
    """Return u, v and patches flat, (n,), and the shape that they broadcast to."""
    refuse_mask(patch_id, "patch_id")
    ids = np.asarray(patch_id)
    if ids.dtype.kind not in "iu":
        raise TypeError(f"patch_id has type {ids.dtype}: pass whole numbers")
    if ids.size and not (ids.min() >= 0 and ids.max() < n_patches):
        bad = ids[(ids < 0) | (ids >= n_patches)].flat[0]
        raise ValueError(
            f"patch_id is {bad}: pass 0 to {n_patches - 1}, this surface has no others"
        )
    u, v = as_floats(u, "u"), as_floats(v, "v")
    try:
        shape = np.broadcast_shapes(u.shape, v.shape, ids.shape)
    except ValueError:
        raise ValueError(
            f"u, v and patch_id have shapes {u.shape}, {v.shape} and {ids.shape}: pass one number or "
            "as many of each"
        ) from None
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
