"""Registers by class of surface, whose entries are found by importing every module of a room."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType
from typing import Any, TypeVar

Entry = TypeVar("Entry")


def import_all(room: ModuleType) -> None:
    """Import every module of a room, so that its classes register themselves."""
    for module in pkgutil.iter_modules(room.__path__, room.__name__ + "."):
        importlib.import_module(module.name)


def entry_of(surface: Any, register: dict[type[Any], Entry]) -> Entry:
    """Return the entry of a surface's class, or of the first class that it derives from.

    Raises
    ------
    TypeError
        If there is none.
    """
    for surface_type in type(surface).__mro__:
        if surface_type in register:
            return register[surface_type]
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )
