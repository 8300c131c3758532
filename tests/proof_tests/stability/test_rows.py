"""The rows of the catalogue with a few rays each; `tools/stability.py` runs them with many."""

import pytest

from proof.stability.row import IDS, NOT_BUILT, TESTS, Effort, all_rows

ALL = all_rows()
# What random search found is run in full by test_fuzz.
ROWS = {i: row for i, row in ALL.items() if not row.tests and row.id in IDS}


@pytest.mark.parametrize("test", sorted({test for row in ALL.values() for test in row.tests}))
def test_tests_that_hold_rows_exist(test):
    file, *_, name = test.split("::")
    assert f"def {name}(" in (TESTS / "hybrid_rt" / file).read_text("utf-8")


@pytest.mark.parametrize("row_id", ROWS)
def test_the_row_holds(row_id):
    outcome = ROWS[row_id].run(Effort(0.01))
    assert outcome.holds, (outcome.faults, outcome.notes, outcome)
    assert outcome.rays > 0


def test_every_row_is_built_or_said_not_to_be():
    assert set(IDS) <= ALL.keys() | NOT_BUILT.keys()
