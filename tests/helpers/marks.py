"""Which cases of a test the ordinary suite runs, and which only `tools/nightly.py`."""

import pytest


def nightly_but(cases, *daily):
    """Return parameters of which those in ``daily`` are run always, the others at night."""
    missing = [one for one in daily if one not in cases]
    assert not missing, missing
    return [one if one in daily else pytest.param(one, marks=pytest.mark.nightly) for one in cases]
