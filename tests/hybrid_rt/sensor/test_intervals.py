"""Intervals of pixels and of the image mean hold the truth as often as they say."""

import math

import numpy as np
import pytest

from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.intervals import FAR_REACH, half_interval_of_mean
from hybrid_rt.sensor.neighbours import mean_around, mean_of_neighbours, sums_around
from hybrid_rt.sensor.passes import group_of


def test_intervals_of_pixels_borrow_from_their_neighbours():
    """Two of three parts come from around, and with them twice the degrees of freedom.

    From 16 passes on they are no less than what medians lack, at most, here in all pixels.
    """
    from scipy.stats import t

    passes = np.random.default_rng(9).normal(5.0, size=(20, 3, 3, 3))
    sheet = Film(3, 3)
    for n in range(1, 21):
        sheet.add(passes[n - 1])
        if n == 1:
            assert np.isnan(sheet.half_interval).all()
            continue
        lacking = np.zeros(3)
        if n >= 16:
            group, _ = group_of(np.arange(n, dtype=np.uint64))
            medians = np.median([passes[:n][group == k].mean(axis=0) for k in range(4)], axis=0)
            above = (passes[:n].mean(axis=0) - medians).reshape(9, 3)
            lacking = (above.mean(axis=0) + 1.645 * above.std(axis=0) / 3).clip(min=0.0)
        freedom = n - 1 if n < 16 else 3
        squares = sheet.standard_error**2
        around = (squares.sum(axis=(0, 1)) - squares[1, 1]) / 8
        expected = t.ppf(0.975, 3 * freedom) * np.sqrt((squares[1, 1] + 2 * around) / 3)
        np.testing.assert_allclose(sheet.half_interval[1, 1], np.maximum(expected, lacking), 3e-4)
        corner = (squares[0, 1] + squares[1, 0] + squares[1, 1]) / 3
        expected = t.ppf(0.975, 3 * freedom) * np.sqrt((squares[0, 0] + 2 * corner) / 3)
        np.testing.assert_allclose(sheet.half_interval[0, 0], np.maximum(expected, lacking), 3e-4)


def test_a_single_pixel_has_its_own_interval():
    sheet = Film(1, 1)
    for n in range(16):
        sheet.add(np.full((1, 1, 3), float(n)))
    np.testing.assert_allclose(sheet.half_interval, 3.182 * sheet.standard_error)


def test_a_spoilt_pixel_leaves_those_farther_away_alone():
    """Sums over squares keep what is next to 1e110: its neighbours alone, 7 x 7, borrow from it."""
    rng = np.random.default_rng(3)
    sheet = Film(48, 48)
    for k in range(16):
        radiance = rng.random((48, 48, 3)).astype(float)
        if k == 5:
            radiance[20, 30] = 1e110
        sheet.add(radiance)
    is_sound = np.isfinite(sheet.half_interval) & (sheet.half_interval < 10.0)
    assert np.count_nonzero(~is_sound.all(axis=2)) <= 49
    assert is_sound[20, 34].all()
    assert is_sound[0].all()


@pytest.mark.statistical
@pytest.mark.parametrize(("n", "rate"), [(16, 1 / 2000), (64, 1 / 200)])
def test_intervals_allow_for_rare_paths(n, rate):
    """A few samples are thirty times as bright as the others: a lamp met through glass.

    By the variance of nine pixels alone these are in their intervals 94 and 92 % of the
    time. 40 sheets of 256 pixels tell it to about 1 %, as neighbours share what they borrow.
    """
    rng, truth, found = np.random.default_rng(11), 1.0 + 30.0 * rate, []
    for _ in range(40):
        sheet = Film(16, 16)
        for _ in range(n):
            rare = 30.0 * (rng.random((16, 16, 1)) < rate)
            sheet.add(1.0 + 0.1 * rng.normal(size=(16, 16, 3)) + rare)
        found.append(np.abs(sheet.image - truth) <= sheet.half_interval)
    assert np.mean(found) == pytest.approx(0.953, abs=0.02)


def test_even_noise_adds_next_to_nothing_to_intervals():
    """Means and medians of four groups differ by 0.3 of a group's deviation, less over 49 pixels."""
    rng, sheet = np.random.default_rng(12), Film(24, 24)
    for _ in range(16):
        sheet.add(rng.normal(size=(24, 24, 3)))
    around = mean_of_neighbours(sheet.standard_error**2)
    pooled = 2.262 * np.sqrt((sheet.standard_error**2 + 2 * around) / 3)
    assert (sheet.half_interval >= pooled * (1.0 - 1e-15)).all()
    assert np.mean(sheet.half_interval / pooled) < 1.01


def test_means_over_squares_are_cut_off_by_the_border():
    image = np.arange(4 * 5 * 3.0).reshape(4, 5, 3)
    around, n = mean_around(image, 2)
    np.testing.assert_allclose(around[0, 0], image[:3, :3].mean(axis=(0, 1)), rtol=1e-15)
    np.testing.assert_allclose(around[2, 3], image[:, 1:].mean(axis=(0, 1)), rtol=1e-15)
    assert (n[0, 0], n[2, 3]) == (9, 16)


def _sheet(n, side, make):
    sheet = Film(side, side)
    for _ in range(n):
        sheet.add(make())
    return sheet


@pytest.mark.statistical
def test_intervals_allow_for_light_that_shows_farther_away():
    """One sample in 1000 is brighter by 100, so of 16 passes one pixel in 60 has met it.

    Half of all squares of 7 x 7 have not; by them alone 49 % of the pixels are in their intervals.
    160 paths are met in ten sheets, so that their rate is known to a twelfth.
    """
    rng, truth, found = np.random.default_rng(13), 1.0 + 100.0 / 1000, []

    def radiance():
        even = 1.0 + 0.01 * rng.normal(size=(32, 32, 3))
        return even + 100.0 * (rng.random((32, 32, 1)) < 1e-3)

    for _ in range(10):
        sheet = _sheet(16, 32, radiance)
        found.append(np.abs(sheet.image - truth) <= sheet.half_interval)
    assert np.mean(found) == pytest.approx(0.95, abs=0.03)


def test_quiet_pixels_keep_narrow_intervals_beside_noisy_ones():
    """A sky beside rare light: even noise of 1e-5 and 0.1, the latter with rare, bright paths."""
    rng = np.random.default_rng(14)
    noise = np.where(np.arange(40)[:, None] < 20, 1e-5, 0.1)
    rare = 100.0 * (np.arange(40)[:, None] >= 20)

    def radiance():
        even = 1.0 + noise * rng.normal(size=(40, 40, 3))
        return even + rare * (rng.random((40, 40, 1)) < 1e-3)

    sheet = _sheet(16, 40, radiance)
    pooled = 2.262 * np.sqrt(
        (sheet.standard_error**2 + 2 * mean_of_neighbours(sheet.standard_error**2)) / 3
    )
    # Squares of 7 x 7 reach three columns beyond the border.
    np.testing.assert_allclose(sheet.half_interval[:, :16], pooled[:, :16], rtol=0.02)
    assert np.median(sheet.half_interval[:, 24:] / pooled[:, 24:]) > 1.5


def test_intervals_scale_with_the_picture_and_stay_local():
    """A pixel that is not finite spoils those that borrow from it and no others."""
    rng = np.random.default_rng(15)
    passes = rng.exponential(size=(16, 40, 50, 3)) + 50.0 * (rng.random((16, 40, 50, 1)) < 1e-3)
    sheets = [Film(40, 50), Film(40, 50), Film(40, 50)]
    for radiance in passes:
        sheets[0].add(radiance)
        sheets[1].add(1024.0 * radiance)
        spoiled = radiance.copy()
        spoiled[7, 9] = np.inf
        sheets[2].add(spoiled)
    plain, larger, spoiled = (sheet.half_interval for sheet in sheets)
    np.testing.assert_array_equal(larger, 1024.0 * plain)
    is_far = np.ones((40, 50), dtype=bool)
    is_far[4:11, 6:13] = False
    assert np.isfinite(spoiled[is_far]).all()
    beyond = np.ones((40, 50), dtype=bool)
    reach = FAR_REACH + 1
    beyond[: 7 + reach + 1, : 9 + reach + 1] = False
    np.testing.assert_array_equal(spoiled[beyond], plain[beyond])


def test_bright_paths_are_told_by_their_size():
    """Of n samples of each of P pixels some are 8 and the others 0: one of them is 8 / (n P)."""
    rng = np.random.default_rng(16)
    sheet = _sheet(64, 60, lambda: np.repeat(8.0 * (rng.random((60, 60, 1)) < 1e-3), 3, axis=2))
    found = sheet.noise().bright_path_in_image_mean
    # 230 events; the second moment, which both sums share, is known to a fifteenth.
    assert found == pytest.approx(8.0 / (64 * 3600), rel=0.1)


def test_even_noise_has_no_bright_paths():
    """The third moments of 3600 pixels cancel to a sixtieth, which adds a part in a thousand."""
    rng = np.random.default_rng(17)
    noise = _sheet(16, 60, lambda: rng.normal(1.0, 0.3, size=(60, 60, 3))).noise()
    even = noise.interval_factor * noise.standard_error_of_image_mean
    half = half_interval_of_mean(
        noise.standard_error_of_image_mean,
        noise.interval_factor,
        noise.bright_path_in_image_mean,
    )
    assert even <= half < 1.01 * even


@pytest.mark.parametrize(("size", "n"), [(1.0, 0), (0.5, 7), (2.0, 100)])
def test_interval_of_counts_is_the_score_interval(size, n):
    """With n events, (m - n)^2 = 1.96^2 m at the upper end m; Student's t is 1.96 for many groups."""
    half = half_interval_of_mean(size * math.sqrt(n), 1.96, size)
    m = n + half / size
    assert (m - n) ** 2 == pytest.approx(1.96**2 * m, rel=2e-3)


@pytest.mark.statistical
def test_intervals_of_means_hold_where_few_bright_paths_make_them():
    """Ten events a picture, each 100 times the mean of the rest of a pixel: 400 pictures.

    Student's t alone holds less than 95 % of the time, as unlucky pictures are too dark and know of
    no noise. With the skewness it is more.
    """
    rng, by_t, found = np.random.default_rng(18), [], []
    rate = 10 / (16 * 64)
    for _ in range(400):
        noise = _sheet(
            16,
            8,
            lambda: np.repeat(rng.random((8, 8, 1)) + 50.0 * (rng.random((8, 8, 1)) < rate), 3, 2),
        ).noise()
        error = abs(noise.image_mean - 0.5 - 50.0 * rate)
        t, s = noise.interval_factor, noise.standard_error_of_image_mean
        by_t.append(error <= t * s)
        found.append(error <= half_interval_of_mean(s, t, noise.bright_path_in_image_mean))
    assert np.mean(by_t) < 0.95
    assert np.mean(found) > 0.95


@pytest.mark.parametrize("reach", [1, 2, 3, 15])
def test_sums_over_squares_are_those_of_their_pixels(reach):
    planes = np.random.default_rng(19).normal(size=(9, 20, 2))
    sums = sums_around(planes, reach)
    for row, column in ((0, 0), (4, 10), (8, 19), (3, 1)):
        square = planes[
            max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1
        ]
        np.testing.assert_allclose(sums[row, column], square.sum(axis=(0, 1)), rtol=1e-12)
