import math

import numpy as np
import pytest

from hybrid_rt.sensor.image_metrics import (
    noise_of_reference,
    picture_errors,
    relative_mse,
    seconds_to,
)

REFERENCE = np.full((10, 10, 3), 0.3)


def test_relative_error_by_hand():
    image = REFERENCE.copy()
    image[0, 0, 0] += 1.0
    assert relative_mse(image, REFERENCE) == pytest.approx(1 / 0.1 / 300)
    assert relative_mse(image, REFERENCE, leave_out=0.01) == 0.0


def test_scaling_down_to_nothing_is_finite():
    assert relative_mse(1e-30 * REFERENCE, 0.0 * REFERENCE) < 1e-50
    assert relative_mse(1e30 * REFERENCE, 1e30 * REFERENCE) == 0.0


def test_noise_of_reference_is_what_its_errors_say():
    assert noise_of_reference(REFERENCE, 0.1 + 0 * REFERENCE) == pytest.approx(0.01 / 0.1)


def test_other_shapes_are_refused():
    with pytest.raises(ValueError, match="shape"):
        relative_mse(REFERENCE, REFERENCE[0])


def test_seconds_between_measurements_follow_the_power_law():
    seconds = [1.0, 2.0, 4.0]
    errors = [1.0, 0.5, 0.25]
    assert seconds_to(0.5 / math.sqrt(2), seconds, errors) == pytest.approx(2 * math.sqrt(2))
    assert seconds_to(2.0, seconds, errors) == 1.0
    assert math.isnan(seconds_to(0.1, seconds, errors))


class TestPictureErrors:
    def test_by_hand(self):
        """One pixel of 2000 is off by 3 in one channel, all others by -0.1."""
        reference = np.full((40, 50, 3), 0.3)
        image = reference - 0.1
        image[3, 4, 1] = 3.3
        e = picture_errors(image, reference)
        n = reference.size
        squares = (n - 1) * 0.1**2 + 3.0**2
        assert e.rmse == pytest.approx(math.sqrt(squares / n))
        assert e.relative_rmse == pytest.approx(math.sqrt(squares / 0.1 / n))
        assert e.rmse_of_most == pytest.approx(0.1)  # two pixels are left out
        assert e.relative_rmse_of_most == pytest.approx(math.sqrt(0.1**2 / 0.1))
        assert e.mean_error == pytest.approx((-0.1 * (n - 1) + 3) / n)
        assert e.relative_mean_error == pytest.approx(e.mean_error / 0.3)
        assert e.worst == pytest.approx(3.0)

    def test_root_of_relative_mse(self):
        rng = np.random.default_rng(3)
        image, reference = rng.uniform(size=(2, 7, 9, 3))
        assert picture_errors(image, reference).relative_rmse == pytest.approx(
            math.sqrt(relative_mse(image, reference))
        )

    @pytest.mark.parametrize("scale", [1e-30, 1e200])
    def test_extreme_brightness(self, scale):
        e = picture_errors(2.0 * scale * REFERENCE, scale * REFERENCE)
        assert e.rmse == pytest.approx(0.3 * scale)
        assert e.mean_error == pytest.approx(0.3 * scale)

    def test_what_is_not_finite_is_refused(self):
        image = REFERENCE.copy()
        image[2, 3, 0] = np.nan
        with pytest.raises(ValueError, match="image has 1 pixels that are not finite"):
            picture_errors(image, REFERENCE)
