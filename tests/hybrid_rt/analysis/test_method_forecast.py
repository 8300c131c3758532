"""Forecasts on curves and meshes whose law is known."""

import math
from dataclasses import replace

import pytest

from hybrid_rt.analysis.curves import Curve, Point, spread
from hybrid_rt.analysis.method_forecast import (
    at_equal_time,
    forecast,
    growing_seconds,
    seconds_fall,
    triangles_for,
)
from hybrid_rt.analysis.tables import equal_time_table


def law(bias=0.0, first=1.0, setup=0.5, each=0.25, passes=(1, 4, 16), own=0.0):
    """Errors of sqrt(bias^2 + first^2 / n), seconds of setup + each n."""
    points = []
    for n in passes:
        error = math.sqrt(bias**2 + first**2 / n + own**2)
        points.append(Point(n, spread([setup + each * n]), spread([error]), {}))
    return Curve("law", "--integrator law", points)


def at_seconds(*seconds):
    points = zip(law().points, seconds, strict=True)
    return replace(law(), points=[replace(p, seconds=spread([s])) for p, s in points])


class TestForecast:
    def test_noise_alone_beyond_the_last_point(self):
        """1 / sqrt(n) reaches 0.1 with 100 passes, in 0.5 + 25 s."""
        found = forecast(law(), 0.1)
        assert (found.passes, found.bias, found.is_measured) == (100, 0.0, False)
        assert found.seconds.median == pytest.approx(25.5)

    def test_between_points_it_is_measured(self):
        found = forecast(law(), math.sqrt(1 / 8))
        assert (found.passes, found.is_measured) == (8, True)
        assert found.seconds.median == pytest.approx(2.5)

    def test_a_lucky_pass_is_no_forecast(self):
        """Errors of 0.1, 0.5, 0.2 and 0.1 by 1, 4, 16 and 64 passes: 0.3 is reached between 4 and 16."""
        points = [
            Point(n, spread([float(n)]), spread([error]), {})
            for n, error in ((1, 0.1), (4, 0.5), (16, 0.2), (64, 0.1))
        ]
        found = forecast(Curve("dots", "", points), 0.3)
        share = math.log(0.5 / 0.3) / math.log(0.5 / 0.2)
        assert (found.passes, found.is_measured) == (math.ceil(4 * 4**share), True)
        assert forecast(Curve("dots", "", points), 0.6).passes == 1

    def test_bias_is_seen_and_paid_for(self):
        """Of 0.01 a bias of 0.2^2 leaves 0.25^2 - 0.2^2 = 0.0225 to the noise: 45 passes."""
        found = forecast(law(bias=0.2), 0.25)
        assert found.bias == pytest.approx(0.2)
        assert found.passes == math.ceil(1 / 0.0225)
        assert forecast(law(bias=0.2), 0.19).passes is None
        assert math.isnan(forecast(law(bias=0.2), 0.19).seconds.median)

    def test_bright_dots_are_no_bias_of_what_converges(self):
        """Of a path tracer with 1, 4 and 16 passes; with 64 and 256 it had 0.08 and 0.05."""
        points = [
            Point(n, spread([float(n)]), spread([error]), {})
            for n, error in ((1, 0.534), (4, 0.25), (16, 0.22))
        ]
        assert forecast(Curve("refined", "", points), 0.08).passes is None
        found = forecast(Curve("path", "", points, converges=True), 0.08)
        assert (found.bias, found.passes) == (0.0, math.ceil(16 * (0.22 / 0.08) ** 2))

    def test_errors_that_more_passes_raise_are_dots_and_no_bias(self):
        """Of paths on a mesh: errors of 418, 148 and 379 % were told as a bias of 380 %."""
        points = [
            Point(n, spread([float(n)]), spread([error]), {})
            for n, error in ((1, 4.18), (4, 1.48), (16, 3.79))
        ]
        dots = Curve("mesh", "", points, bias_at_most=0.17)
        found = forecast(dots, 0.2)
        assert (found.bias, found.passes) == (0.0, math.ceil(16 * (3.79 / 0.2) ** 2))
        assert forecast(replace(dots, bias_at_most=0.0), 0.2).bias == 0.0
        # Where they fall slowly, the bias is what pictures say that triangles change, if they do.
        slow = replace(dots, points=[replace(points[0], setting=8), points[2]])
        assert forecast(replace(slow, bias_at_most=0.0), 4.0).bias > 3.0
        assert forecast(slow, 0.2).bias == 0.0
        assert forecast(replace(slow, bias=0.1), 0.2).bias == 0.1

    def test_seconds_are_those_of_all_runs(self):
        """Errors that are a tenth smaller or larger take 0.81 to 1.21 times the passes, of 0.9 to 1.1 s."""
        points = [
            Point(n, spread([0.9 * n, n, 1.1 * n]), spread([0.9 * e, e, 1.1 * e]), {})
            for n, e in ((1.0, 1.0), (4.0, 0.5))
        ]
        found = forecast(Curve("runs", "", points, converges=True), 0.1)
        assert (found.passes, found.seconds.median) == (100, pytest.approx(100.0))
        assert found.seconds.least == pytest.approx(0.9 * 81.0)
        assert found.seconds.most == pytest.approx(1.1 * 121.0)

    def test_known_bias_counts_before_it_is_seen(self):
        """Errors of 1 / sqrt(n) down to 1/4 cannot show a bias of 0.05: 0.0025 of 0.01 to pay."""
        found = forecast(replace(law(), bias=0.05), 0.1)
        assert (found.bias, found.passes) == (0.05, math.ceil((1 - 16 * 0.0025) / 0.0075))
        assert forecast(replace(law(), bias=0.05), 0.04).passes is None

    def test_slower_laws_take_more_passes(self):
        """Squares of 1 / n^(2/3): 0.1 is reached when n^(2/3) is 100."""
        points = [
            Point(n, spread([float(n)]), spread([n ** (-1 / 3)]), {}) for n in (1.0, 8.0, 64.0)
        ]
        found = forecast(Curve("slow", "", points, power=2 / 3), 0.1)
        assert (found.passes, found.bias) == (1000, 0.0)

    def test_noise_of_the_reference_is_no_bias(self):
        found = forecast(law(own=0.3), 0.1, reference_error=0.3)
        assert (found.passes, found.bias) == (100, 0.0)

    def test_light_that_photons_found_and_the_method_does_not_is_out_of_reach(self):
        """Errors fall to 0.05 by a reference that lacks the same 6 % of the light."""
        lacks = replace(law(first=0.2), left_out=["light"], unfound=0.06, error_by_unfound=0.058)
        assert forecast(replace(lacks, error_by_unfound=0.0), 0.051).is_measured
        found = forecast(lacks, 0.051)
        assert found.passes is None
        assert found.obstacle == "does not find light that is 6.0 % of the mean, as photons measure"
        assert forecast(lacks, 0.1).passes == 4

    def test_errors_that_do_not_fall_are_bias(self):
        assert forecast(law(bias=0.5, first=1e-9), 0.1).passes is None


def test_triangles_by_the_law_of_the_mesh():
    meshes = [{"triangles": n, "error": 40.0 / n} for n in (1e2, 1e3, 1e4)]
    assert triangles_for(meshes, 0.01) == pytest.approx(4000)  # between two meshes
    assert triangles_for(meshes, 1e-4) == pytest.approx(4e5)  # beyond
    # A target far above: as little as one triangle would be told of.
    near = [{"triangles": n, "error": e} for n, e in ((1000, 0.0100), (4000, 0.0099))]
    assert math.isnan(triangles_for(near, 0.1))
    # Errors that hardly fall: they are those of other things.
    flat = [{"triangles": n, "error": e} for n, e in ((1000, 0.1), (4000, 0.0999999))]
    assert math.isnan(triangles_for(flat, 1e-4))
    unseen = [*meshes[:2], {"triangles": 1e4, "error": 0.0}]  # below the noise
    assert triangles_for(unseen, 0.01) == pytest.approx(4000)
    assert math.isnan(triangles_for(meshes[:1], 0.01))
    assert math.isnan(triangles_for([{**m, "error": 0.1} for m in meshes], 0.01))


class TestEqualTime:
    def test_errors_are_those_of_the_time_all_reach(self):
        """The slow one ends at 4.5 s; the other one has a line in logarithms from 1.5 to 4.5 s."""
        slow, fast = law(passes=(1, 4, 16)), law(passes=(1, 4, 16, 64), first=2.0, setup=0.0)
        seconds, errors = at_equal_time([slow, fast])
        assert seconds == pytest.approx(4.5)
        assert errors[0] == pytest.approx(1 / 4)
        # Without set-up 4.5 s are 18 passes: 2 / sqrt(18) on the line from 16 to 64.
        assert errors[1] == pytest.approx(2 / math.sqrt(18))

    def test_times_of_a_busy_machine_are_evened_out(self):
        """0.1, 0.19 and 0.13 s for 1, 4 and 16 passes count as 0.1, 0.16 and 0.16 s."""
        busy = at_seconds(0.1, 0.19, 0.13)
        assert seconds_fall(busy)
        assert growing_seconds(busy) == pytest.approx([0.1, 0.16, 0.16])
        found = forecast(busy, 0.1)  # 84 passes more, by the slope from the first to the last
        assert (found.passes, found.seconds.median) == (100, pytest.approx(0.16 + 84 * 0.06 / 15))
        # After 0.16 s both have their 16 passes.
        seconds, errors = at_equal_time([busy, at_seconds(0.1, 0.15, 0.16)])
        assert (seconds, errors) == (pytest.approx(0.16), pytest.approx([0.25, 0.25]))
        # Where none is longer than another, all seconds are those of passes.
        assert forecast(at_seconds(0.3, 0.2, 0.1), 0.1).seconds.median == pytest.approx(
            0.2 * 100 / 16
        )
        assert not seconds_fall(law())

    def test_what_takes_longer_has_none(self):
        seconds, errors = at_equal_time([law(passes=(1, 4)), law(setup=7.0)])
        assert seconds == pytest.approx(1.5)
        assert errors[0] == pytest.approx(0.5)
        assert math.isnan(errors[1])

    def test_errors_near_that_of_the_reference_are_not_compared(self):
        """After 4.5 s errors of 0.25 and 0.5; a reference off by 0.2 adds 0.04 to their squares."""
        good, bad = law(own=0.0), replace(law(first=2.0), name="bad")
        table = equal_time_table([bad, good], math.nan)
        assert [row[0] for row in table.rows] == ["law", "bad"]
        assert [float(row[2]) for row in table.rows] == [1.0, 4.0]
        table = equal_time_table([bad, good], 0.2)
        assert [row[2] for row in table.rows] == ["not known", "1.00"]
        assert "the reference is itself off by 20 %" in table.words[-1]
