"""Frozen dataclasses as the plain dicts that JSON files hold, and back."""

import json
import math
import types
import typing
from collections.abc import Mapping
from dataclasses import Field, field, fields, is_dataclass
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


def inline() -> Any:
    """Return a field whose entries lie among those of its record: of a dict, all that are left over."""
    return field(metadata={"inline": True})


def absent() -> Any:
    """Return a field that a dict lacks where it is None, as it is by default."""
    return field(default=None, metadata={"absent": True})


def as_plain(value: Any, *, finite: bool = False) -> Any:
    """Return a value with dicts in place of records and named tuples, lists in place of tuples and arrays.

    Keys that are tuples become "1,2". ``finite``: with None in place of numbers that are not finite, which
    JSON lacks.
    """
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {
            ",".join(map(str, name)) if isinstance(name, tuple) else name: as_plain(
                one, finite=finite
            )
            for name, one in value.items()
        }
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [as_plain(one, finite=finite) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    elif is_dataclass(value):
        return as_plain(plain_fields(value), finite=finite)
    return None if finite and isinstance(value, float) and not math.isfinite(value) else value


def as_json(value: Any) -> str:
    """Return figures as JSON text; numbers that are not finite become null."""
    return json.dumps(as_plain(value, finite=True), indent=2, allow_nan=False) + "\n"


def plain_fields(record: Any) -> dict[str, Any]:
    """Return a record as a dict."""
    found: dict[str, Any] = {}
    for one in fields(record):
        value = as_plain(getattr(record, one.name))
        if one.metadata.get("inline"):
            found |= value
        elif value is not None or not one.metadata.get("absent"):
            found[one.name] = value
    return found


def from_plain(kind: type[T], held: Mapping[str, Any]) -> T:
    """Return the record of which `plain_fields` made a dict, which may hold records too.

    JSON has no numbers that are not finite: None in place of a number becomes nan. Another dict is a KeyError
    or TypeError.
    """
    hints = typing.get_type_hints(kind)
    of_kind = fields(kind)  # type: ignore[arg-type]
    named = {name for one in of_kind for name in _names(one, hints)}
    values: dict[str, Any] = {}
    for one in of_kind:
        if not one.metadata.get("inline"):
            value = held.get(one.name) if one.metadata.get("absent") else held[one.name]
        elif is_dataclass(hints[one.name]):
            value = held
        else:
            value = {name: count for name, count in held.items() if name not in named}
        values[one.name] = _read(hints[one.name], value)
    return kind(**values)


def _names(one: Field[Any], hints: Mapping[str, Any]) -> list[str]:
    is_inline = one.metadata.get("inline") and is_dataclass(hints[one.name])
    return [part.name for part in fields(hints[one.name])] if is_inline else [one.name]


def _read(hint: Any, value: Any) -> Any:
    of = typing.get_args(hint)
    if isinstance(hint, types.UnionType):
        kinds = [one for one in of if one is not types.NoneType]
        return None if value is None else _read(kinds[0], value) if len(kinds) == 1 else value
    if hint is float:
        return math.nan if value is None else value
    if isinstance(hint, type) and is_dataclass(hint):
        return value if isinstance(value, hint) else from_plain(hint, value)
    if typing.get_origin(hint) is list:
        return [_read(of[0], one) for one in value]
    if typing.get_origin(hint) is tuple:
        return tuple(value)
    return value
