"""The rows of geometry with a few rays each; `tools/stability.py` runs them with many."""

import pytest

from proof.stability.row import Effort, all_rows

# Rows of light and what random search found have tests of their own.
OTHERS = (".rows_light_", ".rows_found")
ROWS = {
    row_id: entry
    for row_id, entry in all_rows().items()
    if not any(module in entry.run.__module__ for module in OTHERS)
}
EFFORT = Effort(0.01)


@pytest.mark.parametrize("row_id", list(ROWS))
def test_the_row_holds(row_id):
    outcome = ROWS[row_id].run(EFFORT)
    assert outcome.holds, (outcome.faults, outcome.notes, outcome)
    assert outcome.rays > 0
