"""Checks of what the user describes: clear refusals before any work starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.records import FloatArray


def vector(value: ArrayLike, what: str) -> FloatArray:
    """Return three finite float64 numbers, read-only, or raise naming ``what``."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{what}: expected three numbers, got {value!r}") from error
    if array.shape != (3,):
        raise ValueError(f"{what}: expected three numbers, got shape {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: {_shown(array)} is not finite")
    array.setflags(write=False)
    return array


def direction(value: ArrayLike, what: str) -> FloatArray:
    """Return a unit vector, or raise naming ``what``."""
    array = vector(value, what)
    largest = np.abs(array).max()
    if largest == 0.0:
        raise ValueError(f"{what}: the zero vector has no direction")
    # Scaled first: squares of very large or small components would overflow or vanish.
    scaled = array / largest
    unit: FloatArray = scaled / np.linalg.norm(scaled)
    unit.setflags(write=False)
    return unit


def number(value: float, what: str, *, above: float = -np.inf, up_to: float = np.inf) -> float:
    """Return a finite number with above < number <= up_to, or raise naming ``what``."""
    try:
        result = float(value)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{what}: expected a number, got {value!r}") from error
    if not np.isfinite(result):
        raise ValueError(f"{what}: {result} is not finite")
    if not above < result <= up_to:
        limits = f"above {above:g}" + (f" and at most {up_to:g}" if np.isfinite(up_to) else "")
        raise ValueError(f"{what}: {result:g} is out of range, it must be {limits}")
    return result


def rgb(value: ArrayLike, what: str, *, up_to: float = np.inf) -> FloatArray:
    """Return three numbers from 0 to ``up_to`` (one number counts for all), or raise."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{what}: expected a number or three numbers, got {value!r}") from error
    if array.shape not in {(), (3,)}:
        raise ValueError(f"{what}: expected a number or three numbers, got shape {array.shape}")
    array = np.array(np.broadcast_to(array, (3,)))
    if not np.isfinite(array).all():
        raise ValueError(f"{what}: {_shown(array)} is not finite")
    if array.min() < 0.0:
        raise ValueError(f"{what}: {_shown(array)} has a negative channel")
    if array.max() > up_to:
        raise ValueError(
            f"{what}: {_shown(array)} is above {up_to:g}; a surface cannot send on more light than "
            "it receives"
        )
    array.setflags(write=False)
    return array


def whole(value: int, what: str, *, at_least: int) -> int:
    """Return an integer of at least ``at_least``, or raise naming ``what``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{what}: expected an integer, got {value!r}")
    if value < at_least:
        raise ValueError(f"{what}: {value} is too small, it must be at least {at_least}")
    return int(value)


def _shown(array: FloatArray) -> str:
    return "(" + ", ".join(f"{x:g}" for x in array) + ")"
