"""Calls of kernels whose arguments are stored."""

from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import kernel
from meshing.kernels.stored_calls import Returned, StoredCall, call_stored


class Table(NamedTuple):
    values: Any
    part: Any  # None or a number
    scale: float
    inside: Any  # a named tuple


class Inside(NamedTuple):
    ids: Any
    flag: Any


@kernel
def gather(table, n, is_negative, out):
    """Every argument counts, and each kind of one is there."""
    total = 0.0
    for i in range(n):
        for j in range(table.values.shape[1]):
            total += table.values[i, j] * table.scale
    for k in range(table.inside.ids.size):
        total += table.inside.ids[k]
    if table.inside.flag:
        total += 1000.0
    out[0] = -total if is_negative else total
    return n, table.inside.ids.size


@kernel
def note(n, out):
    out[n] = 1.0


@kernel
def call_all(addresses):
    for i in range(addresses.size):
        call_stored(addresses[i])


def test_arguments_of_all_kinds_arrive():
    values = np.arange(12.0).reshape(3, 4)
    values.flags.writeable = False
    out = np.zeros(1)
    table = Table(values, None, 0.5, Inside(np.array([3, 4], np.int32), True))
    call = StoredCall(gather, table, 2, True, out)
    call_all(np.array([call.address]))
    # 0.5 (0 + ... + 7) + 3 + 4 + 1000
    assert out[0] == -(14.0 + 7.0 + 1000.0)


def test_a_view_of_another_order_keeps_its_strides():
    out = np.zeros(1)
    table = Table(np.arange(12.0).reshape(3, 4).T, None, 1.0, Inside(np.zeros(0, np.int32), False))
    call_all(np.array([StoredCall(gather, table, 1, False, out).address]))
    assert out[0] == 0.0 + 4.0 + 8.0


def test_a_call_takes_what_another_has_returned_and_waits_for_it():
    ids, out, marks = np.array([7, 7], np.int32), np.zeros(1), np.zeros(4)
    table = Table(np.ones((3, 1)), None, 1.0, Inside(ids, False))
    for n, marked in ((0, None), (3, 3)):
        first = StoredCall(gather, table, n, False, out)
        second = StoredCall(note, Returned(first, 0), marks, only_if=Returned(first, 0))
        call_all(np.array([first.address, second.address]))
        # Of 0 rows nothing is returned, and the second call is left out.
        np.testing.assert_array_equal(np.flatnonzero(marks), [] if marked is None else [marked])
