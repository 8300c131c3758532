"""Prefetches are in the machine's code, and change nothing."""

import re

import numba
import numpy as np
import pytest

from meshing.kernels.jit import kernel
from meshing.kernels.prefetch import LINE, prefetch


@kernel
def _sum_of_rows(table, rows):
    total = 0.0
    for i in range(rows.size):
        for offset in range(0, table.strides[0], LINE):
            prefetch(table, rows[i], offset)
        total += table[rows[i], 0]
    return total


def _column_of_records():
    records = np.zeros(100, dtype=[("place", np.float64, 3), ("other", np.float64, 20)])
    records["place"][:, 0] = np.arange(100)
    return records["place"]


@pytest.mark.parametrize("table", [np.arange(300.0).reshape(100, 3), _column_of_records()])
def test_rows_are_asked_for(table):
    rows = np.array([99, 0, 17])
    before = table.copy()
    assert _sum_of_rows(table, rows) == table[rows, 0].sum()
    np.testing.assert_array_equal(table, before)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_the_instruction_is_there():
    table = _column_of_records()
    with_it = numba.njit(lambda table, row: prefetch(table, row, 0))
    without = numba.njit(lambda table, row: table[row, 0])
    found = []
    for kernel in (with_it, without):
        kernel(table, 5)
        (code,) = kernel.inspect_asm().values()
        # Of x86 and of ARM; names of functions have this module's name in them.
        found.append(re.search(r"^\s+(prefetcht0|prfm)\s", code, re.MULTILINE) is not None)
    assert found == [True, False]
