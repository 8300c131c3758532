"""What connections read of light vertices."""

import numpy as np
import pytest

from hybrid_rt.integrators.path.light_paths import (
    candidates_of,
    new_light_vertices,
    packed,
)


@pytest.mark.parametrize("n", [0, 1, 2, 5])
@pytest.mark.parametrize("n_slots", [0, 1, 3])
def test_packed_rows(n, n_slots):
    rng = np.random.default_rng(3)
    points = new_light_vertices(n, n_slots)
    for column in points:
        column[...] = rng.integers(1, 100, column.shape)
    rows = packed(points)
    for name, before, after in zip(points._fields, points, rows, strict=True):
        if before.size:  # of materials without lobes there are no colours
            np.testing.assert_array_equal(after[:n], before, err_msg=name)
        assert after.dtype == before.dtype
        # All of one type for numba, so the kernels that read them are compiled once.
        assert not after.flags.c_contiguous
        assert after.strides[0] == rows.density.strides[0]


def test_candidates():
    """Position, the lit side's normal times strength, steps; no strength where nothing joins."""
    points = new_light_vertices(3, 1)
    points.position[...] = np.arange(9).reshape(3, 3)
    points.geometric[...] = (0, 0, 1)
    points.direction[...] = [(0, 0.6, -0.8), (0, 0.6, 0.8), (0, 0.6, -0.8)]
    points.material[...] = [0, 0, 1]
    points.strength[...] = [2, 3, 4]
    points.steps[...] = [1, 2, 5]
    table = candidates_of(points, np.array([True, False]))
    np.testing.assert_array_equal(table[:, :3], points.position)
    np.testing.assert_array_equal(table[:, 3:6], [(0, 0, 2), (0, 0, -3), (0, 0, 0)])
    np.testing.assert_array_equal(table[:, 6], points.steps)
    # A row is a line of the cache.
    assert table.ctypes.data % 64 == 0
    assert table.strides == (64, 8)
