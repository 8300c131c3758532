"""Points of surfaces, chosen by area."""

import numpy as np

from meshing.area import Squares


def test_what_lies_beyond_the_rounded_sum_of_shares_is_of_the_last_cell_with_one():
    sampler = Squares(np.array([0.1] * 10 + [0.0, 0.0]))
    below_one = np.nextafter(1.0, 0.0)
    assert np.cumsum(sampler.share)[-1] <= below_one
    cell, u, v = sampler.choose(np.array([[0.0, 0.25], [below_one, 0.5]]))
    assert cell.tolist() == [0, 9]
    assert u[0] == 0.0
    assert 1.0 - 2.0**-51 <= u[1] <= 1.0  # the end of the cell, rounded in tenths
    assert v.tolist() == [0.25, 0.5]


def test_cells_without_area_are_never_chosen():
    sampler = Squares(np.array([0.0, 3.0, 0.0, 0.0, 1.0, 0.0]))
    cell, u, _ = sampler.choose(np.array([[0.0, 0.0], [0.375, 0.0], [0.75, 0.0], [0.875, 0.0]]))
    assert cell.tolist() == [1, 1, 4, 4]
    assert u.tolist() == [0.0, 0.5, 0.0, 0.5]
