"""Tables of columns: rows of all of them are allocated, selected and joined at once."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hybrid_rt.integrators.rows import joined, new_rows, rows_of


class Columns(NamedTuple):
    number: np.ndarray
    place: np.ndarray
    media: np.ndarray


@dataclass(frozen=True)
class Table:
    columns: Columns
    lacking: np.ndarray  # (0, 3)
    depth: int
    source: Columns | None = None


def some(n, first=0):
    columns = new_rows(Columns, n, "i8, 3f8, (0,)i4")
    columns.number[:] = columns.place.T[:] = np.arange(first, first + n)
    return Table(columns, np.zeros((0, 3)), 7)


def test_columns_have_the_types_and_widths_of_the_form():
    number, place, media = new_rows(Columns, 4, "u8, 3f4, (2,)i4")
    assert (number.shape, place.shape, media.shape) == ((4,), (4, 3), (4, 2))
    assert (number.dtype, place.dtype, media.dtype) == (np.uint64, np.float32, np.int32)
    # Kernels are compiled for such arrays.
    assert all(column.flags.c_contiguous for column in (number, place, media))


def test_rows_are_taken_from_all_columns_that_have_some():
    table = some(5)
    for rows in (np.array([3, 1]), np.array([0, 1, 0, 1, 0], dtype=bool), slice(1, 3)):
        found = rows_of(table, rows)
        expected = np.arange(5)[rows]
        np.testing.assert_array_equal(found.columns.number, expected)
        np.testing.assert_array_equal(found.columns.place[:, 2], expected)
        assert found.columns.media.shape == (len(expected), 0)
        assert found.lacking is table.lacking
        assert (found.depth, found.source) == (7, None)
    pair = rows_of((np.arange(3), np.arange(3.0)), [2])
    assert type(pair) is tuple
    assert pair == (2, 2.0)


def test_tables_are_joined_column_by_column():
    a, b = some(2).columns, some(3, first=2).columns
    np.testing.assert_array_equal(joined([a, b]).number, np.arange(5))
    assert joined([a, b]).place.shape == (5, 3)
    assert joined([a]) is a
