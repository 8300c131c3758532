"""Checks of colours, choices, flags, lists; `meshing.checks` has those of numbers and vectors."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from meshing.checks import as_direction, as_floats, as_vector, freeze, number, shown, whole

__all__ = [
    "BRIGHTEST", "FARTHEST", "SMALLEST", "as_direction", "as_floats", "as_vector", "choice", "edge",
    "finite", "flag", "has", "items", "number", "rgb", "shown", "whole",
]  # fmt: skip

# Between these, squares, cross products and fourth powers of lengths have room in float64.
SMALLEST, FARTHEST = 1e-60, 1e60
# Pictures are float32, up to 3e38: this leaves room for sums, and for lights near a surface.
BRIGHTEST = 1e30


def finite(value: ArrayLike, what: str, shape: tuple[int, ...]) -> FloatArray:
    """Return an array of finite float64 numbers, or raise; -1 in ``shape`` is any length."""
    array = as_floats(value, what)
    if len(shape) != array.ndim or any(
        n not in (-1, m) for n, m in zip(shape, array.shape, strict=True)
    ):
        wanted = ", ".join("n" if n == -1 else str(n) for n in shape)
        raise ValueError(
            f"{what} has shape {array.shape}: pass ({wanted}{',' * (len(shape) == 1)})"
        )
    if not np.isfinite(array).all():
        raise ValueError(f"{what} holds {array[~np.isfinite(array)][0]}: pass finite numbers")
    return array


def edge(value: ArrayLike, what: str) -> FloatArray:
    """Return an edge (3,) that is zero or neither too short nor too long to compute with, or raise."""
    vector = as_vector(value, what, up_to=FARTHEST)
    if 0.0 < np.abs(vector).max() < SMALLEST:
        raise ValueError(
            f"{what} is {vector.tolist()}: scale the scene, edges from {SMALLEST:g} long on are possible"
        )
    return vector


def rgb(value: ArrayLike, what: str, *, up_to: float = BRIGHTEST) -> FloatArray:
    """Return three numbers from 0 to ``up_to``, read-only, or raise; one number stands for all three."""
    array = as_floats(value, what)
    if array.shape not in {(), (3,)}:
        raise ValueError(f"{what} has shape {array.shape}: pass one number, or three")
    if not (np.isfinite(array).all() and array.min() >= 0.0 and array.max() <= up_to):
        because = " (a surface cannot send on more light than it receives)" if up_to == 1.0 else ""
        raise ValueError(f"{what} is {array.tolist()}: pass numbers from 0 to {up_to:g}{because}")
    return freeze(np.array(np.broadcast_to(array, (3,))))


def choice(value: str, what: str, options: Iterable[str], hint: str = "") -> str:
    """Return a value that is one of the options; else raise ValueError, which names ``what``."""
    if not isinstance(value, str) or value not in options:
        wanted = f"pass one of {', '.join(options)}" + (f"; {hint}" if hint else "")
        raise ValueError(f"{what} is {shown(value)}: {wanted}")
    return value


def flag(value: bool, what: str) -> bool:
    """Return a bool; else raise TypeError, also for strings, since "no" would be true."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{what} is {shown(value)}: pass True or False")
    return bool(value)


def has(value: object, *names: str) -> bool:
    """Tell whether a value has all of these attributes; a class does not count as what it makes."""
    return not isinstance(value, type) and all(hasattr(value, name) for name in names)


def items(values: Iterable[Any], what: str) -> tuple[Any, ...]:
    """Return the items of an iterable, also of one that can be read only once; raise for a string or a dict."""
    if isinstance(values, str | bytes | dict) or not isinstance(values, Iterable):
        raise TypeError(f"{what} is {shown(values)}: pass a list")
    return tuple(values)
