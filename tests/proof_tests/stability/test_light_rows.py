"""The rows of light, with a fraction of their rays and photons: each as the catalogue asks."""

import pytest

from nightly import nightly_but
from proof.stability.row import IDS, NOT_BUILT, Effort, all_rows

LIGHT = {
    row_id: entry for row_id, entry in all_rows().items() if ".rows_light_" in entry.run.__module__
}

pytestmark = [pytest.mark.statistical, pytest.mark.slow]


# L12, L13 and L15 take ten seconds each even so.
@pytest.mark.parametrize("row_id", nightly_but(LIGHT, *(LIGHT.keys() - {"L12", "L13", "L15"})))
def test_row_holds(row_id):
    outcome = LIGHT[row_id].run(Effort(0.01))
    assert outcome.rays > 0
    assert outcome.holds, outcome.faults


def test_every_row_of_light_is_there():
    wanted = {row_id for row_id in IDS if row_id[0] in "DL" and row_id[1:] > "05"}
    wanted |= {row_id for row_id in IDS if row_id[0] == "L"} | {"F09", "F11", "F12"}
    assert wanted - set(NOT_BUILT) == set(LIGHT)
