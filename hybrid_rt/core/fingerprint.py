"""Fingerprints of objects: equal for equal contents, whatever process makes them."""

from __future__ import annotations

import copyreg
import hashlib
from collections.abc import Mapping
from functools import cached_property
from types import BuiltinFunctionType, CodeType, FunctionType
from typing import Any

import numpy as np

# Digits of a fingerprint: that two of a thousand scenes share one has a chance of 1e-13.
DIGITS = 16


def fingerprint(value: Any) -> str:
    """Return 16 hexadecimal digits that name the contents of an object.

    Arrays count by dtype, shape and bytes; objects by their class and what pickle would keep of
    them, without `functools.cached_property`; functions by name and compiled code, so a comment is
    none of their contents.

    Raises
    ------
    TypeError
        For objects that pickle refuses as well, such as open files.
    """
    digest = hashlib.sha256()
    _add(value, digest, ())
    return digest.hexdigest()[:DIGITS]


def _add(value: Any, digest: Any, around: tuple[int, ...]) -> None:
    """Add an object's contents; ``around`` holds the ids of the objects that it is a part of."""
    if id(value) in around:
        digest.update(b"<itself %d>" % around[::-1].index(id(value)))
        return
    inside = (*around, id(value))
    digest.update(f"<{type(value).__module__}.{type(value).__qualname__}>".encode())
    if value is None or isinstance(value, bool | int | str | np.generic | type):
        digest.update(repr(value).encode())
    elif isinstance(value, float | complex):
        digest.update(repr(value).encode())  # all digits, and the sign of zero
    elif isinstance(value, bytes | bytearray):
        digest.update(bytes(value))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        if value.dtype.hasobject:
            for item in value.ravel().tolist():
                _add(item, digest, inside)
        else:
            digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, tuple | list):
        for item in value:
            _add(item, digest, inside)
    elif isinstance(value, set | frozenset):
        for name in sorted(fingerprint(item) for item in value):
            digest.update(name.encode())
    elif isinstance(value, Mapping):
        for key, item in value.items():
            _add(key, digest, inside)
            _add(item, digest, inside)
    elif isinstance(value, FunctionType):
        cells = [cell.cell_contents for cell in value.__closure__ or ()]
        defaults = (value.__defaults__, value.__kwdefaults__)
        for part in (value.__qualname__, value.__code__, defaults, cells):
            _add(part, digest, inside)
    elif isinstance(value, CodeType):  # of functions and comprehensions within it as well
        _add((value.co_code, value.co_names, value.co_consts), digest, inside)
    elif isinstance(value, BuiltinFunctionType):
        digest.update(f"{value.__module__}.{value.__qualname__}".encode())
    else:
        for part in _kept(value):
            _add(part, digest, inside)
    digest.update(b"</>")


def _kept(value: Any) -> tuple[Any, ...]:
    """Return what pickle would keep of an object."""
    registered = copyreg.dispatch_table.get(type(value))
    kept = value.__reduce_ex__(4) if registered is None else registered(value)
    if isinstance(kept, str):  # a global of its module, by name
        return kept, type(value).__module__
    make, *parts = kept
    if make is copyreg.__newobj__:  # type: ignore[attr-defined]
        make = type(value)
    arguments, state, *items = (*parts, None, None, None)[:4]
    if isinstance(state, dict):
        cached = {
            name
            for base in type(value).__mro__
            for name, found in vars(base).items()
            if isinstance(found, cached_property)
        }
        state = {name: item for name, item in state.items() if name not in cached}
    several = tuple(tuple(one) for one in items if one is not None)
    return make, arguments, state, several
