"""Functions that only kernels call: linked into these, without machine code of their own."""

import numba
import numpy as np
import pytest

from meshing.kernels.jit import inlined, inner, kernel


@inner
def square(x):
    return x * x


@inlined
def sum_of_squares(x, y):
    return square(x) + square(y)


@kernel(allocates=True)
def lengths(points, out):
    for i in range(points.shape[0]):
        out[i] = np.sqrt(sum_of_squares(points[i, 0], points[i, 1]))


@kernel
def double_square(x):
    return 2.0 * square(x)


def test_two_kernels_share_what_they_call():
    out = np.empty(2)
    lengths(np.array([[3.0, 4.0], [5.0, 12.0]]), out)
    np.testing.assert_array_equal(out, [5.0, 13.0])
    assert double_square(3.0) == 18.0


def test_python_may_call_them_too():
    assert square(3.0) == 9.0
    assert sum_of_squares(3, 4) == 25


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_only_kernels_get_machine_code():
    """numba keeps the machine code of a library, if there is any, for its cache."""
    lengths(np.ones((1, 2)), np.empty(1))
    lengths.recompile()  # what comes from the cache has no library
    for function, has_code in ((lengths, True), (sum_of_squares, False), (square, False)):
        library = next(iter(function.overloads.values())).library
        assert (getattr(library, "_compiled_object", None) is not None) == has_code
