"""Stated errors against true ones. The long version: tools/calibrate.py."""

import numpy as np
import pytest

from hybrid_rt.verify.calibration import PICTURES, bounds, coverage
from hybrid_rt.verify.campaign import SCENES

pytestmark = pytest.mark.statistical

SEEDS = range(400)
PASSES = 64


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "integrator"),
    [*((name, "path") for name in PICTURES), ("floor under a lamp", "whitted")],
)
def test_truth_is_in_the_stated_interval_as_often_as_stated(name, integrator):
    """400 means: 95 % is known to 1.1 %, so honest intervals stay between 92 and 98 %.

    The stated standard errors of 4 groups have the right mean square; 5 % is some 5 standard
    deviations of what 400 seeds can tell.
    """
    found = coverage(PICTURES[name](), integrator, PASSES, SEEDS)
    assert 0.92 <= found.of_pixels <= 0.98
    assert 0.92 <= found.of_mean <= 0.98
    assert found.error_ratio == pytest.approx(1.0, abs=0.05)


def test_few_passes_err_on_the_safe_side():
    """One net is better than four independent samples, as which its passes count."""
    found = coverage(PICTURES["floor under a lamp"](), "path", 4, range(50))
    assert found.of_pixels > 0.99
    assert found.error_ratio > 2.0


@pytest.mark.slow
def test_bounds_hold_and_are_not_loose():
    parts = list(bounds(SCENES["mixed"](), 10_000, seed=5))
    hits = sum(part.hits for part in parts)
    assert hits > 4000
    assert sum(part.wrong for part in parts) == 0
    assert sum(part.exceeded for part in parts) == 0
    assert max(part.worst for part in parts) <= 1.0
    assert np.median(np.concatenate([part.looseness for part in parts])) < 64.0


def test_a_broken_bound_is_seen(monkeypatch):
    from hybrid_rt.verify import calibration

    class Boastful(calibration.Intersector):
        def intersect(self, *arguments, **settings):
            hits = super().intersect(*arguments, **settings)
            hits.t_bound[...] *= 1e-3
            return hits

    monkeypatch.setattr(calibration, "Intersector", Boastful)
    (part,) = bounds(SCENES["closed forms"](), 5000, seed=5)
    assert part.exceeded > 0
    assert part.worst > 1.0
