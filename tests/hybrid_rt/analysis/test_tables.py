"""Slopes of curves, and tables for LaTeX."""

import math

import numpy as np
import pytest

from hybrid_rt.analysis.curves import Curve, Point, fitted_slope, power_law, spread
from hybrid_rt.analysis.tables import Table, in_latex, slope_table


def curve(passes, error, own=0.0):
    points = [
        Point(n, spread([2.0 * n**0.5] * 2), spread([math.hypot(error(n), own)] * 2), {})
        for n in passes
    ]
    return Curve("path", "", points)


def test_a_power_law_is_found_without_the_error_of_the_reference():
    """Error 0.3 / passes^(1/2), so 1 over the seconds here; 1e-12: roundings of logarithms."""
    found = fitted_slope(curve([1, 4, 16], lambda n: 0.3 / math.sqrt(n), own=0.05), 0.05)
    assert found.by_passes == pytest.approx((-0.5, 0.0), abs=1e-12)
    assert found.by_seconds == pytest.approx((-1.0, 0.0), abs=1e-12)
    assert found.of_noise == -0.5


def test_runs_that_the_reference_cannot_judge_are_left_out():
    """At 64 passes the reference has more than half of the squared error, so two numbers are left."""
    found = fitted_slope(curve([1, 4, 64], lambda n: 0.3 / math.sqrt(n), own=0.05), 0.05)
    assert np.isnan(found.by_passes).all()
    assert "unknown" in slope_table([found]).rows[0]


def test_the_standard_error_is_that_of_the_regression():
    """Logarithms (0, 1, 2) and (0, 1, 5): b = 5/2, rests (1/2, -1, 1/2), so sqrt(3/2 / 1 / 2)."""
    b, error = power_law(np.exp([0.0, 1.0, 2.0]), np.exp([0.0, 1.0, 5.0]))
    assert (b, error) == pytest.approx((2.5, math.sqrt(0.75)), rel=1e-14)


def test_a_table_for_latex():
    table = Table("Errors of 1 %", ("method", "error %"), [("a_b", "-0.5 +- 1e-3")], ("about",))
    assert in_latex(table) == (
        "% Errors of 1 %\n% about\n\\begin{tabular}{lr}\n\\hline\nmethod & error \\% \\\\ \\hline\n"
        "a\\_b & $-$0.5 $\\pm$ 1e-3 \\\\\n\\hline\n\\end{tabular}\n"
    )
