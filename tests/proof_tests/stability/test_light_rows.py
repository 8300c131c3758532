"""The rows of light, with a fraction of their rays and photons: each as the catalogue asks."""

import pytest

from proof.stability.row import Effort, all_rows

LIGHT = {
    row_id: entry for row_id, entry in all_rows().items() if ".rows_light_" in entry.run.__module__
}

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


@pytest.mark.parametrize("row_id", LIGHT)
def test_row_holds(row_id):
    outcome = LIGHT[row_id].run(Effort(0.04))
    assert outcome.rays > 0
    assert outcome.holds, outcome.faults
