import math

import numpy as np
import pytest

from hybrid_rt.measures import noise_of_reference, relative_mse, seconds_to

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
