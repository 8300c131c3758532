"""Light vertices packed row by row hold what they held column by column."""

import numpy as np
import pytest

from hybrid_rt.integrators.path.light_paths import new_light_vertices, packed


@pytest.mark.parametrize("n", [0, 1, 2, 5])
@pytest.mark.parametrize("n_slots", [1, 3])
def test_packed_rows(n, n_slots):
    rng = np.random.default_rng(3)
    points = new_light_vertices(n, n_slots)
    for column in points:
        column[...] = rng.integers(1, 100, column.shape)
    rows = packed(points)
    for name, before, after in zip(points._fields, points, rows, strict=True):
        np.testing.assert_array_equal(after[:n], before, err_msg=name)
        assert after.dtype == before.dtype
        # All of one type for numba, so the kernels that read them are compiled once.
        assert not after.flags.c_contiguous
        assert after.strides[0] == rows.density.strides[0]
