"""Tables: NamedTuples and dataclasses of columns, with a row for each ray, path or photon."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, cast

import numpy as np

Table = TypeVar("Table")


def new_rows(kind: type[Table], n: int, form: str) -> Table:
    """Allocate n rows; ``form`` has the types of the columns in NumPy's notation, as in "i8, 3f8, (4,)i4"."""
    columns = cast(Any, np.dtype(form).fields).values()
    return kind(*(np.empty((n, *column.shape), column.base) for column, _ in columns))


def rows_of(table: Table, rows: Any) -> Table:
    """Select rows by a mask, an index array or a slice.

    Columns without rows stay, as they do in tables that lack them, and so do single values.
    """
    if isinstance(table, np.ndarray):
        return cast(Table, table[rows] if len(table) else table)
    if isinstance(table, tuple) or is_dataclass(table):
        columns = tuple(rows_of(column, rows) for column in _columns(table))
        kind: Any = type(table)
        return cast(Table, columns if kind is tuple else kind(*columns))
    return table


def joined(tables: Sequence[Table]) -> Table:
    """Concatenate tables: one at least."""
    first: Any = tables[0]
    if len(tables) == 1:
        return tables[0]
    if isinstance(first, np.ndarray):
        return cast(Table, np.concatenate(cast(Any, tables)))
    return cast(Table, type(first)(*map(joined, zip(*map(_columns, tables), strict=True))))


def _columns(table: Any) -> Iterable[Any]:
    if isinstance(table, tuple):
        return table
    return (getattr(table, column.name) for column in fields(table))
